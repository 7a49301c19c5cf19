r"""Limb shapes and joints of a whole chain by maximum likelihood, with all poses free (Gaschler 2011, 5.3).

The normal matrix of all unknowns is a bordered system: one block per frame (its pose), and its coupling to the few
constants of the skeleton. The poses are eliminated frame by frame (Schur complement), so the cost is linear in frames:

.. math::
    S = H_{cc} - \sum_f H_{cf} H_{ff}^{-1} H_{fc}, \qquad S\,\delta c = g_c - \sum_f H_{cf} H_{ff}^{-1} g_f .

After every step the poses are fitted again, so that their gradient :math:`g_f` is 0. For a step S is computed from a
few evenly spread frames and scaled, but the gradient of the constants comes from all: so the solution is that of all
frames.

The inverse of S, times the noise variance, is the covariance of the constants: the Cramer-Rao bound at the solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen.geometry.rotations import nearest_rotation
from skelgen.kinematics.calibration.uncertainty import Spectrum, scaled_spectrum
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, observed
from skelgen.kinematics.chain.normal_equations import constant_gradient, total_information
from skelgen.kinematics.inverse.poses import MAX_STEPS, fit_poses
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread, spread_frames

STEP_FRAMES = 80
"""Frames from which the matrix S of a step is computed: it need not be exact, but must determine all constants."""

INFORMATION_WORK = 1.5e8
"""Multiplications that S for deviations may take, some 50 ms: larger chains use fewer frames, but `STEP_FRAMES`."""

LEAST_SIGHTS = 10
"""Least frames of each marker among those from which S is computed, if there are as many."""

MAX_ROUNDS = 12
POSE_STEPS = 3
"""Steps of the poses after each step of the constants: from so near, more would hardly gain anything."""

STEP_TOLERANCE = 1e-7
"""mm; rounds stop when no constant moves more."""

STEP_PARTS = (1.0, 0.5, 0.25, 0.1)
"""Parts of a Gauss-Newton step that are tried until one lowers the sum of squares."""

LEAST_GAIN = 0.01
"""Rounds stop when the log-likelihood of independent frames rises by less than this per constant: less than chance."""

PRIOR_SPREAD = 30.0
"""mm; standard deviation from the start of constants that the frames do not determine (a joint along its hinge)."""

FREE_SHARE = 1e-8
"""Part of the mean information that the prior has at least: it holds the free frames of the limbs in exact takes."""

LEAST_VARIANCE = 1e-12
"""mm^2; of a coordinate, by which gains in likelihood are computed for exact takes."""


@dataclass(frozen=True, eq=False)
class Calibration(ObservedChain):
    """A calibrated chain: limbs, joints, axes and poses are those of maximum likelihood.

    Attributes
    ----------
    noise : float, mm
        Standard deviation of one coordinate of weight 1, with the freedoms of poses and constants taken off.
    known_information : ndarray, shape (n_constants, n_constants), optional
        Information from elsewhere, such as that with unknown soft tissue.
    """

    noise: float
    known_information: Floats | None = None

    @cached_property
    def information(self) -> Floats:
        """Information matrix of the constants for noise 1, shape (n_constants, n_constants), computed when needed.

        Of marker offsets, then joints 1 .. n_limbs - 1, in 1 / mm^2 times `noise` squared, then of the constants of
        axes.
        """
        if self.known_information is not None:
            return self.known_information
        affordable = int(INFORMATION_WORK / (self.n_constants**2 * (3 + 3 * self.chain.n_limbs)))
        return information_of(self, max(affordable, STEP_FRAMES))

    @cached_property
    def spectrum(self) -> Spectrum:
        """Eigenvalues and eigenvectors of the information, see `scaled_spectrum`."""
        return scaled_spectrum(self.information)


def calibrate(
    chain: Chain,
    start: ChainPoses,
    positions: Floats,
    n_rounds: int | None = None,
    articulation: Articulation | None = None,
    correlated: float = 1.0,
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
        What the joints allow; any rotation if it is not given.
    correlated : float
        How many frames are worth one independent frame.
    """
    articulation = articulation or Articulation.free(chain.n_limbs)
    if not articulation.is_free:
        start = ChainPoses(start.root, articulation.projected(chain.parents, start.rotations))
        articulation = articulation.at_rest(chain.parents, start.rotations)
    guess = observed(chain, articulation, start, positions)
    state = FittedChain.of(guess)
    for _ in range(MAX_ROUNDS if n_rounds is None else n_rounds):
        better = _improved(state, chain)
        if better is None:
            break
        moved = float(np.abs(_packed(better.fit.chain) - _packed(state.fit.chain)).max())
        gain = (state.squares - better.squares) / (2 * correlated * max(better.variance, LEAST_VARIANCE))
        state = better
        if moved < STEP_TOLERANCE or gain <= LEAST_GAIN * guess.n_constants:
            break
    fit = state.fit
    noise = float(np.sqrt(state.variance))
    return Calibration(fit.chain, fit.articulation, fit.poses, fit.positions, fit.weights, noise)


