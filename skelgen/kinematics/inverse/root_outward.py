r"""A chain posed from the root outward in closed form (Schönauer 2007, 3.8.2), and how sure that is.

The root is placed by absolute orientation. Every other limb turns about the joint that its parent has placed, onto its
own markers. With small errors :math:`\delta o` of that joint, :math:`\omega_p` of the parent's rotation and noise n of
the markers at arms a, the limb's rotation errs by

.. math::
    \omega = \omega_p + P \left( G^{-1} \sum a \times (n - \delta o) - \omega_p \right), \qquad
    G = \sum (a^T a\, I - a a^T),

where P projects on the rotations that the joint allows. Covariances are carried outward with the poses.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import Rotator, fit_transform, moments_about, rotation_by_quaternion
from skelgen.geometry.rotations import cross_matrix, fill_rotations, fill_vectors
from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.inverse.poses import LEAST_NOISE, UNKNOWN_SHIFT, UNKNOWN_TURN, PoseCovariances
from skelgen.kinematics.inverse.skeleton_tree import SkeletonTree
from skelgen.kinematics.rigid_bodies import FLATNESS, determines_pose
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


@dataclass(frozen=True, eq=False)
class KnownJoints:
    """What is known of the joints of a chain before it is posed.

    Attributes
    ----------
    articulation : Articulation
        What the joints allow.
    rotations : ndarray, shape (n_limbs, 3, 3), optional
        World from limb just before; a limb that a frame does not fix keeps its rotation against the parent.
    """

    articulation: Articulation
    rotations: Floats | None = None


def pose_outward(
    chain: Chain,
    positions: Floats,
    raw_joints: Floats | None = None,
    *,
    joints: KnownJoints | None = None,
    rotator: Rotator = rotation_by_quaternion,
    flatness: float = FLATNESS,
) -> tuple[ChainPoses, Bools]:
    """Pose a chain in every frame, limb by limb from the root outward.

    Parameters
    ----------
    chain : Chain
        The limbs.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    raw_joints : ndarray, shape (n_frames, n_limbs, 3), mm, optional
        Joint above each limb, NaN where unknown. Joints to its children help where a limb's markers do not fix it.
    joints : KnownJoints, optional
        The axis of a hinge helps where a limb's points do not fix its rotation. If rotations just before are given,
        frames are posed one by one, and joints turn as they allow; else frames follow each other in time, joints turn
        freely, and rotations that a frame does not fix are interpolated.
    rotator : callable
        Closed form of absolute orientation.
    flatness : float
        Points whose second extent is below this part of the first fix no rotation.

    Returns
    -------
    tuple of ChainPoses and ndarray of bool, shape (n_frames, n_limbs)
        Poses, and whether points of the frame fix each rotation.
    """
    n_frames = len(positions)
    rotations = np.empty((n_frames, chain.n_limbs, 3, 3))
    origins = np.empty((n_frames, chain.n_limbs, 3))
    fixed = np.zeros((n_frames, chain.n_limbs), dtype=bool)
    rest = None if joints is None or joints.rotations is None else _against_parents(chain, joints.rotations)
    world = np.broadcast_to(np.eye(3), (n_frames, 3, 3))
    for limb in range(chain.n_limbs):
        parent = int(chain.parents[limb])
        points, places, seen = _points_to_fit(chain, limb, positions, raw_joints, flatness)
        fixed[:, limb] = _fixes_rotation(points, seen, parent >= 0, flatness)
        above = world if parent < 0 else rotations[:, parent]
        if parent >= 0:
            origins[:, limb] = origins[:, parent] + above @ chain.joints[limb]
        if joints is not None and joints.articulation.types[limb] == "hinge":
            helped = fixed[:, parent] & ~fixed[:, limb]
            axes = joints.articulation.in_child[limb], above @ joints.articulation.in_parent[limb]
            points, places, seen = _with_axis_point((points, places, seen), axes, origins[:, limb], helped)
            fixed[:, limb] = _fixes_rotation(points, seen, True, flatness)
        use, turns = np.flatnonzero(fixed[:, limb]), world.copy()
        if parent < 0:
            turns[use] = fit_transform(points, places[use], seen[use], rotator)[:, :3, :3]
        else:
            turns[use] = rotator(moments_about(points, places[use], origins[use, limb], seen[use]))
        rotations[:, limb] = _completed(turns, fixed[:, limb], above, None if rest is None else rest[limb])
        if parent < 0:
            origins[:, limb], placed = _root_origins(rotations[:, limb], points, places, seen)
            if rest is None:
                origins[:, limb] = fill_vectors(origins[:, limb], placed)
            else:
                origins[~placed, limb] = np.nanmean(positions[~placed], axis=1)
        elif joints is not None and rest is not None:
            rotations[:, limb] = joints.articulation.allowed(limb, above, rotations[:, limb])
    return ChainPoses(origins[:, 0].copy(), rotations), fixed


def pose_by_own_markers(chain: Chain, positions: Floats, flatness: float = FLATNESS) -> tuple[Floats, Bools]:
    """Pose every limb by its own markers alone, where these fix a pose.

    Parameters
    ----------
    chain : Chain
        The limbs.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    flatness : float
        Points whose second extent is below this part of the first fix no rotation.

    Returns
    -------
    tuple of ndarray, shape (n_frames, n_limbs, 4, 4), and ndarray of bool, shape (n_frames, n_limbs)
        World from limb, NaN where the limb's markers fix no pose, and where they do.
    """
    seen = ~np.isnan(positions[:, :, 0])
    poses = np.full((len(positions), chain.n_limbs, 4, 4), np.nan)
    fixed = np.zeros(poses.shape[:2], dtype=bool)
    for limb in range(chain.n_limbs):
        markers = np.flatnonzero(chain.limb_of_marker == limb)
        points = chain.offsets[markers]
        fixed[:, limb] = determines_pose(points, seen[:, markers], flatness)
        frames = np.flatnonzero(fixed[:, limb])
        block = np.ix_(frames, markers)
        poses[frames, limb] = fit_transform(points, positions[block], seen[block])
    return poses, fixed


def _against_parents(chain: Chain, rotations: Floats) -> Floats:
    """Rotations of limbs in the frames of their parents, shape (n_limbs, 3, 3); those of roots stay."""
    above = np.where((chain.parents >= 0)[:, np.newaxis, np.newaxis], rotations[chain.parents], np.eye(3))
    return np.asarray(above.swapaxes(1, 2) @ rotations)


def _points_to_fit(
    chain: Chain, limb: int, positions: Floats, raw_joints: Floats | None, flatness: float
) -> tuple[Floats, Floats, Bools]:
    """Points of a limb in its frame and in the world, and which count: raw joints only where markers do not suffice."""
    own = chain.limb_of_marker == limb
    points, places = chain.offsets[own], positions[:, own]
    if raw_joints is None:
        return points, places, ~np.isnan(places[:, :, 0])
    outer = chain.parents == limb
    n_markers = len(points)
    points = np.concatenate([points, chain.joints[outer]])
    places = np.concatenate([places, raw_joints[:, outer]], axis=1)
    seen = ~np.isnan(places[:, :, 0])
    enough = _fixes_rotation(points[:n_markers], seen[:, :n_markers], bool(chain.parents[limb] >= 0), flatness)
    seen[enough, n_markers:] = False
    return points, places, seen


def _with_axis_point(
    known: tuple[Floats, Floats, Bools], axes: tuple[Floats, Floats], origins: Floats, helped: Bools
) -> tuple[Floats, Floats, Bools]:
    """Points of a limb (in its frame, in the world, which count) with one on its hinge's axis, as far as the others.

    The axes are unit vectors in the limb, shape (3,), and in the world, shape (n_frames, 3). The point counts in frames
    that are `helped`: there the parent has placed the axis, and the limb's other points do not fix its rotation.
    """
    points, places, seen = known
    size = np.sqrt((points**2).sum(axis=1).mean()) if len(points) else 1.0
    on_axis = (origins + size * axes[1])[:, np.newaxis]
    return (
        np.concatenate([points, size * axes[0][np.newaxis]]),
        np.concatenate([places, on_axis], axis=1),
        np.concatenate([seen, helped[:, np.newaxis]], axis=1),
    )


def _fixes_rotation(points: Floats, seen: Bools, about_joint: bool, flatness: float) -> Bools:
    """Whether the seen points fix the rotation; about a joint, the origin is one more known point."""
    if about_joint:
        points = np.concatenate([points, np.zeros((1, 3))])
        seen = np.concatenate([seen, np.ones((len(seen), 1), dtype=bool)], axis=1)
    return determines_pose(points, seen, flatness)


def _completed(turns: Floats, fixed: Bools, above: Floats, rest: Floats | None) -> Floats:
    """Rotations of a limb; where points do not fix them, those against the parent are kept or interpolated."""
    if fixed.all():
        return turns
    missing = np.flatnonzero(~fixed)
    relative = fill_rotations(above.swapaxes(1, 2) @ turns, fixed)[missing] if rest is None else rest
    completed = turns.copy()
    completed[missing] = above[missing] @ relative
    return completed


def _root_origins(turns: Floats, points: Floats, places: Floats, seen: Bools) -> tuple[Floats, Bools]:
    """Where the root's points place its origin [mm], and whether a frame shows one."""
    gaps = np.where(seen[..., np.newaxis], places - np.einsum("fij,nj->fni", turns, points), 0.0).sum(axis=1)
    return gaps / np.maximum(seen.sum(axis=1), 1)[:, np.newaxis], np.asarray(seen.any(axis=1))


