"""Search without knowledge of the frame before: the pose of the subject, or a rigid group of lost markers.

For each limb, three of its markers are searched among the points by their distances; each match is a candidate pose,
scored by its log likelihood over chance. The best combination of candidates whose joints agree is found exactly, by
dynamic programming from the leaves to the roots. A rigid group of lost markers is found by three distances in the same
way, and accepted if further markers of the group are where it predicts them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.explained_points import LimbMarkers, scores_of_poses
from skelgen.geometry.orientation import fit_transform
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.online.marker_history import MarkerHistory
from skelgen.stages.labels.online.pose_filter import PoseFilter

TOLERANCE = 3.5
"""Standard deviations within which a distance between two markers must agree."""

MOST_TRIPLES = 10
"""Triples of a limb's markers that are tried, the widest first; any three that are seen determine the pose."""

MOST_NEIGHBOURS = 12
"""Poses of a neighbouring limb that predict a joint."""

MOST_MATCHES = 300
"""Matches of a triple that are examined; if there are more, most are there by chance."""

MOST_CANDIDATES = 60
"""Candidate poses of a limb among which the tree chooses."""

LEAST_AREA = 0.05
"""Least height of a triangle of markers over its longest side; flatter ones do not fix a pose."""

JOINT_TOLERANCE = 3.0
"""Deviation of a joint that is placed by one limb alone, in those of a marker: the rotation's error adds to it."""

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


@dataclass(frozen=True, eq=False)
class PoseCandidates:
    """Poses that one limb may have.

    Attributes
    ----------
    poses : ndarray, shape (n, 4, 4), mm
        World from limb.
    scores : ndarray, shape (n,)
        Log likelihood over chance, best first.
    used : ndarray of bool, shape (n, n_points)
        Points that each pose explains.
    """

    poses: Floats
    scores: Floats
    used: Bools

    def joined(self, other: PoseCandidates) -> PoseCandidates:
        """The best of both."""
        scores = np.concatenate([self.scores, other.scores])
        order = np.argsort(-scores, kind="stable")[:MOST_CANDIDATES]
        poses, used = np.concatenate([self.poses, other.poses]), np.concatenate([self.used, other.used])
        return PoseCandidates(poses[order], scores[order], used[order])

    def without(self, points: Bools) -> PoseCandidates:
        """The candidates that explain none of some points."""
        kept = ~(self.used & points).any(axis=1)
        return PoseCandidates(self.poses[kept], self.scores[kept], self.used[kept])


def find_pose(skeleton: PoseFilter, points: Floats, spacing: float) -> tuple[Floats, Floats] | None:
    """Find where the limbs are.

    Parameters
    ----------
    skeleton : PoseFilter
        The skeleton.
    points : ndarray, shape (n, 3), mm
        One frame.
    spacing : float, mm
        Typical distance of a point from its nearest neighbour.

    Returns
    -------
    rotations : ndarray, shape (n_limbs, 3, 3)
        World from limb; NaN for limbs that were not found.
    origins : ndarray, shape (n_limbs, 3), mm
    None where no limb was found.
    """
    if len(points) < 3:
        return None
    found = _candidates(skeleton, points, spacing)
    chosen = _best_combination(skeleton, found, spacing)
    for _ in range(skeleton.n_limbs):
        loser, taken = _conflict(found, chosen)
        if loser < 0:
            break
        found[loser] = found[loser].without(taken)
        chosen = _best_combination(skeleton, found, spacing)
    if (chosen < 0).all():
        return None
    poses = np.full((skeleton.n_limbs, 4, 4), np.nan)
    for limb in np.flatnonzero(chosen >= 0):
        poses[limb] = found[limb].poses[chosen[limb]]
    return poses[:, :3, :3], poses[:, :3, 3]


def _candidates(skeleton: PoseFilter, points: Floats, spacing: float) -> list[PoseCandidates]:
    """Poses that each limb may have: by its own markers, then by these and the joints of limbs that have some already.

    A limb of two markers is found by a joint; the next one of two, farther out, when that is found.
    """
    limbs = range(skeleton.n_limbs)
    found = [_limb_candidates(skeleton, limb, points, spacing) for limb in limbs]
    searched = list(limbs)
    while searched:
        more = {limb: _limb_candidates(skeleton, limb, points, spacing, found) for limb in searched}
        gained = [limb for limb, one in more.items() if len(one.scores) and not len(found[limb].scores)]
        found = [found[limb].joined(more[limb]) if limb in more else found[limb] for limb in limbs]
        searched = [limb for limb in limbs if not len(found[limb].scores)] if gained else []
    return found


