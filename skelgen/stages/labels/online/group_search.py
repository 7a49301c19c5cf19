"""Search for a rigid group of lost markers, without knowledge of the frame before.

Three lost markers are found by their distances, and accepted if further markers of their group are where these predict
them.
"""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.online.marker_history import MarkerHistory
from skelgen.stages.labels.online.pose_search import chance

GROUP_TOLERANCE = 3.0
"""Standard deviations within which a distance in a group must agree."""

MOST_GROUPS = 30
"""Rigid triples of lost markers that are searched, the most rigid first."""

MOST_GROUP_MATCHES = 20
"""Matches of triples that are extended, the best first: bounds the work of a frame."""

MOST_OTHERS = 8
"""Further lost markers by which a match is confirmed."""

PROOF = 8.0
"""nats of evidence by further markers that confirm a match: three distances may agree by chance."""


def find_group(history: MarkerHistory, lost: Ints, points: Floats, spacing: float) -> dict[int, int]:
    """Find lost markers among points by their distances alone.

    Parameters
    ----------
    history : MarkerHistory
        Distances and poses of markers.
    lost : ndarray of intp
        Slots of markers that are not seen at present.
    points : ndarray, shape (n, 3), mm
        Points without a label.
    spacing : float, mm
        Typical distance of a point from its nearest neighbour.

    Returns
    -------
    dict of int to int
        Point of each slot of the group that is confirmed best; empty if there is none.
    """
    if len(points) < 4 or len(lost) < 4:
        return {}
    best: dict[int, int] = {}
    most = PROOF
    for _, slots, corners in sorted(_matches(history, lost, points), key=lambda match: match[0])[:MOST_GROUP_MATCHES]:
        group, proof = _extended(history, lost, points, dict(zip(slots, corners, strict=True)), spacing)
        if proof > most:
            best, most = group, proof
    return best


def _matches(
    history: MarkerHistory, lost: Ints, points: Floats
) -> list[tuple[float, tuple[int, ...], tuple[int, ...]]]:
    """Misfit, slots and points of triples whose distances agree."""
    apart = np.linalg.norm(points[:, np.newaxis] - points, axis=2)
    found: list[tuple[float, tuple[int, ...], tuple[int, ...]]] = []
    for triple in _rigid_triples(history, lost):
        slots = np.array(triple)
        wanted, deviation = history.distances(slots, slots), history.deviations(slots, slots)
        off = [np.abs(apart - wanted[i, j]) / deviation[i, j] for i, j in ((0, 1), (0, 2), (1, 2))]
        first, second = np.nonzero((off[0] < GROUP_TOLERANCE) & (apart > 0))
        rows, third = np.nonzero((off[1][first] < GROUP_TOLERANCE) & (off[2][second] < GROUP_TOLERANCE))
        one, two = first[rows], second[rows]
        misfit = off[0][one, two] ** 2 + off[1][one, third] ** 2 + off[2][two, third] ** 2
        for index in np.argsort(misfit, kind="stable")[:MOST_GROUP_MATCHES].tolist():
            found.append((float(misfit[index]), triple, (int(one[index]), int(two[index]), int(third[index]))))
    return found


def _rigid_triples(history: MarkerHistory, lost: Ints) -> list[tuple[int, int, int]]:
    """Each lost marker with its two most rigid lost neighbours, the most rigid triples first."""
    deviation = history.deviations(lost, lost)
    np.fill_diagonal(deviation, np.inf)
    order = np.argsort(deviation, axis=1, kind="stable")[:, :2]
    sums = np.take_along_axis(deviation, order, axis=1).sum(axis=1)
    triples: dict[tuple[int, int, int], None] = {}
    for row in np.argsort(sums, kind="stable")[: int(np.isfinite(sums).sum())].tolist():
        first, second, third = sorted((int(lost[row]), int(lost[order[row, 0]]), int(lost[order[row, 1]])))
        if len(triples) < MOST_GROUPS:
            triples[first, second, third] = None
    return list(triples)


def _extended(
    history: MarkerHistory, lost: Ints, points: Floats, group: dict[int, int], spacing: float
) -> tuple[dict[int, int], float]:
    """Add lost markers that are found where the group predicts them; the group, and their evidence [nats]."""
    corners = np.array(list(group))
    others = np.setdiff1d(lost, corners)
    total = history.deviations(others, corners).sum(axis=1)
    order = np.argsort(total, kind="stable")[: min(MOST_OTHERS, int(np.isfinite(total).sum()))]
    proof = 0.0
    for slot in others[order].tolist():
        chosen = np.array(list(group.values()))
        neighbours = history.neighbours(np.array([slot]), np.array(list(group)))
        expected = history.expected(neighbours, 0, points[chosen])
        if expected is None:
            continue
        place, variance = expected
        squares = ((points - place) ** 2).sum(axis=1)
        squares[chosen] = np.inf
        nearest = int(np.argmin(squares))
        gain = chance(spacing) - 0.5 * float(squares[nearest]) / variance - 1.5 * float(np.log(2 * np.pi * variance))
        if gain > 0:
            group[slot] = nearest
            proof += gain
    return group, proof
