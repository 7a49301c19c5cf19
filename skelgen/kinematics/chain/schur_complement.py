"""Bordered least squares: a few constants and a few unknowns in each frame, solved by the Schur complement.

The frames' own unknowns are eliminated from every frame. Directions of the constants that the frames do not determine
stay where they are. `effective_frames` is the number of independent frames that correlated residuals are worth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.least_squares import OWN_RIDGE, RANK_TOLERANCE, eliminate
from skelgen.model.arrays import Floats

MAX_ROUNDS = 30
LEAST_GAIN = 1e-7
"""Rounds stop when the sum of squares falls by less than this part: the next would gain its square."""

STEP_PARTS = (1.0, 0.3, 0.1, 0.01)
"""Parts of a Gauss-Newton step that are tried until one lowers the sum of squares."""

State = TypeVar("State")

FEW_LAGS = 32
"""Lags whose products take less time than a Fourier transform that finds all."""


@dataclass(frozen=True, eq=False)
class LinearisedProblem:
    """A linearised least squares problem: residuals and derivatives, in standard deviations.

    Attributes
    ----------
    residuals : ndarray, shape (n_frames, n_rows)
        Measured minus modelled, in standard deviations.
    constants : ndarray, shape (n_frames, n_rows, n_constants)
        Derivatives of the model by the constants.
    angles : ndarray, shape (n_frames, n_rows, n_angles)
        Derivatives by the frame's own unknowns.
    """

    residuals: Floats
    constants: Floats
    angles: Floats

    @property
    def squares(self) -> float:
        """Sum of squares."""
        return float((self.residuals**2).sum())


@dataclass(frozen=True, eq=False)
class BorderedSolution:
    """A Gauss-Newton step with covariances.

    Attributes
    ----------
    constants : ndarray, shape (n_constants,)
        Step of the constants.
    angles : ndarray, shape (n_frames, n_angles)
        Steps of the frames' unknowns.
    covariance : ndarray, shape (n_constants, n_constants)
        Of the constants, for residuals of variance 1; 0 along directions that are not determined.
    residuals : ndarray, shape (n_frames, n_rows)
        What no step of any frame's own unknowns could take away.
    unknown : ndarray, shape (n_constants, n_unknown)
        Unit directions of the constants that are not determined.
    own_inverse : ndarray, shape (n_frames, n_angles, n_angles)
        Covariance of the frames' unknowns if the constants are known.
    follow : ndarray, shape (n_frames, n_angles, n_constants)
        Derivatives of the frames' unknowns by the constants.
    reduced : ndarray, shape (n_frames, n_rows, n_constants)
        Derivatives by the constants, with the frames' unknowns eliminated.
    """

    constants: Floats
    angles: Floats
    covariance: Floats
    residuals: Floats
    unknown: Floats
    own_inverse: Floats
    follow: Floats
    reduced: Floats

    @property
    def rank(self) -> int:
        """Number of directions of the constants that are determined."""
        return len(self.constants) - int(self.unknown.shape[1])

    @property
    def angle_covariance(self) -> Floats:
        """Covariance of the frames' unknowns, the constants' share included, shape (n_frames, n_angles, n_angles)."""
        return np.asarray(self.own_inverse + self.follow @ self.covariance @ self.follow.swapaxes(1, 2))

    @property
    def scores(self) -> Floats:
        """Gradient of each frame by the constants; their sum is 0 at the solution; shape (n_frames, n_constants)."""
        return np.asarray(np.einsum("frc,fr->fc", self.reduced, self.residuals))


def solve_bordered(linear: LinearisedProblem) -> BorderedSolution:
    """Solve a linear problem by eliminating the frames' own unknowns."""
    given = contiguous(linear.residuals, linear.constants, linear.angles)
    own_inverse, follow, alone, reduced, left, normal, gradient = eliminate(*given)
    covariance, unknown = _pseudo_inverse(normal)
    constants = covariance @ gradient
    angles, residuals = alone - follow @ constants, left - reduced @ constants
    return BorderedSolution(constants, angles, covariance, residuals, unknown, own_inverse, follow, reduced)


def gain_of_frames(slopes: Floats) -> tuple[Floats, Floats]:
    """Return the inverse normal matrix of each frame's own unknowns, and their derivatives by its residuals.

    Parameters
    ----------
    slopes : ndarray, shape (n_frames, n_rows, n_angles)
        Derivatives of the model by them.
    """
    own = np.swapaxes(slopes, 1, 2)
    normal = own @ slopes
    level = OWN_RIDGE * np.einsum("fii->f", normal)[:, np.newaxis, np.newaxis] + np.finfo(np.float64).tiny
    inverse = np.linalg.inv(normal + level * np.eye(normal.shape[1]))
    return inverse, inverse @ own


