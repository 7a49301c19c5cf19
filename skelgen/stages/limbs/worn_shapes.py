"""The shape of a marker set, or of a take: usual distances of markers and how much they vary, without names or unit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, wraps
from typing import TypeVar

import numpy as np

from skelgen._kernels.distance_statistics import precision_of
from skelgen.geometry.statistics import lengths_of
from skelgen.model.arrays import Floats, Ints, Singles, spread_frames
from skelgen.stages.limbs.hidden_distances import with_hidden
from skelgen.stages.limbs.postures import Postures, above_diagonal, numbers_of_pairs, square_of_pairs

_Found = TypeVar("_Found")

LOOKED_AT = 60
"""Frames."""

LEAST_COMMON = 8
"""Frames that must show both markers."""

MUCH_HIDDEN = 0.25
"""Part of all distances from which those that are hidden are completed: where less is, what is seen says about as much,
and single markers that are seldom seen would be made up."""

SHORTEST, LEAST_MOTION = 5.0, 1.0
"""mm; smaller distances and deviations of these say nothing more."""

OUTLINE = tuple(np.linspace(0.05, 0.95, 12))
"""Quantiles of a marker's distances to all others, by which a search begins."""

OUTLINE_SPREAD = 0.15, 0.5
"""Standard deviations of these, and of those of how much the distances vary."""


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
    def tables(self) -> Singles:
        """Distances and motions, shape (2, n_markers, n_markers)."""
        return np.array([self.distances, self.motions], dtype=np.float32)

    @cached_property
    def precision(self) -> Singles:
        """How much squares of what is off count, if these are standard deviations, (2, n_markers, n_markers)."""
        return precision_of(self.tables)

    def of(self, taken: Ints) -> Shape:
        """Return the shape of some markers.

        Parameters
        ----------
        taken : ndarray of intp
            Which.
        """
        pairs = np.ix_(taken, taken)
        return Shape(self.distances[pairs], self.motions[pairs])

    @cached_property
    def outlines(self) -> Floats:
        """Quantiles of the distances and of the motions of each marker, weighted, shape (n_markers, n_quantiles)."""
        weights = np.sqrt(precision_of(np.array(OUTLINE_SPREAD)) / len(OUTLINE))
        return np.concatenate([w * _quantiles(table) for w, table in zip(weights, self.tables, strict=True)], axis=1)


@dataclass(frozen=True, eq=False)
class WornSet:
    """A marker set, as people wear it.

    Attributes
    ----------
    name : str
        What the set is called.
    mean, spread : Shape
        Of people, and the standard deviations between them.
    ways, left : ndarray, shapes (n_pairs, 2, n_ways) and (2, n_pairs)
        By how much distances and motions of each two markers differ where posture and proportions are one standard
        deviation off in one way, and the standard deviations of what no way explains; pairs as above a diagonal.
    segments : ndarray of intp, shape (n_markers,)
        Number of the segment that carries each marker.
    markers : tuple of str, length n_markers
        What the set calls them.
    parts : tuple of ndarray of intp
        Its markers on the lower and on the upper body: many laboratories wear no others.
    beginnings : ndarray, shape (n_postures, n_ways)
        Postures from which searches may begin, in standard deviations of each way.
    """

    name: str
    mean: Shape
    spread: Shape
    ways: Singles
    left: Floats
    segments: Ints
    markers: tuple[str, ...]
    parts: tuple[Ints, ...] = ()
    beginnings: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    @cached_property
    def postures(self) -> Postures:
        """What postures and proportions do to the distances of its markers."""
        return Postures(self.mean.tables, self.ways, self.left)

    @cached_property
    def halves(self) -> tuple[tuple[Ints, WornSet], ...]:
        """Markers on half a body, and the set that these are."""
        return tuple((taken, self._of(taken)) for taken in self.parts)

    def _of(self, taken: Ints) -> WornSet:
        first, second = above_diagonal(len(taken))
        pairs = numbers_of_pairs(len(self.segments))[taken[first], taken[second]]
        mean, spread = (shape.of(taken) for shape in (self.mean, self.spread))
        names = tuple(self.markers[marker] for marker in taken.tolist())
        usual = Shape(mean.distances - np.nanmedian(mean.distances), mean.motions)
        return WornSet(self.name, usual, spread, self.ways[pairs], self.left[:, pairs], self.segments[taken], names)


def once_for_frames(find: Callable[[Floats], _Found]) -> Callable[[Floats], _Found]:
    """Return a function that asks another for the frames of a take that are looked at, once for all who ask."""

    @lru_cache(maxsize=4)
    def of_frames(shown: bytes, n: tuple[int, ...]) -> _Found:
        return find(np.frombuffer(shown).reshape(n))

    @wraps(find)
    def found(positions: Floats) -> _Found:
        shown = positions[spread_frames(len(positions), LOOKED_AT)]
        return of_frames(shown.tobytes(), shown.shape)

    return found


@once_for_frames
def shape_of(positions: Floats) -> Shape:
    """Return usual distances of markers and how much they vary: sets, places and what these say all ask for it.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    first, second = above_diagonal(positions.shape[1])
    lengths = np.maximum(lengths_of(positions[:, first] - positions[:, second]), SHORTEST)
    seen = np.isfinite(lengths).sum(axis=0)
    known = seen >= min(LEAST_COMMON, len(positions))
    is_much_hidden = seen.sum() < (1.0 - MUCH_HIDDEN) * lengths.size
    lengths, unknown = with_hidden(lengths) if is_much_hidden else (lengths, 0.0)
    lengths = np.sort(lengths, axis=0)  # NaN last
    count = np.maximum((~np.isnan(lengths)).sum(axis=0), 1)
    middle = np.take_along_axis(lengths, (count - 1)[np.newaxis] // 2, axis=0)[0]
    mean = np.nansum(lengths, axis=0) / count
    variance = np.nansum((lengths - mean) ** 2, axis=0) / count + (count - seen) / count * unknown * middle**2
    distances = np.where(known, np.log(middle), np.nan)
    motions = np.log(np.maximum(np.sqrt(variance), LEAST_MOTION)) - distances
    usual = np.nanmedian(distances) if known.any() else 0.0
    return Shape(square_of_pairs(distances - usual), square_of_pairs(motions))


def _quantiles(table: Floats) -> Floats:
    """The quantiles `OUTLINE` of what is known in each row, of rows without anything zeros, shape (n, n_quantiles)."""
    count = (~np.isnan(table)).sum(axis=1, keepdims=True)
    rows = np.sort(np.where(count > 0, table, 0.0), axis=1)  # NaN last
    place = np.array(OUTLINE) * np.maximum(count - 1, 0)
    below = place.astype(np.intp)
    low = np.take_along_axis(rows, below, axis=1)
    high = np.take_along_axis(rows, np.minimum(below + 1, np.maximum(count - 1, 0)), axis=1)
    return np.asarray(low + (high - low) * (place - below))
