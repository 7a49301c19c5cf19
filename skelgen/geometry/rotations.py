"""Rotations as matrices, unit quaternions (w x y z), rotation vectors and Euler angles, batched over leading axes.

Every rotation has two sets of Euler angles, (a, b, c) and (a + pi, pi - b, c + pi), and full turns are free. Where b is
a quarter turn, the first and the third axis are one and only a + c or a - c is determined: the gimbal position. Near
it, a and c change fast while the rotation hardly does.
"""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from skelgen._kernels.rotations import SMALL_ANGLE
from skelgen.model.arrays import Bools, Floats, Ints

_NO_LENGTH = 1e-9  # shorter vectors have no direction
_GIMBAL = 1e-6  # rad: nearer to the gimbal position scipy takes the first and the third axis for one


def matrix_from_quaternion(quaternion_wxyz: Floats) -> Floats:
    """Return rotation matrices, shape (..., 3, 3), from unit quaternions, shape (..., 4)."""
    w, x, y, z = np.moveaxis(quaternion_wxyz, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_matrix(matrix: Floats) -> Floats:
    """Return unit quaternions w x y z with w >= 0, shape (..., 4), from rotation matrices, shape (..., 3, 3).

    The largest of the four candidates is computed first, so that nothing is divided by a small number (Shepperd 1978).
    """
    m = np.asarray(matrix, dtype=np.float64)
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    chosen = np.empty((*m.shape[:-2], 4))
    chosen[..., 0] = 1 + trace
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        chosen[..., i + 1] = m[..., k, j] - m[..., j, k]
    others = np.maximum(np.maximum(m[..., 0, 0], m[..., 1, 1]), m[..., 2, 2]) > trace
    if others.any():
        chosen[others] = _by_largest_of_vector(m[others], trace[others])
    chosen /= np.sqrt((chosen * chosen).sum(axis=-1, keepdims=True))
    return np.asarray(np.where(chosen[..., :1] < 0, -chosen, chosen))


def _by_largest_of_vector(m: Floats, trace: Floats) -> Floats:
    """Quaternions times any number, shape (n, 4), of rotations whose largest candidate is not the first."""
    candidates = np.empty((len(m), 3, 4))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        candidates[:, i, 0] = m[:, k, j] - m[:, j, k]
        candidates[:, i, i + 1] = 1 + 2 * m[:, i, i] - trace
        candidates[:, i, j + 1] = candidates[:, j, i + 1] = m[:, i, j] + m[:, j, i]
    best = np.argmax(np.einsum("nii->ni", m), axis=1)
    return np.asarray(candidates[np.arange(len(m)), best])


def matrix_from_vector(vector: Floats) -> Floats:
    """Return rotation matrices, shape (..., 3, 3), from rotation vectors [rad], shape (..., 3) (Rodrigues)."""
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    xx, yy, zz = x * x, y * y, z * z
    angle = np.sqrt(xx + yy + zz)
    safe = np.maximum(angle, SMALL_ANGLE)
    sine = np.where(angle > SMALL_ANGLE, np.sin(safe) / safe, 1.0)
    half = np.where(angle > SMALL_ANGLE, 2 * (np.sin(safe / 2) / safe) ** 2, 0.5)
    xy, xz, yz = half * x * y, half * x * z, half * y * z
    out = np.empty((*angle.shape, 3, 3))
    out[..., 0, 0], out[..., 1, 1], out[..., 2, 2] = 1 - half * (yy + zz), 1 - half * (xx + zz), 1 - half * (xx + yy)
    x, y, z = sine * x, sine * y, sine * z
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = xy - z, xz + y, yz - x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = xy + z, xz - y, yz + x
    return out


def vector_from_matrix(matrix: Floats) -> Floats:
    """Return rotation vectors [rad] with angles in 0 .. pi, shape (..., 3), from rotation matrices."""
    quaternion = quaternion_from_matrix(matrix)
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, quaternion[..., :1])
    factor = np.where(sine > SMALL_ANGLE, angle / np.maximum(sine, SMALL_ANGLE), 2.0)
    return np.asarray(quaternion[..., 1:] * factor)


def unit_vectors(vectors: ArrayLike) -> Floats:
    """Return vectors divided by their lengths, shape (..., 3); those of no length stay zero.

    Parameters
    ----------
    vectors : array_like, shape (..., 3)
        NaN gives NaN.
    """
    array = np.asarray(vectors, dtype=np.float64)
    return np.asarray(array / np.maximum(np.linalg.norm(array, axis=-1, keepdims=True), _NO_LENGTH))


