"""A calibrated chain is fitted once more with its rings closed: limbs, joints, axes, rings and all poses together."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.chain.normal_equations import (
    constant_gradient,
    frames_together,
    linearised,
    n_constants,
    reduced_information,
    total_information,
)
from skelgen.kinematics.inverse.loop_closure import STIFFNESS, Rings, closed_squares, fit_closed_poses, with_loops
from skelgen.model.arrays import Floats, Ints

SOFT = (1.0, 100.0, STIFFNESS)
"""Weights of the gaps, one after the other: stiff rings leave constants no way but along them."""

MAX_ROUNDS = 10
STEP_PARTS = (1.0, 0.5, 0.25, 0.1)
"""Parts of a Gauss-Newton step that are tried until one lowers the sum of squares."""

LEAST_GAIN = 1e-6
"""Rounds stop when the sum of squares falls by less than this part."""

PRIOR = 1e-6
"""Of the mean information: what holds directions that nothing determines where they are."""


@dataclass(frozen=True, eq=False)
class ClosedCalibration(Calibration):
    """A calibrated chain with closed rings; its information counts them.

    Attributes
    ----------
    rings : Rings
        The joints that close them.
    """

    rings: Rings = field(kw_only=True)

    @cached_property
    def information(self) -> Floats:
        """Information of the constants without the rings' places, which are free, shape (n_constants, n_constants).

        Where the tree's is known otherwise, as that of soft tissue is, the rings add what they add to the plain one.
        """
        whole, n_own = self.whole_information, 6 * self.rings.n_rings
        border = whole[-n_own:, :-n_own]
        closed = whole[:-n_own, :-n_own] - border.T @ np.linalg.solve(self.free_corner, border)
        if self.known is None:
            return np.asarray(closed)
        return np.asarray(self.known + closed - total_information(*self._frames()))

    @property
    def free_corner(self) -> Floats:
        """Information of the rings' places, regular where they are not determined, shape (6 n_rings, 6 n_rings)."""
        n_own = 6 * self.rings.n_rings
        corner = self.whole_information[-n_own:, -n_own:]
        return np.asarray(corner + PRIOR * np.trace(corner) / n_own * np.eye(n_own))

    def _frames(self) -> tuple[Chain, Articulation, ChainPoses, Floats, Floats]:
        return self.chain, self.articulation, self.poses, self.positions, self.weights

    @cached_property
    def whole_information(self) -> Floats:
        """Information of all constants, the rings' places last."""
        return _information(self)


def close_loops(last: Calibration, limbs: Ints) -> ClosedCalibration:
    """Fit limbs, joints and poses once more so that pairs of limbs meet in a point.

    Parameters
    ----------
    last : Calibration
        Fitted as a tree.
    limbs : ndarray of intp, shape (n_rings, 2)
        Pairs of limbs that meet.
    """
    rings = Rings.of_poses(limbs, last.chain, last.poses)
    fields = last.chain, last.articulation, last.poses, last.noise, last.positions, last.weights, last.known
    state = ClosedCalibration(*fields, rings=rings)
    for stiffness in SOFT:
        state = _fitted(replace(state, rings=replace(state.rings, stiffness=stiffness)))
    return replace(state, noise=_noise(state))


def _fitted(state: ClosedCalibration) -> ClosedCalibration:
    """Fit with one weight of the gaps."""
    state = _settled(state)
    for _ in range(MAX_ROUNDS):
        better = _improved(state)
        if better is None:
            break
        gain, state = 1 - _squares(better) / max(_squares(state), np.finfo(np.float64).tiny), better
        if gain < LEAST_GAIN:
            break
    return state


def _settled(state: ClosedCalibration) -> ClosedCalibration:
    poses = fit_closed_poses(state.chain, state.rings, state.poses, state.positions, state.articulation, state.weights)
    return replace(state, poses=poses)


def _squares(state: ClosedCalibration) -> float:
    return float(closed_squares(state.chain, state.rings, state.poses, state.positions, state.weights).sum())


def _improved(state: ClosedCalibration) -> ClosedCalibration | None:
    """One Gauss-Newton step of all constants, halved until it lowers the sum of squares; None if it does not."""
    chain, articulation = state.chain, state.articulation
    information = state.whole_information
    held = information + PRIOR * np.diag(np.maximum(np.diag(information), np.diag(information).mean()))
    step = np.linalg.solve(held, _pull(state))
    n_offsets, n_joints = 3 * chain.n_markers, 3 * (chain.n_limbs - 1)
    n_axes = articulation.n_constants
    parts = np.split(step, np.cumsum([n_offsets, n_joints, n_axes]))
    for share in STEP_PARTS:
        joints = chain.joints.copy()
        joints[1:] += share * parts[1].reshape(-1, 3)
        moved = chain.moved(joints, chain.offsets + share * parts[0].reshape(-1, 3))
        changed, rotations = articulation.tilted(chain.parents, state.poses.rotations, share * parts[2])
        trial = replace(
            state,
            chain=moved,
            articulation=changed,
            poses=ChainPoses(state.poses.root, rotations),
            rings=state.rings.moved(share * parts[3]),
        )
        trial = _settled(trial)
        if _squares(trial) <= _squares(state):
            return trial
    return None


def _pull(state: ClosedCalibration) -> Floats:
    """How residuals and gaps of settled poses pull at the constants."""
    chain, articulation, rings = state.chain, state.articulation, state.rings
    own = constant_gradient(chain, articulation, state.poses, state.positions, state.weights)
    by_pose, by_constants = rings.slopes(chain, state.poses)
    gap = rings.gaps(chain, state.poses).reshape(len(by_pose), -1)
    _, tilts = articulation.bases(chain.parents, state.poses.rotations)
    at_constants = -rings.stiffness * np.einsum("frc,fr->c", by_constants, gap)
    at_axes = -rings.stiffness * np.einsum("frt,fr->t", by_pose @ tilts, gap)
    n_offsets, n_joints = 3 * chain.n_markers, 3 * (chain.n_limbs - 1)
    more = [np.zeros(n_offsets), at_constants[:n_joints], at_axes]
    return np.concatenate([own + np.concatenate(more), at_constants[n_joints:]])


def _information(state: ClosedCalibration) -> Floats:
    chain, articulation = state.chain, state.articulation
    size = n_constants(chain, articulation) + 6 * state.rings.n_rings
    together = frames_together(chain, articulation)
    total = np.zeros((size, size))
    for first in range(0, len(state.positions), together):
        part = slice(first, first + together)
        poses = state.poses[part]
        frames = linearised(chain, articulation, poses, state.positions[part], state.weights[part])
        total += reduced_information(with_loops(frames, chain, state.rings, poses))
    return np.asarray((total + total.T) / 2)


def _noise(state: ClosedCalibration) -> float:
    """Standard deviation of a coordinate of weight 1, freedoms taken off; gaps are data that are known exactly."""
    heard = state.weights > 0
    gaps = 3 * state.rings.n_rings * (len(state.positions) - 2)
    n_data = 3 * int(heard.sum())
    free = n_data + gaps - len(state.positions) * state.articulation.n_freedoms
    free -= n_constants(state.chain, state.articulation)
    return float(np.sqrt(_squares(state) / max(free, 0.05 * n_data, 1)))
