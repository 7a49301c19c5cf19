"""How steady distances are but for some of the time, and how far each marker departs from its mates in every frame.

Mates of a marker are those to which its distances are steadiest, on its limb or near it.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from skelgen.geometry.statistics import median_of_known, pair_lengths
from skelgen.model.arrays import Floats, Ints, spread_frames

GROUPING_FRAMES = 400
"""Frames from which limbs are grouped; more do not change the groups."""

KEPT_PART = 0.75
"""Part of a distance's samples, the densest, from which its deviation is computed: the others hold wrong labels."""

TRIMMED_DEVIATION = 0.607
"""Standard deviation of the central three quarters of a standard normal variable."""

LEAST_COMMON = 8
"""Common frames that a distance needs."""

STARTS = 11
"""Places at which the densest part of the samples may begin."""

MATES = 5
"""Markers at the steadiest distances: the middle of what these say does not mind if two of them are wrong."""

FLOOR = 0.5
"""Part of the usual deviation between mates that any has."""

TINY = 1e-6
"""mm."""


def departures(positions: Floats) -> Iterator[tuple[Ints, Floats]]:
    """Yield the mates of one marker after the other, and how far it is from them in every frame, shape (n_frames,).

    That is by how many standard deviations its distances to them are off in their middle; 0 where nothing is seen.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    deviation = trimmed_deviations(positions)
    known = np.where(np.isnan(deviation), np.inf, deviation) + np.diag(np.full(len(deviation), np.inf))
    n_mates = min(MATES, len(known) - 1)
    if n_mates < 1:
        return
    floor = max(FLOOR * float(np.median(known.min(axis=1))), TINY)
    for marker, mates in enumerate(np.argsort(known, axis=1)[:, :n_mates]):
        own, others = np.zeros(n_mates, dtype=np.intp), np.arange(1, n_mates + 1)
        lengths = pair_lengths(positions[:, [marker, *mates]], own, others)
        usual = np.maximum(known[marker, mates], floor)[:, np.newaxis]
        off = np.abs(lengths - median_of_known(lengths.T)[:, np.newaxis]) / usual
        yield mates, np.nan_to_num(median_of_known(off))


def trimmed_deviations(positions: Floats) -> Floats:
    """Return the standard deviations of the densest three quarters of all distances, shape (n_markers, n_markers).

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    shown = positions[spread_frames(len(positions), GROUPING_FRAMES)]
    return _deviations_of(shown.tobytes(), shown.shape).copy()


@lru_cache(maxsize=1)
def _deviations_of(shown: bytes, shape: tuple[int, ...]) -> Floats:
    """The same of these frames, which most repairs leave as they are for the next one."""
    positions, n_markers = np.frombuffer(shown).reshape(shape), shape[1]
    first, second = np.triu_indices(n_markers, 1)
    values = np.sort(pair_lengths(positions, first, second), axis=1)
    count = (~np.isnan(values)).sum(axis=1)
    kept = np.maximum((KEPT_PART * count).astype(np.intp), 1)
    starts = (np.linspace(0, 1, STARTS)[:, np.newaxis] * np.maximum(count - kept, 0)).astype(np.intp)
    rows = np.arange(len(values))
    widths = values[rows, starts + kept - 1] - values[rows, starts]
    start = starts[np.argmin(np.where(np.isnan(widths), np.inf, widths), axis=0), rows]
    index = np.arange(kept.max(initial=1))
    inside = np.minimum(start[:, np.newaxis] + index, values.shape[1] - 1)
    centred = np.take_along_axis(values, inside, axis=1) - values[rows, start][:, np.newaxis]
    centred[index >= kept[:, np.newaxis]] = 0.0
    variance = (centred**2).sum(axis=1) / kept - (centred.sum(axis=1) / kept) ** 2
    result = np.zeros((n_markers, n_markers))
    deviation = np.sqrt(np.maximum(variance, 0.0)) / TRIMMED_DEVIATION
    result[first, second] = result[second, first] = np.where(count >= LEAST_COMMON, deviation, np.nan)
    return result