def outward_covariances(tree: SkeletonTree, poses: ChainPoses, fixed: Bools, positions: Floats) -> PoseCovariances:
    """Return how sure poses from the root outward are.

    Parameters
    ----------
    tree : SkeletonTree
        The limbs.
    poses : ChainPoses
        From `pose_outward`.
    fixed : ndarray of bool, shape (n_frames, n_limbs)
        Whether markers of the frame fix each rotation.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    """
    chain, errors = tree.chain, _Errors(*np.zeros((4, *fixed.shape, 3, 3)))
    seen = ~np.isnan(positions[:, :, 0])
    for limb in range(chain.n_limbs):
        own = chain.limb_of_marker == limb
        arms = np.einsum("fij,mj->fmi", poses.rotations[:, limb], chain.offsets[own]) * seen[:, own, np.newaxis]
        errors.add(tree, limb, poses.rotations, arms, seen[:, own], fixed[:, limb])
    return PoseCovariances(errors.origins, errors.turns)


@dataclass(frozen=True, eq=False)
class _Errors:
    """Covariances of limbs so far: origins, world turns, both together, and turns against the parents in their axes."""

    origins: Floats
    world_turns: Floats
    mixed: Floats
    turns: Floats

    def add(self, tree: SkeletonTree, limb: int, rotations: Floats, arms: Floats, seen: Bools, fixed: Bools) -> None:
        """Carry errors to a limb whose markers have arms [mm], shape (n_frames, n_own, 3), 0 where unseen."""
        noise, parent = max(tree.noise, LEAST_NOISE), int(tree.chain.parents[limb])
        if parent < 0:
            self._add_root(arms, seen, fixed, noise)
            return
        lever = -cross_matrix(rotations[:, parent] @ tree.chain.joints[limb])
        before, mixed = self.world_turns[:, parent], self.mixed[:, parent]
        at_joint = mixed + lever @ before  # origin with the parent's turn
        across = mixed @ lever.swapaxes(1, 2)
        turned = lever @ before @ lever.swapaxes(1, 2)
        self.origins[:, limb] = self.origins[:, parent] + across + across.swapaxes(1, 2) + turned
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

    def _add_root(self, arms: Floats, seen: Bools, fixed: Bools, noise: float) -> None:
        count = seen.sum(axis=1)[:, np.newaxis, np.newaxis]
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
    if FREEDOMS[articulation.types[limb]] in {0, 3}:
        return every if FREEDOMS[articulation.types[limb]] else np.zeros_like(every)
    first = parent @ articulation.in_parent[limb]
    if articulation.types[limb] == "hinge":
        return np.asarray(first[:, :, np.newaxis] * first[:, np.newaxis])
    normal = np.cross(first, child @ articulation.in_child[limb])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    return np.asarray(every - normal[:, :, np.newaxis] * normal[:, np.newaxis])
