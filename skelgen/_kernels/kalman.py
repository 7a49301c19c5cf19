"""Arithmetic of the Kalman filter of one rigid body: pose, velocity and acceleration under white jerk.

The state has 18 freedoms: pose, velocity, acceleration, each a small rotation about the world's axes [rad], then a
shift [mm].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, array_part
from skelgen._kernels.least_squares import factorise, solve
from skelgen._kernels.rotations import move_pose, write_pose_error
from skelgen.model.arrays import Floats

N_STATE = 18
GROWTH = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
"""How white jerk grows in the covariances of pose, velocity and acceleration, times a power of the time step."""


class BodyState(NamedTuple):
    """Where a body is and how it moves.

    Attributes
    ----------
    pose : ndarray, shape (4, 4), mm
        World from body.
    rates : ndarray, shape (12,)
        Velocities and accelerations, each rotation [rad], then place [mm], by s and s^2.
    covariance : ndarray, shape (18, 18)
        Of pose and rates.
    """

    pose: Floats
    rates: Floats
    covariance: Floats


class Innovation(NamedTuple):
    """How far a pose that was found is from the predicted one.

    Attributes
    ----------
    deviation : float
        Squared, in standard deviations, of all six freedoms together.
    rotation, shift : float
        The same of the rotation and of the shift alone, each per freedom.
    """

    deviation: float
    rotation: float
    shift: float


@array_kernel
def predict(state: BodyState, power: Floats, step: float) -> BodyState:
    """Return the state some time later.

    Parameters
    ----------
    state : BodyState
        Now.
    power : ndarray, shape (6,)
        Spectral density of the white jerk, rad^2/s^5 and mm^2/s^5.
    step : float, s
        How much later.
    """
    half = step * step / 2.0
    moved, rates, pose = np.empty(6), state.rates.copy(), state.pose.copy()
    for i in range(6):
        moved[i] = step * state.rates[i] + half * state.rates[i + 6]
        rates[i] += step * state.rates[i + 6]
    move_pose(pose, moved)
    covariance = _carry_rows(_carry_rows(state.covariance, step), step)
    for row in range(3):
        for column in range(3):
            grown = GROWTH[row, column] * step ** (5 - row - column)
            for i in range(6):
                covariance[i + 6 * row, i + 6 * column] += power[i] * grown
    return BodyState(pose, rates, covariance)


@array_part
def _carry_rows(matrix: Floats, step: float) -> Floats:
    """Return the transpose of F matrix, with the transition F of the state, so that two calls carry a covariance."""
    half, carried = step * step / 2.0, np.empty((N_STATE, N_STATE))
    for column in range(N_STATE):
        for i in range(6):
            velocity, acceleration = matrix[i + 6, column], matrix[i + 12, column]
            carried[column, i] = matrix[i, column] + step * velocity + half * acceleration
            carried[column, i + 6] = velocity + step * acceleration
            carried[column, i + 12] = acceleration
    return carried


@array_kernel
def correct(state: BodyState, found: Floats, spread: Floats) -> tuple[BodyState, Innovation]:
    """Return the state after a pose was found, and how far it was from the predicted one.

    Parameters
    ----------
    state : BodyState
        As predicted.
    found : ndarray, shape (4, 4), mm
        The pose.
    spread : ndarray, shape (6, 6)
        Its covariance.
    """
    covariance, error, total = state.covariance, np.empty(6), np.empty((6, 6))
    write_pose_error(state.pose, found, error)
    for i in range(6):
        for j in range(6):
            total[i, j] = covariance[i, j] + spread[i, j]
    rotation = _squared_deviation(error[:3], total[:3, :3]) / 3.0
    shift = _squared_deviation(error[3:], total[3:, 3:]) / 3.0
    factorise(total)
    weighted = error.copy()
    solve(total, weighted)
    deviation, step, gain = 0.0, np.zeros(N_STATE), np.empty((N_STATE, 6))
    for i in range(6):
        deviation += error[i] * weighted[i]
    for row in range(N_STATE):
        for i in range(6):
            gain[row, i] = covariance[i, row]
            step[row] += covariance[row, i] * weighted[i]
        solve(total, gain[row])
    after, pose, rates = np.empty((N_STATE, N_STATE)), state.pose.copy(), state.rates.copy()
    for row in range(N_STATE):
        for column in range(row + 1):
            value = covariance[row, column]
            for i in range(6):
                value -= gain[row, i] * covariance[i, column]
            after[row, column] = after[column, row] = value
    move_pose(pose, step)
    for i in range(12):
        rates[i] += step[i + 6]
    return BodyState(pose, rates, after), Innovation(deviation, rotation, shift)


@array_part
def _squared_deviation(error: Floats, covariance: Floats) -> float:
    """Return error^T covariance^-1 error."""
    factor, weighted, total = covariance.copy(), error.copy(), 0.0
    factorise(factor)
    solve(factor, weighted)
    for i in range(len(error)):
        total += error[i] * weighted[i]
    return total
