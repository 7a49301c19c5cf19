"""Rows of several people, animals or bones that take turns in a wide table: a frame is what has one row of each."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model.arrays import Floats
from skelgen.progress import counted
from skelgen_formats.body_columns import Body
from skelgen_formats.table_heads import Head
from skelgen_formats.table_rows import notice_skipped
from skelgen_formats.text import is_number
from skelgen_formats.time_stamps import Stamps

_MOST_TIMES, _FREE_ROWS = 16, 1 << 14  # rows that frames of all owners may have beside those of the file


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
        n_frames, n_owners = max(self.frames) + 1, len(self.names)
        if n_frames * n_owners > _MOST_TIMES * len(rows) + _FREE_ROWS:
            what = f"{n_owners} people or points take turns in {n_frames} frames and {len(rows)} rows"
            raise FormatError(path, "", f"{what}; write a row for each point with the titles frame, name, x, y, z")
        found = np.full((n_frames, n_owners, rows.shape[1]), np.nan)
        found[self.frames, self.owners] = rows
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
