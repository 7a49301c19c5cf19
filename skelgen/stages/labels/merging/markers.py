r"""Markers merged by their distances: with tracks that were left without one, across pauses, and those found twice.

Where two of a limb's three markers are hidden, its pose is not known, and with it no place for the third; yet its
distances to what is seen tell it apart. Such a track counts as one more marker, and is merged into the one that it is
(`likelihood`). What is merged into none stays without a marker.

Nothing that was seen before a pause in which everything vanished was ever seen together with anything after it, so
distances cannot compare the two sides. A triangle of markers that is rigid on both sides and has the same edges is
tried as the same three markers; once merged, all others are compared by their distances to these. The trial that
merges most is accepted if it explains most of the smaller side. The same is done for a body that leaves and comes back
while another one stays.

A marker that nobody ever sees beside another one hardly exists. Who stands still at first and moves later shows
distances that differ by more than they varied in either part, so that a marker is found once for each. But had there
been two, one would have been hidden all the time that the other was seen. With gaps of the mean length :math:`\bar g`
in a take of :math:`n` frames, a marker more costs :math:`n / \bar g` nats, at most `MOST_EXISTENCE`. Two markers that
are never seen together are one if distances, of which those of a slow pose count once, do not say more against it, and
if neither has another such partner that is nearly as likely.
"""

import copy
import itertools
from collections.abc import Callable

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import existence
from skelgen.stages.labels.merging.likelihood import EVIDENCE, SEEN_ENOUGH, DistanceRecord, merge_likely
from skelgen.stages.limbs import Distances, bodies_by_distances

LEAST_POINTS = 8
"""Frames that a track must last: false points hardly ever do."""

MOST_TRACKS = 400
"""Tracks that are merged at once, the longest: bounds the work."""

LEAST_MARKERS = 4
"""A smaller group has no marker beyond a triangle to confirm it."""

TRIED = 24
"""Pairs of triangles that are tried, the most alike first."""

TRIANGLES = 60
"""Rigid triangles of a group that are compared, the largest first: these distinguish limbs best."""

ALIKE = 4.0
"""Edges are the same if they differ by less than this many deviations of a rigid distance."""

NORMAL_FARTHEST = 1.645
"""Deviations above the mean below which 95 % of normally distributed distances lie."""

EXPLAINED = 0.6
"""Part of the smaller group's markers that must be found in the larger one."""


