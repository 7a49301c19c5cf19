"""Middle and spread that a few wild values do not spoil, and the distances they are taken of."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints

SORTED_AT_ONCE = 1_000_000
"""Distances that are sorted at once: 8 MB."""

MOST_PLACES = 4
"""Places up to which a part of the order costs less than all of it."""

FEW_ROWS = 64
"""Rows up to which all of the order costs less than to tell the places."""

FARTHEST = 0.95
"""Quantile of the distance of two markers that counts as their largest: labels may jump in the other frames."""

LEAST_COMMON = 8
"""Frames that must show both markers of a pair."""

SIGMA_OF_MEDIAN = 1.4826
"""Standard deviation of normal numbers with a median absolute deviation of 1."""


def median_of_known(values: Floats) -> Floats:
    """Return the median of each column without its NaN, shape (n_columns,): `numpy.nanmedian`, many times as fast.

    Parameters
    ----------
    values : ndarray, shape (n_rows, n_columns)
        NaN where unknown. Columns without any value give NaN.
    """
    ordered = np.array(values.T, order="C")
    count = values.shape[0] - np.isnan(ordered).sum(axis=1)
    lower, upper = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, max(len(values) - 1, 0))
    places = np.unique([lower, upper]) if len(values) > FEW_ROWS else ()
    if 0 < len(places) <= MOST_PLACES:
        ordered.partition(places, axis=1)
    else:
        ordered.sort(axis=1)
    columns = np.arange(len(ordered))
    return np.asarray((ordered[columns, lower] + ordered[columns, upper]) / 2)


def mean_of_known(values: Floats) -> Floats:
    """Return the mean over the rows without NaN, shape (...); 0 where nothing is known, unlike `numpy.nanmean`.

    Parameters
    ----------
    values : ndarray, shape (n_rows, ...)
        NaN where unknown.
    """
    known = ~np.isnan(values)
    return np.asarray(np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))


def median_and_deviation(rows: Floats) -> tuple[Floats, Floats, Ints]:
    """Return median and robust standard deviation of each row without its NaN; of two middle values, the lower one.

    Parameters
    ----------
    rows : ndarray, shape (n_rows, n_values)
        NaN where unknown.

    Returns
    -------
    median, deviation : ndarray, shape (n_rows,)
        The deviation is that of normal numbers with the same median absolute deviation; NaN without any value.
    n_known : ndarray of intp, shape (n_rows,)
        Values that are known.
    """
    n_known = (~np.isnan(rows)).sum(axis=1)
    index, place = np.arange(len(rows)), np.maximum(n_known - 1, 0) // 2
    middle = np.sort(rows, axis=1)[index, place]
    away = np.sort(np.abs(rows - middle[:, np.newaxis]), axis=1)[index, place]
    return middle, SIGMA_OF_MEDIAN * away, n_known


def quantile_of(values: Floats, part: float) -> float:
    """Return what a part of some numbers does not exceed, as `numpy.quantile` does, many times as fast.

    Parameters
    ----------
    values : ndarray, shape (n,)
        At least one, none NaN.
    part : float
        Between 0 and 1.
    """
    place = part * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    ordered = np.partition(values, (below, above))
    low, high, way = float(ordered[below]), float(ordered[above]), place - below
    return low + (high - low) * way if way < 0.5 else high - (high - low) * (1 - way)


def lengths_of(vectors: Floats) -> Floats:
    """Return the lengths of vectors, shape (...): `numpy.linalg.norm` of the last axis, many times as fast.

    Parameters
    ----------
    vectors : ndarray, shape (..., 3)
        NaN gives NaN.
    """
    x, y, z = np.moveaxis(vectors, -1, 0)
    squares = np.asarray(x * x)
    squares += y * y
    squares += z * z
    return np.asarray(np.sqrt(squares))


def spread_of_markers(errors: Floats) -> Floats:
    """Return the root mean square coordinate of the errors of each marker [mm], NaN where it is never seen.

    Parameters
    ----------
    errors : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    seen = ~np.isnan(errors[:, :, 0])
    squares = np.where(seen[..., np.newaxis], errors, 0.0) ** 2
    spread = np.sqrt(squares.sum(axis=(0, 2)) / np.maximum(3 * seen.sum(axis=0), 1))
    return np.where(seen.any(axis=0), spread, np.nan)


