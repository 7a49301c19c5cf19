"""Hidden markers: where they are by the distances that they keep from others, and by a ball of a single camera.

A Kalman filter of place and speed. A marker on a limb keeps its distance from the others there, and nearly so from
those of the next limb: each distance is a measurement, and so is a ball, of what is across its ray. See
`skelgen._kernels.room_points` for how cameras and balls are given.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, array_part, kernel_part
from skelgen._kernels.room_points import Room, is_in_view, whitened
from skelgen._kernels.small_matrices import block, dot, turned
from skelgen.model.arrays import Bools, Floats, Ints

N_STATE = 6
"""Place [mm] and speed [mm/s]."""

FEWEST, MOST_OF = 2, 1.0
"""Distances of its limb that must be kept for a hidden marker to be where it is expected, and their part of all."""

RIGID = 5.0
"""mm^2; variance of a distance up to which two markers are on one limb."""


class Kept(NamedTuple):
    """Distances that hidden markers keep from those that are seen.

    Attributes
    ----------
    places : ndarray, shape (n, n_others, 3), mm
        Where these are; NaN where there are fewer.
    distances, variances : ndarray, shape (n, n_others), mm and mm^2
        How far that is, and how much it varies.
    """

    places: Floats
    distances: Floats
    variances: Floats


@array_kernel
def carry(states: Floats, covariances: Floats, kept: Kept, passed: Floats, acceleration: float, gate: float) -> Bools:
    """Move hidden markers to where speed and distances want them; return whether these agree, shape (n,).

    Parameters
    ----------
    states : ndarray, shape (n, 6), mm and mm/s
        Places and speeds before; moved.
    covariances : ndarray, shape (n, 6, 6)
        Of these; updated.
    kept : Kept
        The distances.
    passed : ndarray, shape (n,), s
        Time since then.
    acceleration : float, mm/s^2
        By which speeds change.
    gate : float
        Standard deviations beyond which a distance is no longer kept.
    """
    slope, agree = np.zeros(N_STATE), np.zeros(len(states), dtype=np.bool_)
    for marker in range(len(states)):
        state, covariance, n_there, n_kept = states[marker], covariances[marker], 0, 0
        _advance(state, covariance, passed[marker], acceleration)
        for other in range(kept.distances.shape[1]):
            square = 0.0
            for axis in range(3):
                slope[axis] = state[axis] - kept.places[marker, other, axis]
                square += slope[axis] * slope[axis]
            length = math.sqrt(square)
            if not length > 1.0:
                continue
            for axis in range(3):
                slope[axis] /= length
            off, variance = kept.distances[marker, other] - length, kept.variances[marker, other]
            is_kept = _measure(state, covariance, slope, off, variance, gate)
            if variance <= RIGID:
                n_there, n_kept = n_there + 1, n_kept + is_kept
        agree[marker] = n_kept >= FEWEST and n_kept >= MOST_OF * n_there
    return agree


@kernel_part
def _advance(state: Floats, covariance: Floats, passed: float, acceleration: float) -> None:
    """Let time pass: a speed that changes by chance."""
    for axis in range(3):
        state[axis] += passed * state[3 + axis]
    for row in range(3):
        for column in range(N_STATE):
            covariance[row, column] += passed * covariance[3 + row, column]
    for row in range(N_STATE):
        for column in range(3):
            covariance[row, column] += passed * covariance[row, 3 + column]
    for axis in range(3):
        change = (acceleration * passed) ** 2
        covariance[axis, axis] += change * passed * passed / 4.0
        covariance[axis, 3 + axis] += change * passed / 2.0
        covariance[3 + axis, axis] += change * passed / 2.0
        covariance[3 + axis, 3 + axis] += change


@array_part
def _measure(state: Floats, covariance: Floats, slope: Floats, off: float, variance: float, gate: float) -> bool:
    """Correct a state by one number that is seen; return whether it lies within the gate."""
    spread, gain = variance, np.zeros(N_STATE)
    for row in range(N_STATE):
        for axis in range(3):
            gain[row] += covariance[row, axis] * slope[axis]
    for axis in range(3):
        spread += gain[axis] * slope[axis]
    if off * off > gate * gate * spread:
        return False
    for row in range(N_STATE):
        state[row] += gain[row] * off / spread
    for row in range(N_STATE):
        for column in range(N_STATE):
            covariance[row, column] -= gain[row] * gain[column] / spread
    return True


@array_kernel
def place_by_balls(room: Room, is_free: Bools, states: Floats, covariances: Floats, gate: float) -> tuple[Ints, Floats]:
    """Correct hidden markers by balls of one camera that lie where they must be.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    is_free : ndarray of bool, shape (n_balls,)
        Which balls are no marker's; those of hidden markers are taken.
    states : ndarray, shape (n, 6), mm and mm/s
        Places and speeds of hidden markers; corrected.
    covariances : ndarray, shape (n, 6, 6)
        Of these; reduced.
    gate : float
        Standard deviations within which a ball belongs to a marker.

    Returns
    -------
    balls : ndarray of intp, shape (n, n_cameras)
        The ball of the camera that sees the marker, -1 of all others.
    squares : ndarray, shape (n,)
        Chi-squared of how far the ball is off, with two degrees of freedom.
    """
    n, n_cameras = len(states), len(room.poses)
    found, squares = np.full((n, n_cameras), -1, dtype=np.intp), np.full(n, gate * gate)
    slope = np.zeros(3)
    for marker in range(n):
        which, ball = -1, -1
        for camera in range(n_cameras):
            if not is_in_view(room, camera, states[marker]):
                continue
            for other in range(room.starts[camera], room.starts[camera + 1]):
                if is_free[other]:
                    square = _off(room, camera, other, states[marker], covariances[marker])
                    if square < squares[marker]:
                        squares[marker], which, ball = square, camera, other
        if ball < 0:
            continue
        is_free[ball] = False
        found[marker, which] = ball - room.starts[which]
        seen, start = whitened(room, which, ball, states[marker]), states[marker].copy()
        for half in range(2):
            off, along = seen[half]
            for axis in range(3):
                slope[axis] = along[axis]
                off -= slope[axis] * (states[marker, axis] - start[axis])
            _measure(states[marker], covariances[marker], slope, off, 1.0, math.inf)
    return found, squares


@kernel_part
def _off(room: Room, camera: int, ball: int, state: Floats, covariance: Floats) -> float:
    """Return the squared distance of a ball from where a marker is expected, in standard deviations of both."""
    (r, u), (s, v) = whitened(room, camera, ball, state)
    p, q = turned(block(covariance, 0, 0), u), turned(block(covariance, 0, 0), v)
    a, b, c = 1.0 + dot(u, p), dot(v, p), 1.0 + dot(v, q)
    return float((c * r * r - 2.0 * b * r * s + a * s * s) / (a * c - b * b))