def gauss_newton(
    state: State,
    linearised: Callable[[State], LinearisedProblem],
    stepped: Callable[[State, Floats, Floats], State],
    max_rounds: int = MAX_ROUNDS,
    least_gain: float = LEAST_GAIN,
) -> Minimum[State]:
    """Repeat Gauss-Newton steps until the sum of squares stays.

    Parameters
    ----------
    state : object
        First guess.
    linearised : callable (state) -> LinearisedProblem
        Residuals and slopes at a state.
    stepped : callable (state, constants, angles) -> state
        The state after a step.
    max_rounds : int
        Rounds at most.
    least_gain : float
        Part of the sum of squares; a round that gains no more is the last.
    """
    linear = linearised(state)
    for _ in range(max_rounds):
        solution = solve_bordered(linear)
        for part in STEP_PARTS:
            trial = stepped(state, part * solution.constants, part * solution.angles)
            trial_linear = linearised(trial)
            if trial_linear.squares <= linear.squares:
                break
        else:
            return Minimum(state, linear.squares, solution)
        gain = linear.squares - trial_linear.squares
        state, linear = trial, trial_linear
        if gain <= least_gain * linear.squares:
            break
    return Minimum(state, linear.squares, solve_bordered(linear))


@dataclass(frozen=True, eq=False)
class Minimum(Generic[State]):
    """The state that was found, its sum of squares, and the solution there with its covariance."""

    state: State
    squares: float
    solution: BorderedSolution


def _pseudo_inverse(matrix: Floats) -> tuple[Floats, Floats]:
    """Return the inverse of an information matrix on what is determined, and unit directions of the rest."""
    if not len(matrix):
        return matrix, matrix
    scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(np.float64).tiny))  # mm and rad beside each other
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    known = values > RANK_TOLERANCE * max(values[-1], np.finfo(np.float64).tiny)
    root = vectors[:, known] / np.sqrt(values[known]) / scale[:, np.newaxis]
    unknown = vectors[:, ~known] / scale[:, np.newaxis]
    return root @ root.T, unknown / np.linalg.norm(unknown, axis=0)


def effective_frames(residuals: Floats) -> float:
    """Return the number of independent frames that correlated residuals are worth.

    The autocorrelation is summed over pairs of neighbouring lags while their sum is positive (Geyer 1992, *Practical
    Markov chain Monte Carlo*, 3.3). So independent residuals count in full.

    Parameters
    ----------
    residuals : ndarray, shape (n_frames, n_rows)
        In the order of time; of any unit.
    """
    return _effective(_correlation(residuals), len(residuals))


def effective_frames_of_both(residuals: Floats) -> tuple[float, float]:
    """Return the number of independent frames for the mean and for the variance.

    The squares of normal numbers decorrelate twice as fast as the numbers themselves.

    Parameters
    ----------
    residuals : ndarray, shape (n_frames, n_rows)
        As for `effective_frames`.
    """
    correlation = _correlation(residuals)
    return (_effective(correlation, len(residuals)), _effective(correlation * np.abs(correlation), len(residuals)))


def _correlation(residuals: Floats) -> Floats:
    """Autocorrelation of the residuals at lags 0, 1, ..., until two neighbouring lags have no positive sum.

    Few lags are summed one by one, at the cost of a product each; if the residuals last, all are found at once.
    """
    n_frames, n_rows = residuals.shape
    flat = np.ascontiguousarray(residuals).ravel()
    squares = float(flat @ flat)
    if n_frames < 2 or squares == 0:
        return np.ones(1)
    found: list[float] = []
    for lag in range(0, min(n_frames - 1, FEW_LAGS), 2):
        ways = (lag * n_rows, (lag + 1) * n_rows)
        found += [float(flat[way:] @ flat[: len(flat) - way]) / squares for way in ways]
        if found[-2] + found[-1] <= 0:
            return np.array(found[:-2])
    spectrum = np.fft.rfft(residuals, 2 * n_frames, axis=0)
    power = (spectrum.real**2 + spectrum.imag**2).sum(axis=1)
    correlation = np.fft.irfft(power)[: n_frames - n_frames % 2] / squares
    ends = np.flatnonzero(correlation.reshape(-1, 2).sum(axis=1) <= 0)
    return np.asarray(correlation[: 2 * ends[0] if len(ends) else None])


def _effective(correlation: Floats, n_frames: int) -> float:
    return float(n_frames / max(2 * correlation.sum() - 1, 1.0))
