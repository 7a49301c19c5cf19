"""Frames of which each has a row or record of several people, points or bones; in wide tables their rows take turns.

Points are told apart by the names or numbers that rows and records have; where a frame has none of one, it is unseen.
"""

from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import FormatError
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import counted
from skelgen_formats.body_columns import Body
from skelgen_formats.table_rows import notice_skipped
from skelgen_formats.text import is_number
from skelgen_formats.time_stamps import Stamps
from skelgen_formats.title_lines import Head

_MOST_TIMES, _FREE_NUMBERS = 16, 1 << 22  # numbers that frames may have beside those that are listed
_COMPARED, _SHARED = 2, 0.5  # owners in blocks, and which part of the shorter one's moments both have, at least


@dataclass
class Turns:
    """Of each row the frame and the owner; frames by what their rows have in common, owners by their names."""

    frames: list[int] = field(default_factory=list)
    owners: list[int] = field(default_factory=list)
    moments: dict[str, int] = field(default_factory=dict)
    names: dict[tuple[str, ...], int] = field(default_factory=dict)

    def noted(self, numbered: Iterable[tuple[int, str]], head: Head) -> Iterator[tuple[int, str]]:
        """Yield the lines, and keep of each whose it is; says where frame numbers leave some out.

        Parameters
        ----------
        numbered : iterable of (number, line)
            With all cells.
        head : Head
            Of the table; gets a notice.
        """
        there: set[tuple[int, int]] = set()
        n_frames = 0
        for number, line in numbered:
            cells = line.split(head.delimiter)
            moment = "" if head.counts is None else cells[head.counts].strip()
            owner = self.names.setdefault(tuple(cells[at].strip() for at in head.owners), len(self.names))
            frame = self.moments.setdefault(moment, n_frames)
            if (frame, owner) in there:
                frame = self.moments[moment] = n_frames
            n_frames = max(n_frames, frame + 1)
            there.add((frame, owner))
            self.frames.append(frame)
            self.owners.append(owner)
            yield number, line
        if head.frames is not None and all(map(is_number, self.moments)):
            steps = (int(float(second) - float(first)) for first, second in pairwise(self.moments))
            notice_skipped(Counter(steps), head.notices)

    def spread(self, path: Path, rows: Floats, times: Stamps | None) -> tuple[Floats, Stamps | None]:
        """Return a row for each frame, with the numbers of all owners, NaN where one has none, and its time.

        Parameters
        ----------
        path : Path
            The file, for errors.
        rows : ndarray, shape (n_rows, n_numbers)
            As they stand in the file.
        times : Stamps or None
            Of the rows.

        Raises
        ------
        FormatError
            If most owners have no row in most frames.
        """
        n_frames = max(self.frames) + 1
        places, what = np.array([self.frames, self.owners]).T, "people or points take turns"
        found = spread(path, rows, places, (n_frames, len(self.names)), what)
        if times is not None:
            since = np.full(n_frames, np.nan)
            since[self.frames[::-1]] = times.since[::-1]
            times = replace(times, since=since)
        return found.reshape(n_frames, -1), times

    def named(self, bodies: Sequence[Body]) -> list[Body]:
        """Return the bodies of all owners, with the parts of owners' names before theirs that tell them apart."""
        apart = [len({*part}) > 1 for part in zip(*self.names, strict=True)]
        owners = ["_".join(part for part, is_told in zip(name, apart, strict=True) if is_told) for name in self.names]
        return [replace(body, name="_".join(filter(None, (owner, body.name)))) for owner in owners for body in bodies]


