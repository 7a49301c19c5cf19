"""Angles about three axes in turn, smooth over time, and matrices of them."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model.arrays import Bools, Floats

_TURN = 2 * np.pi


def zxy_from_matrix(rotations: Floats) -> Floats:
    """Return angles [rad] z, x, y with R = Rz Rx Ry that change as little as can be from frame to frame.

    Two triples make every rotation; the second one is taken where it lies nearer to the frame before, and whole turns
    are added, so that programs which draw curves through the angles do not spin. Where x is a right angle, z and y
    turn about one axis; y is found after z, so that the product is R there, too.

    Parameters
    ----------
    rotations : ndarray, shape (n_frames, ..., 3, 3)
        Proper rotations.

    Returns
    -------
    ndarray, shape (n_frames, ..., 3), rad
    """
    z = np.arctan2(-rotations[..., 0, 1], rotations[..., 1, 1])
    x = np.arctan2(rotations[..., 2, 1], np.hypot(rotations[..., 0, 1], rotations[..., 1, 1]))
    cosine, sine = np.cos(z)[..., np.newaxis], np.sin(z)[..., np.newaxis]
    row = cosine * rotations[..., 0, :] + sine * rotations[..., 1, :]  # of Rx Ry: cos y, 0, sin y
    angles = np.stack([z, x, np.arctan2(row[..., 2], row[..., 0])], axis=-1)
    turned = _other(angles)
    other = np.concatenate([np.zeros((1, *z.shape[1:]), dtype=np.bool_), _is_nearer(angles, turned)])
    chosen = np.where((np.cumsum(other, axis=0) % 2 == 1)[..., np.newaxis], turned, angles)
    return np.asarray(np.unwrap(chosen, axis=0))


def matrix_from_turns(axes: str, angles: Floats) -> Floats:
    """Return the product of rotations about axes in turn, e.g. Rz Rx Ry for ``zxy``.

    Parameters
    ----------
    axes : str
        Any of ``xyz``, the leftmost factor first; empty for the identity.
    angles : ndarray, shape (..., len(axes)), rad

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    product = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    for index, axis in enumerate(axes):
        product = product @ matrix_from_vector(angles[..., index, np.newaxis] * np.eye(3)["xyz".index(axis)])
    return np.asarray(product)


def _other(angles: Floats) -> Floats:
    """The other triple that makes the same rotation."""
    return np.asarray(np.stack([angles[..., 0] + np.pi, np.pi - angles[..., 1], angles[..., 2] + np.pi], axis=-1))


def _is_nearer(angles: Floats, turned: Floats) -> Bools:
    """Whether from each frame to the next the way to the other kind of triple is the shorter one, whole turns apart."""
    return np.asarray(_way(angles[:-1], turned[1:]) < _way(angles[:-1], angles[1:]))


def _way(first: Floats, second: Floats) -> Floats:
    apart = second - first
    return np.asarray(np.abs(apart - _TURN * np.rint(apart / _TURN)).sum(axis=-1))
