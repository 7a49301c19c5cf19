"""Where the words beside joints go: where they cover the least of what else is drawn. Numbers only."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats

GAP = 10.0
"""px, from the middle of a joint to the nearest corner or side of its words."""

_SIDES = np.array([[1, 0], [-1, 0], [0, -1], [0, 1], [1, -1], [1, 1], [-1, -1], [-1, 1]], dtype=np.float64)
"""Directions that are tried, the first of equally good ones is taken."""

_SAMPLES = np.linspace(0.0, 1.0, 24)
"""Parts of a line that are looked at."""

_ON_DISC, _ON_WORDS, _ON_LINE = 10.0, 10.0, 1.0
"""What it costs to touch a disc, the words of another joint, or a point of a line."""


def place_words(middles: Floats, sizes: Floats, discs: Floats, radius: float, lines: Floats) -> Floats:
    """Place words beside joints, one after the other.

    Parameters
    ----------
    middles : ndarray, shape (n, 2), px
        Joints.
    sizes : ndarray, shape (n, 2), px
        Width and height of their words; 0 without any.
    discs : ndarray, shape (n_discs, 2), px
        What must not be covered.
    radius : float, px
        Of the discs.
    lines : ndarray, shape (n_lines, 2, 2), px
        What had better not be covered.

    Returns
    -------
    ndarray, shape (n, 2), px
        Middle of the words of each.
    """
    dots = (lines[:, :1] + (lines[:, 1:] - lines[:, :1]) * _SAMPLES[:, np.newaxis]).reshape(-1, 2)
    placed = np.array(middles, dtype=np.float64)
    for index in np.flatnonzero(sizes[:, 0] > 0):
        half = sizes[index] / 2
        tried = middles[index] + _SIDES * (GAP + half)
        costs = _ON_DISC * _touched(tried, half + radius, discs) + _ON_LINE * _touched(tried, half, dots)
        earlier = np.flatnonzero(sizes[:index, 0] > 0)
        for other in earlier:
            costs += _ON_WORDS * _touched(tried, half + sizes[other] / 2, placed[other][np.newaxis])
        placed[index] = tried[int(np.argmin(costs))]
    return placed


def _touched(boxes: Floats, half: Floats, places: Floats) -> Floats:
    """How many places lie in each box, given by middles and half sizes."""
    inside = np.abs(places - boxes[:, np.newaxis]) < half
    return np.asarray(inside.all(axis=2).sum(axis=1), dtype=np.float64)