@dataclass(frozen=True, eq=False)
class FittedChain:
    """A chain with fitted poses.

    Attributes
    ----------
    fit : ObservedChain
        The chain.
    squares : float, mm^2
        Sum of the squared residuals.
    variance : float, mm^2
        Of a coordinate.
    """

    fit: ObservedChain
    squares: float
    variance: float

    @classmethod
    def of(cls, guess: ObservedChain, max_steps: int = MAX_STEPS) -> FittedChain:
        """Fit the poses of a chain.

        Parameters
        ----------
        guess : ObservedChain
            With poses to start from.
        max_steps : int
            Steps of the poses.
        """
        start, positions, weights = guess.poses, guess.positions, guess.weights
        fit = replace(guess, poses=fit_poses(guess.chain, start, positions, guess.articulation, weights, max_steps))
        n_data = 3 * int((weights > 0).sum())
        n_free = n_data - fit.n_frames * fit.articulation.n_freedoms - fit.n_constants
        squares = fit.squares
        return cls(fit, squares, squares / max(n_free, 0.05 * n_data, 1))


def _improved(state: FittedChain, first: Chain) -> FittedChain | None:
    """Take a Gauss-Newton step of the constants, shortened until it lowers the sum of squares; None if none does."""
    fit, n_places = state.fit, 3 * (first.n_markers + first.n_limbs - 1)
    step = _step(state, _packed(first) - _packed(fit.chain))
    for part in STEP_PARTS:
        offsets, joints, tilts = np.split(part * step, [3 * first.n_markers, n_places])
        better = FittedChain.of(fit.stepped(offsets, joints, tilts), POSE_STEPS)
        if better.squares <= state.squares:
            return better
    return None


def _step(state: FittedChain, from_start: Floats) -> Floats:
    """Step of the constants, with a weak prior at the start.

    Directions that no frame determines, such as the free frames of the limbs, are filtered out of it. There the
    gradient is not exactly 0 where poses have not quite converged, and only the weak prior would hold it.
    """
    fit, n_places = state.fit, len(from_start)
    information = information_of(fit, STEP_FRAMES)
    held = FREE_SHARE * float(np.diag(information)[:n_places].mean())
    prior = max(state.variance / PRIOR_SPREAD**2, held)
    levels = np.full(len(information), prior)
    levels[n_places:] *= level_of_tilts(fit.chain)
    gradient = constant_gradient(fit)
    gradient[:n_places] += prior * from_start
    with_prior = information + np.diag(levels)
    return np.asarray(np.linalg.solve(with_prior, information @ np.linalg.solve(with_prior, gradient)))


def _packed(chain: Chain) -> Floats:
    return np.concatenate([chain.offsets.ravel(), chain.joints[1:].ravel()])


def level_of_tilts(chain: Chain) -> float:
    """Return the square of the length [mm^2] by which a tilt of 1 rad moves a point at a typical distance."""
    return max(3 * float((chain.offsets**2).mean()), 1.0)


def turned_like(fit: ObservedChain, poses: ChainPoses, before: ObservedChain) -> ChainPoses:
    """Rotate the frames of limbs, in poses of all frames, as a fit to some of the frames rotated them.

    Parameters
    ----------
    fit, before : ObservedChain
        The fit to some frames, and what it began with.
    poses : ChainPoses
        Of all frames, as they were before.
    """
    after, earlier = (one.poses.rotations.swapaxes(0, 1).reshape(fit.chain.n_limbs, -1, 3) for one in (fit, before))
    turn = nearest_rotation(earlier.swapaxes(1, 2) @ after)
    rotations = fit.articulation.projected(fit.chain.parents, poses.rotations @ turn)
    return ChainPoses(poses.root, rotations)


def information_of(fit: ObservedChain, most: int) -> Floats:
    """Return S of all frames, scaled up from some.

    Parameters
    ----------
    fit : ObservedChain
        The chain with fitted poses.
    most : int
        Evenly spread frames from which S is computed, and a few more of markers that these hardly show.
    """
    some = fit.at(_spread_frames(fit.weights > 0, most))
    scale = (fit.weights > 0).sum() / max((some.weights > 0).sum(), 1)
    return np.asarray(scale * total_information(some))


def _spread_frames(seen: Bools, most: int) -> Ints:
    """Evenly spread frames, and more of each marker that is seen in few of these."""
    chosen = spread_frames(len(seen), most)
    rare = np.flatnonzero(seen[chosen].sum(axis=0) < LEAST_SIGHTS)
    more = [evenly_spread(np.flatnonzero(seen[:, marker]), LEAST_SIGHTS) for marker in rare]
    return np.unique(np.concatenate([chosen, *more]))
