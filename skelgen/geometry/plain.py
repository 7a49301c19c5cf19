"""Moments of points over many frames, and the rotations that follow from them: the NumPy twin of `compiled`."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.quartic import fast_rotations
from skelgen.model.arrays import Bools, Floats

__all__ = ["fast_rotations", "means_in_body", "moments_about", "moments_of"]


def moments_of(source: Floats, target: Floats, seen: Bools) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the moments of two sets of points about their centres, both centres, and how many points are seen.

    Parameters
    ----------
    source : ndarray, shape (1 or n_frames, n_points, 3), mm
        Points in the frame of a body.
    target : ndarray, shape (n_frames, n_points, 3), mm
        The same points in the world.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which count.

    Returns
    -------
    tuple of ndarray
        Shapes (n_frames, 3, 3), (n_frames, 3), (n_frames, 3) and (n_frames,). Centres of no points are NaN.
    """
    weight = seen.astype(np.float64)[..., np.newaxis]
    count = weight.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        filled = np.where(seen[..., np.newaxis], target, 0.0)
        before, after = (source * weight).sum(axis=1) / count, filled.sum(axis=1) / count
    inner = (source - np.nan_to_num(before)[:, np.newaxis]) * weight
    outer = (filled - np.nan_to_num(after)[:, np.newaxis]) * weight
    return outer.swapaxes(1, 2) @ inner, before, after, count[:, 0]


def moments_about(source: Floats, target: Floats, centres: Floats, seen: Bools) -> Floats:
    """Return the moments of two sets of points about centres that coincide, shape (n_frames, 3, 3).

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
    filled = np.where(seen[..., np.newaxis], target - centres[:, np.newaxis], 0.0)
    return filled.swapaxes(1, 2) @ source


def means_in_body(poses: Floats, places: Floats, seen: Bools) -> Floats:
    """Return the mean of each point in the frame of a body, shape (n_points, 3), mm; NaN for points never seen.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, 4, 4)
        world_from_body.
    places : ndarray, shape (n_frames, n_points, 3), mm
        The points in the world.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which count.
    """
    local = np.einsum("fij,fni->fnj", poses[:, :3, :3], places - poses[:, np.newaxis, :3, 3])
    with np.errstate(invalid="ignore", divide="ignore"):
        total = np.where(seen[..., np.newaxis], local, 0.0).sum(axis=0)
        return np.asarray(total / seen.sum(axis=0)[:, np.newaxis])
