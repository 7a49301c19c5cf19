"""Arithmetic of the Kalman filter of one body, compiled; `plain_filter` says what it does.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels.small_matrices import factorise, solve
from skelgen.capture.bodies.compiled_pose import inverse, turn, weighed
from skelgen.capture.plain_filter import GROWTH, N_STATE, Corrected
from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats


@compile_function
def carried(
    pose: Floats, rates: Floats, covariance: Floats, power: Floats, step: float
) -> tuple[Floats, Floats, Floats]:
    """Return pose, rates and covariance some time later; arguments as those of `plain_filter.carried`."""
    half = step * step / 2.0
    moved, later, ahead = np.empty(6), rates.copy(), pose.copy()
    for i in range(6):
        moved[i] = step * rates[i] + half * rates[i + 6]
        later[i] += step * rates[i + 6]
    turn(ahead, moved)
    return ahead, later, _grown(_carried_rows(_carried_rows(covariance, step), step), power, step)


@compile_function
def _carried_rows(matrix: Floats, step: float) -> Floats:
    """The transpose of carry @ matrix, so that two calls carry a covariance."""
    half, out = step * step / 2.0, np.empty((N_STATE, N_STATE))
    for column in range(N_STATE):
        for i in range(6):
            velocity, acceleration = matrix[i + 6, column], matrix[i + 12, column]
            out[column, i] = matrix[i, column] + step * velocity + half * acceleration
            out[column, i + 6] = velocity + step * acceleration
            out[column, i + 12] = acceleration
    return out


@compile_function
def _grown(covariance: Floats, power: Floats, step: float) -> Floats:
    """A covariance with what white jerk adds to it, in place."""
    for row in range(3):
        for column in range(3):
            grown = GROWTH[row, column] * step ** (5 - row - column)
            for i in range(6):
                covariance[i + 6 * row, i + 6 * column] += power[i] * grown
    return covariance


@compile_function
def corrected(pose: Floats, rates: Floats, covariance: Floats, found: Floats, spread: Floats) -> Corrected:
    """Return the state after a pose was found; arguments and result as those of `plain_filter.corrected`."""
    error, total = _error(pose, found), np.empty((6, 6))
    for i in range(6):
        for j in range(6):
            total[i, j] = covariance[i, j] + spread[i, j]
    surprises = _surprise(error, total, 0), _surprise(error, total, 3)
    factorise(total)
    pulled = error.copy()
    solve(total, pulled)
    deviation, step, gain = 0.0, np.zeros(N_STATE), np.empty((N_STATE, 6))
    for i in range(6):
        deviation += error[i] * pulled[i]
    for row in range(N_STATE):
        for i in range(6):
            gain[row, i] = covariance[i, row]
            step[row] += covariance[row, i] * pulled[i]
        solve(total, gain[row])
    after, moved, later = np.empty((N_STATE, N_STATE)), pose.copy(), rates.copy()
    for row in range(N_STATE):
        for column in range(row + 1):
            value = covariance[row, column]
            for i in range(6):
                value -= gain[row, i] * covariance[i, column]
            after[row, column] = after[column, row] = value
    turn(moved, step[:6])
    for i in range(12):
        later[i] += step[i + 6]
    return Corrected(moved, later, after, deviation, surprises)


@compile_function
def _error(pose: Floats, found: Floats) -> Floats:
    """Turn about the world's axes and shift from one pose to another, shape (6,)."""
    turned, out = np.zeros((3, 3)), np.empty(6)
    for i in range(3):
        out[3 + i] = found[i, 3] - pose[i, 3]
        for j in range(3):
            for k in range(3):
                turned[i, j] += found[i, k] * pose[j, k]
    x, y, z = turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]
    sine, cosine = math.sqrt(x * x + y * y + z * z), turned[0, 0] + turned[1, 1] + turned[2, 2] - 1.0
    scale = math.atan2(sine, cosine) / sine if sine > 0.0 else 0.5
    out[0], out[1], out[2] = scale * x, scale * y, scale * z
    if sine == 0.0 and cosine < 0.0:  # a half turn about an axis that does not matter: it is too far
        out[0] = math.pi
    return out


@compile_function
def _surprise(error: Floats, spread: Floats, first: int) -> float:
    """Squared deviation per freedom of three of the six errors."""
    return weighed(error[first : first + 3], inverse(spread[first : first + 3, first : first + 3])) / 3.0