def merge_again(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Merge markers, and tracks without one, by the likelihood of their distances; each turn knows more of these.

    In a take of few seconds, distances at few moments say little; there it counts, too, who goes on where another one
    was lost (`continuity`), if distances speak at all.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Markers found so far, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; numbered without holes.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    extended = with_leftovers(take.track_of_point, marker_of_point)
    n_extended = int(extended.max(initial=-1)) + 1
    sums = take.distances(extended)
    apart = sums[0] > 0
    if n_extended > n_markers:  # short tracks may lie between the sampled frames
        meeting = point_labels.seen_together(take.cloud, extended, n_extended) > 0
        meeting[:n_markers, :n_markers] = False
        apart |= meeting
    gaps = take.continuity(extended) if take.has_few_moments else None
    prior = gaps.between(apart) if gaps else None
    spread = spread_in_room(take.cloud, extended, n_extended)
    merged = _merge_across_pauses(DistanceRecord(sums, apart, take.spacing, prior, decides=False), spread)
    merged[merged >= n_markers] = -1
    if (merged[:n_markers] == np.arange(n_markers)).all() and (merged[n_markers:] < 0).all():
        return marker_of_point
    return point_labels.joined(take.cloud, extended, merged)


def with_leftovers(track_of_point: Ints, marker_of_point: Ints) -> Ints:
    """Give every lasting track of points without a marker a number of its own, behind those of the markers.

    Parameters
    ----------
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    free = np.flatnonzero((marker_of_point < 0) & (track_of_point >= 0))
    tracks, place, counts = np.unique(track_of_point[free], return_inverse=True, return_counts=True)
    chosen = np.argsort(-counts, kind="stable")[:MOST_TRACKS]
    chosen = chosen[counts[chosen] >= LEAST_POINTS]
    number = np.full(len(tracks), -1, dtype=marker_of_point.dtype)
    number[chosen] = marker_of_point.max(initial=-1) + 1 + np.arange(len(chosen))
    result = marker_of_point.copy()
    result[free] = number[place]
    return result


def spread_in_room(cloud: PointCloud, marker_of_point: Ints, n_markers: int) -> Floats:
    """Variance of each marker's place in the room [mm^2], in the mean of the coordinates, shape (n_markers,).

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_markers : int
        Number of markers.
    """
    sums = np.zeros((5, n_markers))
    for start in range(0, len(marker_of_point), point_labels.BLOCK_POINTS):
        owned = np.flatnonzero(marker_of_point[start : start + point_labels.BLOCK_POINTS] >= 0) + start
        marker, points = marker_of_point[owned], cloud.points[owned]
        values = (*points.T, (points**2).sum(axis=1), np.ones(len(points)))
        sums += [np.bincount(marker, value, n_markers) for value in values]
    means = sums[:4] / np.maximum(sums[4], 1.0)
    return np.asarray(np.maximum(means[3] - (means[:3] ** 2).sum(axis=0), 0.0) / 3.0)


def may_be_incomplete(take: FollowedCloud, marker_of_point: Ints, seconds: float) -> bool:
    """Return whether a track that lasts so long has no marker, or two markers are never seen at once: they may be one.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    seconds : float, s
        Tracks that last so long should have a marker.
    """
    left = take.unlabelled_per_track(marker_of_point)
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    is_left = bool(left.max() >= seconds * take.rate)
    return is_left or not (point_labels.seen_together(take.cloud, marker_of_point, n_markers) > 0).all()


def _merge_across_pauses(record: DistanceRecord, spread: Floats) -> Ints:
    """Merge what is likely one marker, also across pauses in which nothing was seen.

    Parameters
    ----------
    record : DistanceRecord
        Distances between tracklets.
    spread : ndarray, shape (n,), mm^2
        Variance of each one's place in the room.

    Returns
    -------
    ndarray of intp, shape (n,)
        The tracklet that each became part of.
    """
    group = merge_likely(record)
    while True:
        for first, second in itertools.combinations(_sessions(record, spread), 2):
            if (record.count[np.ix_(first, second)] > 0).any():
                continue
            trial = _matched(record, first, second)
            if trial is not None:
                record, joined = trial
                group = joined[group]
                break
        else:
            return group


def _sessions(record: DistanceRecord, spread: Floats) -> list[Ints]:
    """Tracklets that are linked by being seen together, body by body, the largest group first."""
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - heavy

    alive = np.flatnonzero(np.diag(record.count) > 0)
    _, label = connected_components(record.count[np.ix_(alive, alive)] > 0, directed=False)
    groups = [alive[label == number] for number in range(int(label.max(initial=-1)) + 1)]
    groups = [body for group in groups for body in _bodies(record, group, spread)]
    return sorted((group for group in groups if len(group) >= LEAST_MARKERS), key=len, reverse=True)


def _bodies(record: DistanceRecord, members: Ints, spread: Floats) -> list[Ints]:
    """The bodies that tracklets seen together are on: of one that left and came back there are two."""
    counts = record.count[np.ix_(members, members)]
    often = members[(counts >= SEEN_ENOUGH).sum(axis=1) > LEAST_MARKERS]
    block = np.ix_(often, often)
    count, known = record.count[block], record.count[block] >= SEEN_ENOUGH
    deviation = np.sqrt(record.scatter[block] / np.maximum(count - 1.0, 1.0))
    far = np.where(known, record.mean[block] + NORMAL_FARTHEST * deviation, np.inf)
    body, sure = bodies_by_distances(Distances(far, np.where(known, deviation, np.inf), spread[often]))
    return [members] if len(sure) == 1 else [often[body == number] for number in range(len(sure))]


def _matched(record: DistanceRecord, first: Ints, second: Ints) -> tuple[DistanceRecord, Ints] | None:
    """Merge two sessions by the pair of triangles that explains most; None if none explains enough."""
    best: tuple[int, DistanceRecord, Ints] | None = None
    for pairs in _alike(record, first, second):
        trial = copy.deepcopy(record)
        group = np.arange(len(record.count))
        for one, other in pairs:
            trial.merge(one, other)
            group[other] = one
        group = merge_likely(trial)[group]
        n_found = int(np.isin(group[second], group[first]).sum())
        if best is None or n_found > best[0]:
            best = (n_found, trial, group)
        if n_found == min(len(first), len(second)):
            break
    if best is None or best[0] < max(LEAST_MARKERS, EXPLAINED * min(len(first), len(second))):
        return None
    return best[1], best[2]


def _alike(record: DistanceRecord, first: Ints, second: Ints) -> list[list[tuple[int, int]]]:
    """Pairs of rigid triangles with the same sides, corner by corner, the most alike first."""
    tolerance = ALIKE * record.deviations.rigid
    corners, sides = _triangles(record, first)
    others = _triangles(record, second)[0]
    if not len(corners) or not len(others):
        return []
    found: list[tuple[float, list[tuple[int, int]]]] = []
    for turn in itertools.permutations(range(3)):
        turned = others[:, turn]
        apart = np.abs(sides[:, np.newaxis] - _sides(record.mean, turned)).max(axis=2)
        for i, j in np.argwhere(apart < tolerance):
            found.append((float(apart[i, j]), list(zip(corners[i].tolist(), turned[j].tolist(), strict=True))))
    return [pairs for _, pairs in sorted(found)[:TRIED]]


def _triangles(record: DistanceRecord, members: Ints) -> tuple[Ints, Floats]:
    """Rigid triangles with their sides [mm]; the largest first."""
    block = np.ix_(members, members)
    count = record.count[block]
    deviation = np.sqrt(record.scatter[block] / np.maximum(count - 1.0, 1.0))
    rigid = (count >= SEEN_ENOUGH) & (deviation < 2.0 * record.deviations.rigid) & (record.mean[block] > 0.0)
    found = [
        (members[i], members[j], members[k])
        for i, j in np.argwhere(np.triu(rigid, 1))
        for k in np.flatnonzero(rigid[i] & rigid[j])
        if k > j
    ]
    corners = np.array(found, dtype=np.intp).reshape(-1, 3)
    sides = _sides(record.mean, corners)
    order = np.argsort(-sides.min(axis=1), kind="stable")[:TRIANGLES]
    return corners[order], sides[order]


def _sides(distance: Floats, corners: Ints) -> Floats:
    """Sides of triangles [mm], shape (n, 3)."""
    return np.stack([distance[corners[:, i], corners[:, j]] for i, j in ((0, 1), (0, 2), (1, 2))], axis=1)


COMMON_FRAMES = 2
"""Frames with both that false points may cause."""


def join_duplicates(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Join markers that were found in several parts of the take under different numbers.

    In a take of few seconds, pieces are seen together at so few independent moments that distances hardly contradict a
    join; there it counts, too, who goes on where another one was lost (`continuity`). If the take says that markers are
    joined sparingly, the evidence of the whole must not fall by more than a marker costs, either.

    Parameters
    ----------
    take : FollowedCloud
        The take, and whether markers are joined sparingly.
    marker_of_point : ndarray of intp, shape (n_points,)
        Markers found so far, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; numbered without holes.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    apart = point_labels.seen_together(take.cloud, marker_of_point, n_markers) > COMMON_FRAMES
    if apart[~np.eye(n_markers, dtype=bool)].all():
        return marker_of_point
    sums = take.distances(marker_of_point)
    gaps = take.continuity(marker_of_point) if take.has_few_moments else None
    record = DistanceRecord(sums, apart, take.spacing, gaps.between(apart) if gaps else None)
    cost = existence(take.cloud, marker_of_point)
    spares = _Sparing(take, marker_of_point, cost).spares if take.joins_sparingly else None
    same = _joined(record, EVIDENCE - cost, spares)
    if (same == np.arange(n_markers)).all():
        return marker_of_point
    return point_labels.joined(take.cloud, marker_of_point, same)


class _Sparing:
    """Says which joins lose more evidence than a marker more costs; mutable, as each one that is made changes it."""

    def __init__(self, take: FollowedCloud, marker_of_point: Ints, cost: float) -> None:
        self._take, self._marker_of_point, self._cost = take, marker_of_point, cost
        self._evidence = take.evidence(marker_of_point)[0]

    def spares(self, group: Ints) -> bool:
        """Whether the last join that made these groups is better left out; else it counts as made."""
        labels = point_labels.joined(self._take.cloud, self._marker_of_point, group)
        evidence = self._take.evidence(labels)[0]
        if evidence < self._evidence - self._cost:
            return True
        self._evidence = evidence
        return False


def _joined(record: DistanceRecord, least: float, spares: Callable[[Ints], bool] | None = None) -> Ints:
    """The marker that each one is a part of; the record changes."""
    n_markers = len(record.count)
    group = np.arange(n_markers)
    link = np.array([record.evidence(one, is_slow=True) for one in range(n_markers)])
    while (best := link.max(initial=-np.inf)) >= least:
        one, other = sorted(int(index) for index in np.unravel_index(int(np.argmax(link)), link.shape))
        if best - _rival(link, one, other, ~record.apart) < EVIDENCE:
            link[one, other] = link[other, one] = -np.inf
            continue
        trial = np.where(group == other, one, group)
        if spares and spares(trial):
            record.apart[one, other] = record.apart[other, one] = True
            link[one, other] = link[other, one] = -np.inf
            continue
        record.merge(one, other)
        group = trial
        link[other] = link[:, other] = -np.inf
        for marker in np.flatnonzero(np.diag(record.count) > 0):
            link[marker] = record.evidence(int(marker), is_slow=True)
    return group


def _rival(link: Floats, one: int, other: int, possible: Bools) -> float:
    """Evidence of the next best partner of either."""
    rows = np.where(possible[[one, other]], link[[one, other]], -np.inf)
    rows[:, [one, other]] = -np.inf
    return float(rows.max(initial=-np.inf))
