"""Distance statistics: which markers keep their distance best, which are alike in place, and which may be one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, pair_lengths
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames

N_MATES = 6
"""Mates of each marker: a point has three coordinates, and some mates may be hidden."""

N_RIVALS = 4
"""Other markers whose places are tried: the most similar ones."""

SAMPLE_FRAMES = 300
"""Frames from which the statistics are taken."""

MOST_SAMPLES = 20_000_000
"""Distances from which the statistics are taken: with very many markers fewer frames are sampled."""

CHUNK_VALUES = 1_000_000
"""Distances held at once: 8 MB per array."""

LEAST_SAMPLES = 20
"""Frames that are sampled in any case."""

LEAST_COMMON = 8
"""Common frames that a distance needs."""

LEAST_SPREAD = 1e-3
"""Of a distance: the least spread, however exact the take."""

TINY_SPREAD = 1e-9
"""mm; keeps the density of distances finite for markers that coincide."""

LOOK_ALIKE = 2.0
"""Root mean square of the standard deviations by which distances must differ, or two markers look alike."""

COMMON_PART = 0.02
"""Part of its frames in which a piece of a marker may be seen together with the rest, because of false points."""


@dataclass(frozen=True, eq=False)
class DistanceStatistics:
    """Median and spread of all distances between markers, and which markers each one is compared with.

    Attributes
    ----------
    distance, spread : ndarray, shape (n_markers, n_markers), mm
        Median and robust standard deviation; NaN where two are never seen together for long enough.
    mates : ndarray of intp, shape (n_markers, n_mates)
        Markers whose distances vary least; -1 = none.
    rivals : ndarray of intp, shape (n_markers, n_rivals)
        Markers with the most similar distances to the mates; -1 = none.
    separation : ndarray, shape (n_markers, n_rivals)
        By how many standard deviations their distances differ, root mean square.
    reach : float, mm
        Largest distance of two markers; a point that belongs to no marker may lie anywhere within it.
    """

    distance: Floats
    spread: Floats
    mates: Ints
    rivals: Ints
    separation: Floats
    reach: float

    def without_pieces(self, original: Ints) -> DistanceStatistics:
        """Return the statistics without rivals that are pieces of the marker itself; `original` as in `look_alikes`."""
        own = (self.rivals >= 0) & (original[self.rivals] == np.arange(len(original))[:, np.newaxis])
        return replace(self, rivals=np.where(own, -1, self.rivals))


def distance_statistics(trajectories: Trajectories) -> DistanceStatistics:
    """Take median and spread of all distances, and find mates and rivals of each marker."""
    n_markers = trajectories.n_markers
    bounded = MOST_SAMPLES // max(1, trajectories.n_markers**2)
    n_samples = min(SAMPLE_FRAMES, max(LEAST_SAMPLES, bounded))
    frames = spread_frames(trajectories.n_frames, n_samples)
    positions = trajectories.positions[frames]
    distance, spread = np.full((2, n_markers, n_markers), np.nan)
    pairs = np.stack(np.triu_indices(n_markers, 1))
    step = max(1, CHUNK_VALUES // max(1, len(positions)))
    for start in range(0, pairs.shape[1], step):
        first, second = pairs[:, start : start + step]
        middle, deviation = _median_and_spread(pair_lengths(positions, first, second))
        distance[first, second] = distance[second, first] = middle
        spread[first, second] = spread[second, first] = deviation
    reach = float(np.nanmax(distance, initial=0.0))
    # Bound spreads from below by half of the median spread of each marker's steadiest distance
    known = ~np.isnan(spread)
    steadiest = np.where(known, spread, np.inf).min(axis=1, initial=np.inf)
    steadiest = steadiest[np.isfinite(steadiest)]
    least = float(np.median(steadiest)) / 2 if len(steadiest) else 0.0
    spread = np.maximum(spread, np.maximum(max(least, TINY_SPREAD), LEAST_SPREAD * distance))
    n_mates, n_rivals = min(N_MATES, n_markers - 1), min(N_RIVALS, n_markers - 1)
    order = np.argsort(np.where(np.isnan(spread), np.inf, spread), axis=1, kind="stable")[:, :n_mates]
    mates = np.where(np.isfinite(np.take_along_axis(spread, order, axis=1)), order, -1)
    rivals = np.full((n_markers, n_rivals), -1, dtype=np.intp)
    separation = np.full((n_markers, n_rivals), np.inf)
    for marker in range(n_markers):
        apart = _separations(marker, mates[marker], distance, spread)
        nearest = np.argsort(apart, kind="stable")[:n_rivals]
        rivals[marker] = np.where(np.isfinite(apart[nearest]), nearest, -1)
        separation[marker] = apart[nearest]
    return DistanceStatistics(distance, spread, mates, rivals, separation, max(reach, TINY_SPREAD))


def _median_and_spread(values: Floats) -> tuple[Floats, Floats]:
    """Median and robust standard deviation of each row without its NaN; NaN for rows with few values."""
    count = (~np.isnan(values)).sum(axis=1)
    rows, place = np.arange(len(values)), np.maximum(count - 1, 0) // 2
    middle = np.sort(values, axis=1)[rows, place]
    off = np.sort(np.abs(values - middle[:, np.newaxis]), axis=1)[rows, place]
    enough = count >= LEAST_COMMON
    return np.where(enough, middle, np.nan), np.where(enough, SIGMA_OF_MEDIAN * off, np.nan)


def _separations(marker: int, mates: Ints, distance: Floats, spread: Floats) -> Floats:
    """Root mean square deviations between the distances of each marker and of one to that one's mates, (n_markers,)."""
    mates = mates[mates >= 0]
    result = np.full(len(distance), np.inf)
    if not len(mates):
        return result
    apart = (distance[:, mates] - distance[marker, mates]) / np.hypot(spread[:, mates], spread[marker, mates])
    known = ~np.isnan(apart)
    squares = np.where(known, apart**2, 0.0).sum(axis=1)
    some = known.any(axis=1)
    result[some] = np.sqrt(squares[some] / known[some].sum(axis=1))
    result[marker] = np.inf
    return result