def pair_lengths(positions: Floats, first: Ints, second: Ints) -> Floats:
    """Return the distances of pairs of markers [mm], shape (n_pairs, n_frames): a row per pair, for sorting.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    first, second : ndarray of intp, shape (n_pairs,)
        Indices of markers.

    Examples
    --------
    >>> pair_lengths(np.array([[[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]]), np.array([0]), np.array([1]))
    array([[5.]])
    """
    squares = np.zeros((len(first), len(positions)))
    for coordinate in np.ascontiguousarray(positions.transpose(2, 1, 0)):
        away = coordinate[first] - coordinate[second]
        squares += away * away
    return np.sqrt(squares, out=squares)


def sorted_pair_lengths(positions: Floats, first: Ints, second: Ints) -> Iterator[tuple[slice, Floats]]:
    """Sort the distances of pairs of markers over all frames, some pairs after the other.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    first, second : ndarray of intp, shape (n_pairs,)
        Indices of markers.

    Yields
    ------
    part : slice
        Which pairs.
    lengths : ndarray, shape (n_frames, n_part), mm
        Their distances, rising down each column; NaN last.
    """
    step = max(1, SORTED_AT_ONCE // max(1, len(positions)))
    for start in range(0, len(first), step):
        part = slice(start, start + step)
        yield part, np.ascontiguousarray(np.sort(pair_lengths(positions, first[part], second[part]), axis=1).T)


@dataclass(frozen=True, eq=False)
class PairDistances:
    """How far the two markers of each pair are from each other over the frames of a take.

    Attributes
    ----------
    n_common : ndarray of intp, shape (n_pairs,)
        Frames that show both.
    largest : ndarray, shape (n_pairs,), mm
        Distance below which they usually stay; NaN where no frame shows both.
    deviation : ndarray, shape (n_pairs,), mm
        Standard deviation of their distance, as it were if all frames showed both: markers seen together in few frames
        had little time to move.
    mean : ndarray, shape (n_pairs,), mm
        Mean distance; 0 where no frame shows both.
    """

    n_common: Ints
    largest: Floats
    deviation: Floats
    mean: Floats

    @property
    def is_known(self) -> Bools:
        """Return which pairs are seen together long enough, shape (n_pairs,)."""
        return np.asarray(self.n_common >= LEAST_COMMON)


def pair_distances(
    positions: Floats,
    first: Ints,
    second: Ints,
    within: tuple[float, float] = (0.0, FARTHEST),
    *,
    method: Literal["lower", "nearest"] = "lower",
    clipped: bool = False,
) -> PairDistances:
    """Describe the distance of each pair of markers over all frames.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    first, second : ndarray of intp, shape (n_pairs,)
        Indices of markers.
    within : tuple of float
        Quantiles of the distance that count as its least and its largest.
    method : {"lower", "nearest"}
        Which frame has a quantile that lies between two, as for `numpy.quantile`.
    clipped : bool
        Whether mean and deviation are those of distances clipped to the two quantiles.

    Examples
    --------
    >>> positions = np.array([[[0.0, 0.0, 0.0], [gap, 0.0, 0.0]] for gap in (3.0, 5.0)])
    >>> pair_distances(positions, np.array([0]), np.array([1]), within=(0.0, 1.0)).largest
    array([5.])
    """
    n_common = np.zeros(len(first), dtype=np.intp)
    largest, deviation, mean = np.empty((3, len(first)))
    whole = np.floor if method == "lower" else np.rint
    for part, gaps in sorted_pair_lengths(positions, first, second):
        n_seen = (~np.isnan(gaps)).sum(axis=0)
        count, columns = np.maximum(n_seen, 1), np.arange(gaps.shape[1])
        least, most = (gaps[whole(share * (count - 1)).astype(np.intp), columns] for share in within)
        kept = np.clip(gaps, least, most) if clipped else gaps
        middle = np.nansum(kept, axis=0) / count
        squares = np.nansum((kept - middle) ** 2, axis=0) / count
        n_common[part], largest[part], mean[part] = n_seen, most, middle
        deviation[part] = np.sqrt(squares * (len(positions) / count))
    return PairDistances(n_common, largest, deviation, mean)
