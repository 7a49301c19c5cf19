"""Which parts of an image the board has been in: where it never was, the lens is a guess."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skelgen.model.arrays import Floats, Ints

PARTS = (
    ("upper left", "upper middle", "upper right"),
    ("middle left", "centre", "middle right"),
    ("lower left", "lower middle", "lower right"),
)
"""Names of the ninths of an image."""

LEAST_CORNERS = 4
"""Corners in a part from which on it counts as covered: fewer may come from one board's edge."""


def coverage(corners: Sequence[Floats], size: tuple[int, int], parts: tuple[int, int] = (3, 3)) -> Ints:
    """Return how many corners of all views lie in each part of the image, shape (rows, columns).

    Parameters
    ----------
    corners : sequence of ndarray, shape (n_corners, 2), px
        One for each view.
    size : tuple of int, px
        Width and height of the image.
    parts : tuple of int
        Rows and columns of parts.
    """
    every = np.concatenate([np.empty((0, 2)), *corners])
    across = np.clip(every[:, 0] / size[0] * parts[1], 0, parts[1] - 1).astype(np.intp)
    down = np.clip(every[:, 1] / size[1] * parts[0], 0, parts[0] - 1).astype(np.intp)
    counts = np.zeros(parts, dtype=np.intp)
    np.add.at(counts, (down, across), 1)
    return counts


def uncovered(corners: Sequence[Floats], size: tuple[int, int]) -> list[str]:
    """Return the names of the ninths of an image where the board has never been."""
    counts = coverage(corners, size)
    return [
        name
        for row, names in enumerate(PARTS)
        for column, name in enumerate(names)
        if counts[row, column] < LEAST_CORNERS
    ]
