"""A tree of limbs in motion, as far as names need it: ways along it, and where its joints are in some frames."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from skelgen.geometry.rotations import moved_points
from skelgen.kinematics.chain.chain import ObservedChain
from skelgen.model import Motion, Skeleton
from skelgen.model.arrays import Floats, spread_frames

_FRAMES = 300


@dataclass(frozen=True, eq=False)
class MovingTree:
    """One tree of limbs, in some frames spread over a take.

    Attributes
    ----------
    limbs : tuple of int
        Limbs of this tree.
    joints : mapping of pairs of int to ndarray, shape (n_frames, 3), mm
        Where two limbs meet, by the pair either way.
    rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
        World from limb, of all limbs of the skeleton.
    markers : mapping of int to ndarray, shape (n_frames, n_markers, 3), mm
        Markers of each limb of the tree.
    rate : float, Hz
        Of these frames.
    """

    limbs: tuple[int, ...]
    joints: dict[tuple[int, int], Floats]
    rotations: Floats
    markers: dict[int, Floats]
    rate: float

    @cached_property
    def neighbours(self) -> dict[int, tuple[int, ...]]:
        """Limbs that each limb is joined to."""
        return {limb: tuple(sorted(b for a, b in self.joints if a == limb)) for limb in self.limbs}

    @cached_property
    def ends(self) -> tuple[int, ...]:
        """Limbs with one neighbour."""
        return tuple(limb for limb in self.limbs if len(self.neighbours[limb]) == 1)

    @cached_property
    def centres(self) -> dict[int, Floats]:
        """Middle of each limb's markers, shape (n_frames, 3)."""
        return {limb: markers.mean(axis=1) for limb, markers in self.markers.items()}

    def middle(self, limbs: Iterable[int]) -> Floats:
        """Middle of all markers of some limbs, shape (n_frames, 3)."""
        return np.asarray(np.concatenate([self.markers[limb] for limb in limbs], axis=1).mean(axis=1))

    def path(self, first: int, last: int) -> tuple[int, ...]:
        """Return the limbs on the way from one to another, both included.

        Parameters
        ----------
        first, last : int
            Two limbs of the tree.
        """
        return self._paths[first][last]

    def joints_on(self, path: tuple[int, ...]) -> list[Floats]:
        """Joints between the limbs of a path, in its order."""
        return [self.joints[pair] for pair in pairwise(path)]

    def way(self, first: int, last: int) -> float:
        """Return the length of the way along the joints from the middle of one limb to that of another [mm].

        Parameters
        ----------
        first, last : int
            Two limbs of the tree.
        """
        path = self.path(first, last)
        places = [self.centres[first], *self.joints_on(path), self.centres[last]]
        return sum(distance(one, other) for one, other in pairwise(places))

    def meeting(self, first: int, second: int, third: int) -> int:
        """Return the limb at which the ways between three limbs meet.

        Parameters
        ----------
        first, second, third : int
            Three limbs of the tree.
        """
        shared = set(self.path(first, second)) & set(self.path(first, third)) & set(self.path(second, third))
        return shared.pop()

    @cached_property
    def _paths(self) -> dict[int, dict[int, tuple[int, ...]]]:
        found = {}
        for start in self.limbs:
            paths: dict[int, tuple[int, ...]] = {start: (start,)}
            waiting = [start]
            while waiting:
                limb = waiting.pop()
                for other in self.neighbours[limb]:
                    if other not in paths:
                        paths[other] = (*paths[limb], other)
                        waiting.append(other)
            found[start] = paths
        return found


def distance(first: Floats, second: Floats) -> float:
    """Return the median distance of two points over frames [mm].

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 3), mm
        The points.
    """
    return float(np.median(np.linalg.norm(first - second, axis=1)))


def along(vectors: Floats, axis: Floats) -> Floats:
    """Return how far vectors go along others, shape (...).

    Parameters
    ----------
    vectors : ndarray, shape (..., 3)
        Any vectors.
    axis : ndarray, shape (..., 3)
        Vectors of length 1.
    """
    return np.asarray((vectors * axis).sum(axis=-1))


def moving_trees(skeleton: Skeleton, motion: Motion) -> list[MovingTree]:
    """Return the trees of a skeleton whose limbs all carry markers.

    Parameters
    ----------
    skeleton : Skeleton
        With at least one limb.
    motion : Motion
        With at least one frame.
    """
    frames = spread_frames(motion.n_frames, _FRAMES)
    poses = motion.world_from_limb[frames]
    rate = motion.rate * len(frames) / motion.n_frames
    tree_of = np.arange(skeleton.n_limbs)
    for limb in skeleton.outward.tolist():
        if skeleton.parents[limb] >= 0:
            tree_of[limb] = tree_of[skeleton.parents[limb]]
    trees = []
    for root in skeleton.roots.tolist():
        limbs = tuple(np.flatnonzero(tree_of == root).tolist())
        offsets = {limb: skeleton.marker_offsets[skeleton.markers_of(limb)] for limb in limbs}
        markers = {limb: moved_points(poses[:, limb], own) for limb, own in offsets.items()}
        joints = {}
        for index, joint in enumerate(skeleton.joints):
            if tree_of[joint.child] == root:
                places = motion.joint_positions[frames, index]
                if joint.kind == "hinge" and joint.axis is not None and markers[joint.child].shape[1]:
                    axis = poses[:, joint.parent, :3, :3] @ joint.axis  # beside the child: along it nothing is known
                    places = places + along(markers[joint.child].mean(axis=1) - places, axis).mean() * axis
                joints[joint.parent, joint.child] = joints[joint.child, joint.parent] = places
        if all(markers[limb].shape[1] for limb in limbs):
            trees.append(MovingTree(limbs, joints, poses[..., :3, :3], markers, rate))
    return trees


def tree_of_chain(fit: ObservedChain) -> MovingTree | None:
    """Return the tree of a fitted chain, limbs by their places in it; None if a limb carries no markers.

    Parameters
    ----------
    fit : ObservedChain
        In frames spread over the take.
    """
    some = fit.at(spread_frames(fit.n_frames, _FRAMES))
    chain, placed, origins = some.chain, some.poses.markers(some.chain), some.poses.origins(some.chain)
    limbs = tuple(range(chain.n_limbs))
    markers = {limb: placed[:, chain.limb_of_marker == limb] for limb in limbs}
    edges = [(int(chain.parents[limb]), limb) for limb in limbs[1:]]
    joints = {pair: origins[:, edge[1]] for edge in edges for pair in (edge, edge[::-1])}
    if not all(one.shape[1] for one in markers.values()):
        return None
    return MovingTree(limbs, joints, some.poses.rotations, markers, 1.0)


def together(trees: Sequence[MovingTree]) -> MovingTree:
    """Return trees as one without joints between them.

    Parameters
    ----------
    trees : sequence of MovingTree
        Of one skeleton, one and more.
    """
    joints = {pair: places for tree in trees for pair, places in tree.joints.items()}
    markers = {limb: placed for tree in trees for limb, placed in tree.markers.items()}
    return MovingTree(tuple(sorted(markers)), joints, trees[0].rotations, markers, trees[0].rate)
