r"""A tree of rigid limbs fitted to markers in every frame at once: Gauss-Newton on the whole chain.

In a frame the unknowns are the root's translation and one rotation per limb. A marker m on limb l is at

.. math::
    x = t + \sum_{a \to b} R_a v_b + R_l m,

the sum running over the joints b on the way from the root. Turning limb a by a small rotation vector
:math:`\omega_a` moves the marker by :math:`\omega_a \times A_a` with the arm :math:`A_a = R_a v_b` (or
:math:`R_l m`). The normal matrix needs nothing but sums of outer products of arms, so a frame costs one small matrix
product and one solve; unseen markers are simply absent. Maximum likelihood for Gaussian noise (Gaschler 2011, 5.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import cross_matrix, matrix_from_vector, nearest_rotation
from skelgen.model.arrays import Bools, Floats, Ints

CHUNK_FRAMES = 512
"""Frames solved together: their normal matrices stay within some ten megabytes."""

DAMPING = 1e-6
"""Levenberg damping relative to the mean diagonal: what no marker determines stays where it starts."""

LEAST_RIDGE = 1e-12
"""Keeps the normal matrix of a frame without markers regular."""

GIVE_UP_DAMPING = 1e6
"""A frame that needs more damping than this does not get better."""

MAX_STEPS = 15
STEP_TOLERANCE = 1e-10
"""rad and, scaled by the arms, far below a micrometre."""

GAIN_TOLERANCE = 1e-9
"""Frames are settled when a step lowers the sum of squares by less than this part."""


@dataclass(frozen=True, eq=False)
class Chain:
    """A tree of rigid limbs with markers; limbs are in outward order, the root is 0.

    Attributes
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, smaller than its own index; -1 for the root.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    joints : ndarray, shape (n_limbs, 3), mm
        The joint to the parent in the parent's frame; zero for the root.
    offsets : ndarray, shape (n_markers, 3), mm
        Markers in the frames of their limbs, whose origins are the joints to the parents.
    """

    parents: Ints
    limb_of_marker: Ints
    joints: Floats
    offsets: Floats

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.parents)

    @property
    def n_markers(self) -> int:
        """Number of markers."""
        return len(self.limb_of_marker)

    def moved(self, joints: Floats, offsets: Floats) -> Chain:
        """Return the chain with other joints and offsets."""
        return replace(self, joints=joints, offsets=offsets)

    def ancestry(self) -> Bools:
        """Whether limb b is limb a or lies beyond it, shape (n_limbs a, n_limbs b)."""
        below = np.eye(self.n_limbs, dtype=bool)
        for limb in range(1, self.n_limbs):
            below[:, limb] |= below[:, self.parents[limb]]
        return below

    def arms(self) -> Floats:
        """Vector of each limb that carries each marker, in the limb's frame [mm], shape (n_markers, n_limbs, 3)."""
        arms = np.zeros((self.n_markers, self.n_limbs, 3))
        for marker, limb in enumerate(self.limb_of_marker):
            arms[marker, limb] = self.offsets[marker]
            beyond = int(limb)
            while (parent := int(self.parents[beyond])) >= 0:
                arms[marker, parent] = self.joints[beyond]
                beyond = parent
        return arms


@dataclass(frozen=True, eq=False)
class ChainPoses:
    """Where a chain is in some frames.

    Attributes
    ----------
    root : ndarray, shape (n_frames, 3), mm
        World position of the root's origin.
    rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
        World from limb.
    """

    root: Floats
    rotations: Floats

    def origins(self, chain: Chain) -> Floats:
        """World positions of the limbs' origins [mm], shape (n_frames, n_limbs, 3)."""
        origins = np.empty((*self.rotations.shape[:2], 3))
        origins[:, 0] = self.root
        for limb in range(1, chain.n_limbs):
            parent = chain.parents[limb]
            origins[:, limb] = origins[:, parent] + self.rotations[:, parent] @ chain.joints[limb]
        return origins

    def markers(self, chain: Chain) -> Floats:
        """World positions of the markers [mm], shape (n_frames, n_markers, 3)."""
        limb = chain.limb_of_marker
        turned = np.einsum("fmij,mj->fmi", self.rotations[:, limb], chain.offsets)
        return np.asarray(self.origins(chain)[:, limb] + turned)

    def stepped(self, step: Floats) -> ChainPoses:
        """Apply translations and rotation vectors, shape (n_frames, 3 + 3 n_limbs)."""
        turn = matrix_from_vector(step[:, 3:].reshape(len(step), -1, 3))
        return ChainPoses(self.root + step[:, :3], turn @ self.rotations)

    def __getitem__(self, frames: slice | Ints | Bools) -> ChainPoses:
        return ChainPoses(self.root[frames], self.rotations[frames])


def fit_poses(chain: Chain, start: ChainPoses, positions: Floats) -> ChainPoses:
    """Fit a chain to markers in every frame by least squares over all its limbs.

    Parameters
    ----------
    chain : Chain
        Known limbs.
    start : ChainPoses
        First guess; directions that no marker determines stay there.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    """
    fitted = [
        _fit_chunk(chain, start[slice(first, first + CHUNK_FRAMES)], positions[first : first + CHUNK_FRAMES])
        for first in range(0, len(positions), CHUNK_FRAMES)
    ]
    return ChainPoses(
        np.concatenate([part.root for part in fitted]),
        nearest_rotation(np.concatenate([part.rotations for part in fitted])),
    )


