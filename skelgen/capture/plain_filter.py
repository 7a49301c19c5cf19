"""Arithmetic of the Kalman filter of one body, in NumPy: the twin that the compiled one is tested against."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector, vector_from_matrix
from skelgen.model.arrays import Floats

N_STATE = 18
GROWTH = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
"""How white jerk grows in the covariances of pose, velocity and acceleration, times a power of the time step."""

_POSE = slice(0, 6)
_EACH = np.arange(6)


class Corrected(NamedTuple):
    """A state after a pose was taken in.

    Attributes
    ----------
    pose, rates, covariance : ndarray, shape (4, 4), (12,) and (18, 18)
        See `carried`.
    deviation : float
        Squared deviation of the pose that was found from the predicted one.
    surprises : tuple of float
        The same of turn and shift alone, each per freedom.
    """

    pose: Floats
    rates: Floats
    covariance: Floats
    deviation: float
    surprises: tuple[float, float]


def carried(
    pose: Floats, rates: Floats, covariance: Floats, power: Floats, step: float
) -> tuple[Floats, Floats, Floats]:
    """Return pose, rates and covariance some time later.

    Parameters
    ----------
    pose : ndarray, shape (4, 4), mm
        Of the body.
    rates : ndarray, shape (12,)
        Velocities and accelerations, each turn [rad], then place [mm].
    covariance : ndarray, shape (18, 18)
        Of pose and rates.
    power : ndarray, shape (6,)
        Of white jerk.
    step : float, s
        How much later.
    """
    carry = np.eye(N_STATE)
    carry[_EACH, _EACH + 6] = carry[_EACH + 6, _EACH + 12] = step
    carry[_EACH, _EACH + 12] = step**2 / 2
    noise = np.zeros((N_STATE, N_STATE))
    for row in range(3):
        for column in range(3):
            noise[_EACH + 6 * row, _EACH + 6 * column] = power * step ** (5 - row - column) * GROWTH[row, column]
    moved = carry @ np.concatenate([np.zeros(6), rates])
    return _moved(pose, moved[_POSE]), moved[_POSE.stop :], carry @ covariance @ carry.T + noise


def corrected(pose: Floats, rates: Floats, covariance: Floats, found: Floats, spread: Floats) -> Corrected:
    """Return the state after a pose was found.

    Parameters
    ----------
    pose, rates, covariance : ndarray
        As predicted; see `carried`.
    found : ndarray, shape (4, 4), mm
        The pose.
    spread : ndarray, shape (6, 6)
        Its covariance.
    """
    error = np.concatenate([vector_from_matrix(found[:3, :3] @ pose[:3, :3].T), found[:3, 3] - pose[:3, 3]])
    spread = covariance[_POSE, _POSE] + spread
    turn, shift = (float(error[at] @ np.linalg.solve(spread[at, at], error[at])) / 3 for at in (slice(3), slice(3, 6)))
    gain = np.linalg.solve(spread, covariance[_POSE]).T
    step = gain @ error
    after = covariance - gain @ covariance[_POSE]
    state = _moved(pose, step[_POSE]), rates + step[_POSE.stop :], (after + after.T) / 2
    return Corrected(*state, float(error @ np.linalg.solve(spread, error)), (turn, shift))


def _moved(pose: Floats, step: Floats) -> Floats:
    """A pose after a turn about the world's axes and a shift."""
    out = pose.copy()
    out[:3, :3] = matrix_from_vector(step[:3]) @ pose[:3, :3]
    out[:3, 3] += step[3:]
    return out
