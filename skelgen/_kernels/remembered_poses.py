"""Where remembered poses put a marker that is not seen: they are aligned with its visible neighbours.

The better a pose fits the neighbours, the more its place counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.rigid_neighbours import LEAST_NEIGHBOURS
from skelgen._kernels.small_matrices import dot, minus, plus, set_vector, turned, vector
from skelgen.model.arrays import Floats, Ints


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