def _fit_chunk(chain: Chain, start: ChainPoses, positions: Floats) -> ChainPoses:
    poses = ChainPoses(start.root.copy(), start.rotations.copy())
    body_arms = chain.arms()
    active = np.arange(len(positions))
    loss = _squares(residuals(chain, poses, positions))
    damping = np.full(len(positions), DAMPING)
    for _ in range(MAX_STEPS):
        part = poses[active]
        hessian, gradient = normal_equations(chain, body_arms, part, positions[active])
        step = solve_damped(hessian, gradient, damping[active])
        trial = part.stepped(step)
        new_loss = _squares(residuals(chain, trial, positions[active]))
        better = new_loss <= loss[active]
        kept = active[better]
        poses.root[kept], poses.rotations[kept] = trial.root[better], trial.rotations[better]
        settled = better & (loss[active] - new_loss <= GAIN_TOLERANCE * loss[active])
        settled |= np.abs(step).max(axis=1) < STEP_TOLERANCE
        loss[kept] = new_loss[better]
        damping[active] = np.where(better, np.maximum(damping[active] / 10, DAMPING), damping[active] * 100)
        active = active[~settled & (damping[active] < GIVE_UP_DAMPING)]
        if not len(active):
            break
    return poses


def residuals(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    """Measured minus predicted markers [mm], zero where unseen, shape (n_frames, n_markers, 3)."""
    return np.nan_to_num(positions - poses.markers(chain))


def normal_equations(chain: Chain, body_arms: Floats, poses: ChainPoses, positions: Floats) -> tuple[Floats, Floats]:
    """Gauss-Newton normal matrix and right-hand side of every frame.

    Parameters
    ----------
    chain : Chain
        The limbs.
    body_arms : ndarray
        `chain.arms()`.
    poses : ChainPoses
        Where to linearise.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.

    Returns
    -------
    tuple of ndarray
        Shapes (n_frames, d, d) and (n_frames, d) with d = 3 + 3 n_limbs: translation first, then rotation vectors.
    """
    n_frames, n_markers = positions.shape[:2]
    n_limbs = chain.n_limbs
    seen = (~np.isnan(positions[:, :, 0])).astype(np.float64)
    error = residuals(chain, poses, positions)
    arms = world_arms(body_arms, poses) * seen[:, :, np.newaxis, np.newaxis]
    flat = arms.reshape(n_frames, n_markers, 3 * n_limbs)
    outer = (flat.swapaxes(1, 2) @ flat).reshape(n_frames, n_limbs, 3, n_limbs, 3)
    trace = np.einsum("faibi->fab", outer)
    hessian = np.zeros((n_frames, 3 + 3 * n_limbs, 3 + 3 * n_limbs))
    turns = np.einsum("fab,ij->faibj", trace, np.eye(3)) - outer.transpose(0, 1, 4, 3, 2)
    hessian[:, 3:, 3:] = turns.reshape(n_frames, 3 * n_limbs, 3 * n_limbs)
    hessian[:, :3, :3] = seen.sum(axis=1)[:, np.newaxis, np.newaxis] * np.eye(3)
    mixed = -cross_matrix(arms.sum(axis=1)).transpose(0, 2, 1, 3).reshape(n_frames, 3, 3 * n_limbs)
    hessian[:, :3, 3:] = mixed
    hessian[:, 3:, :3] = mixed.swapaxes(1, 2)
    moment = (flat.swapaxes(1, 2) @ error).reshape(n_frames, n_limbs, 3, 3)
    torque = np.stack([moment[..., i, j] - moment[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
    gradient = np.concatenate([error.sum(axis=1), torque.reshape(n_frames, -1)], axis=1)
    return hessian, gradient


def world_arms(body_arms: Floats, poses: ChainPoses) -> Floats:
    """Arms turned into the world [mm], shape (n_frames, n_markers, n_limbs, 3)."""
    return (poses.rotations @ body_arms.transpose(1, 2, 0)).transpose(0, 3, 1, 2)


def solve_damped(hessian: Floats, gradient: Floats, damping: Floats) -> Floats:
    """Solve every frame's normal equations for right-hand sides of shape (n_frames, d) or (n_frames, d, n).

    Translation and rotations are damped relative to the mean of their own diagonal, so that units do not matter.
    """
    n = hessian.shape[1]
    diagonal = np.einsum("fii->fi", hessian)
    shift, turn = diagonal[:, :3].mean(axis=1), diagonal[:, 3:].mean(axis=1)
    level = np.stack([shift] * 3 + [turn] * (n - 3), axis=1) * damping[:, np.newaxis]
    damped = hessian + np.maximum(level, LEAST_RIDGE)[:, :, np.newaxis] * np.eye(n)
    if gradient.ndim == 2:
        return np.asarray(np.linalg.solve(damped, gradient[..., np.newaxis])[..., 0])
    return np.asarray(np.linalg.solve(damped, gradient))


def _squares(error: Floats) -> Floats:
    return np.asarray(np.einsum("fmi,fmi->f", error, error))
