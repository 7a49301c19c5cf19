"""Absolute orientation: the rigid motion that brings one set of points onto another, batched over frames.

Two closed forms of the same least squares problem: the unit quaternion as the eigenvector of Horn's symmetric matrix N
(Horn 1987; Schönauer 2007, 3.7; by the roots of the quartic, and by an eigensolver where these are not sure), and the
singular value decomposition (Umeyama 1991). Neither ever returns a reflection.
"""

from collections.abc import Callable

import numpy as np

from skelgen._kernels import absolute_orientation as kernels
from skelgen._kernels import contiguous
from skelgen.geometry.rotations import matrix_from_quaternion, nearest_rotation, transform_from
from skelgen.model.arrays import Bools, Floats

Rotator = Callable[[Floats], Floats]


def rotation_by_quaternion(moments: Floats) -> Floats:
    """Return the rotations R that maximise trace(R^T M), by Horn's quaternion.

    Parameters
    ----------
    moments : ndarray, shape (..., 3, 3)
        M = sum of (target point) (source point)^T.
    """
    flat = moments.reshape(-1, 3, 3)
    turns, sure = kernels.fast_rotations(*contiguous(flat))
    if not sure.all():
        turns[~sure] = _by_eigenvectors(flat[~sure])
    return np.asarray(turns.reshape(moments.shape))


def _by_eigenvectors(moments: Floats) -> Floats:
    m = np.swapaxes(moments, -1, -2)
    n = np.empty((len(m), 4, 4))
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    n[:, 0, 0] = trace
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        n[:, i + 1, i + 1] = 2 * m[:, i, i] - trace
        n[:, 0, i + 1] = n[:, i + 1, 0] = m[:, j, k] - m[:, k, j]
        n[:, i + 1, j + 1] = n[:, j + 1, i + 1] = m[:, i, j] + m[:, j, i]
    _, vectors = np.linalg.eigh(n)
    return matrix_from_quaternion(vectors[..., -1])


def rotation_by_svd(moments: Floats) -> Floats:
    """Return the rotations R that maximise trace(R^T M), by the singular value decomposition.

    Parameters
    ----------
    moments : ndarray, shape (..., 3, 3)
        As for `rotation_by_quaternion`.
    """
    return nearest_rotation(moments)


ROTATORS: dict[str, Rotator] = {"horn": rotation_by_quaternion, "umeyama": rotation_by_svd}
"""The two closed forms by name."""


def fit_transform(source: Floats, target: Floats, seen: Bools, rotator: Rotator = rotation_by_quaternion) -> Floats:
    """Return the rigid transforms that best bring `source` onto `target` in the least squares sense.

    Parameters
    ----------
    source : ndarray, shape (n_points, 3) or (..., n_points, 3), mm
        Points in the frame of the body.
    target : ndarray, shape (..., n_points, 3), mm
        The same points in the world; unseen ones are ignored.
    seen : ndarray of bool, shape (..., n_points)
        Which points count. With fewer than three that are not on one line the rotation is one of many.
    rotator : callable
        `rotation_by_quaternion` or `rotation_by_svd`.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        target_from_source; NaN where no point is seen.
    """
    shape = seen.shape
    flat = seen.reshape(-1, shape[-1])
    source, target = (np.reshape(one, (-1, shape[-1], 3)) for one in (source, target))
    moments, before, after, count = kernels.moments_of(*contiguous(source, target, flat))
    rotation = rotator(moments)
    transform = transform_from(rotation, after - (rotation @ before[..., np.newaxis])[..., 0])
    transform[count == 0] = np.nan
    return transform.reshape(*shape[:-1], 4, 4)


def moments_about(source: Floats, target: Floats, centres: Floats, seen: Bools) -> Floats:
    """Return the moments of two sets of points about given centres, for a `Rotator`, shape (n_frames, 3, 3).

    Parameters
    ----------
    source : ndarray, shape (n_points, 3), mm
        Points from the centre, in the frame of a body.
    target : ndarray, shape (n_frames, n_points, 3), mm
        The same points in the world.
    centres : ndarray, shape (n_frames, 3), mm
        Where the centre is in the world.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which points count.
    """
    return np.asarray(kernels.moments_about(*contiguous(source, target, centres, seen)))


def means_in_body(poses: Floats, places: Floats, seen: Bools) -> Floats:
    """Return the mean of each point in the frame of a body, shape (n_points, 3), mm; NaN for points never seen.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, 4, 4), mm
        world_from_body.
    places : ndarray, shape (n_frames, n_points, 3), mm
        The points in the world.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which count.
    """
    return np.asarray(kernels.means_in_body(*contiguous(poses, places, seen)))