def _limb_candidates(
    skeleton: PoseFilter, limb: int, points: Floats, spacing: float, neighbours: list[PoseCandidates] | None = None
) -> PoseCandidates:
    """Find poses of one limb in which points lie where its markers belong.

    Parameters
    ----------
    skeleton, points, spacing
        As `find_pose`.
    limb : int
        Which limb.
    neighbours : list of PoseCandidates, optional
        Poses of all limbs: where they put the limb's joints counts like points, so that two markers can be enough.
    """
    own = np.flatnonzero(skeleton.carried & (skeleton.limb == limb))
    carried = LimbMarkers(skeleton.offsets[own], skeleton.deviation[own])
    marks = _Marks(*carried, [points] * len(own))
    triples = itertools.combinations(range(len(own)), 3)
    if neighbours is not None:
        marks = marks.with_joints(skeleton, limb, neighbours)
        triples = itertools.combinations(range(len(marks.targets)), 3)
    sources, targets = [], []
    wide = _wide_triples(marks.offsets, triples, len(own))
    for triple, matches in zip(wide, marks.matches(wide), strict=True):
        sources.extend([marks.offsets[list(triple)]] * len(matches))
        targets.append(matches)
    if not sources:
        return PoseCandidates(np.empty((0, 4, 4)), np.empty(0), np.empty((0, len(points)), dtype=np.bool_))
    target = np.concatenate(targets)
    poses = fit_transform(np.array(sources), target, np.ones(target.shape[:2], dtype=np.bool_))
    candidates, places = contiguous(poses, points)
    scores, used = scores_of_poses(candidates, carried, places, chance(spacing))
    order = np.argsort(-scores, kind="stable")[:MOST_CANDIDATES]
    order = order[scores[order] > 0]
    return PoseCandidates(poses[order], scores[order], used[order])


def chance(spacing: float) -> float:
    """Logarithm of the volume [mm^3] in which one point is expected by chance."""
    return 3.0 * float(np.log(spacing))


@dataclass(frozen=True, eq=False)
class _Marks:
    """Marks of a limb, markers and then joints: their offsets, deviations [mm], and where each may be."""

    offsets: Floats
    deviation: Floats
    targets: list[Floats]

    def with_joints(self, skeleton: PoseFilter, limb: int, neighbours: list[PoseCandidates]) -> _Marks:
        """Add the limb's joints, which may be where the poses of its neighbours put them."""
        places, targets = [], []
        for joint, (parent, child) in enumerate(zip(skeleton.parents, skeleton.children, strict=True)):
            if limb not in (parent, child):
                continue
            at_limb, at_other = skeleton.at_parent[joint], skeleton.at_child[joint]
            other = child
            if limb == child:
                at_limb, at_other, other = at_other, at_limb, parent
            poses = neighbours[other].poses[:MOST_NEIGHBOURS]
            places.append(at_limb)
            targets.append(poses[:, :3, :3] @ at_other + poses[:, :3, 3])
        coarse = JOINT_TOLERANCE * float(np.median(skeleton.deviation))
        offsets = np.concatenate([self.offsets, np.array(places).reshape(-1, 3)])
        deviation = np.concatenate([self.deviation, np.full(len(places), coarse)])
        return _Marks(offsets, deviation, self.targets + targets)

    def matches(self, triples: list[tuple[int, int, int]]) -> list[Floats]:
        """Triples of places with the distances of three marks, of each triple of marks of shape (n, 3, 3), mm."""
        pairs = dict.fromkeys(pair for triple in triples for pair in itertools.combinations(triple, 2))
        fits = {pair: self._fits(*pair) for pair in pairs}
        found = []
        for one, two, three in triples:
            first, second = np.nonzero(fits[one, two])
            rows, third = np.nonzero(fits[one, three][first] & fits[two, three][second])
            rows, third = rows[:MOST_MATCHES], third[:MOST_MATCHES]
            corners = (self.targets[one][first[rows]], self.targets[two][second[rows]], self.targets[three][third])
            found.append(np.stack(corners, axis=1))
        return found

    def _fits(self, one: int, two: int) -> Bools:
        """Which places of two marks are as far apart as the marks."""
        apart = np.linalg.norm(self.targets[one][:, np.newaxis] - self.targets[two], axis=2)
        wanted = float(np.linalg.norm(self.offsets[one] - self.offsets[two]))
        limit = TOLERANCE * float(np.hypot(self.deviation[one], self.deviation[two]))
        return np.asarray((np.abs(apart - wanted) < limit) & (apart > 0))


