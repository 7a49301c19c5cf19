"""What markers that arrive frame by frame leave behind: their distances, and poses in which they were seen.

Distances have running means and variances, which say which neighbours are most rigid. Poses that are remembered say
where a marker is that is not seen: they are aligned with its visible neighbours. The better a pose fits the neighbours,
the more its place counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.distance_statistics import squared_distance
from skelgen._kernels.small_matrices import dot, minus, plus, set_vector, turned, vector
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
            surprise = math.sqrt(squared_distance(positions, one, positions, other)) - tables.mean[row, column]
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
                    off = math.sqrt(squared_distance(points, point, positions, other)) - neighbours.means[marker, place]
                    squares += (off / neighbours.deviations[marker, place]) ** 2
                    count += 1
            misfits[point, marker] = math.sqrt(squares / count) if count >= LEAST_NEIGHBOURS else math.inf


@kernel_part
def _deviation(tables: DistanceTables, row: int, column: int, window: int, noise: float) -> float:
    """Standard deviation of a distance [mm], larger where few samples are known; infinite where too few."""
    common = min(tables.common[row, column], window)
    if common < LEAST_COMMON:
        return math.inf
    prior = (PRIOR_SHARE * tables.mean[row, column]) ** 2
    variance = (common * tables.variance[row, column] + PRIOR_SAMPLES * prior) / (common + PRIOR_SAMPLES)
    return math.sqrt(variance + noise**2)


class SeenNeighbours(NamedTuple):
    """A marker that is not seen, and its neighbours that are.

    Attributes
    ----------
    slots : ndarray of intp, shape (1 + n,)
        Slot of the marker, and those of its neighbours.
    positions : ndarray, shape (n, 3), mm
        Where the neighbours are.
    weights : ndarray, shape (n,)
        How much each counts.
    """

    slots: Ints
    positions: Floats
    weights: Floats


class AlignedPoses(NamedTuple):
    """Poses that show the marker and enough of its neighbours.

    Attributes
    ----------
    rows : ndarray of intp, shape (n_poses,)
        Which poses.
    totals : ndarray, shape (n_poses,)
        Sum of the weights of the neighbours that each shows.
    centres : ndarray, shape (n_poses, 6), mm
        Weighted means of the neighbours in the pose, and of the same neighbours now.
    moments : ndarray, shape (n_poses, 3, 3)
        Of the neighbours now and in the pose, about these means.
    """

    rows: Ints
    totals: Floats
    centres: Floats
    moments: Floats


def room_for_poses(n_poses: int) -> AlignedPoses:
    """Return room for as many poses."""
    rows, totals, moments = np.empty(n_poses, dtype=np.intp), np.empty(n_poses), np.empty((n_poses, 3, 3))
    return AlignedPoses(rows, totals, np.empty((n_poses, 6)), moments)


@kernel
def write_moments(poses: Floats, neighbours: SeenNeighbours, aligned: AlignedPoses) -> int:
    """Write the moments by which poses are aligned; return how many poses can be used.

    Parameters
    ----------
    poses : ndarray, shape (n_poses, n_slots, 3), mm
        What is remembered; NaN is unseen.
    neighbours : SeenNeighbours
        By which they are aligned.
    aligned : AlignedPoses
        Receives the poses that can be used; it has room for all.
    """
    slots, n_used = neighbours.slots, 0
    for pose in range(len(poses)):
        total, count = 0.0, 0
        for place in range(len(neighbours.weights)):
            if not math.isnan(poses[pose, slots[1 + place], 0]):
                total += neighbours.weights[place]
                count += 1
        if count >= LEAST_NEIGHBOURS and not math.isnan(poses[pose, slots[0], 0]):
            aligned.rows[n_used], aligned.totals[n_used] = pose, total
            _write_moments(poses, neighbours, aligned, n_used)
            n_used += 1
    return n_used


@kernel_part
def _write_moments(poses: Floats, neighbours: SeenNeighbours, aligned: AlignedPoses, used: int) -> None:
    """Write the centres and moments of a pose."""
    pose, centres, moments = aligned.rows[used], aligned.centres, aligned.moments
    for i in range(3):
        centres[used, i] = centres[used, 3 + i] = 0.0
        for j in range(3):
            moments[used, i, j] = 0.0
    for place in range(len(neighbours.weights)):
        slot = neighbours.slots[1 + place]
        if not math.isnan(poses[pose, slot, 0]):
            share = neighbours.weights[place] / aligned.totals[used]
            for i in range(3):
                centres[used, i] += share * poses[pose, slot, i]
                centres[used, 3 + i] += share * neighbours.positions[place, i]
    for place in range(len(neighbours.weights)):
        slot = neighbours.slots[1 + place]
        if not math.isnan(poses[pose, slot, 0]):
            share = neighbours.weights[place] / aligned.totals[used]
            for i in range(3):
                target = share * (neighbours.positions[place, i] - centres[used, 3 + i])
                for j in range(3):
                    moments[used, i, j] += target * (poses[pose, slot, j] - centres[used, j])


@kernel
def place_marker(
    poses: Floats, neighbours: SeenNeighbours, aligned: AlignedPoses, rotations: Floats, noise: float, places: Floats
) -> float:
    """Average where poses put a marker, weighted by how well they fit; return the variance per coordinate [mm^2].

    Parameters
    ----------
    poses, neighbours, aligned
        As in `write_moments`.
    rotations : ndarray, shape (n_used, 3, 3)
        Now from then, of each pose that is used.
    noise : float, mm
        Standard deviation of rigid distances.
    places : ndarray, shape (1 + n_poses, 4), mm
        Receives the mean place, and in rows below where each pose puts the marker, and its weight.
    """
    least, scale, total, spread = math.inf, 0.0, 0.0, 0.0
    for used in range(len(rotations)):
        _place(poses, neighbours, aligned, rotations, used, places)
        least = min(least, places[1 + used, 3])
    scale = least + noise**2
    for i in range(3):
        places[0, i] = 0.0
    for row in range(1, 1 + len(rotations)):
        places[row, 3] = math.exp(-0.5 * (places[row, 3] - least) / scale)
        total += places[row, 3]
        for i in range(3):
            places[0, i] += places[row, 3] * places[row, i]
    for i in range(3):
        places[0, i] /= total
    for row in range(1, 1 + len(rotations)):
        away = minus(vector(places, row, 0), vector(places, 0, 0))
        spread += places[row, 3] / total * dot(away, away)
    return spread / 3.0 + scale


@kernel_part
def _place(
    poses: Floats, neighbours: SeenNeighbours, aligned: AlignedPoses, rotations: Floats, used: int, places: Floats
) -> None:
    """Write where a pose puts the marker, and the mean squared misfit of its neighbours [mm^2]."""
    turn = vector(rotations[used], 0, 0), vector(rotations[used], 1, 0), vector(rotations[used], 2, 0)
    pose, slots, misfit = poses[aligned.rows[used]], neighbours.slots, 0.0
    centre, now = vector(aligned.centres, used, 0), vector(aligned.centres, used, 3)
    set_vector(places, 1 + used, 0, plus(turned(turn, minus(vector(pose, slots[0], 0), centre)), now))
    for place in range(len(neighbours.weights)):
        if not math.isnan(pose[slots[1 + place], 0]):
            reached = turned(turn, minus(vector(pose, slots[1 + place], 0), centre))
            off = minus(minus(vector(neighbours.positions, place, 0), now), reached)
            misfit += neighbours.weights[place] / aligned.totals[used] * dot(off, off)
    places[1 + used, 3] = misfit
