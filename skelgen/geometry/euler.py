"""Euler angles that run on smoothly over time, and matrices of them; scipy's, with the neighbouring set of angles.

Every rotation has two sets of angles, (a, b, c) and (a + pi, pi - b, c + pi), and full turns are free. Where b is a
quarter turn, the first and the third axis are one and only a + c or a - c is determined: the gimbal position. Near it,
a and c change fast while the rotation hardly does.
"""

from __future__ import annotations

import warnings

import numpy as np

from skelgen.model.arrays import Bools, Floats


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
        warnings.simplefilter("ignore", UserWarning)  # at the gimbal position the third angle becomes 0, as good as any
        angles = Rotation.from_matrix(rotations).as_euler(axes)
    other = angles * [1.0, -1.0, 1.0] + np.pi
    crossing = _distances(angles[:-1], other[1:]) < _distances(angles[:-1], angles[1:])
    # Two frames that both take their other set are as far apart as before: each crossing changes sets from there on.
    changed: Bools = np.concatenate([[False], np.cumsum(crossing) % 2 == 1])
    return np.asarray(np.unwrap(np.where(changed[:, np.newaxis], other, angles), axis=0))


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
    return np.asarray(np.arccos(np.abs(np.sin(angles[:, 1]))))


def _distances(first: Floats, second: Floats) -> Floats:
    """Sum of squares of the angles between, full turns left out."""
    apart = second - first
    return np.asarray(((apart - 2 * np.pi * np.round(apart / (2 * np.pi))) ** 2).sum(axis=1))
