"""Where points come back that their nearest neighbours carry along, and how badly the neighbours fit one motion."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import contiguous, kernel, kernel_part
from skelgen._kernels.absolute_orientation import N_ROOM, write_rotations
from skelgen._kernels.tracklet_evidence import ranked
from skelgen.model.arrays import Bools, Floats, Ints

NEIGHBOURS = 5
"""Points that carry one along."""

LEAST_NEIGHBOURS = 3
"""Fewer fix no motion."""


class _Room(NamedTuple):
    """Where one point after the other is carried."""

    nearness: Floats  # (NEIGHBOURS,) minus the squared distances of the nearest, mm^2
    nearest: Ints  # (NEIGHBOURS,) and which they are
    centres: Floats  # (2, 3) mm, of the neighbours before and after
    moments: Floats  # (1, 3, 3)
    turns: Floats  # (1, 3, 3)
    sure: Bools  # (1,)
    matrices: Floats  # (N_ROOM, 4, 4)


def carried(points: Floats, begin: Ints, before: Ints, after: Ints) -> tuple[Floats, Floats]:
    """Return where the nearest of others carry points [mm], and how badly they fit one rigid motion [mm].

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud.
    begin : ndarray of intp, shape (n,)
        The points that are carried.
    before, after : ndarray of intp, shape (n, n_others)
        The others beside them, and the same ones later; -1 where unseen.

    Returns
    -------
    tuple of ndarray, shapes (n, 3) and (n,)
        Places, NaN where fewer than `LEAST_NEIGHBOURS` are seen at both times, or all lie on one line; and the root of
        the mean squared misfit of a coordinate.
    """
    found = np.full((len(begin), 3), np.nan), np.zeros(len(begin))
    room = _Room(
        np.empty(NEIGHBOURS),
        np.empty(NEIGHBOURS, dtype=np.intp),
        np.empty((2, 3)),
        np.empty((1, 3, 3)),
        np.empty((1, 3, 3)),
        np.empty(1, dtype=np.bool_),
        np.empty((N_ROOM, 4, 4)),
    )
    (points,) = contiguous(np.asarray(points, dtype=np.float64))
    begin, before, after = contiguous(*(np.asarray(index, dtype=np.intp) for index in (begin, before, after)))
    _write_carried(points, begin, before, after, room, found)
    return found


@kernel
def _write_carried(
    points: Floats, begin: Ints, before: Ints, after: Ints, room: _Room, found: tuple[Floats, Floats]
) -> None:
    """Write what `carried` returns."""
    expected, misfit = found
    for row in range(len(begin)):
        count = _find_nearest(points, begin[row], before[row], after[row], room)
        if count < LEAST_NEIGHBOURS:
            continue
        _write_moments(points, count, before[row], after[row], room)
        write_rotations(room.moments, room.matrices, room.turns, room.sure)
        if not room.sure[0]:
            continue
        squares = 0.0
        for place in range(count):
            other = room.nearest[place]
            for i in range(3):
                left = _turned(points, before[row, other], i, room) - points[after[row, other], i]
                squares += left * left
        misfit[row] = math.sqrt(squares / max(3.0 * count - 6.0, 1.0))
        for i in range(3):
            expected[row, i] = _turned(points, begin[row], i, room)


@kernel_part
def _find_nearest(points: Floats, begin: int, before: Ints, after: Ints, room: _Room) -> int:
    """Write the others that are nearest to a point of those seen at both times; return how many they are."""
    count = 0
    for other in range(len(before)):
        if before[other] >= 0 and after[other] >= 0:
            square = 0.0
            for i in range(3):
                square += (points[before[other], i] - points[begin, i]) ** 2
            count = ranked(room.nearness, room.nearest, count, -square, other)
    return count


@kernel_part
def _write_moments(points: Floats, count: int, before: Ints, after: Ints, room: _Room) -> None:
    """Write the centres of the neighbours at both times, and their moments about these."""
    centres, moments = room.centres, room.moments
    centres[:] = 0.0
    moments[:] = 0.0
    for place in range(count):
        other = room.nearest[place]
        for i in range(3):
            centres[0, i] += points[before[other], i] / count
            centres[1, i] += points[after[other], i] / count
    for place in range(count):
        other = room.nearest[place]
        for i in range(3):
            away = points[after[other], i] - centres[1, i]
            for j in range(3):
                moments[0, i, j] += away * (points[before[other], j] - centres[0, j])


@kernel_part
def _turned(points: Floats, point: int, i: int, room: _Room) -> float:
    """A coordinate of a point when the neighbours' motion has carried it."""
    value = room.centres[1, i]
    for j in range(3):
        value += room.turns[0, i, j] * (points[point, j] - room.centres[0, j])
    return float(value)
