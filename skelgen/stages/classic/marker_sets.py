"""The seed's method: Marker Sets that meet when the poses in which they are seen are aligned are one marker.

Kirk, O'Brien and Forsyth 2005; Schönauer 2007, 3.3 and 4.2. It needs the number of markers, given or as many as are
seen at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.classic.aligned_distances import find_distances
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import typical_spacing
from skelgen.stages.labels.tracking.tracklets import MarkerSets, count_markers, least_length, stand_alone_frames

MOST_SETS = 3000
"""Bounds time and memory, which grow with the square of the number of sets."""


def markers_by_sets(
    cloud: PointCloud,
    sets: MarkerSets,
    rate: float,
    parameters: LabelParameters,
    *,
    n_markers: int | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> tuple[Ints, int]:
    """Find the marker of each point by joining Marker Sets over aligned poses.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    sets : MarkerSets
        Its Marker Sets.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        How to compare and group sets.
    n_markers : int or None
        Number of markers; None takes the largest number of sets seen at once.
    seed : int
        Seed of spectral clustering.
    monitor : Monitor
        Hears of progress and may cancel.

    Returns
    -------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_removed : int
        Number of Marker Sets that found no marker.
    """
    n_too_many = max(0, len(sets) - MOST_SETS)
    sets = _longest(sets)
    wanted = n_markers or count_markers(sets, least_length(cloud.n_frames, rate, parameters))
    limit = parameters.remove_distance or typical_spacing(cloud)
    group, nearest = group_sets(cloud.points, sets, wanted, limit, parameters, seed, monitor)
    markers = sets.merged(group)
    trusted = (markers.lengths >= stand_alone_frames(cloud.n_frames, rate, parameters)) | (nearest <= limit)
    kept = _chosen(markers, trusted, wanted)
    return markers.chosen(kept).set_of_points(cloud.n_points), n_too_many + int((~kept)[group].sum())


def _longest(sets: MarkerSets) -> MarkerSets:
    """Bound the number of sets by leaving the shortest out."""
    order = np.argsort(-sets.lengths, kind="stable")
    keep = np.zeros(len(sets), dtype=np.bool_)
    keep[order[:MOST_SETS]] = True
    return sets.chosen(keep)


def _chosen(markers: MarkerSets, trusted: Bools, wanted: int) -> Bools:
    """The `wanted` markers that are seen longest, after all trusted ones."""
    keep = np.zeros(len(markers), dtype=np.bool_)
    keep[np.lexsort((-markers.lengths, ~trusted))[:wanted]] = True
    return keep


# Shares of the limit up to which sets are joined, round by round: what is certain first, because every joined set
# adds shared markers by which the poses of the next round are aligned.
_ROUNDS = (0.05, 0.2, 0.5, 1.0)
# Local scale of a set: its distance to this neighbour. Zelnik-Manor and Perona take the 7th of hundreds of points; a
# marker has but a few sets.
_SCALE_NEIGHBOUR = 2
# Keeps the scale of a set that meets its neighbours exactly above 0, as a share of the limit.
_LEAST_SCALE = 0.01
_RESTARTS = 10


def group_sets(
    points: Floats,
    sets: MarkerSets,
    n_groups: int,
    limit: float,
    parameters: LabelParameters,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> tuple[Ints, Floats]:
    """Group Marker Sets into markers.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    sets : MarkerSets
        What to group.
    n_groups : int
        Wanted number of groups.
    limit : float, mm
        Sets farther apart are not joined.
    parameters : LabelParameters
        How to compare and how to group.
    seed : int
        Seed of spectral clustering.
    monitor : Monitor
        Hears of the progress and may cancel.

    Returns
    -------
    group : ndarray of intp, shape (n_sets,)
        Group of each set, from 0 without holes.
    nearest : ndarray, shape (n_found,), mm
        Distance of each group to the nearest one that it could still be joined with; infinite where there is none.
    """
    group, overlaps = np.arange(len(sets)), sets.overlaps
    spectral = parameters.clustering == "spectral"
    distance, n_compared = np.zeros((0, 0)), -1
    for share in _ROUNDS[-1:] if spectral else _ROUNDS:
        if n_compared != len(sets):
            monitor.begin("comparing Marker Sets")
            distance, n_compared = find_distances(points, sets, overlaps, parameters, monitor), len(sets)
        if spectral:
            joined = cut_spectrally(distance, overlaps, n_groups, limit, seed)
        else:
            joined = join_nearest(distance, overlaps, n_groups, share * limit, parameters.clustering)
        group = joined[group]
        sets = sets.merged(joined)
        distance, overlaps = _merged(distance, joined, np.minimum), _merged(overlaps, joined, np.logical_or)
    np.fill_diagonal(distance, np.inf)
    return group, np.where(overlaps, np.inf, distance).min(axis=1, initial=np.inf)


def _merged(table: Any, group: Ints, combine: np.ufunc) -> Any:
    """Combine the rows and columns of a symmetric table that belong to the same group."""
    order = np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], np.arange(group.max(initial=-1) + 1))
    return combine.reduceat(combine.reduceat(table[np.ix_(order, order)], starts, axis=0), starts, axis=1)


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


def cut_spectrally(distance: Floats, overlaps: Bools, n_groups: int, limit: float, seed: int) -> Ints:
    """Cluster sets by their affinity to each other, then part those of a cluster that overlap.

    The affinity of two sets is exp(-d^2 / (s_i s_j)) with local scales s, and 0 where they overlap. Arguments and
    result are those of `join_nearest`; a set that fits into no cluster, or lies farther than `limit` from all sets of
    the one it would fit, becomes a group of its own.
    """
    n_sets = len(distance)
    if n_sets <= n_groups:
        return np.arange(n_sets)
    embedded = _embed(distance, n_groups, _LEAST_SCALE * limit)
    from sklearn.cluster import KMeans  # noqa: PLC0415 - takes seconds to import

    centres = KMeans(n_groups, n_init=_RESTARTS, random_state=seed).fit(embedded).cluster_centers_
    away = np.linalg.norm(embedded[:, np.newaxis] - centres, axis=2)
    members: list[list[int]] = [[] for _ in range(n_groups)]
    for item in np.argsort(away.min(axis=1), kind="stable"):
        fitting = (
            members[cluster]
            for cluster in np.argsort(away[item], kind="stable")
            if not overlaps[item, members[cluster]].any() and distance[item, members[cluster]].min(initial=0.0) <= limit
        )
        found = next(fitting, None)
        if found is None:
            members.append(found := [])
        found.append(int(item))
    group = np.empty(n_sets, dtype=np.intp)
    for number, items in enumerate(filter(None, members)):
        group[items] = number
    return group


def _embed(distance: Floats, n_groups: int, least_scale: float) -> Floats:
    """Rows of the leading eigenvectors of the normalised affinity at unit length (Ng, Jordan and Weiss 2002)."""
    others = np.sort(np.where(np.eye(len(distance), dtype=np.bool_), np.inf, distance), axis=1)
    scale = others[:, min(_SCALE_NEIGHBOUR, len(distance)) - 1]
    scale = np.maximum(np.where(np.isfinite(scale), scale, others[:, 0]), least_scale)
    scale[~np.isfinite(scale)] = least_scale
    with np.errstate(under="ignore"):
        affinity = np.exp(-(distance**2) / np.outer(scale, scale))
    np.fill_diagonal(affinity, 0.0)
    degree = affinity.sum(axis=1)
    root = np.sqrt(np.where(degree > 0.0, degree, 1.0))
    _, vectors = np.linalg.eigh(affinity / np.outer(root, root))
    leading = vectors[:, -n_groups:]
    length = np.linalg.norm(leading, axis=1, keepdims=True)
    return np.asarray(leading / np.where(length > 0.0, length, 1.0))
