r"""Limb shapes and joints of a whole chain by maximum likelihood, with all poses free (Gaschler 2011, 5.3).

The normal matrix of all unknowns is an arrow: one block per frame (its pose), bordered by the few constants of the
skeleton. The poses are eliminated frame by frame (Schur complement), so that the cost is linear in frames:

.. math::
    S = H_{cc} - \sum_f H_{cf} H_{ff}^{-1} H_{fc}, \qquad S\,\delta c = g_c - \sum_f H_{cf} H_{ff}^{-1} g_f .

After every step the poses are settled, so that their pull :math:`g_f` is nothing. For steps S is computed from a few
evenly spread frames and scaled, while the pull of the constants comes from all: the solution is that of all frames.

The inverse of S, times the noise variance, is the covariance of the constants: the Cramer-Rao bound at the solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, residuals, seen_weights
from skelgen.kinematics.chain.normal_equations import constant_gradient, n_constants, total_information
from skelgen.kinematics.inverse.poses import fit_poses
from skelgen.model.arrays import Bools, Floats, Ints

STEP_FRAMES = 80
"""Frames that the matrix S of a step rests on: it need not be exact, but few frames do not tell all constants."""

INFORMATION_WORK = 1.5e8
"""Multiplications that S for deviations may take, some 50 ms: larger chains use fewer frames, but not below those of a
step."""

LEAST_SIGHTS = 10
"""Frames of each marker that are among those for S, if there are as many."""

MAX_ROUNDS = 12
POSE_STEPS = 3
"""Steps of the poses after each step of the constants: from so near, more would gain nothing that counts."""

STEP_TOLERANCE = 1e-7
"""mm; rounds stop when no constant moves more."""

STEP_PARTS = (1.0, 0.5, 0.25, 0.1)
"""Parts of a Gauss-Newton step that are tried until one lowers the sum of squares."""

LEAST_GAIN = 0.01
"""Rounds stop when the log-likelihood rises by less than this per constant: less is nothing but noise."""

PRIOR_SPREAD = 30.0
"""mm; constants that the frames do not determine (a joint along its hinge) lean to the start with this spread."""

FREE_SHARE = 1e-8
"""Of the mean information: what at least holds the free frames of the limbs, however exact the take."""

LEAST_NOISE = 1e-12
"""mm^2; of a gain in likelihood, for exact takes."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated chain.

    Attributes
    ----------
    chain : Chain
        Limbs with their maximum likelihood shapes and joints.
    articulation : Articulation
        What the joints allow, their axes calibrated too.
    poses : ChainPoses
        Poses in the frames used.
    noise : float, mm
        Standard deviation of one coordinate of weight 1, with the freedoms of poses and constants taken off.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        What was measured.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.
    """

    chain: Chain
    articulation: Articulation
    poses: ChainPoses
    noise: float
    positions: Floats
    weights: Floats
    known: Floats | None = None

    @cached_property
    def information(self) -> Floats:
        """Information matrix, shape (n_constants, n_constants), computed when it is first asked for.

        Of marker offsets, then joints 1 .. n_limbs - 1, in 1 / mm^2 times `noise` squared, then of the constants of
        axes.
        """
        if self.known is not None:
            return self.known
        size = n_constants(self.chain, self.articulation)
        affordable = int(INFORMATION_WORK / (size**2 * (3 + 3 * self.chain.n_limbs)))
        most = max(affordable, STEP_FRAMES)
        return _information(self.chain, self.articulation, self.poses, self.positions, self.weights, most)


def calibrate(
    chain: Chain,
    start: ChainPoses,
    positions: Floats,
    n_rounds: int | None = None,
    articulation: Articulation | None = None,
    weights: Floats | None = None,
) -> Calibration:
    """Fit marker offsets, joints and axes together with the poses of all frames.

    Parameters
    ----------
    chain : Chain
        First guess.
    start : ChainPoses
        First guess of the poses.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers of some hundred frames, NaN where unseen.
    n_rounds : int, optional
        Rounds at most; 0 keeps the chain and only finds poses, noise and information.
    articulation : Articulation, optional
        What the joints allow; any turn if it is not given.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances.
    """
    articulation = articulation or Articulation.free(chain.n_limbs)
    weights = seen_weights(positions, weights)
    if not articulation.is_free:
        start = ChainPoses(start.root, articulation.projected(chain.parents, start.rotations))
        articulation = articulation.at_rest(chain.parents, start.rotations)
    poses = fit_poses(chain, start, positions, articulation, weights)
    state = _State(chain, articulation, poses, positions, weights)
    for _ in range(MAX_ROUNDS if n_rounds is None else n_rounds):
        better = _improved(state, chain, positions, weights)
        if better is None:
            break
        moved = float(np.abs(_packed(better.chain) - _packed(state.chain)).max())
        gain = (state.squares - better.squares) / (2 * max(better.noise, LEAST_NOISE))
        state = better
        if moved < STEP_TOLERANCE or gain <= LEAST_GAIN * n_constants(chain, articulation):
            break
    noise = float(np.sqrt(state.noise))
    return Calibration(state.chain, state.articulation, state.poses, noise, positions, weights)


class _State:
    """A chain with poses, and how well they explain the markers."""

    def __init__(
        self, chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats
    ) -> None:
        self.chain, self.articulation, self.poses = chain, articulation, poses
        error = residuals(chain, poses, positions)
        self.squares = float(np.einsum("fmi,fmi,fm->", error, error, weights))
        n_data = 3 * int((weights > 0).sum())
        n_free = n_data - len(positions) * articulation.n_freedoms - n_constants(chain, articulation)
        self.noise = self.squares / max(n_free, 0.05 * n_data, 1)


def _improved(state: _State, first: Chain, positions: Floats, weights: Floats) -> _State | None:
    """One Gauss-Newton step of the constants, halved until it lowers the sum of squares; None if it does not."""
    chain, articulation = state.chain, state.articulation
    constants = _packed(chain)
    step = _step(state, _packed(first) - constants, positions, weights)
    for part in STEP_PARTS:
        trial = _unpacked(chain, constants + part * step[: len(constants)])
        changed, rotations = articulation.tilted(chain.parents, state.poses.rotations, part * step[len(constants) :])
        start = ChainPoses(state.poses.root, rotations)
        poses = fit_poses(trial, start, positions, changed, weights, POSE_STEPS)
        better = _State(trial, changed, poses, positions, weights)
        if better.squares <= state.squares:
            return better
    return None


def _step(state: _State, from_start: Floats, positions: Floats, weights: Floats) -> Floats:
    """Step of the constants, drawn weakly to the start.

    What no frame determines, such as the free frames of the limbs, is filtered out of it: there, poses that are not
    quite settled pull at nothing but the weak prior.
    """
    chain, articulation, n_places = state.chain, state.articulation, len(from_start)
    information = _information(chain, articulation, state.poses, positions, weights, STEP_FRAMES)
    held = FREE_SHARE * float(np.diag(information)[:n_places].mean())
    prior = max(state.noise / PRIOR_SPREAD**2, held)
    levels = np.full(len(information), prior)
    levels[n_places:] *= max(3 * float((chain.offsets**2).mean()), 1.0)  # tilts move what is a limb away
    pull = constant_gradient(chain, articulation, state.poses, positions, weights)
    pull[:n_places] += prior * from_start
    held_together = information + np.diag(levels)
    return np.asarray(np.linalg.solve(held_together, information @ np.linalg.solve(held_together, pull)))


def _packed(chain: Chain) -> Floats:
    return np.concatenate([chain.offsets.ravel(), chain.joints[1:].ravel()])


def _unpacked(chain: Chain, constants: Floats) -> Chain:
    offsets = constants[: 3 * chain.n_markers].reshape(-1, 3)
    joints = np.concatenate([np.zeros((1, 3)), constants[3 * chain.n_markers :].reshape(-1, 3)])
    return chain.moved(joints, offsets)


def _information(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats, most: int
) -> Floats:
    """S of all frames, scaled up from at most some that are evenly spread."""
    frames = _spread_frames(weights > 0, most)
    scale = (weights > 0).sum() / max((weights[frames] > 0).sum(), 1)
    return np.asarray(scale * total_information(chain, articulation, poses[frames], positions[frames], weights[frames]))


def _spread_frames(seen: Bools, most: int) -> Ints:
    """Evenly spread frames, and some of each marker that is seen in few of these."""
    frames = np.arange(len(seen))
    if len(frames) <= most:
        return frames
    chosen = np.unique(np.linspace(0, len(frames) - 1, most).astype(np.intp))
    rare = np.flatnonzero(seen[chosen].sum(axis=0) < LEAST_SIGHTS)
    more = [np.flatnonzero(seen[:, marker]) for marker in rare]
    picked = [
        one[np.linspace(0, len(one) - 1, min(LEAST_SIGHTS, len(one))).astype(np.intp)] for one in more if len(one)
    ]
    return np.unique(np.concatenate([chosen, *picked]))
