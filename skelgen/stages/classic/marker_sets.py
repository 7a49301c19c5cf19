"""The labelling of the thesis: Marker Sets that meet when the poses in which they are seen are aligned are one marker.

Sets that overlap in time never belong together. Either the nearest two groups are joined again and again; or spectral
clustering with local scaling (Zelnik-Manor and Perona 2004), the best in the thesis, or with one scale is followed by
an assignment that keeps overlapping sets apart; or k-means keeps them apart in every step.

Kirk, O'Brien and Forsyth 2005; Schönauer 2007, 3.3 and 4.2. The method needs the number of markers; unless it is given,
it is the number of those seen at once.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.tracklets import TrackletPoints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.classic.aligned_distances import Alignment, find_distances

MOST_SETS = 3000
"""Bounds time and memory, which grow with the square of the number of sets."""


Table = TypeVar("Table", Floats, Bools)

ROUNDS = (0.05, 0.2, 0.5, 1.0)
"""Parts of the limit up to which sets are joined, round by round: what is certain first, because every joined set adds
shared markers by which the poses of the next round are aligned."""

SCALE_NEIGHBOUR = 2
"""Local scale of a set: its distance to this neighbour. Zelnik-Manor and Perona take the 7th of hundreds of points; a
marker has but a few sets."""

LEAST_SCALE = 0.01
"""Of the limit: keeps the scale of a set that meets its neighbours exactly above 0."""

N_SCALES = 12
"""Scales that a scan tries, from the least scale to the limit."""

RESTARTS = 10
"""Starts of k-means."""

LLOYD_STEPS = 30

SPECTRAL = ("spectral", "global-spectral", "k-means")
"""Clusterings of eigenvectors: with local scales or one; or with local scales and an exclusion list within k-means."""


@dataclass(frozen=True)
class SetMethod:
    """How Marker Sets become markers.

    Attributes
    ----------
    alignment : Alignment
        How poses are aligned before sets are compared.
    clustering : str
        ``average`` or ``complete`` linkage, or one of `SPECTRAL`.
    limit : float, mm
        Sets farther apart are not joined.
    least_length : int, frames
        Length of the shortest set.
    stand_alone : float, frames
        Sets at least this long need no partner to be reliable.
    seed : int
        Random seed of spectral clustering.
    sigma : float, mm
        The one scale of ``global-spectral``; 0 tries several.
    """

    alignment: Alignment
    clustering: str
    limit: float
    least_length: int
    stand_alone: float
    seed: int
    sigma: float = 0.0


def markers_by_sets(
    cloud: PointCloud, sets: TrackletPoints, n_markers: int | None, method: SetMethod, monitor: Monitor = SILENT
) -> tuple[Ints, int]:
    """Find the marker of each point by joining Marker Sets over aligned poses.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    sets : TrackletPoints
        Its Marker Sets.
    n_markers : int or None
        Number of markers; None takes the largest number of sets seen at once.
    method : SetMethod
        How sets are compared and grouped.
    monitor : Monitor
        Receives progress and may cancel.

    Returns
    -------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_removed : int
        Number of Marker Sets that found no marker.
    """
    n_too_many = max(0, len(sets) - MOST_SETS)
    longest = np.zeros(len(sets), dtype=np.bool_)
    longest[np.argsort(-sets.lengths, kind="stable")[:MOST_SETS]] = True
    sets = sets.chosen(longest)
    wanted = n_markers or sets.most_at_once(method.least_length)
    group, nearest = _group_sets(cloud.points, sets, wanted, method, monitor)
    markers = sets.merged(group)
    reliable = (markers.lengths >= method.stand_alone) | (nearest <= method.limit)
    kept = np.zeros(len(markers), dtype=np.bool_)
    kept[np.lexsort((-markers.lengths, ~reliable))[:wanted]] = True  # those seen longest, after all reliable ones
    return markers.chosen(kept).tracklet_of_all_points(cloud.n_points), n_too_many + int((~kept)[group].sum())


def _group_sets(
    points: Floats, sets: TrackletPoints, n_groups: int, method: SetMethod, monitor: Monitor = SILENT
) -> tuple[Ints, Floats]:
    """Group Marker Sets into markers.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    sets : TrackletPoints
        Its Marker Sets.
    n_groups : int
        Wanted number of groups.
    method : SetMethod
        How sets are compared and grouped.
    monitor : Monitor
        Receives progress and may cancel.

    Returns
    -------
    group : ndarray of intp, shape (n_sets,)
        Group of each set, from 0 without holes.
    nearest : ndarray, shape (n_found,), mm
        Distance of each group to the nearest one that it could still be joined with; infinite where there is none.
    """
    group, overlaps = np.arange(len(sets)), sets.overlaps
    spectral = method.clustering in SPECTRAL
    distance, n_compared = np.zeros((0, 0)), -1
    for share in ROUNDS[-1:] if spectral else ROUNDS:
        if n_compared != len(sets):
            monitor.begin("comparing Marker Sets")
            distance, n_compared = find_distances(points, sets, overlaps, method.alignment, monitor), len(sets)
        if spectral:
            joined = cut_spectrally(distance, overlaps, n_groups, method)
        else:
            joined = join_nearest(distance, overlaps, n_groups, share * method.limit, method.clustering)
        group = joined[group]
        sets = sets.merged(joined)
        distance, overlaps = _merged(distance, joined, np.minimum), _merged(overlaps, joined, np.logical_or)
    np.fill_diagonal(distance, np.inf)
    return group, np.where(overlaps, np.inf, distance).min(axis=1, initial=np.inf)


def _merged(table: Table, group: Ints, combine: np.ufunc) -> Table:
    """Combine the rows and columns of a symmetric table that belong to the same group."""
    order = np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], np.arange(group.max(initial=-1) + 1))
    merged: Table = combine.reduceat(combine.reduceat(table[np.ix_(order, order)], starts, axis=0), starts, axis=1)
    return merged


def join_nearest(distance: Floats, overlaps: Bools, n_groups: int, limit: float, linkage: str) -> Ints:
    """Join the nearest two groups that do not overlap, until `n_groups` are left or all are farther than `limit`.

    Parameters
    ----------
    distance : ndarray, shape (n_sets, n_sets), mm
        Symmetric distances; infinite where unknown or forbidden.
    overlaps : ndarray of bool, shape (n_sets, n_sets)
        Sets that must not be joined.
    n_groups : int
        Wanted number of groups.
    limit : float, mm
        Farther groups are not joined.
    linkage : str
        ``average`` or ``complete``: mean or largest of the known distances between the sets of two groups.

    Returns
    -------
    ndarray of intp, shape (n_sets,)
        Group of each set, from 0 without holes.
    """
    group = np.arange(len(distance))
    known = np.isfinite(distance)
    total = np.where(known, distance, 0.0)
    count = known.astype(np.intp)
    forbidden = overlaps.copy()
    np.fill_diagonal(forbidden, True)
    link = np.where(known & ~forbidden, distance, np.inf)
    for _ in range(len(distance) - n_groups):
        i, j = np.unravel_index(int(np.argmin(link)), link.shape)
        if link[i, j] > limit:
            break
        total[i] = total[i] + total[j] if linkage == "average" else np.maximum(total[i], total[j])
        count[i] += count[j]
        forbidden[i] |= forbidden[j]
        forbidden[j] = True
        known_i = (count[i] > 0) & ~forbidden[i] & ~forbidden[:, j]
        link[i] = np.inf
        divisor = count[i] if linkage == "average" else np.ones_like(count[i])
        link[i, known_i] = total[i, known_i] / divisor[known_i]
        forbidden[:, i], total[:, i], count[:, i], link[:, i] = forbidden[i], total[i], count[i], link[i]
        link[j] = link[:, j] = np.inf
        forbidden[:, j] = True
        group[group == j] = i
    return np.unique(group, return_inverse=True)[1].astype(np.intp)


def cut_spectrally(distance: Floats, overlaps: Bools, n_groups: int, method: SetMethod) -> Ints:
    """Cluster sets by their affinity to each other; sets that overlap are kept apart.

    The affinity of two sets is exp(-d^2 / (s_i s_j)) with local scales s, or exp(-d^2 / 2 s^2) with one scale, given or
    the best of several: small distances within groups and large ones between them (Schönauer 2007, 5.2). A set that
    fits into no cluster, or lies farther than the limit from all sets of those it would fit, is a group of its own.

    Parameters
    ----------
    distance : ndarray, shape (n_sets, n_sets), mm
        Distances between sets, infinite where not known.
    overlaps : ndarray of bool, shape (n_sets, n_sets)
        Sets that cannot be in one group.
    n_groups : int
        Wanted number of groups.
    method : SetMethod
        Its clustering, limit, scale and seed.
    """
    if len(distance) <= n_groups:
        return np.arange(len(distance))
    least = LEAST_SCALE * method.limit
    if method.clustering == "global-spectral":
        scales = np.array([method.sigma]) if method.sigma > 0 else np.geomspace(least, method.limit, N_SCALES)
        products = [2 * scale**2 * np.ones_like(distance) for scale in scales.tolist()]
    else:
        local = _local_scales(distance, least)
        products = [local[:, np.newaxis] * local]
    embedded = [_embed(distance, product, n_groups) for product in products]
    trials = [_parted(rows, distance, overlaps, n_groups, method) for rows in embedded]
    return min(trials, key=lambda group: (int(group.max()), _looseness(distance, group)))


def _parted(rows: Floats, distance: Floats, overlaps: Bools, n_groups: int, method: SetMethod) -> Ints:
    """Group of each set, by k-means on rows; overlapping sets are kept apart at the end, or in every step."""
    if method.clustering == "k-means":
        centres = _exclusive_centres(rows, overlaps, n_groups, method.seed)
    else:
        from sklearn.cluster import KMeans  # noqa: PLC0415 - takes seconds to import

        centres = KMeans(n_groups, n_init=RESTARTS, random_state=method.seed).fit(rows).cluster_centers_
    group = np.empty(len(rows), dtype=np.intp)
    members = _members(rows, centres, overlaps, distance > method.limit)
    for number, items in enumerate(filter(None, members)):
        group[items] = number
    return group


def _exclusive_centres(rows: Floats, overlaps: Bools, n_groups: int, seed: int) -> Floats:
    """Centres of k-means from k-means++ starts in which sets that overlap never share a cluster."""
    from sklearn.cluster import kmeans_plusplus  # noqa: PLC0415 - takes seconds to import

    best, least = rows[:n_groups], np.inf
    for start in range(RESTARTS):
        centres, _ = kmeans_plusplus(rows, n_groups, random_state=seed + start)
        for _ in range(LLOYD_STEPS):
            members = _members(rows, centres, overlaps, np.zeros_like(overlaps))
            moved = np.stack([rows[items].mean(axis=0) for items in members if items])
            if np.array_equal(moved, centres):
                break
            centres = moved
        squares = sum(float(((rows[items] - rows[items].mean(axis=0)) ** 2).sum()) for items in members if items)
        if (value := squares + len(members)) < least:
            best, least = centres, value
    return best


def _members(rows: Floats, centres: Floats, overlaps: Bools, far: Bools) -> list[list[int]]:
    """Sets by cluster, those nearest to a centre first; one that fits nowhere is a cluster of its own."""
    away = np.linalg.norm(rows[:, np.newaxis] - centres, axis=2)
    members: list[list[int]] = [[] for _ in centres]
    for item in np.argsort(away.min(axis=1), kind="stable").tolist():
        fitting = (
            members[cluster]
            for cluster in np.argsort(away[item], kind="stable")
            if not overlaps[item, members[cluster]].any()
            and not (members[cluster] and far[item, members[cluster]].all())
        )
        found = next(fitting, None)
        if found is None:
            members.append(found := [])
        found.append(item)
    return members


def _looseness(distance: Floats, group: Ints) -> float:
    """Mean distance within groups by that between them."""
    known = np.isfinite(distance) & ~np.eye(len(distance), dtype=np.bool_)
    same = (group[:, np.newaxis] == group) & known
    others = known & ~same
    if not same.any() or not others.any():
        return np.inf
    return float(distance[same].mean() / max(distance[others].mean(), np.finfo(np.float64).tiny))


def _local_scales(distance: Floats, least: float) -> Floats:
    """Distance of each set to its neighbour (Zelnik-Manor and Perona 2004)."""
    others = np.sort(np.where(np.eye(len(distance), dtype=np.bool_), np.inf, distance), axis=1)
    scale = others[:, min(SCALE_NEIGHBOUR, len(distance)) - 1]
    scale = np.maximum(np.where(np.isfinite(scale), scale, others[:, 0]), least)
    scale[~np.isfinite(scale)] = least
    return np.asarray(scale)


def _embed(distance: Floats, product: Floats, n_groups: int) -> Floats:
    """Rows of the leading eigenvectors of the normalised affinity at unit length (Ng, Jordan and Weiss 2002)."""
    with np.errstate(under="ignore"):
        affinity = np.exp(-(distance**2) / product)
    np.fill_diagonal(affinity, 0.0)
    degree = affinity.sum(axis=1)
    root = np.sqrt(np.where(degree > 0.0, degree, 1.0))
    _, vectors = np.linalg.eigh(affinity / np.outer(root, root))
    leading = vectors[:, -n_groups:]
    length = np.linalg.norm(leading, axis=1, keepdims=True)
    return np.asarray(leading / np.where(length > 0.0, length, 1.0))
