"""Where three marks of a rigid body may be: places that are as far apart as the marks are on the body."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import contiguous, kernel, kernel_part
from skelgen._kernels.distance_statistics import squared_distance
from skelgen.model.arrays import Floats, Ints


class MarkPattern(NamedTuple):
    """Marks of a body, and which three of them are searched.

    Attributes
    ----------
    distances : ndarray, shape (n_marks, n_marks), mm
        Between marks, on the body.
    limits : ndarray, shape (n_marks, n_marks), mm
        By how much less these may deviate.
    triples : ndarray of intp, shape (n_triples, 3)
        Marks that are searched together.
    """

    distances: Floats
    limits: Floats
    triples: Ints


def matching_triples(pattern: MarkPattern, places: Floats, parts: Ints, most: int) -> tuple[Ints, Ints]:
    """Find all places of each triple of marks.

    Parameters
    ----------
    pattern : MarkPattern
        What is searched.
    places : ndarray, shape (n_places, 3), mm
        Where marks may be.
    parts : ndarray of intp, shape (n_marks, 2)
        First and last place, exclusive, where each mark may be.
    most : int
        Matches of one triple that are kept, the first ones.

    Returns
    -------
    triples : ndarray of intp, shape (n_matches,)
        Row in the pattern's triples.
    matches : ndarray of intp, shape (n_matches, 3)
        Places of the three marks, in the order of the triples, then of the places.
    """
    matches = np.empty((len(pattern.triples), most, 3), dtype=np.intp)
    counts = np.zeros(len(pattern.triples), dtype=np.intp)
    everywhere, own = contiguous(places, parts)
    _write_matches(pattern, everywhere, own, matches, counts)
    return np.repeat(np.arange(len(counts)), counts), matches[np.arange(most) < counts[:, np.newaxis]]


@kernel
def _write_matches(pattern: MarkPattern, places: Floats, parts: Ints, matches: Ints, counts: Ints) -> None:
    for triple in range(len(pattern.triples)):
        counts[triple] = _n_matches(pattern, triple, places, parts, matches)


@kernel_part
def _n_matches(pattern: MarkPattern, triple: int, places: Floats, parts: Ints, matches: Ints) -> int:
    """Write matches of one triple as far as there is room, and return how many there are."""
    one, two, three = pattern.triples[triple, 0], pattern.triples[triple, 1], pattern.triples[triple, 2]
    count = 0
    for first in range(parts[one, 0], parts[one, 1]):
        for second in range(parts[two, 0], parts[two, 1]):
            if not _fits(pattern, one, two, places, first, second):
                continue
            for third in range(parts[three, 0], parts[three, 1]):
                fits = _fits(pattern, one, three, places, first, third)
                if fits and _fits(pattern, two, three, places, second, third):
                    matches[triple, count, 0], matches[triple, count, 1] = first, second
                    matches[triple, count, 2] = third
                    count += 1
                    if count == matches.shape[1]:
                        return count
    return count


@kernel_part
def _fits(pattern: MarkPattern, mark: int, other: int, places: Floats, place: int, other_place: int) -> bool:
    """Whether two places are as far apart as two marks; two marks are never at one place."""
    apart = math.sqrt(squared_distance(places, place, places, other_place))
    return abs(apart - pattern.distances[mark, other]) < pattern.limits[mark, other] and apart > 0.0
