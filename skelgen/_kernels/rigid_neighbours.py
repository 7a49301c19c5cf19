"""Distances between markers that arrive frame by frame: running means and variances, and the most rigid neighbours."""

from __future__ import annotations

import math
from typing import NamedTuple

from skelgen._kernels import kernel, kernel_part
from skelgen.model.arrays import Floats, Ints

PRIOR_SAMPLES = 20.0
"""Weight of the prior variance of a distance, in samples: after fewer a distance is not known to be rigid."""

PRIOR_SHARE = 0.1
"""Prior deviation of a distance, as a part of it: that of near markers across a joint."""

LEAST_COMMON = 3
"""Samples that a distance needs."""

LEAST_NEIGHBOURS = 3
"""Fewer do not fix a rotation."""


class DistanceTables(NamedTuple):
    """What is known of the distances between markers in numbered slots.

    Attributes
    ----------
    common : ndarray, shape (n_slots, n_slots)
        Samples in which two markers were seen together.
    mean, variance : ndarray, shape (n_slots, n_slots), mm and mm^2
        Of their distance.
    """

    common: Floats
    mean: Floats
    variance: Floats


class Neighbours(NamedTuple):
    """The most rigid visible neighbours of some markers.

    Attributes
    ----------
    slots : ndarray of intp, shape (n, 1 + n_neighbours)
        Slot of each marker, and those of its neighbours.
    order : ndarray of intp, shape (n, n_neighbours)
        Which of the visible markers they are, the most rigid first; -1 where there are fewer.
    deviations : ndarray, shape (n, n_neighbours), mm
        Standard deviations of their distances; infinite where there are fewer.
    means : ndarray, shape (n, n_neighbours), mm
        Mean distances.
    """

    slots: Ints
    order: Ints
    deviations: Floats
    means: Floats


@kernel
def learn_distances(tables: DistanceTables, slots: Ints, positions: Floats, window: int) -> None:
    """Add the distances between the markers of a frame to their running means and variances.

    Parameters
    ----------
    tables : DistanceTables
        Are updated.
    slots : ndarray of intp, shape (n,)
        The markers, each once.
    positions : ndarray, shape (n, 3), mm
        Where they are.
    window : int
        Samples over which is averaged.
    """
    for one in range(len(slots)):
        for other in range(len(slots)):
            row, column = slots[one], slots[other]
            common = tables.common[row, column] + 1.0
            step = 1.0 / min(common, window)
            surprise = _distance(positions, one, positions, other) - tables.mean[row, column]
            variance = (1.0 - step) * (tables.variance[row, column] + step * surprise**2)
            tables.common[row, column] = common
            tables.mean[row, column] += step * surprise
            tables.variance[row, column] = variance


@kernel
def write_deviations(
    tables: DistanceTables, rows: Ints, columns: Ints, window: int, noise: float, deviations: Floats
) -> None:
    """Write the standard deviations of distances.

    Parameters
    ----------
    tables : DistanceTables
        What is known.
    rows, columns : ndarray of intp, shapes (n_rows,) and (n_columns,)
        Slots of the markers of both sides.
    window : int
        Samples over which is averaged.
    noise : float, mm
        Added to all, as a deviation of its own.
    deviations : ndarray, shape (n_rows, n_columns), mm
        Receives them, infinite where too little is known.
    """
    for row in range(len(rows)):
        for column in range(len(columns)):
            deviations[row, column] = _deviation(tables, rows[row], columns[column], window, noise)


@kernel
def find_neighbours(
    tables: DistanceTables, slots: Ints, visible: Ints, window: int, noise: float, found: Neighbours
) -> None:
    """Find the most rigid visible neighbours of markers, of equally rigid ones the first.

    Parameters
    ----------
    tables : DistanceTables
        What is known.
    slots, visible : ndarray of intp
        The markers, and those that may be their neighbours; none is its own.
    window : int
        Samples over which is averaged.
    noise : float, mm
        Added to all deviations, as one of its own.
    found : Neighbours
        Receives them; what it held is overwritten.
    """
    for marker in range(len(slots)):
        found.slots[marker, 0] = slots[marker]
        for place in range(found.order.shape[1]):
            found.slots[marker, 1 + place] = found.order[marker, place] = -1
            found.deviations[marker, place], found.means[marker, place] = math.inf, 0.0
        for other in range(len(visible)):
            if visible[other] != slots[marker]:
                deviation = _deviation(tables, slots[marker], visible[other], window, noise)
                place = _free_place(found, marker, deviation)
                if place >= 0:
                    found.slots[marker, 1 + place], found.order[marker, place] = visible[other], other
                    found.deviations[marker, place] = deviation
                    found.means[marker, place] = tables.mean[slots[marker], visible[other]]


@kernel_part
def _free_place(found: Neighbours, marker: int, deviation: float) -> int:
    """Make a place for a neighbour behind those that are as rigid; -1 where there are enough that are."""
    last: int = found.order.shape[1] - 1
    if not deviation < found.deviations[marker, last]:
        return -1
    place = last
    while place > 0 and deviation < found.deviations[marker, place - 1]:
        found.slots[marker, 1 + place] = found.slots[marker, place]
        found.order[marker, place] = found.order[marker, place - 1]
        found.deviations[marker, place] = found.deviations[marker, place - 1]
        found.means[marker, place] = found.means[marker, place - 1]
        place -= 1
    return place


@kernel
def write_misfits(points: Floats, positions: Floats, neighbours: Neighbours, misfits: Floats) -> None:
    """Write how far points are from keeping the distances of markers to their neighbours, in deviations.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points that may be the markers.
    positions : ndarray, shape (n_visible, 3), mm
        Where visible markers are.
    neighbours : Neighbours
        Those of n markers.
    misfits : ndarray, shape (n_points, n)
        Receives root mean squares; infinite where a marker has too few neighbours.
    """
    for point in range(len(points)):
        for marker in range(len(neighbours.order)):
            squares, count = 0.0, 0
            for place in range(neighbours.order.shape[1]):
                other = neighbours.order[marker, place]
                if other >= 0:
                    off = _distance(points, point, positions, other) - neighbours.means[marker, place]
                    squares += (off / neighbours.deviations[marker, place]) ** 2
                    count += 1
            misfits[point, marker] = math.sqrt(squares / count) if count >= LEAST_NEIGHBOURS else math.inf


@kernel_part
def _distance(points: Floats, one: int, others: Floats, other: int) -> float:
    x = points[one, 0] - others[other, 0]
    y = points[one, 1] - others[other, 1]
    z = points[one, 2] - others[other, 2]
    return math.sqrt(x * x + y * y + z * z)


@kernel_part
def _deviation(tables: DistanceTables, row: int, column: int, window: int, noise: float) -> float:
    """Standard deviation of a distance [mm], larger where few samples are known; infinite where too few."""
    common = min(tables.common[row, column], window)
    if common < LEAST_COMMON:
        return math.inf
    prior = (PRIOR_SHARE * tables.mean[row, column]) ** 2
    variance = (common * tables.variance[row, column] + PRIOR_SAMPLES * prior) / (common + PRIOR_SAMPLES)
    return math.sqrt(variance + noise**2)
