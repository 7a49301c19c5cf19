"""Models of a joint fitted to its rotations, over frames: rigid, hinge, universal."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.small_matrices import (
    SMALL_ANGLE,
    TINY,
    turn_to_axes,
    write_inverse_root,
    write_product,
    write_times_transposed,
)
from skelgen.model.arrays import Floats

STEP_PARTS = (1.0, 0.3, 0.1, 0.01)
"""Parts of a Gauss-Newton step that are tried until one lowers the sum of squares."""

RANK_TOLERANCE = 1e-12
"""Directions whose information is below this part of the largest are not determined: double precision ends there."""

OWN_RIDGE = 1e-14
"""Of a frame's own normal matrix: keeps angles that nothing measures in place."""

UNIVERSAL_RIDGE = 1e-6
"""Of unit variance: axes that never move against each other make no universal joint."""

Parts = tuple[Floats, Floats, float, Floats]
"""Joint's frames in the parent and in the child, shape (3, 3), the angle between the axes, and the frames' angles."""

Eliminated = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]


@kernel
def whitened(covariances: Floats) -> Floats:
    """Return matrices W with W^T W = covariance^-1, shape (n_frames, n, n)."""
    out, room = np.zeros_like(covariances), np.empty_like(covariances[0])
    for frame in range(len(covariances)):
        room[:] = covariances[frame]
        write_inverse_root(room, out[frame])
    return out


@kernel
def eliminate(residuals: Floats, constants: Floats, angles: Floats) -> Eliminated:
    """Take the frames' own unknowns out of a least squares problem.

    Parameters
    ----------
    residuals, constants, angles : ndarray
        See `arrow.Linear`.

    Returns
    -------
    tuple of ndarray
        Inverse normal matrices of the frames' own unknowns, shape (n_frames, n_angles, n_angles); how these follow the
        constants, shape (n_frames, n_angles, n_constants), and what they are without, shape (n_frames, n_angles); the
        constants' slopes and the residuals that they leave, shapes (n_frames, n_rows, n_constants) and
        (n_frames, n_rows); the constants' normal matrix and right-hand side.
    """
    n_frames, n_rows, n_constants = constants.shape
    n_angles = angles.shape[2]
    inverse, follow = np.zeros((n_frames, n_angles, n_angles)), np.zeros((n_frames, n_angles, n_constants))
    alone, reduced, left = np.zeros((n_frames, n_angles)), constants.copy(), residuals.copy()
    normal, pull = np.zeros((n_constants, n_constants)), np.zeros(n_constants)
    for frame in range(n_frames):
        _invert_own(angles[frame], inverse[frame])
        _follow(angles[frame], inverse[frame], constants[frame], residuals[frame], follow[frame], alone[frame])
        for row in range(n_rows):
            for a in range(n_angles):
                left[frame, row] -= angles[frame, row, a] * alone[frame, a]
                for c in range(n_constants):
                    reduced[frame, row, c] -= angles[frame, row, a] * follow[frame, a, c]
            for c in range(n_constants):
                pull[c] += reduced[frame, row, c] * left[frame, row]
                for d in range(c + 1):
                    normal[c, d] += reduced[frame, row, c] * reduced[frame, row, d]
    for c in range(n_constants):
        for d in range(c):
            normal[d, c] = normal[c, d]
    return inverse, follow, alone, reduced, left, normal, pull


@kernel_part
def _follow(
    angles: Floats, inverse: Floats, constants: Floats, residuals: Floats, follow: Floats, alone: Floats
) -> None:
    """Add how a frame's own unknowns follow the constants, and what they are without."""
    for a in range(len(alone)):
        for row in range(len(residuals)):
            gain = 0.0
            for b in range(len(alone)):
                gain += inverse[a, b] * angles[row, b]
            alone[a] += gain * residuals[row]
            for c in range(constants.shape[1]):
                follow[a, c] += gain * constants[row, c]


@kernel_part
def _invert_own(slopes: Floats, out: Floats) -> None:
    """Write the inverse of slopes^T slopes, its diagonal a little raised: Gauss and Jordan without exchanges."""
    n_rows, size = slopes.shape
    trace = 0.0
    for i in range(size):
        for j in range(size):
            out[i, j] = 0.0
            for row in range(n_rows):
                out[i, j] += slopes[row, i] * slopes[row, j]
        trace += out[i, i]
    level = OWN_RIDGE * trace + TINY
    for i in range(size):
        out[i, i] += level
    for pivot in range(size):
        scale = 1.0 / max(out[pivot, pivot], level)
        out[pivot, pivot] = 1.0
        for j in range(size):
            out[pivot, j] *= scale
        for i in range(size):
            if i != pivot:
                factor = out[i, pivot]
                out[i, pivot] = 0.0
                for j in range(size):
                    out[i, j] -= factor * out[pivot, j]


