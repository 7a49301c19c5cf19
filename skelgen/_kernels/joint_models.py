"""Models of a joint fitted to its rotations, over frames: rigid, hinge, universal."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import fixed, kernel, kernel_part
from skelgen._kernels.least_squares import (
    Linearised,
    turn_to_axes,
    write_copy,
    write_inverse_root,
    write_times_transposed,
)
from skelgen._kernels.rotations import SMALL_ANGLE
from skelgen.model.arrays import Floats

UNIVERSAL_RIDGE = 1e-6
"""Of unit variance: axes that never move against each other make no universal joint."""

Parts = tuple[Floats, Floats, float, Floats]
"""Joint's frames in the parent and in the child, shape (3, 3), the angle between the axes, and the frames' angles."""

N_ROOM = 6
"""Matrices of room that `_linearise` works in."""

PARENT, CHILD = fixed(0, 1)
"""Limbs of a joint."""

ABOUT_Z, ABOUT_X = fixed(0, 1)
"""Axes of `_turn`, by the first of the two that it turns."""


def linearised(parts: Parts, rotations: Floats, weight: Floats) -> Linearised:
    """Return whitened residuals of rotations, and their derivatives by the constants and angles of a joint.

    Parameters
    ----------
    parts : tuple
        Of a rigid joint, hinge or universal joint, as in `ConstrainedRotation`.
    rotations : ndarray, shape (n_frames, 3, 3)
        Measured, parent from child.
    weight : ndarray, shape (n_frames, 3, 3)
        Whitening of small turns.
    """
    n_frames, n_angles = parts[3].shape
    size = 3 + n_angles
    out = Linearised(np.empty((n_frames, 3)), np.empty((n_frames, 3, size)), np.empty((n_frames, 3, n_angles)))
    _linearise(parts, rotations, weight, np.empty((N_ROOM, 3, size + n_angles)), out)
    return out


@kernel
def _linearise(parts: Parts, rotations: Floats, weight: Floats, room: Floats, out: Linearised) -> None:
    """Write what `linearised` returns; there is `room` to work in."""
    in_parent, in_child, between, angles = parts
    residuals, constants, own = out
    n_angles = angles.shape[1]
    first, both, model, error, columns = room[0], room[1], room[2], room[3], room[4]
    vector = room[5, 0]
    write_copy(in_parent, first)
    write_copy(in_parent, both)
    cosine, sine = math.cos(between), math.sin(between)
    for frame in range(len(angles)):
        if n_angles > 0:
            _turn(in_parent, ABOUT_Z, math.cos(angles[frame, 0]), math.sin(angles[frame, 0]), both)
        if n_angles == 2:
            first, both = both, first
            _turn(first, ABOUT_X, cosine, sine, both)
            _turn(both, ABOUT_Z, math.cos(angles[frame, 1]), math.sin(angles[frame, 1]), both)
        write_times_transposed(both, in_child, model)
        write_times_transposed(rotations[frame], model, error)
        _write_vector(error, vector)
        _write_jacobian(in_parent, first, both, n_angles, columns)
        for i in range(3):
            residuals[frame, i] = weight[frame, i, 0] * vector[0]
            residuals[frame, i] += weight[frame, i, 1] * vector[1] + weight[frame, i, 2] * vector[2]
            for column in range(3 + 2 * n_angles):
                value = weight[frame, i, 0] * columns[0, column] + weight[frame, i, 1] * columns[1, column]
                value += weight[frame, i, 2] * columns[2, column]
                if column < 3 + n_angles:
                    constants[frame, i, column] = value
                else:
                    own[frame, i, column - 3 - n_angles] = value


@kernel_part
def _turn(frame: Floats, start: int, cosine: float, sine: float, out: Floats) -> None:
    """Write a frame turned in the plane of two neighbouring axes: about z or x; both may be the same array."""
    other, still = start + 1, 2 - 2 * start
    for i in range(3):
        x, y = frame[i, start], frame[i, other]
        out[i, start], out[i, other], out[i, still] = cosine * x + sine * y, cosine * y - sine * x, frame[i, still]


def relative_vectors(first: Floats, second: Floats) -> Floats:
    """Return the rotation vectors [rad] of first^T second, shape (n, 3).

    Parameters
    ----------
    first : ndarray, shape (m, 3, 3)
        Rotations, repeated as often as m goes into n.
    second : ndarray, shape (n, 3, 3)
        Rotations.
    """
    out = np.empty((len(second), 3))
    _write_vectors(first, second, np.empty((3, 3)), out)
    return out


@kernel
def _write_vectors(first: Floats, second: Floats, between: Floats, out: Floats) -> None:
    for frame in range(len(second)):
        own = frame % len(first)
        for i in range(3):
            for j in range(3):
                between[i, j] = 0.0
                for k in range(3):
                    between[i, j] += first[own, k, i] * second[frame, k, j]
        _write_vector(between, out[frame])


@kernel_part
def _write_vector(m: Floats, out: Floats) -> None:
    """Write the rotation vector of a rotation: the largest part of its quaternion is found first (Shepperd 1978)."""
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    best, most = -1, trace
    for i in range(3):
        if m[i, i] > most:
            best, most = i, m[i, i]
    if best < 0:
        w, x, y, z = 1.0 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    else:
        i, j, k = best, (best + 1) % 3, (best + 2) % 3
        out[i], out[j], out[k] = 1.0 + 2.0 * m[i, i] - trace, m[i, j] + m[j, i], m[i, k] + m[k, i]
        w, x, y, z = m[k, j] - m[j, k], out[0], out[1], out[2]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    length = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine > SMALL_ANGLE else 2.0
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@kernel_part
def _write_jacobian(in_parent: Floats, first: Floats, both: Floats, n_angles: int, out: Floats) -> None:
    """Write the derivatives of a joint's rotation by the constants of its type, then by the frame's angles."""
    for i in range(3):
        if n_angles == 0:
            for column in range(3):
                out[i, column] = 1.0 if i == column else 0.0
        else:
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = in_parent[i, 0], in_parent[i, 1], -both[i, 0], -both[i, 1]
            if n_angles == 1:
                out[i, 4] = in_parent[i, 2]
            else:
                out[i, 4], out[i, 5], out[i, 6] = first[i, 0], in_parent[i, 2], both[i, 2]


def alternated(moments: Floats, mean: Floats, starts: Floats, n_rounds: int) -> tuple[Floats, Floats]:
    """Find two axes whose angle hardly changes, one at a time.

    Parameters
    ----------
    moments : ndarray, shape (9, 9)
        Covariance of the rotations' elements, row by row.
    mean : ndarray, shape (9,)
        Their means.
    starts : ndarray, shape (n, 3)
        First guesses of the axis in the child.
    n_rounds : int
        How often each of the two axes is found.

    Returns
    -------
    tuple of ndarray, shapes (n, 3) and (n,)
        The axes in the child before the last round, and the angles' variances after it.
    """
    axes, variances = starts.copy(), np.empty(len(starts))
    _alternate(moments, mean, n_rounds, np.empty((7, 3, 3)), axes, variances)
    return axes, variances


@kernel
def _alternate(moments: Floats, mean: Floats, n_rounds: int, room: Floats, axes: Floats, variances: Floats) -> None:
    """Replace axes in the child by those before the last round; there is `room` to work in."""
    first, second = room[5, 0], room[6, 0]
    for start in range(len(axes)):
        for i in range(3):
            second[i] = axes[start, i]
        for _ in range(n_rounds):
            for i in range(3):
                axes[start, i] = second[i]
            _write_partner(moments, mean, second, PARENT, room, first)
            variances[start] = _write_partner(moments, mean, first, CHILD, room, second)


@kernel_part
def _write_partner(moments: Floats, mean: Floats, known: Floats, of: int, room: Floats, out: Floats) -> float:
    """Write the axis of one limb that keeps its angle to a known one of the other best; return the angle's variance."""
    spread, root, turned, vectors, middle = room[0], room[1], room[2], room[3], room[4, 0]
    own, other = (3, 1) if of == PARENT else (1, 3)  # steps in tables whose rows are elements of matrices
    for i in range(3):
        middle[i] = 0.0
        for a in range(3):
            middle[i] += mean[own * i + other * a] * known[a]
    for i in range(3):
        for j in range(3):
            spread[i, j] = 0.0
            root[i, j] = (1.0 + UNIVERSAL_RIDGE if i == j else 0.0) - middle[i] * middle[j]
            for a in range(3):
                for b in range(3):
                    spread[i, j] += moments[own * i + other * a, own * j + other * b] * known[a] * known[b]
    write_inverse_root(root, turned)
    for i in range(3):
        for j in range(3):
            root[i, j] = turned[i, 0] * spread[0, j] + turned[i, 1] * spread[1, j] + turned[i, 2] * spread[2, j]
    write_times_transposed(root, turned, spread)
    turn_to_axes(spread, vectors, len(spread))
    least = 0
    for i in range(1, 3):
        if spread[i, i] < spread[least, least]:
            least = i
    length = 0.0
    for i in range(3):
        out[i] = turned[0, i] * vectors[0, least] + turned[1, i] * vectors[1, least] + turned[2, i] * vectors[2, least]
        length += out[i] ** 2
    for i in range(3):
        out[i] /= math.sqrt(length)
    return float(spread[least, least])
