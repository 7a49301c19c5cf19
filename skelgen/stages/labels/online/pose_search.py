"""Search for the pose of a skeleton, without knowledge of the frame before.

For each limb, three of its markers are searched among the points by their distances; each match is a candidate pose,
scored by its log likelihood over chance. The best combination of candidates whose joints agree is found exactly, by
dynamic programming from the leaves to the roots.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.explained_points import LimbMarkers, scores_of_poses
from skelgen._kernels.triple_matching import MarkPattern, matching_triples
from skelgen.geometry.orientation import fit_transform
from skelgen.model.arrays import Bools, Floats, Ints
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

    def places_of(self, offset: Floats) -> Floats:
        """Where the poses put a place of the limb [mm], shape (n, 3)."""
        return np.asarray(self.poses[:, :3, :3] @ offset + self.poses[:, :3, 3])


def chance(spacing: float) -> float:
    """Logarithm of the volume [mm^3] in which one point is expected by chance."""
    return 3.0 * float(np.log(spacing))


class PoseSearch:
    """Search for the poses of a skeleton's limbs in one frame.

    Parameters
    ----------
    skeleton : PoseFilter
        The skeleton.
    """

    def __init__(self, skeleton: PoseFilter) -> None:
        self._skeleton = skeleton
        self._coarse = JOINT_TOLERANCE * float(np.median(skeleton.deviation))
        limbs = range(skeleton.n_limbs)
        self._by_markers = [_Marks.of_limb(skeleton, limb, ()) for limb in limbs]
        self._by_joints = [_Marks.of_limb(skeleton, limb, _joints_of(skeleton, limb), self._coarse) for limb in limbs]

    def find(self, points: Floats, spacing: float) -> tuple[Floats, Floats] | None:
        """Find where the limbs are.

        Parameters
        ----------
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
        found = self._candidates(points, spacing)
        agreement = self._agreement(found, spacing)
        scores = [np.append(candidates.scores, 0.0) for candidates in found]  # the last one: no candidate
        chosen = self._best_combination(agreement, scores)
        for _ in range(self._skeleton.n_limbs):
            loser, taken = _conflict(found, chosen)
            if loser < 0:
                break
            scores[loser][:-1][(found[loser].used & taken).any(axis=1)] = -np.inf
            chosen = self._best_combination(agreement, scores)
        if (chosen < 0).all():
            return None
        poses = np.full((self._skeleton.n_limbs, 4, 4), np.nan)
        for limb in np.flatnonzero(chosen >= 0):
            poses[limb] = found[limb].poses[chosen[limb]]
        return poses[:, :3, :3], poses[:, :3, 3]

    def _candidates(self, points: Floats, spacing: float) -> list[PoseCandidates]:
        """Poses that each limb may have: by its markers, then by these and the joints of limbs that have some already.

        A limb of two markers is found by a joint; the next one of two, farther out, when that is found.
        """
        found = _candidates_of(self._by_markers, points, (), spacing)
        searched = list(range(len(found)))
        while searched:
            more = _candidates_of([self._by_joints[limb] for limb in searched], points, found, spacing)
            gains = any(
                len(one.scores) and not len(found[limb].scores) for limb, one in zip(searched, more, strict=True)
            )
            for limb, one in zip(searched, more, strict=True):
                found[limb] = found[limb].joined(one)
            searched = [limb for limb in searched if not len(found[limb].scores)] if gains else []
        return found

    def _agreement(self, found: list[PoseCandidates], spacing: float) -> list[Floats]:
        """Score of each pair of candidates by where they put each joint; the last row and column: no candidate."""
        skeleton, variance = self._skeleton, 2 * self._coarse**2
        peak = chance(spacing) - 1.5 * np.log(2 * np.pi * variance)
        agreement = []
        for joint, (parent, child) in enumerate(zip(skeleton.parents, skeleton.children, strict=True)):
            first = found[parent].places_of(skeleton.at_parent[joint])
            second = found[child].places_of(skeleton.at_child[joint])
            squares = ((first[:, np.newaxis] - second) ** 2).sum(axis=2)
            agreement.append(np.pad(peak - 0.5 * squares / variance, ((0, 1), (0, 1))))
        return agreement

    def _best_combination(self, agreement: list[Floats], scores: list[Floats]) -> Ints:
        """Index of the chosen candidate of each limb, -1 where none fits, for the largest sum of scores."""
        skeleton, totals, choices = self._skeleton, list(scores), dict[int, Ints]()
        for joint in range(len(agreement) - 1, -1, -1):
            parent, child = int(skeleton.parents[joint]), int(skeleton.children[joint])
            together = agreement[joint] + totals[child]
            choices[child] = together.argmax(axis=1)
            totals[parent] = totals[parent] + together.max(axis=1)
        chosen = np.full(skeleton.n_limbs, -1, dtype=np.intp)
        for root in skeleton.roots:
            chosen[root] = int(totals[root].argmax())
        for parent, child in zip(skeleton.parents, skeleton.children, strict=True):
            chosen[child] = choices[int(child)][chosen[parent]]
        none = np.array([len(of_limb) - 1 for of_limb in scores])
        return np.where(chosen == none, -1, chosen)


