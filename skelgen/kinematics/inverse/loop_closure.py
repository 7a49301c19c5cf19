r"""Kinematic loops: joints beyond the tree, kept closed while poses are fitted.

A loop is closed where a point of one limb coincides with a point of another, :math:`g_f = x_a(p_a) - x_b(p_b) = 0` in
every frame f. The gap is added to the sum of squares as three more observations per frame, with a much larger weight
than markers. It follows the poses by the difference of both points' arms, and the constants by those of both points.
The normal matrix of a frame is then no tree, so it is solved as a whole: loops cost more than trees.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import cross_matrix, matrix_from_vector, transform_from
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, world_arms
from skelgen.kinematics.chain.normal_equations import FrameBlocks, normal_equations
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.model import Motion, Skeleton
from skelgen.model.arrays import Floats, Ints

STIFFNESS = 1e4
"""Weight of a gap beside a marker: closed loops stay so within a hundredth of the noise."""

CHUNK_FRAMES = 256
MAX_STEPS = 20
DAMPING, GIVE_UP_DAMPING = 1e-9, 1e3
"""Levenberg damping relative to the mean diagonal, which the gaps' weight makes large."""

STEP_TOLERANCE = 1e-8  # mm and rad
GAIN_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class KinematicLoops:
    """Points of two limbs each that coincide.

    Attributes
    ----------
    limbs : ndarray of intp, shape (n_loops, 2)
        The two limbs.
    places : ndarray, shape (n_loops, 2, 3), mm
        The point in both limbs' frames.
    stiffness : float
        Weight of a gap beside a marker.
    """

    limbs: Ints
    places: Floats
    stiffness: float = STIFFNESS

    @classmethod
    def of_poses(cls, limbs: Ints, chain: Chain, poses: ChainPoses) -> KinematicLoops:
        """Find the points that come nearest to coinciding in some frames.

        Parameters
        ----------
        limbs : ndarray of intp, shape (n_loops, 2)
            Pairs of limbs that meet.
        chain : Chain
            The limbs.
        poses : ChainPoses
            Their poses.
        """
        world = transform_from(poses.rotations, poses.origins(chain))
        places = []
        for first, second in limbs.tolist():
            near = [_centroid(chain, limb) for limb in (first, second)]
            found = fit_fixed_point(world[:, first], world[:, second], *near)
            places.append(near if found is None else (found.in_first, found.in_second))
        return cls(limbs, np.array(places).reshape(len(limbs), 2, 3))

    @property
    def n_loops(self) -> int:
        """Number of loops."""
        return len(self.limbs)

    def gaps(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return the vectors between both images of the points [mm], shape (n_frames, n_loops, 3).

        Parameters
        ----------
        chain : Chain
            The limbs.
        poses : ChainPoses
            Their poses.
        """
        placed = np.einsum("frsij,rsj->frsi", poses.rotations[:, self.limbs], self.places)
        placed += poses.origins(chain)[:, self.limbs]
        return np.asarray(placed[:, :, 0] - placed[:, :, 1])

    def gap(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return the root mean square gap of each loop [mm], shape (n_loops,).

        Parameters
        ----------
        chain : Chain
            The limbs.
        poses : ChainPoses
            Their poses.
        """
        return np.asarray(np.sqrt((self.gaps(chain, poses) ** 2).sum(axis=2).mean(axis=0)))

    def slopes(self, chain: Chain, poses: ChainPoses) -> tuple[Floats, Floats]:
        """Return the derivatives of the gaps.

        Parameters
        ----------
        chain : Chain
            The limbs.
        poses : ChainPoses
            Their poses.

        Returns
        -------
        ndarray, shape (n_frames, 3 n_loops, 3 + 3 n_limbs)
            By translation and rotations of the limbs.
        ndarray, shape (n_frames, 3 n_loops, 3 (n_limbs - 1) + 6 n_loops)
            By the joints and by the loops' own points.
        """
        n_frames, n_limbs = poses.rotations.shape[:2]
        ends = Chain(chain.parents, self.limbs.ravel(), chain.joints, self.places.reshape(-1, 3))
        arms = world_arms(ends.arms(), poses).reshape(n_frames, self.n_loops, 2, n_limbs, 3)
        turns = -cross_matrix(arms[:, :, 0] - arms[:, :, 1]).transpose(0, 1, 3, 2, 4)
        by_pose = np.zeros((n_frames, 3 * self.n_loops, 3 + 3 * n_limbs))
        by_pose[:, :, 3:] = turns.reshape(n_frames, 3 * self.n_loops, 3 * n_limbs)
        beyond = chain.ancestry()
        by_constants = np.zeros((n_frames, self.n_loops, 3, n_limbs - 1 + 2 * self.n_loops, 3))
        for loop, limbs in enumerate(self.limbs.tolist()):
            for side, (limb, sign) in enumerate(zip(limbs, (1.0, -1.0), strict=True)):
                by_constants[:, loop, :, n_limbs - 1 + 2 * loop + side] = sign * poses.rotations[:, limb]
                for joint in np.flatnonzero(beyond[1:, limb]) + 1:
                    by_constants[:, loop, :, joint - 1] += sign * poses.rotations[:, chain.parents[joint]]
        return by_pose, by_constants.reshape(n_frames, 3 * self.n_loops, -1)

    def moved(self, change: Floats) -> KinematicLoops:
        """Return the loops with their points moved by `change` [mm], shape (6 n_loops,)."""
        return replace(self, places=self.places + change.reshape(self.places.shape))


def loop_gaps(skeleton: Skeleton, motion: Motion) -> Floats:
    """Return the distance of both images of each joint that closes a loop [mm], shape (n_frames, n_loops).

    Parameters
    ----------
    skeleton : Skeleton
        With its `loops`.
    motion : Motion
        How it moves.
    """
    gaps = np.zeros((motion.n_frames, len(skeleton.loops)))
    for column, joint in enumerate(skeleton.loops):
        ends = [
            motion.world_from_limb[:, limb, :3, :3] @ place + motion.world_from_limb[:, limb, :3, 3]
            for limb, place in ((joint.parent, joint.position_in_parent), (joint.child, joint.position_in_child))
        ]
        gaps[:, column] = np.linalg.norm(ends[0] - ends[1], axis=1)
    return gaps


def fit_closed_poses(start: ObservedChain, loops: KinematicLoops) -> ChainPoses:
    """Fit poses to the markers of every frame, loops closed.

    Parameters
    ----------
    start : ObservedChain
        The chain with a first guess of its poses, and what was measured.
    loops : KinematicLoops
        What is closed.
    """
    parts = [_closed(part, loops) for part in start.in_parts(CHUNK_FRAMES)]
    return ChainPoses(np.concatenate([one.root for one in parts]), np.concatenate([one.rotations for one in parts]))


def closed_squares(observed: ObservedChain, loops: KinematicLoops) -> Floats:
    """Return the sum of squares of every frame, gaps included, shape (n_frames,).

    Parameters
    ----------
    observed : ObservedChain
        Poses and what was measured.
    loops : KinematicLoops
        Whose gaps count.
    """
    error = np.nan_to_num(observed.positions - observed.poses.markers(observed.chain))
    squares = np.einsum("fmi,fmi,fm->f", error, error, observed.weights)
    gaps = loops.gaps(observed.chain, observed.poses)
    return np.asarray(squares + loops.stiffness * (gaps**2).sum(axis=(1, 2)))


def with_loops(frames: FrameBlocks, chain: Chain, loops: KinematicLoops, poses: ChainPoses) -> FrameBlocks:
    """Return normal equations with the loops' gaps; the points of the loops become the last constants.

    Parameters
    ----------
    frames : FrameBlocks
        Of the tree.
    chain : Chain
        The limbs.
    loops : KinematicLoops
        What is closed.
    poses : ChainPoses
        Poses of the frames.
    """
    by_pose, by_constants = loops.slopes(chain, poses)
    n_joints, n_axes = 3 * (chain.n_limbs - 1), frames.tilts.shape[2]
    n_offsets = frames.coupling.shape[2] - n_joints - n_axes
    own = by_pose @ frames.turns
    nothing = np.zeros((*by_pose.shape[:2], n_offsets))
    tilted = by_pose @ frames.tilts
    follow = np.concatenate([nothing, by_constants[..., :n_joints], tilted, by_constants[..., n_joints:]], axis=2)
    more = 6 * loops.n_loops
    normal = frames.own + loops.stiffness * own.swapaxes(1, 2) @ own
    coupling = np.pad(frames.coupling, ((0, 0), (0, 0), (0, more))) + loops.stiffness * own.swapaxes(1, 2) @ follow
    flat = follow.reshape(-1, follow.shape[2])
    constants = np.pad(frames.constants, ((0, more), (0, more))) + loops.stiffness * flat.T @ flat
    return replace(frames, own=normal, coupling=coupling, constants=constants)


def _closed(start: ObservedChain, loops: KinematicLoops) -> ChainPoses:
    """Fit the poses of some frames by damped Gauss-Newton steps."""
    chain, articulation = start.chain, start.articulation
    poses = ChainPoses(start.poses.root.copy(), articulation.projected(chain.parents, start.poses.rotations))
    active = np.arange(start.n_frames)
    loss = closed_squares(replace(start, poses=poses), loops)
    damping = np.full(len(active), DAMPING)
    for _ in range(MAX_STEPS):
        here = replace(start.at(active), poses=poses[active])
        step = _step(here, loops, damping[active])
        turned = matrix_from_vector(step[:, 3:].reshape(len(step), -1, 3)) @ here.poses.rotations
        there = ChainPoses(here.poses.root + step[:, :3], articulation.projected(chain.parents, turned))
        squares = closed_squares(replace(here, poses=there), loops)
        better = squares <= loss[active]
        kept = active[better]
        converged = better & (loss[active] - squares <= GAIN_TOLERANCE * loss[active])
        converged |= np.abs(step).max(axis=1) < STEP_TOLERANCE
        poses.root[kept], poses.rotations[kept] = there.root[better], there.rotations[better]
        loss[kept] = squares[better]
        damping[active] = np.where(better, np.maximum(damping[active] / 10, DAMPING), damping[active] * 1000)
        active = active[~converged & (damping[active] < GIVE_UP_DAMPING)]
        if not len(active):
            break
    return poses


def _step(here: ObservedChain, loops: KinematicLoops, damping: Floats) -> Floats:
    """Damped step of translation and rotations, shape (n_frames, 3 + 3 n_limbs)."""
    chain, poses = here.chain, here.poses
    hessian, gradient = normal_equations(chain, poses, here.positions, here.weights)
    by_pose, _ = loops.slopes(chain, poses)
    hessian += loops.stiffness * by_pose.swapaxes(1, 2) @ by_pose
    gap = loops.gaps(chain, poses).reshape(here.n_frames, -1)
    gradient -= loops.stiffness * np.einsum("frd,fr->fd", by_pose, gap)
    turns, _ = here.articulation.bases(chain.parents, poses.rotations)
    own = turns.swapaxes(1, 2) @ hessian @ turns
    diagonal = np.einsum("fqq->fq", own)
    level = np.empty_like(diagonal)
    level[:, :3], level[:, 3:] = (part.mean(axis=1, keepdims=True) for part in (diagonal[:, :3], diagonal[:, 3:]))
    level = np.maximum(level * damping[:, np.newaxis], np.finfo(np.float64).tiny)
    right = np.einsum("fdq,fd->fq", turns, gradient)
    step = np.linalg.solve(own + level[:, :, np.newaxis] * np.eye(own.shape[1]), right[..., np.newaxis])
    return np.asarray((turns @ step)[..., 0])


def _centroid(chain: Chain, limb: int) -> Floats:
    own = chain.limb_of_marker == limb
    return np.asarray(chain.offsets[own].mean(axis=0)) if own.any() else np.zeros(3)