@kernel
def linearised(
    in_parent: Floats, in_child: Floats, between: float, angles: Floats, rotations: Floats, weight: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return whitened errors of rotations, and how a joint's rotations follow its constants and angles.

    Parameters
    ----------
    in_parent, in_child, between, angles
        `Turning.parts` of a rigid joint, hinge or universal joint.
    rotations : ndarray, shape (n_frames, 3, 3)
        Measured, parent from child.
    weight : ndarray, shape (n_frames, 3, 3)
        Whitening of small turns.

    Returns
    -------
    tuple of ndarray
        Shapes (n_frames, 3), (n_frames, 3, 3 + n_angles) and (n_frames, 3, n_angles).
    """
    n_frames, n_angles = angles.shape
    residuals = np.empty((n_frames, 3))
    constants, own = np.empty((n_frames, 3, 3 + n_angles)), np.empty((n_frames, 3, n_angles))
    first, both, model, error = in_parent.copy(), in_parent.copy(), np.empty((3, 3)), np.empty((3, 3))
    columns, vector = np.empty((3, 3 + 2 * n_angles)), np.empty(3)
    cosine, sine = math.cos(between), math.sin(between)
    for frame in range(n_frames):
        if n_angles > 0:
            _turn(in_parent, 0, math.cos(angles[frame, 0]), math.sin(angles[frame, 0]), both)
        if n_angles == 2:
            first, both = both, first
            _turn(first, 1, cosine, sine, both)
            _turn(both, 0, math.cos(angles[frame, 1]), math.sin(angles[frame, 1]), both)
        write_times_transposed(both, in_child, model)
        write_times_transposed(rotations[frame], model, error)
        _write_vector(error, vector)
        _write_slopes(in_parent, first, both, n_angles, columns)
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
    return residuals, constants, own


@kernel
def descended(
    in_parent: Floats,
    in_child: Floats,
    between: float,
    angles: Floats,
    rotations: Floats,
    weight: Floats,
    max_rounds: int,
    least_gain: float,
) -> Parts:
    """Fit a joint to rotations by the steps of `arrow.descend`.

    Parameters
    ----------
    in_parent, in_child, between, angles, rotations, weight
        See `linearised`; the joint is a first guess.
    max_rounds, least_gain
        See `arrow.descend`.

    Returns
    -------
    tuple
        `Turning.parts` of the joint that comes nearest.
    """
    state = (in_parent, in_child, between, angles)
    residuals, constants, own = linearised(in_parent, in_child, between, angles, rotations, weight)
    squares = (residuals**2).sum()
    for _ in range(max_rounds):
        _, follow, alone, _, _, normal, pull = eliminate(residuals, constants, own)
        step = _solved(normal, pull)
        for frame in range(len(alone)):
            for a in range(alone.shape[1]):
                for c in range(len(step)):
                    alone[frame, a] -= follow[frame, a, c] * step[c]
        better = False
        for part in STEP_PARTS:
            trial = _stepped(state[0], state[1], state[2], state[3], part * step, part * alone)
            residuals, constants, own = linearised(trial[0], trial[1], trial[2], trial[3], rotations, weight)
            reached = (residuals**2).sum()
            better = reached <= squares
            if better:
                break
        if not better:
            break
        gain = squares - reached
        settled = gain <= least_gain * squares
        state, squares = trial, reached
        if settled:
            break
    return state


@kernel_part
def _stepped(
    in_parent: Floats, in_child: Floats, between: float, angles: Floats, constants: Floats, own: Floats
) -> Parts:
    """Return the parts of a joint after a step, as `Turning.stepped` does."""
    parent, child = np.empty((3, 3)), in_child.copy()
    n_angles = angles.shape[1]
    if n_angles == 0:
        turn = np.empty((3, 3))
        _write_turn(constants[0], constants[1], constants[2], turn)
        write_product(turn, in_parent, parent)
        return parent, child, between, angles
    _tilt(in_parent, constants[0], constants[1], parent)
    _tilt(in_child, constants[2], constants[3], child)
    return parent, child, between + (constants[4] if n_angles == 2 else 0.0), angles + own


@kernel_part
def _tilt(frame: Floats, about_x: float, about_y: float, out: Floats) -> None:
    turn = np.empty((3, 3))
    _write_turn(about_x, about_y, 0.0, turn)
    write_product(frame, turn, out)


@kernel_part
def _write_turn(x: float, y: float, z: float, out: Floats) -> None:
    """Write the rotation of a rotation vector (Rodrigues)."""
    angle = math.sqrt(x * x + y * y + z * z)
    sine = math.sin(angle) / angle if angle > SMALL_ANGLE else 1.0
    half = 2.0 * (math.sin(angle / 2.0) / angle) ** 2 if angle > SMALL_ANGLE else 0.5
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - half * (y * y + z * z), half * x * y - sine * z, half * x * z + sine * y
    out[1, 0], out[1, 1], out[1, 2] = half * x * y + sine * z, 1.0 - half * (x * x + z * z), half * y * z - sine * x
    out[2, 0], out[2, 1], out[2, 2] = half * x * z - sine * y, half * y * z + sine * x, 1.0 - half * (x * x + y * y)


@kernel_part
def _solved(normal: Floats, pull: Floats) -> Floats:
    """Solve for a step along the directions that are determined; see `arrow.pseudo_inverse`."""
    size = len(pull)
    matrix, vectors, scale, out = np.empty((size, size)), np.empty((size, size)), np.empty(size), np.zeros(size)
    for i in range(size):
        scale[i] = math.sqrt(max(normal[i, i], TINY))
    for i in range(size):
        for j in range(size):
            matrix[i, j] = normal[i, j] / (scale[i] * scale[j])
    turn_to_axes(matrix, vectors, size)
    largest = TINY
    for k in range(size):
        largest = max(largest, matrix[k, k])
    for k in range(size):
        if matrix[k, k] > RANK_TOLERANCE * largest:
            along = 0.0
            for i in range(size):
                along += vectors[i, k] * pull[i] / scale[i]
            for i in range(size):
                out[i] += vectors[i, k] * along / (matrix[k, k] * scale[i])
    return out


@kernel_part
def _turn(frame: Floats, start: int, cosine: float, sine: float, out: Floats) -> None:
    """Write a frame turned in the plane of two neighbouring axes: about z or x; both may be the same array."""
    other, still = start + 1, 2 - 2 * start
    for i in range(3):
        x, y = frame[i, start], frame[i, other]
        out[i, start], out[i, other], out[i, still] = cosine * x + sine * y, cosine * y - sine * x, frame[i, still]


@kernel
def relative_vectors(first: Floats, second: Floats) -> Floats:
    """Return the rotation vectors [rad] of first^T second, shape (n, 3).

    Parameters
    ----------
    first : ndarray, shape (m, 3, 3)
        Rotations, repeated as often as m goes into n.
    second : ndarray, shape (n, 3, 3)
        Rotations.
    """
    out, between = np.empty((len(second), 3)), np.empty((3, 3))
    for frame in range(len(second)):
        before = first[frame % len(first)]
        for i in range(3):
            for j in range(3):
                between[i, j] = before[0, i] * second[frame, 0, j] + before[1, i] * second[frame, 1, j]
                between[i, j] += before[2, i] * second[frame, 2, j]
        _write_vector(between, out[frame])
    return out


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
def _write_slopes(in_parent: Floats, first: Floats, both: Floats, n_angles: int, out: Floats) -> None:
    """Write how a turn follows the constants of its kind, then the frame's angles."""
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


@kernel
def alternated(moments: Floats, mean: Floats, starts: Floats, n_rounds: int) -> tuple[Floats, Floats]:
    """Find two axes whose angle hardly changes, one at a time.

    Parameters
    ----------
    moments, mean
        See `universal.best_partners`.
    starts : ndarray, shape (n, 3)
        First guesses of the axis in the child.
    n_rounds : int
        How often each of the two axes is found.

    Returns
    -------
    tuple of ndarray, shapes (n, 3) and (n,)
        The axes in the child before the last round, and the angles' variances after it.
    """
    before, variances = starts.copy(), np.empty(len(starts))
    first, second = np.empty(3), np.empty(3)
    room = np.empty((4, 3, 3))
    for start in range(len(starts)):
        second[:] = starts[start]
        for _ in range(n_rounds):
            before[start] = second
            _write_partner(moments, mean, second, False, room, first)
            variances[start] = _write_partner(moments, mean, first, True, room, second)
    return before, variances


@kernel_part
def _write_partner(moments: Floats, mean: Floats, known: Floats, back: bool, room: Floats, out: Floats) -> float:
    """Write the axis that keeps its angle to a known one best, and return the angle's variance."""
    spread, root, turned, vectors = room[0], room[1], room[2], room[3]
    middle = np.zeros(3)
    for i in range(3):
        for a in range(3):
            middle[i] += (mean[a, i] if back else mean[i, a]) * known[a]
    for i in range(3):
        for j in range(3):
            spread[i, j] = 0.0
            root[i, j] = (1.0 + UNIVERSAL_RIDGE if i == j else 0.0) - middle[i] * middle[j]
            for a in range(3):
                for b in range(3):
                    value = moments[a, i, b, j] if back else moments[i, a, j, b]
                    spread[i, j] += value * known[a] * known[b]
    write_inverse_root(root, turned)
    for i in range(3):
        for j in range(3):
            root[i, j] = turned[i, 0] * spread[0, j] + turned[i, 1] * spread[1, j] + turned[i, 2] * spread[2, j]
    write_times_transposed(root, turned, spread)
    turn_to_axes(spread, vectors, 3)
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