def frame_along(axis: Floats) -> Floats:
    """Return rotations whose last columns are unit axes, shape (..., 3, 3); the other two are any."""
    first = unit_vectors(np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=-1)]))
    return np.stack([first, np.cross(axis, first), axis], axis=-1)


def cross_matrix(vector: Floats) -> Floats:
    """Return the matrices [v]x with [v]x u = v x u, shape (..., 3, 3)."""
    out = np.zeros((*vector.shape[:-1], 3, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def moved_points(pose: Floats, points: Floats) -> Floats:
    """Return points that poses bring into the frames that they lead to.

    Parameters
    ----------
    pose : ndarray, shape (..., 4, 4), mm
        One for each set of points.
    points : ndarray, shape (..., n, 3), mm
        Before.
    """
    return np.asarray(points @ np.swapaxes(pose[..., :3, :3], -1, -2) + pose[..., np.newaxis, :3, 3])


N_POSE = 6
"""Numbers of a pose that changes: a small rotation [rad], then a shift [mm]."""


def slopes_by_motion(arms: Floats) -> Floats:
    """Return how points at the ends of arms move with a small rotation and a shift, shape (..., 3, 6)."""
    return np.concatenate([-cross_matrix(arms), np.broadcast_to(np.eye(3), (*arms.shape, 3))], axis=-1)


def moved_pose(pose: Floats, step: Floats) -> Floats:
    """Return poses after a small turn and a shift.

    Parameters
    ----------
    pose : ndarray, shape (..., 4, 4), mm
        Before.
    step : ndarray, shape (..., 6)
        A turn [rad] about the axes of the frame that the pose leads to, and a shift [mm].
    """
    turn = nearest_rotation(matrix_from_vector(step[..., :3]) @ pose[..., :3, :3])
    return transform_from(turn, pose[..., :3, 3] + step[..., 3:])


def transform_from(rotation: Floats, translation: Floats) -> Floats:
    """Return homogeneous transforms, shape (..., 4, 4), from rotations and translations.

    Parameters
    ----------
    rotation : ndarray, shape (..., 3, 3)
        Rotation matrices.
    translation : ndarray, shape (..., 3), mm
        In the frame that the transforms lead to.
    """
    out = np.zeros((*rotation.shape[:-2], 4, 4))
    out[..., :3, :3] = rotation
    out[..., :3, 3] = translation
    out[..., 3, 3] = 1.0
    return out


def nearest_rotation(matrix: Floats) -> Floats:
    """Return the proper rotations nearest to some matrices in the Frobenius norm, shape (..., 3, 3)."""
    u, _, vt = np.linalg.svd(matrix)
    sign = np.sign(np.linalg.det(u @ vt))
    u = u.copy()
    u[..., :, 2] *= sign[..., np.newaxis]
    return np.asarray(u @ vt)


def fill_rotations(rotations: Floats, known: Bools) -> Floats:
    """Interpolate rotations that are not known: slerp between known ones, hold before the first and after the last.

    Parameters
    ----------
    rotations : ndarray, shape (n_frames, 3, 3)
        Rotation matrices; entries that are not known are ignored.
    known : ndarray of bool, shape (n_frames,)
        Which are known; with none, all become the identity.
    """
    if known.all():
        return rotations
    if not known.any():
        return np.tile(np.eye(3), (len(rotations), 1, 1))
    missing = np.flatnonzero(~known)
    before, after, part = (one[missing] for one in _gap_neighbours(known))
    turn = vector_from_matrix(rotations[before].swapaxes(1, 2) @ rotations[after])
    filled = rotations.copy()
    filled[missing] = rotations[before] @ matrix_from_vector(turn * part[:, np.newaxis])
    return filled


def fill_vectors(vectors: Floats, known: Bools) -> Floats:
    """Interpolate rows that are not known linearly, held at the ends.

    Parameters
    ----------
    vectors : ndarray, shape (n_frames, ...)
        In any unit; rows that are not known are ignored.
    known : ndarray of bool, shape (n_frames,)
        Which are known; with none, all become 0.
    """
    if known.all():
        return vectors
    if not known.any():
        return np.zeros_like(vectors)
    before, after, part = _gap_neighbours(known)
    weight = part.reshape(-1, *([1] * (vectors.ndim - 1)))
    filled = (1 - weight) * vectors[before] + weight * vectors[after]
    return np.asarray(np.where(known.reshape(weight.shape), vectors, filled))


def _gap_neighbours(known: Bools) -> tuple[Ints, Ints, Floats]:
    """For each frame: the last known frame before or at it, the next one after or at it, and the part of the way.

    At the ends both neighbours are the nearest known frame and the part is 0.
    """
    frames = np.arange(len(known))
    indices = np.flatnonzero(known)
    position = np.searchsorted(indices, frames, side="right")
    before = indices[np.clip(position - 1, 0, len(indices) - 1)]
    after = indices[np.clip(np.searchsorted(indices, frames, side="left"), 0, len(indices) - 1)]
    span = np.maximum(after - before, 1)
    return before, after, np.clip((frames - before) / span, 0.0, 1.0) * (after > before)


def euler_angles(axes: str, rotations: Floats) -> Floats:
    """Return angles about three different axes in turn that change as little as possible from frame to frame.

    The first frame has its second angle within a quarter turn of 0; each later one takes the set that is nearer to that
    of the frame before, so that programs which draw curves through the angles do not spin.

    Parameters
    ----------
    axes : str
        Each of ``XYZ`` once, the leftmost factor first: R = Rz Rx Ry for ``ZXY``.
    rotations : ndarray, shape (n_frames, 3, 3)
        Proper rotations.

    Returns
    -------
    ndarray, shape (n_frames, 3), rad
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - scipy is slow to load

    if len(rotations) == 0:
        return np.empty((0, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of the gimbal position
        angles = Rotation.from_quat(np.roll(quaternion_from_matrix(rotations), -1, axis=-1)).as_euler(axes)
    locked = gimbal_distance(angles) < _GIMBAL
    angles[locked] = _angles_at_gimbal(axes, rotations[locked])
    other = angles * [1.0, -1.0, 1.0] + np.pi
    crossing = _distances(angles[:-1], other[1:]) < _distances(angles[:-1], angles[1:])
    # Two frames that both take their other set are as far apart as before: each crossing changes sets from there on.
    changed: Bools = np.concatenate([[False], np.cumsum(crossing) % 2 == 1])
    return np.asarray(np.unwrap(np.where(changed[:, np.newaxis], other, angles), axis=0))


def _angles_at_gimbal(axes: str, rotations: Floats) -> Floats:
    """Angles about three axes of rotations at the gimbal position: the third is that of what the first leaves."""
    first, second, third = ("XYZ".index(axis) for axis in axes)
    sign = 1.0 if (second - first) % 3 == 1 else -1.0
    across, along = -sign * rotations[:, second, third], rotations[:, third, third]
    angle = np.arctan2(across, along)
    cosine, sine = np.cos(angle)[:, np.newaxis], sign * np.sin(angle)[:, np.newaxis]
    left = cosine * rotations[:, second] + sine * rotations[:, third]
    tilt = np.arctan2(sign * rotations[:, first, third], np.hypot(across, along))
    return np.stack([angle, tilt, np.arctan2(sign * left[:, first], left[:, second])], axis=1)


def matrix_from_euler(axes: str, angles: Floats) -> Floats:
    """Return the product of rotations about different axes in turn.

    Parameters
    ----------
    axes : str
        Some of ``XYZ``, the leftmost factor first; empty for the identity.
    angles : ndarray, shape (n, len(axes)), rad

    Returns
    -------
    ndarray, shape (n, 3, 3)
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - scipy is slow to load

    if not axes:
        return np.tile(np.eye(3), (len(angles), 1, 1))
    return np.asarray(Rotation.from_euler(axes, angles).as_matrix())


def gimbal_distance(angles: Floats) -> Floats:
    """Return how far [rad] rotations are from the gimbal position, shape (n_frames,), given their `euler_angles`."""
    return np.asarray(np.arcsin(np.abs(np.cos(angles[:, 1]))))


def _distances(first: Floats, second: Floats) -> Floats:
    """Sum of squares of the angles between, full turns left out."""
    apart = second - first
    return np.asarray(((apart - 2 * np.pi * np.round(apart / (2 * np.pi))) ** 2).sum(axis=1))
