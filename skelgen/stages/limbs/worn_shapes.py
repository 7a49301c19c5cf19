"""The shape of a marker set, or of a take: usual distances of markers and how much they vary, without names or unit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.model.arrays import Floats, Ints, spread_frames

LOOKED_AT = 60
"""Frames."""

LEAST_COMMON = 8
"""Frames that must show both markers."""

SHORTEST, LEAST_MOTION = 5.0, 1.0
"""mm; smaller distances and deviations of these say nothing more."""

OUTLINE = tuple(np.linspace(0.05, 0.95, 12))
"""Quantiles of a marker's distances to all others, by which a search begins."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Of a set, or of a take.

    Attributes
    ----------
    distances, motions : ndarray, shape (n_markers, n_markers)
        Logarithms of the usual distances over their median, and of their deviations over them; NaN where unknown.
    """

    distances: Floats
    motions: Floats

    @cached_property
    def tables(self) -> Floats:
        """Distances and motions, shape (2, n_markers, n_markers)."""
        return np.stack([self.distances, self.motions]).astype(np.float64, copy=False)

    @cached_property
    def outlines(self) -> tuple[Floats, Floats]:
        """Quantiles of the distances and of the motions of each marker, shapes (n_markers, n_quantiles)."""
        return _quantiles(self.distances), _quantiles(self.motions)


@dataclass(frozen=True, eq=False)
class WornSet:
    """A marker set, as people wear it.

    Attributes
    ----------
    name : str
        What the set is called.
    mean, spread : Shape
        Of people, and the standard deviations between them.
    segments : ndarray of intp, shape (n_markers,)
        Number of the segment that carries each marker.
    markers : tuple of str, length n_markers
        What the set calls them.
    halves : tuple of tuple of ndarray of intp and WornSet
        Its markers on the lower and on the upper body, and how these look alone: many laboratories wear no others.
    """

    name: str
    mean: Shape
    spread: Shape
    segments: Ints
    markers: tuple[str, ...]
    halves: tuple[tuple[Ints, WornSet], ...] = ()


def shape_of(positions: Floats) -> Shape:
    """Return usual distances of markers and how much they vary.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    shown = positions[spread_frames(len(positions), LOOKED_AT)]
    gaps = np.sort(np.linalg.norm(shown[:, :, np.newaxis] - shown[:, np.newaxis], axis=3), axis=0)  # NaN last
    count = (~np.isnan(gaps)).sum(axis=0)
    middle = np.take_along_axis(gaps, np.maximum(count - 1, 0)[np.newaxis] // 2, axis=0)[0]
    mean = np.nansum(gaps, axis=0) / np.maximum(count, 1)
    deviation = np.sqrt(np.nansum((gaps - mean) ** 2, axis=0) / np.maximum(count, 1))
    known = (count >= min(LEAST_COMMON, len(shown))) & ~np.eye(len(count), dtype=np.bool_)
    distances = np.where(known, np.log(np.maximum(middle, SHORTEST)), np.nan)
    motions = np.log(np.maximum(deviation, LEAST_MOTION)) - distances
    return Shape(distances - (np.nanmedian(distances) if known.any() else 0.0), motions)


def _quantiles(table: Floats) -> Floats:
    """The quantiles `OUTLINE` of what is known in each row, of rows without anything zeros, shape (n, n_quantiles)."""
    count = (~np.isnan(table)).sum(axis=1, keepdims=True)
    rows = np.sort(np.where(count > 0, table, 0.0), axis=1)  # NaN last
    place = np.array(OUTLINE) * np.maximum(count - 1, 0)
    below = place.astype(np.intp)
    low = np.take_along_axis(rows, below, axis=1)
    high = np.take_along_axis(rows, np.minimum(below + 1, np.maximum(count - 1, 0)), axis=1)
    return np.asarray(low + (high - low) * (place - below))