def look_alikes(statistics: DistanceStatistics, seen: Bools) -> tuple[Ints, tuple[tuple[int, int], ...]]:
    """Find which marker each one is probably a piece of, and which pairs no distance tells apart.

    Parameters
    ----------
    statistics : DistanceStatistics
        Of the markers.
    seen : ndarray of bool, shape (n_frames, n_markers)
        When each marker is seen.

    Returns
    -------
    original : ndarray of intp, shape (n_markers,)
        The marker that lies in the same place, is seen longer, and hardly ever together with this one; -1 = none.
    twins : tuple of (int, int)
        Pairs that are seen together.
    """
    counts = seen.sum(axis=0)
    original = np.full(len(counts), -1, dtype=np.intp)
    twins = set()
    for marker, slot in np.argwhere(statistics.separation < LOOK_ALIKE).tolist():
        other = int(statistics.rivals[marker, slot])
        together = int((seen[:, marker] & seen[:, other]).sum())
        if together > COMMON_PART * min(counts[marker], counts[other]):
            if not _differ(marker, other, statistics):
                twins.add((min(marker, other), max(marker, other)))
        elif (counts[other], -other) > (counts[marker], -marker) and original[marker] < 0:
            original[marker] = other
    return original, tuple(sorted(twins))


def _differ(first: int, second: int, statistics: DistanceStatistics) -> bool:
    """Whether the distance to any third marker would change visibly if two were exchanged."""
    change = np.abs(statistics.distance[first] - statistics.distance[second])
    change /= np.hypot(statistics.spread[first], statistics.spread[second])
    change[[first, second]] = np.nan
    return bool((change > LOOK_ALIKE).any())