def _wide_triples(
    offsets: Floats, triples: Iterable[tuple[int, int, int]], n_markers: int
) -> list[tuple[int, int, int]]:
    """Triples of marks that fix a limb's pose and hold a marker, the widest first."""
    chosen = np.array([triple for triple in triples if min(triple) < n_markers], dtype=np.intp).reshape(-1, 3)
    first, second, third = offsets[chosen].swapaxes(0, 1)
    longest = np.max([(side**2).sum(axis=1) for side in (second - first, third - first, third - second)], axis=0)
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    order = np.argsort(-areas, kind="stable")
    order = order[areas[order] > LEAST_AREA * longest[order]][:MOST_TRIPLES]
    return [(one, two, three) for one, two, three in chosen[order].tolist()]


def _best_combination(skeleton: PoseFilter, found: list[PoseCandidates], spacing: float) -> Ints:
    """Index of the chosen candidate of each limb, -1 where none fits, for the largest sum of scores."""
    totals = [np.concatenate([candidates.scores, [0.0]]) for candidates in found]  # the last one: no candidate
    choices: dict[int, Ints] = {}
    for joint in range(len(skeleton.children) - 1, -1, -1):
        parent, child = int(skeleton.parents[joint]), int(skeleton.children[joint])
        together = _agreement(skeleton, joint, found[parent].poses, found[child].poses, spacing) + totals[child]
        choices[child] = together.argmax(axis=1)
        totals[parent] = totals[parent] + together.max(axis=1)
    chosen = np.full(skeleton.n_limbs, -1, dtype=np.intp)
    for root in skeleton.roots:
        chosen[root] = int(totals[root].argmax())
    for parent, child in zip(skeleton.parents, skeleton.children, strict=True):
        chosen[child] = choices[int(child)][chosen[parent]]
    return np.array([-1 if chosen[limb] == len(found[limb].scores) else chosen[limb] for limb in range(len(found))])


def _conflict(found: list[PoseCandidates], chosen: Ints) -> tuple[int, Bools]:
    """The weaker of two limbs that explain the same point, -1 for none; and the points of the stronger one."""
    limbs = np.flatnonzero(chosen >= 0)
    if not len(limbs):
        return -1, np.zeros(0, dtype=np.bool_)
    used = np.array([found[limb].used[chosen[limb]] for limb in limbs])
    scores = np.array([found[limb].scores[chosen[limb]] for limb in limbs])
    shared = np.argwhere(np.triu(used.astype(np.intp) @ used.T, 1))
    if not len(shared):
        return -1, np.zeros(0, dtype=np.bool_)
    first, second = shared[0]
    loser, winner = (second, first) if scores[first] >= scores[second] else (first, second)
    return int(limbs[loser]), used[winner]


def _agreement(skeleton: PoseFilter, joint: int, parent: Floats, child: Floats, spacing: float) -> Floats:
    """Score of each pair of candidates by where they put their joint; the last row and column mean no candidate."""
    result = np.zeros((len(parent) + 1, len(child) + 1))
    first = parent[:, :3, :3] @ skeleton.at_parent[joint] + parent[:, :3, 3]
    second = child[:, :3, :3] @ skeleton.at_child[joint] + child[:, :3, 3]
    variance = 2 * (JOINT_TOLERANCE * float(np.median(skeleton.deviation))) ** 2
    squares = ((first[:, np.newaxis] - second) ** 2).sum(axis=2)
    result[:-1, :-1] = chance(spacing) - 0.5 * squares / variance - 1.5 * np.log(2 * np.pi * variance)
    return result


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