class _Joint(NamedTuple):
    """A joint of a limb: the limb at its other side, and its places in both [mm]."""

    other: int
    at_limb: Floats
    at_other: Floats


def _joints_of(skeleton: PoseFilter, limb: int) -> tuple[_Joint, ...]:
    joints = []
    for parent, child, at_parent, at_child in zip(
        skeleton.parents.tolist(), skeleton.children.tolist(), skeleton.at_parent, skeleton.at_child, strict=True
    ):
        if limb == parent:
            joints.append(_Joint(child, at_parent, at_child))
        elif limb == child:
            joints.append(_Joint(parent, at_child, at_parent))
    return tuple(joints)


@dataclass(frozen=True, eq=False)
class _Marks:
    """Marks of a limb, markers and then joints, by which its poses are searched.

    Attributes
    ----------
    offsets : ndarray, shape (n_marks, 3), mm
        In the frame of the limb.
    markers : LimbMarkers
        Those that it carries.
    joints : tuple of _Joint
        Those that are searched: two markers and a joint are enough.
    pattern : MarkPattern
        Distances of the marks, and which are searched together.
    """

    offsets: Floats
    markers: LimbMarkers
    joints: tuple[_Joint, ...]
    pattern: MarkPattern

    @classmethod
    def of_limb(cls, skeleton: PoseFilter, limb: int, joints: tuple[_Joint, ...], coarse: float = 0.0) -> _Marks:
        """Marks of one limb; joints are placed as exactly as `coarse` tells [mm]."""
        own = np.flatnonzero(skeleton.carried & (skeleton.limb == limb))
        markers = LimbMarkers(skeleton.offsets[own], skeleton.deviation[own])
        offsets = np.concatenate([markers.offsets, np.array([joint.at_limb for joint in joints]).reshape(-1, 3)])
        deviation = np.concatenate([markers.deviations, np.full(len(joints), coarse)])
        distances = np.linalg.norm(offsets[:, np.newaxis] - offsets, axis=2)
        limits = TOLERANCE * np.hypot(deviation[:, np.newaxis], deviation)
        return cls(offsets, markers, joints, MarkPattern(distances, limits, _wide_triples(offsets, len(own))))

    def matches(self, points: Floats, neighbours: Sequence[PoseCandidates]) -> tuple[Floats, Floats]:
        """Triples of marks, on the limb and in the world, shape (n, 3, 3) each, mm.

        Parameters
        ----------
        points : ndarray, shape (n_points, 3), mm
            Where markers may be.
        neighbours : sequence of PoseCandidates
            Poses of all limbs, which tell where joints may be.
        """
        places = [points]
        for joint in self.joints:
            places.append(neighbours[joint.other].places_of(joint.at_other)[:MOST_NEIGHBOURS])
        ends = np.cumsum([len(some) for some in places])
        joint_parts = np.stack([ends[:-1], ends[1:]], axis=1)
        parts = np.concatenate([np.tile((0, len(points)), (len(self.markers.offsets), 1)), joint_parts])
        everywhere = np.concatenate(places)
        triple, match = matching_triples(self.pattern, everywhere, parts, MOST_MATCHES)
        return self.offsets[self.pattern.triples[triple]], everywhere[match]


def _wide_triples(offsets: Floats, n_markers: int) -> Ints:
    """Triples of marks that fix a limb's pose and hold a marker, the widest first, shape (n, 3)."""
    triples = itertools.combinations(range(len(offsets)), 3)
    chosen = np.array([triple for triple in triples if triple[0] < n_markers], dtype=np.intp).reshape(-1, 3)
    first, second, third = offsets[chosen].swapaxes(0, 1)
    longest = np.max([(side**2).sum(axis=1) for side in (second - first, third - first, third - second)], axis=0)
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    order = np.argsort(-areas, kind="stable")
    return np.asarray(chosen[order[areas[order] > LEAST_AREA * longest[order]][:MOST_TRIPLES]])


def _candidates_of(
    limbs: list[_Marks], points: Floats, neighbours: Sequence[PoseCandidates], spacing: float
) -> list[PoseCandidates]:
    """Poses of limbs in which points lie where their markers belong, the best of each."""
    matches = [marks.matches(points, neighbours) for marks in limbs]
    source, target = (np.concatenate(side) for side in zip(*matches, strict=True))
    poses = fit_transform(source, target, np.ones(target.shape[:2], dtype=np.bool_))
    ends = np.cumsum([len(sources) for sources, _ in matches])
    found = []
    for marks, of_limb in zip(limbs, np.split(poses, ends[:-1]), strict=True):
        candidates, places = contiguous(of_limb, points)
        scores, used = scores_of_poses(candidates, marks.markers, places, chance(spacing))
        order = np.argsort(-scores, kind="stable")[:MOST_CANDIDATES]
        order = order[scores[order] > 0]
        found.append(PoseCandidates(of_limb[order], scores[order], used[order]))
    return found


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
