r"""A known skeleton posed from the root outward in closed form (Schönauer 2007, 3.8.2), and how sure that is.

The root is placed by its markers. Every other limb turns about the joint that its parent has placed, onto its own
markers, as near as its joint allows. With small errors :math:`\delta o` of that joint, :math:`\omega_p` of the parent's
turn and noise n of the markers at arms a, the limb's turn errs by

.. math::
    \omega = \omega_p + P \left( G^{-1} \sum a \times (n - \delta o) - \omega_p \right), \qquad
    G = \sum (a^T a\, I - a a^T),

where P projects on the turns that the joint allows. Covariances are carried outward with the poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import fit_transform, rotation_by_quaternion
from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.bodies.shape import determines_pose
from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import ChainPoses
from skelgen.kinematics.inverse.poses import LEAST_NOISE, UNKNOWN_SHIFT, UNKNOWN_TURN, PoseCovariances
from skelgen.kinematics.inverse.skeleton_tree import SkeletonTree
from skelgen.model.arrays import Bools, Floats


@dataclass(frozen=True, eq=False)
class PosedTree:
    """A tree posed from the root outward.

    Attributes
    ----------
    poses : ChainPoses
        The poses.
    fixed : ndarray of bool, shape (n_frames, n_limbs)
        Whether markers of the frame fix the limb's rotation.
    covariances : PoseCovariances
        Of limbs' origins in the world, and of turns against the parents.
    """

    poses: ChainPoses
    fixed: Bools
    covariances: PoseCovariances


def pose_outward(tree: SkeletonTree, positions: Floats, before: Floats | None = None) -> PosedTree:
    """Place limbs in closed form; those that markers do not fix keep their turn against the parent.

    Parameters
    ----------
    tree : SkeletonTree
        The limbs.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of the tree, NaN where unseen; every frame shows one.
    before : ndarray, shape (n_limbs, 3, 3), optional
        Rotations that limbs had before; those of the reference pose if not given.
    """
    chain, n_frames = tree.chain, len(positions)
    before = np.tile(np.eye(3), (chain.n_limbs, 1, 1)) if before is None else before
    seen = ~np.isnan(positions[:, :, 0])
    rotations = np.tile(np.eye(3), (n_frames, chain.n_limbs, 1, 1))
    origins = np.zeros((n_frames, chain.n_limbs, 3))
    fixed = np.zeros((n_frames, chain.n_limbs), dtype=bool)
    errors = _Errors.empty(n_frames, chain.n_limbs)
    for limb in range(chain.n_limbs):
        own = np.flatnonzero(chain.limb_of_marker == limb)
        points, heard, places = chain.offsets[own], seen[:, own], positions[:, own]
        parent = int(chain.parents[limb])
        if parent < 0:
            found = _place_root(points, places, heard, positions, before[limb])
            rotations[:, limb], origins[:, limb], fixed[:, limb] = found
        else:
            origins[:, limb] = origins[:, parent] + rotations[:, parent] @ chain.joints[limb]
            with_joint = np.concatenate([heard, np.ones((n_frames, 1), dtype=bool)], axis=1)
            fixed[:, limb] = determines_pose(np.concatenate([points, np.zeros((1, 3))]), with_joint)
            arms = np.nan_to_num(places - origins[:, limb, np.newaxis])
            turn = rotation_by_quaternion(np.einsum("fmi,mj->fij", arms, points))
            kept = rotations[:, parent] @ (before[parent].T @ before[limb])
            rotations[:, limb] = np.where(fixed[:, limb, np.newaxis, np.newaxis], turn, kept)
            rotations[:, limb] = tree.articulation.allowed(limb, rotations[:, parent], rotations[:, limb])
        arms = np.einsum("fij,mj->fmi", rotations[:, limb], points) * heard[..., np.newaxis]
        errors.add(tree, limb, rotations, arms, heard, fixed[:, limb])
    return PosedTree(ChainPoses(origins[:, 0].copy(), rotations), fixed, PoseCovariances(errors.origins, errors.turns))


def _place_root(
    points: Floats, places: Floats, heard: Bools, positions: Floats, before: Floats
) -> tuple[Floats, Floats, Bools]:
    """Place the root by its markers; where it has none, at the middle of all others."""
    fixed = determines_pose(points, heard)
    poses = fit_transform(points, places, heard & fixed[:, np.newaxis])
    turn = np.where(fixed[:, np.newaxis, np.newaxis], poses[:, :3, :3], before)
    gaps = np.where(heard[..., np.newaxis], places - np.einsum("fij,mj->fmi", turn, points), 0.0).sum(axis=1)
    count = heard.sum(axis=1)[:, np.newaxis]
    return turn, np.where(count > 0, gaps / np.maximum(count, 1), np.nanmean(positions, axis=1)), fixed


@dataclass(frozen=True, eq=False)
class _Errors:
    """Covariances of limbs so far: origins, world turns, both together, and turns against the parents in their axes."""

    origins: Floats
    world_turns: Floats
    mixed: Floats
    turns: Floats

    @classmethod
    def empty(cls, n_frames: int, n_limbs: int) -> _Errors:
        return cls(*np.zeros((4, n_frames, n_limbs, 3, 3)))

    def add(self, tree: SkeletonTree, limb: int, rotations: Floats, arms: Floats, heard: Bools, fixed: Bools) -> None:
        """Carry errors to a limb whose markers have arms [mm], shape (n_frames, n_own, 3), 0 where unseen."""
        noise, parent = max(tree.noise, LEAST_NOISE), int(tree.chain.parents[limb])
        if parent < 0:
            self._add_root(arms, heard, fixed, noise)
            return
        lever = -cross_matrix(rotations[:, parent] @ tree.chain.joints[limb])
        before, mixed = self.world_turns[:, parent], self.mixed[:, parent]
        at_joint = mixed + lever @ before  # origin with the parent's turn
        across = mixed @ lever.swapaxes(1, 2)
        self.origins[:, limb] = (
            self.origins[:, parent] + across + across.swapaxes(1, 2) + lever @ before @ lever.swapaxes(1, 2)
        )
        tells = fixed[:, np.newaxis, np.newaxis]  # a limb that is not fixed turns with its parent
        inverse = np.linalg.inv(_inertia(arms) + np.eye(3) * (noise / UNKNOWN_TURN) ** 2)
        inverse = np.where(tells, inverse, np.eye(3) * (UNKNOWN_TURN / noise) ** 2)
        follow = -inverse @ cross_matrix(arms.sum(axis=1)) * tells
        allowed = _allowed_turns(tree.articulation, limb, rotations[:, parent], rotations[:, limb])
        of_joint = follow @ at_joint  # the turn that the joint's error makes, with the parent's turn
        parents = before * tells
        relative = noise**2 * inverse + follow @ self.origins[:, limb] @ follow.swapaxes(1, 2) + parents
        relative = allowed @ (relative - of_joint - of_joint.swapaxes(1, 2)) @ allowed
        with_parent = allowed @ (of_joint - parents)
        self.world_turns[:, limb] = before + relative + with_parent + with_parent.swapaxes(1, 2)
        with_origin = allowed @ (follow @ self.origins[:, limb] - at_joint.swapaxes(1, 2) * tells)
        self.mixed[:, limb] = at_joint + with_origin.swapaxes(1, 2)
        back = rotations[:, parent].swapaxes(1, 2)
        self.turns[:, limb] = back @ relative @ rotations[:, parent]

    def _add_root(self, arms: Floats, heard: Bools, fixed: Bools, noise: float) -> None:
        count = heard.sum(axis=1)[:, np.newaxis, np.newaxis]
        information = np.zeros((len(arms), 6, 6))
        moment = cross_matrix(arms.sum(axis=1))
        information[:, :3, :3] = count * np.eye(3)
        information[:, :3, 3:], information[:, 3:, :3] = -moment, moment
        information[:, 3:, 3:] = _inertia(arms)
        information[~fixed] = 0.0
        weak = np.diag(np.repeat([(noise / UNKNOWN_SHIFT) ** 2, (noise / UNKNOWN_TURN) ** 2], 3))
        covariance = noise**2 * np.linalg.inv(information + weak)
        self.origins[:, 0], self.world_turns[:, 0] = covariance[:, :3, :3], covariance[:, 3:, 3:]
        self.mixed[:, 0], self.turns[:, 0] = covariance[:, :3, 3:], covariance[:, 3:, 3:]


def _inertia(arms: Floats) -> Floats:
    outer = np.einsum("fmi,fmj->fij", arms, arms)
    return np.asarray(np.einsum("fii->f", outer)[:, np.newaxis, np.newaxis] * np.eye(3) - outer)


def _allowed_turns(articulation: Articulation, limb: int, parent: Floats, child: Floats) -> Floats:
    """Projectors on the turns that a joint allows, shape (n_frames, 3, 3)."""
    every = np.broadcast_to(np.eye(3), parent.shape)
    if FREEDOMS[articulation.kinds[limb]] in {0, 3}:
        return every if FREEDOMS[articulation.kinds[limb]] else np.zeros_like(every)
    first = parent @ articulation.in_parent[limb]
    if articulation.kinds[limb] == "hinge":
        return np.asarray(first[:, :, np.newaxis] * first[:, np.newaxis])
    normal = np.cross(first, child @ articulation.in_child[limb])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    return np.asarray(every - normal[:, :, np.newaxis] * normal[:, np.newaxis])
