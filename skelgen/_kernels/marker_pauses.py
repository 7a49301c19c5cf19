"""When two markers pause at once, and what the gaps of both say if they are exchanged there.

What links say is known for parts of markers: that one goes on as another one, which begins within a moment. Two markers
that are exchanged in a span are linked to each other's parts at both of its ends; one of both may not be seen in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel_part
from skelgen._kernels.tracklet_evidence import ranked
from skelgen.model.arrays import Floats, Ints

MOST_PAUSES = 200
"""Of more common pauses of two markers, the longest ones are looked at: spans are between any two of them."""


class Links(NamedTuple):
    """What gaps say if one part of a marker, seen without a gap, goes on as another one.

    Attributes
    ----------
    first_point : ndarray of intp, shape (n_parts,)
        By which parts are known.
    rank : ndarray of intp, shape (n_parts,)
        Which one it is by its beginning.
    starts : ndarray of intp, shape (3, n_parts)
        Rank of the first part that begins behind the end of each, and where the evidence of the parts from there on
        begins and ends.
    evidence : ndarray, shape (n_links,), nats
        That the one goes on as the other.
    """

    first_point: Ints
    rank: Ints
    starts: Ints
    evidence: Floats


NO_LINKS = Links(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros((3, 0), dtype=np.intp), np.zeros(0))
"""Nothing is known of any part."""


class Pauses(NamedTuple):
    """When markers pause, and what that says.

    Attributes
    ----------
    starts : ndarray of intp, shape (n_markers + 1,)
        Where the pauses of each marker begin in what follows.
    last, following : ndarray of intp, shape (n_pauses,)
        Last frames before pauses, and first ones after them, growing; -1 before the take, its length behind it.
    moments : ndarray of intp, shape (n_moments,)
        Frames in which distances are sampled.
    part : ndarray of intp, shape (n_pauses,)
        Part that begins after each pause, -1 for none.
    links : Links
        Between parts.
    """

    starts: Ints
    last: Ints
    following: Ints
    moments: Ints
    part: Ints
    links: Links


class CommonPauses(NamedTuple):
    """Room for the common pauses of two markers.

    Attributes
    ----------
    length : ndarray of intp, shape (n_moments + 1,)
        Of the longest common pause before each moment, 0 for none, -1 where it is kept [frames].
    frames : ndarray of intp, shape (n_moments + 1,)
        First frames behind them.
    ended : ndarray of intp, shape (n_moments + 1, 2)
        The pauses of both markers of which they are part.
    kept : ndarray of intp, shape (n_moments + 1,)
        Moments behind the longest ones, with both ends of the take.
    linked : ndarray, shape (n_moments + 1,), nats
        What links gain if both are exchanged from there on.
    rank, best : ndarray, shape (MOST_PAUSES,)
        Lengths of the longest, and before which moments they are.
    """

    length: Ints
    frames: Ints
    ended: Ints
    kept: Ints
    linked: Floats
    rank: Floats
    best: Ints


def room_for_pauses(n_moments: int) -> CommonPauses:
    """Make room for the common pauses of two markers.

    Parameters
    ----------
    n_moments : int
        Frames in which distances are sampled.
    """
    n_ends = n_moments + 1
    length, frames, kept = (np.empty(n_ends, dtype=np.intp) for _ in range(3))
    ended, linked = np.empty((n_ends, 2), dtype=np.intp), np.empty(n_ends)
    return CommonPauses(
        length, frames, ended, kept, linked, np.empty(MOST_PAUSES), np.empty(MOST_PAUSES, dtype=np.intp)
    )


@kernel_part
def find_common_pauses(one: int, other: int, pauses: Pauses, room: CommonPauses) -> int:
    """Write the moments before which two markers both pause longest, and the frames; return how many, with both ends.

    Of the common pauses before one moment, the longest counts.

    Parameters
    ----------
    one, other : int
        The markers.
    pauses : Pauses
        When all pause.
    room : CommonPauses
        Receives what is found, but for the links.
    """
    length, frames, n_moments = room.length, room.frames, len(pauses.moments)
    length[:] = 0
    first, second = pauses.starts[one], pauses.starts[other]
    moment, is_last = 0, False
    while not is_last:
        frame = min(pauses.following[first], pauses.following[second])
        is_last = first + 1 == pauses.starts[one + 1] and second + 1 == pauses.starts[other + 1]
        pause = frame - max(pauses.last[first], pauses.last[second])
        while moment < n_moments and pauses.moments[moment] < frame:
            moment += 1
        if pause > length[moment]:
            length[moment], frames[moment] = pause, frame
            room.ended[moment, 0], room.ended[moment, 1] = first, second
        first, second = _behind(first, one, frame, pauses), _behind(second, other, frame, pauses)
    frames[0], frames[n_moments] = 0, pauses.following[-1]
    room.ended[n_moments, 0], room.ended[n_moments, 1] = pauses.starts[one + 1] - 1, pauses.starts[other + 1] - 1
    return _keep_longest(room)


@kernel_part
def _behind(pause: int, marker: int, frame: int, pauses: Pauses) -> int:
    """The first pause of a marker that ends behind a frame; its last one if none does."""
    return pause + 1 if pauses.following[pause] <= frame and pause + 1 < pauses.starts[marker + 1] else pause


@kernel_part
def _keep_longest(room: CommonPauses) -> int:
    """Write the moments with the longest pauses, and both ends of the take; return how many they are."""
    length, kept, count = room.length, room.kept, 0
    for moment in range(1, len(length) - 1):
        if length[moment] > 0:
            count = ranked(room.rank, room.best, count, float(length[moment]), moment)
    for place in range(count):
        length[room.best[place]] = -1
    kept[0], n_kept = 0, 1
    for moment in range(1, len(length) - 1):
        if length[moment] < 0:
            kept[n_kept] = moment
            n_kept += 1
    kept[n_kept] = len(length) - 1
    return n_kept + 1


@kernel_part
def _link(before: int, after: int, pauses: Pauses) -> float:
    """What the gap between two parts says if they are one marker [nats]; 0 where there is none, or it is long."""
    if before < 0 or after < 0:
        return 0.0
    starts = pauses.links.starts
    place = starts[1, before] + pauses.links.rank[after] - starts[0, before]
    if place < starts[1, before] or place >= starts[2, before]:
        return 0.0
    return float(pauses.links.evidence[place])


@kernel_part
def _part_before(pause: int, marker: int, pauses: Pauses) -> int:
    return int(pauses.part[pause - 1]) if pause > pauses.starts[marker] else -1


@kernel_part
def write_links(n_common: int, one: int, other: int, pauses: Pauses, room: CommonPauses) -> None:
    """Write what links of two markers gain over each common pause if they are exchanged from there on.

    Parameters
    ----------
    n_common, one, other : int
        How many common pauses, from `find_common_pauses`, and of which markers.
    pauses : Pauses
        When all pause.
    room : CommonPauses
        The common pauses; receives what links gain.
    """
    for place in range(n_common):
        moment = room.kept[place]
        room.linked[moment] = 0.0
        if 0 < place < n_common - 1:
            first, second = room.ended[moment, 0], room.ended[moment, 1]
            mine, others = _part_before(first, one, pauses), _part_before(second, other, pauses)
            then, next_one = pauses.part[first], pauses.part[second]
            room.linked[moment] = _link(mine, next_one, pauses) + _link(others, then, pauses)
            room.linked[moment] -= _link(mine, then, pauses) + _link(others, next_one, pauses)


@kernel_part
def linked_in(one: int, other: int, span: tuple[int, int], pauses: Pauses, room: CommonPauses) -> float:
    """Return what links of two markers gain if they are exchanged in a span, where one may not be seen [nats].

    Parameters
    ----------
    one, other : int
        The markers.
    span : tuple of int
        First moment, and moment behind the last one, each behind a common pause or the end of the take.
    pauses : Pauses
        When all pause.
    room : CommonPauses
        The common pauses of both.
    """
    gain = 0.0
    begin, behind = room.ended[span[0]], room.ended[span[1]]
    for side in range(2):
        own, their = (one, other) if side == 0 else (other, one)
        before = _part_before(begin[side], own, pauses)
        after = pauses.part[behind[side]]
        gain += _through(before, after, (begin[1 - side], behind[1 - side]), their, pauses)
        gain -= _through(before, after, (begin[side], behind[side]), own, pauses)
    return gain


@kernel_part
def _through(before: int, after: int, between: tuple[int, int], marker: int, pauses: Pauses) -> float:
    """What links say if what a marker is between two of its pauses stands between two parts [nats]."""
    if between[0] == between[1]:
        return _link(before, after, pauses)
    last = _part_before(between[1], marker, pauses)
    return _link(before, pauses.part[between[0]], pauses) + _link(last, after, pauses)
