"""Calibration of a chain with its kinematic loops closed: limbs, joints, axes, loops and all poses together."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.chain.normal_equations import (
    constant_gradient,
    frame_blocks,
    frames_together,
    reduced_information,
    total_information,
)
from skelgen.kinematics.inverse.loop_closure import (
    STIFFNESS,
    KinematicLoops,
    closed_squares,
    fit_closed_poses,
    with_loops,
)
from skelgen.model.arrays import Floats, Ints

STIFFNESSES = (1.0, 100.0, STIFFNESS)
"""Weights of the gaps, one after the other: stiff loops alone would let constants move only along them."""

MAX_ROUNDS = 10
STEP_PARTS = (1.0, 0.5, 0.25, 0.1)
"""Parts of a Gauss-Newton step that are tried until one lowers the sum of squares."""

LEAST_GAIN = 1e-6
"""Rounds stop when the sum of squares falls by less than this part."""

PRIOR = 1e-6
"""Of the mean information: prior of directions that nothing determines."""


@dataclass(frozen=True, eq=False)
class ClosedCalibration(Calibration):
    """A calibrated chain with closed loops; its information counts them.

    Attributes
    ----------
    loops : KinematicLoops
        The joints that close them.
    """

    loops: KinematicLoops = field(kw_only=True)

    @cached_property
    def information(self) -> Floats:
        """Information of the constants, the loops' points eliminated, shape (n_constants, n_constants).

        If that of the tree is known otherwise, as with soft tissue, the loops add to it what they add to the plain one.
        """
        whole, n_own = self.whole_information, 6 * self.loops.n_loops
        coupling = whole[-n_own:, :-n_own]
        closed = whole[:-n_own, :-n_own] - coupling.T @ np.linalg.solve(self.loop_information, coupling)
        if self.known_information is None:
            return np.asarray(closed)
        return np.asarray(self.known_information + closed - total_information(self))

    @property
    def loop_information(self) -> Floats:
        """Information of the loops' points, regular where they are not determined, shape (6 n_loops, 6 n_loops)."""
        n_own = 6 * self.loops.n_loops
        corner = self.whole_information[-n_own:, -n_own:]
        return np.asarray(corner + PRIOR * np.trace(corner) / n_own * np.eye(n_own))

    @cached_property
    def whole_information(self) -> Floats:
        """Information of all constants, the loops' points last."""
        size = self.n_constants + 6 * self.loops.n_loops
        total = np.zeros((size, size))
        for part in self.in_parts(frames_together(self)):
            total += reduced_information(with_loops(frame_blocks(part), self.chain, self.loops, part.poses))
        return np.asarray((total + total.T) / 2)

    @property
    def closed_squares(self) -> float:
        """Sum of squares [mm^2], gaps of the loops included."""
        return float(closed_squares(self, self.loops).sum())


def close_loops(last: Calibration, limbs: Ints) -> ClosedCalibration:
    """Fit limbs, joints and poses once more so that pairs of limbs meet in a point.

    Parameters
    ----------
    last : Calibration
        Fitted as a tree.
    limbs : ndarray of intp, shape (n_loops, 2)
        Pairs of limbs that meet.
    """
    fit = last.chain, last.articulation, last.poses, last.positions, last.weights
    loops = KinematicLoops.of_poses(limbs, last.chain, last.poses)
    state = ClosedCalibration(*fit, last.noise, last.known_information, loops=loops)
    for stiffness in STIFFNESSES:
        state = _fitted(replace(state, loops=replace(state.loops, stiffness=stiffness)))
    # The noise of a coordinate of weight 1, freedoms taken off; gaps are data that are known exactly.
    n_data = 3 * int((state.weights > 0).sum())
    gaps = 3 * state.loops.n_loops * (state.n_frames - 2)
    free = n_data + gaps - state.n_frames * state.articulation.n_freedoms - state.n_constants
    return replace(state, noise=float(np.sqrt(state.closed_squares / max(free, 0.05 * n_data, 1))))


def _fitted(state: ClosedCalibration) -> ClosedCalibration:
    """Fit with one weight of the gaps."""
    state = replace(state, poses=fit_closed_poses(state, state.loops))
    for _ in range(MAX_ROUNDS):
        better = _improved(state)
        if better is None:
            break
        gain, state = 1 - better.closed_squares / max(state.closed_squares, np.finfo(np.float64).tiny), better
        if gain < LEAST_GAIN:
            break
    return state


def _improved(state: ClosedCalibration) -> ClosedCalibration | None:
    """Take a Gauss-Newton step of all constants, shortened until it lowers the sum of squares; None if none does."""
    information = state.whole_information
    held = information + PRIOR * np.diag(np.maximum(np.diag(information), np.diag(information).mean()))
    step = np.linalg.solve(held, _gradient(state))
    n_offsets, n_joints = 3 * state.chain.n_markers, 3 * (state.chain.n_limbs - 1)
    parts = np.split(step, np.cumsum([n_offsets, n_joints, state.articulation.n_constants]))
    for share in STEP_PARTS:
        loops = state.loops.moved(share * parts[3])
        trial = replace(state.stepped(*(share * part for part in parts[:3])), loops=loops)
        trial = replace(trial, poses=fit_closed_poses(trial, loops))
        if trial.closed_squares <= state.closed_squares:
            return trial
    return None


def _gradient(state: ClosedCalibration) -> Floats:
    """Gradient of residuals and gaps by the constants, the loops' points last, for poses that fit best."""
    chain, loops = state.chain, state.loops
    by_pose, by_constants = loops.slopes(chain, state.poses)
    gap = loops.gaps(chain, state.poses).reshape(len(by_pose), -1)
    _, tilts = state.articulation.bases(chain.parents, state.poses.rotations)
    at_constants = -loops.stiffness * np.einsum("frc,fr->c", by_constants, gap)
    at_axes = -loops.stiffness * np.einsum("frt,fr->t", by_pose @ tilts, gap)
    n_offsets, n_joints = 3 * chain.n_markers, 3 * (chain.n_limbs - 1)
    by_gaps = np.concatenate([np.zeros(n_offsets), at_constants[:n_joints], at_axes])
    return np.concatenate([constant_gradient(state) + by_gaps, at_constants[n_joints:]])