def owners_in_blocks(numbered: Iterable[tuple[int, str]], head: Head) -> list[int]:
    """Return the column that says whose row it is, where all rows of one stand before those of the next.

    They are of people seen together if the first two have most frames or times in common; none if it is not so.

    Parameters
    ----------
    numbered : iterable of (number, line)
        The rows.
    head : Head
        Of the table; gets a notice where it is so.
    """
    counts, blocks = head.counts, {at: dict[str, list[str]]() for at in head.may_own if at != head.counts}
    if counts is None or not blocks:
        return []
    for _, line in numbered:
        cells = line.split(head.delimiter)
        for at, block in blocks.items():
            owner = cells[at].strip() if max(at, counts) < len(cells) else ""
            if owner in block or (owner and len(block) < _COMPARED):
                block.setdefault(owner, []).append(cells[counts].strip())
    found = [at for at, block in blocks.items() if len(block) == _COMPARED and _are_together(*block.values())][:1]
    if found:
        head.notices.append("rows of one stand before those of the next; those of the same moment are one frame")
    return found


def _are_together(first: Sequence[str], second: Sequence[str]) -> bool:
    """Whether two owners have some rows, each at its own moment, and share most of these."""
    fewest = min(len(first), len(second))
    are_apart = len({*first}) == len(first) and len({*second}) == len(second)
    return are_apart and fewest > 1 and len({*first} & {*second}) >= _SHARED * fewest


def without_copies(rows: Floats, bodies: Sequence[Body], notices: list[str]) -> tuple[Floats, list[Body]]:
    """Return rows without the points that lie where another one does in every frame, as ends of bones on their joint.

    Parameters
    ----------
    rows : ndarray, shape (n_frames, n_bodies * n_numbers)
        Of all bodies.
    bodies : sequence of Body
        Whose numbers they are.
    notices : list of str
        Gets a sentence.
    """
    numbers = rows.reshape(len(rows), len(bodies), -1)
    first = {numbers[:, at].tobytes(): at for at in reversed(range(len(bodies)))}
    kept = sorted(first.values())
    if copies := len(bodies) - len(kept):
        notices.append(f"{counted(copies, 'point lies', 'points lie')} where another one does in every frame: left out")
    return numbers[:, kept].reshape(len(rows), -1), [bodies[at] for at in kept]


def array_from_records(
    path: Path, frames: Sequence[Mapping[Any, list[float]]], keys: Sequence[Hashable], width: int
) -> Floats:
    """Return what frames list, shape (n_frames, n_keys, width), NaN where they do not.

    Parameters
    ----------
    path : Path
        The file, for errors.
    frames : sequence of mapping to lists of float
        The numbers of each frame by whose they are.
    keys : sequence
        Whose numbers are wanted.
    width : int
        Numbers of each.

    Raises
    ------
    FormatError
        If most of them are in hardly any frame.
    """
    place_of = {key: place for place, key in enumerate(keys)}
    places = [(number, place_of[key]) for number, frame in enumerate(frames) for key in frame]
    numbers = np.array([one for frame in frames for one in frame.values()], dtype=np.float64).reshape(-1, width)
    return spread(path, numbers, np.array(places, dtype=np.intp).reshape(-1, 2), (len(frames), len(keys)))


def spread(
    path: Path, numbers: Floats, places: Ints, shape: tuple[int, int], what: str = "points or bodies are listed"
) -> Floats:
    """Return rows of numbers by frame and point, shape (n_frames, n_points, width), NaN where none stand.

    Parameters
    ----------
    path : Path
        The file, for errors.
    numbers : ndarray, shape (n_rows, width)
        Of a point in a frame; the last row counts where there are several.
    places : ndarray, shape (n_rows, 2)
        Frame and point of each row.
    shape : (int, int)
        How many frames and points there are.
    what : str
        What the points are, for errors.

    Raises
    ------
    FormatError
        If there are so few rows that the array would be far larger than the file.
    """
    n_frames, n_points = shape
    if n_frames * n_points * numbers.shape[1] > _MOST_TIMES * numbers.size + _FREE_NUMBERS:
        found_there = f"only {len(numbers)} rows or positions of them"
        raise FormatError(path, "", f"{n_points} {what} in {n_frames} frames, but {found_there}")
    found = np.full((n_frames, n_points, numbers.shape[1]), np.nan)
    found[places[:, 0], places[:, 1]] = numbers
    return found
