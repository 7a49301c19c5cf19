r"""Rings of limbs: joints that a tree cannot hold, closed while the chain is fitted.

A ring is a point of two limbs that must coincide, :math:`g_f = x_a(p_a) - x_b(p_b) = 0` in every frame f. The gap is
added to the sum of squares as three more observations per frame that are much surer than markers; it follows the poses
by the difference of both points' arms and the constants by those of both points. The normal matrix of a frame is no
tree any more, so it is solved as a whole: rings cost more than trees.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import cross_matrix, matrix_from_vector
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, seen_weights, world_arms
from skelgen.kinematics.chain.normal_equations import Frames, normal_equations
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.model import Motion, Skeleton
from skelgen.model.arrays import Floats, Ints

STIFFNESS = 1e4
"""Weight of a gap beside a marker: closed rings stay so within a hundredth of the noise."""

CHUNK_FRAMES = 256
MAX_STEPS = 20
DAMPING, GIVE_UP_DAMPING = 1e-9, 1e3
"""Levenberg damping relative to the mean diagonal, which the gaps' weight makes large."""

STEP_TOLERANCE = 1e-8  # mm and rad
GAIN_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class Rings:
    """Points of two limbs each that coincide.

    Attributes
    ----------
    limbs : ndarray of intp, shape (n_rings, 2)
        The two limbs.
    places : ndarray, shape (n_rings, 2, 3), mm
        The point in both limbs' frames.
    stiffness : float
        Weight of a gap beside a marker.
    """

    limbs: Ints
    places: Floats
    stiffness: float = STIFFNESS

    @classmethod
    def of_poses(cls, limbs: Ints, chain: Chain, poses: ChainPoses) -> Rings:
        """Find the points that come nearest to coinciding in some frames."""
        world = np.tile(np.eye(4), (*poses.rotations.shape[:2], 1, 1))
        world[..., :3, :3], world[..., :3, 3] = poses.rotations, poses.origins(chain)
        places = []
        for first, second in limbs.tolist():
            near = [_centroid(chain, limb) for limb in (first, second)]
            found = fit_fixed_point(world[:, first], world[:, second], *near)
            places.append(near if found is None else (found.in_first, found.in_second))
        return cls(limbs, np.array(places).reshape(len(limbs), 2, 3))

    @property
    def n_rings(self) -> int:
        """Number of rings."""
        return len(self.limbs)

    def gaps(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Ways between both images of the points [mm], shape (n_frames, n_rings, 3)."""
        placed = np.einsum("frsij,rsj->frsi", poses.rotations[:, self.limbs], self.places)
        placed += poses.origins(chain)[:, self.limbs]
        return np.asarray(placed[:, :, 0] - placed[:, :, 1])

    def gap(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Root mean square gap of each ring [mm], shape (n_rings,)."""
        return np.asarray(np.sqrt((self.gaps(chain, poses) ** 2).sum(axis=2).mean(axis=0)))

    def slopes(self, chain: Chain, poses: ChainPoses) -> tuple[Floats, Floats]:
        """How gaps follow translation and turns of limbs, and joints and the rings' own places.

        Returns
        -------
        tuple of ndarray
            Shapes (n_frames, 3 n_rings, 3 + 3 n_limbs) and (n_frames, 3 n_rings, 3 (n_limbs - 1) + 6 n_rings).
        """
        n_frames, n_limbs = poses.rotations.shape[:2]
        ends = Chain(chain.parents, self.limbs.ravel(), chain.joints, self.places.reshape(-1, 3))
        arms = world_arms(ends.arms(), poses).reshape(n_frames, self.n_rings, 2, n_limbs, 3)
        turns = -cross_matrix(arms[:, :, 0] - arms[:, :, 1]).transpose(0, 1, 3, 2, 4)
        by_pose = np.zeros((n_frames, 3 * self.n_rings, 3 + 3 * n_limbs))
        by_pose[:, :, 3:] = turns.reshape(n_frames, 3 * self.n_rings, 3 * n_limbs)
        beyond = chain.ancestry()
        by_constants = np.zeros((n_frames, self.n_rings, 3, n_limbs - 1 + 2 * self.n_rings, 3))
        for ring, limbs in enumerate(self.limbs.tolist()):
            for side, (limb, sign) in enumerate(zip(limbs, (1.0, -1.0), strict=True)):
                by_constants[:, ring, :, n_limbs - 1 + 2 * ring + side] = sign * poses.rotations[:, limb]
                for joint in np.flatnonzero(beyond[1:, limb]) + 1:
                    by_constants[:, ring, :, joint - 1] += sign * poses.rotations[:, chain.parents[joint]]
        return by_pose, by_constants.reshape(n_frames, 3 * self.n_rings, -1)

    def moved(self, change: Floats) -> Rings:
        """Return rings whose places were changed, shape (6 n_rings,)."""
        return replace(self, places=self.places + change.reshape(self.places.shape))


def loop_gaps(skeleton: Skeleton, motion: Motion) -> Floats:
    """Distance of both images of each joint that closes a ring [mm], shape (n_frames, n_loops)."""
    gaps = np.zeros((motion.n_frames, len(skeleton.loops)))
    for column, joint in enumerate(skeleton.loops):
        ends = [
            motion.world_from_limb[:, limb, :3, :3] @ place + motion.world_from_limb[:, limb, :3, 3]
            for limb, place in ((joint.parent, joint.position_in_parent), (joint.child, joint.position_in_child))
        ]
        gaps[:, column] = np.linalg.norm(ends[0] - ends[1], axis=1)
    return gaps


def fit_closed_poses(
    chain: Chain,
    rings: Rings,
    start: ChainPoses,
    positions: Floats,
    articulation: Articulation,
    weights: Floats | None = None,
) -> ChainPoses:
    """Fit a chain whose rings stay closed to the markers of every frame.

    Parameters are those of `posing.fit_poses`.
    """
    parts = [
        _settled(
            chain,
            rings,
            start[slice(first, first + CHUNK_FRAMES)],
            positions[first : first + CHUNK_FRAMES],
            articulation,
            seen_weights(positions, weights)[first : first + CHUNK_FRAMES],
        )
        for first in range(0, len(positions), CHUNK_FRAMES)
    ]
    return ChainPoses(np.concatenate([one.root for one in parts]), np.concatenate([one.rotations for one in parts]))


def closed_squares(chain: Chain, rings: Rings, poses: ChainPoses, positions: Floats, weights: Floats) -> Floats:
    """Sum of squares of every frame, gaps included, shape (n_frames,)."""
    error = np.nan_to_num(positions - poses.markers(chain))
    squares = np.einsum("fmi,fmi,fm->f", error, error, weights)
    return np.asarray(squares + rings.stiffness * (rings.gaps(chain, poses) ** 2).sum(axis=(1, 2)))


def with_loops(frames: Frames, chain: Chain, rings: Rings, poses: ChainPoses) -> Frames:
    """Add the rings to linearised frames; the places of the rings become the last constants."""
    by_pose, by_constants = rings.slopes(chain, poses)
    n_joints, n_axes = 3 * (chain.n_limbs - 1), frames.tilts.shape[2]
    n_offsets = frames.border.shape[2] - n_joints - n_axes
    own = by_pose @ frames.turns
    nothing = np.zeros((*by_pose.shape[:2], n_offsets))
    tilted = by_pose @ frames.tilts
    follow = np.concatenate([nothing, by_constants[..., :n_joints], tilted, by_constants[..., n_joints:]], axis=2)
    more = 6 * rings.n_rings
    border = np.pad(frames.border, ((0, 0), (0, 0), (0, more)))
    flat = follow.reshape(-1, follow.shape[2])
    return replace(
        frames,
        own=frames.own + rings.stiffness * own.swapaxes(1, 2) @ own,
        border=border + rings.stiffness * own.swapaxes(1, 2) @ follow,
        constants=np.pad(frames.constants, ((0, more), (0, more))) + rings.stiffness * flat.T @ flat,
    )


def _settled(
    chain: Chain, rings: Rings, start: ChainPoses, positions: Floats, articulation: Articulation, weights: Floats
) -> ChainPoses:
    poses = ChainPoses(start.root.copy(), articulation.projected(chain.parents, start.rotations))
    active = np.arange(len(positions))
    loss = closed_squares(chain, rings, poses, positions, weights)
    damping = np.full(len(active), DAMPING)
    for _ in range(MAX_STEPS):
        here = poses[active]
        step = _step(chain, rings, here, positions[active], articulation, weights[active], damping[active])
        turned = matrix_from_vector(step[:, 3:].reshape(len(step), -1, 3)) @ here.rotations
        there = ChainPoses(here.root + step[:, :3], articulation.projected(chain.parents, turned))
        squares = closed_squares(chain, rings, there, positions[active], weights[active])
        better = squares <= loss[active]
        kept = active[better]
        settled = better & (loss[active] - squares <= GAIN_TOLERANCE * loss[active])
        settled |= np.abs(step).max(axis=1) < STEP_TOLERANCE
        poses.root[kept], poses.rotations[kept], loss[kept] = (
            there.root[better],
            there.rotations[better],
            squares[better],
        )
        damping[active] = np.where(better, np.maximum(damping[active] / 10, DAMPING), damping[active] * 1000)
        active = active[~settled & (damping[active] < GIVE_UP_DAMPING)]
        if not len(active):
            break
    return poses


def _step(
    chain: Chain,
    rings: Rings,
    poses: ChainPoses,
    positions: Floats,
    articulation: Articulation,
    weights: Floats,
    damping: Floats,
) -> Floats:
    """Damped step of translation and turns, shape (n_frames, 3 + 3 n_limbs)."""
    hessian, gradient = normal_equations(chain, chain.arms(), poses, positions, weights)
    by_pose, _ = rings.slopes(chain, poses)
    hessian += rings.stiffness * by_pose.swapaxes(1, 2) @ by_pose
    gap = rings.gaps(chain, poses).reshape(len(positions), -1)
    gradient -= rings.stiffness * np.einsum("frd,fr->fd", by_pose, gap)
    turns, _ = articulation.bases(chain.parents, poses.rotations)
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
