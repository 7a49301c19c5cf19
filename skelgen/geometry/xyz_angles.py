"""Rotations as three turns, about x, then about the turned y, then about the twice turned z: R = Rx(a) Ry(b) Rz(c).

Where b is a quarter turn, x and z are one axis and only a + c or a - c is known: the gimbal position. Near it, a and c
change fast while the rotation hardly does.
"""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Bools, Floats


def xyz_angles(rotations: Floats) -> Floats:
    """Return the three angles [rad] of successive rotations without jumps, shape (n_frames, 3).

    Every rotation has two sets of angles, (a, b, c) and (a + pi, pi - b, c + pi), and full turns are free: of these the
    set nearest to that of the frame before is taken. The first frame has b within a quarter turn of 0.

    Parameters
    ----------
    rotations : ndarray, shape (n_frames, 3, 3)
        Rotation matrices.
    """
    angles = _principal(rotations)
    other = angles * [1.0, -1.0, 1.0] + np.pi
    crossing = _distances(angles[:-1], other[1:]) < _distances(angles[:-1], angles[1:])
    # Two frames that both take their other set are as far apart as before: each crossing changes sets from there on.
    changed: Bools = np.concatenate([np.zeros(min(1, len(angles)), dtype=bool), np.cumsum(crossing) % 2 == 1])
    return np.asarray(np.unwrap(np.where(changed[:, np.newaxis], other, angles), axis=0))


def gimbal_distance(angles: Floats) -> Floats:
    """Return how far [rad] rotations are from the gimbal position, shape (n_frames,), given their `xyz_angles`."""
    return np.asarray(np.arccos(np.abs(np.sin(angles[:, 1]))))


def _principal(rotations: Floats) -> Floats:
    first = np.arctan2(-rotations[:, 1, 2], rotations[:, 2, 2])
    sine, cosine = np.sin(first), np.cos(first)
    # What is left of the rotation without the first turn is Ry(b) Rz(c), even where the first is hardly known.
    second = np.arctan2(rotations[:, 0, 2], cosine * rotations[:, 2, 2] - sine * rotations[:, 1, 2])
    third = np.arctan2(
        cosine * rotations[:, 1, 0] + sine * rotations[:, 2, 0], cosine * rotations[:, 1, 1] + sine * rotations[:, 2, 1]
    )
    return np.stack([first, second, third], axis=1)


def _distances(first: Floats, second: Floats) -> Floats:
    """Sum of squares of the angles between, full turns left out."""
    apart = second - first
    return np.asarray(((apart - 2 * np.pi * np.round(apart / (2 * np.pi))) ** 2).sum(axis=1))
