"""Markers merged across a pause in which everything vanished, by the shapes of rigid parts.

Nothing that was seen before the pause was ever seen together with anything after it, so distances cannot compare the
two sides. A triangle of markers that is rigid on both sides and has the same edges is tried as the same three markers;
once merged, all others are compared by their distances to these. The trial that merges most is accepted if it explains
most of the smaller side.
"""

from __future__ import annotations

import copy
import itertools

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.merging.likelihood import SEEN_ENOUGH, DistanceRecord, merge_likely

LEAST_MARKERS = 4
"""A smaller group has no marker beyond a triangle to confirm it."""

TRIED = 24
"""Pairs of triangles that are tried, the most alike first."""

TRIANGLES = 60
"""Rigid triangles of a group that are compared, the largest first: these distinguish limbs best."""

ALIKE = 4.0
"""Edges are the same if they differ by less than this many deviations of a rigid distance."""

EXPLAINED = 0.6
"""Part of the smaller group's markers that must be found in the larger one."""


def merge_across_pauses(record: DistanceRecord) -> Ints:
    """Merge what is likely one marker, also across pauses in which nothing was seen.

    Parameters
    ----------
    record : DistanceRecord
        Distances between tracklets.

    Returns
    -------
    ndarray of intp, shape (n,)
        The tracklet that each became part of.
    """
    group = merge_likely(record)
    while True:
        sessions = _sessions(record)
        for other in sessions[1:]:
            trial = _matched(record, sessions[0], other)
            if trial is not None:
                record, joined = trial
                group = joined[group]
                break
        else:
            return group


def _sessions(record: DistanceRecord) -> list[Ints]:
    """Tracklets that are linked by being seen together, the largest group first."""
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - heavy

    alive = np.flatnonzero(np.diag(record.count) > 0)
    _, label = connected_components(record.count[np.ix_(alive, alive)] > 0, directed=False)
    groups = [alive[label == number] for number in range(int(label.max(initial=-1)) + 1)]
    return sorted((group for group in groups if len(group) >= LEAST_MARKERS), key=len, reverse=True)


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
    rigid = _is_rigid(record, members)
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


def _is_rigid(record: DistanceRecord, members: Ints) -> Bools:
    block = np.ix_(members, members)
    count = record.count[block]
    deviation = np.sqrt(record.scatter[block] / np.maximum(count - 1.0, 1.0))
    return np.asarray((count >= SEEN_ENOUGH) & (deviation < 2.0 * record.deviations.rigid) & (record.mean[block] > 0.0))


def _sides(distance: Floats, corners: Ints) -> Floats:
    """Sides of triangles [mm], shape (n, 3)."""
    return np.stack([distance[corners[:, i], corners[:, j]] for i, j in ((0, 1), (0, 2), (1, 2))], axis=1)
