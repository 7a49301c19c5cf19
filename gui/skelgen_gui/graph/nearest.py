"""What lies nearest to a place."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats


def nearest_point(points: Floats, at: Floats, most: float) -> int | None:
    """Return the index of the nearest point within a distance, or None.

    Parameters
    ----------
    points : ndarray, shape (n, 2), px
        Places.
    at : ndarray, shape (2,), px
        From where.
    most : float, px
        How far it may be.
    """
    return _nearest(np.linalg.norm(points - at, axis=1), most)


def nearest_line(ends: Floats, at: Floats, most: float) -> int | None:
    """Return the index of the nearest line within a distance, or None; ends of shape (n, 2, 2) [px]."""
    along = ends[:, 1] - ends[:, 0]
    squares = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    parts = np.clip(((at - ends[:, 0]) * along).sum(axis=1) / squares, 0.0, 1.0)
    return _nearest(np.linalg.norm(ends[:, 0] + parts[:, np.newaxis] * along - at, axis=1), most)


def _nearest(distances: Floats, most: float) -> int | None:
    if not len(distances) or distances.min() > most:
        return None
    return int(distances.argmin())
