"""Positions as a sparse matrix in text, as DLTdv saves them: a row for each number that is there.

A line of title, one of the sizes, ``n_frames n_columns n_numbers``, and then ``frame column number`` in each row,
counted from 1. The columns are x, y and z of each point in turn; zeros and what is missing were not seen.
"""

import re
from itertools import islice
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model.arrays import Floats
from skelgen_formats.lines import Lines
from skelgen_formats.text import parse_rows
from skelgen_formats.turn_titles import AXES

_SIZES, _ENTRY = (
    re.compile(r"(\d{1,9})\s+(\d{1,9})\s+(\d{1,9})\s*"),
    re.compile(r"(\d{1,9})\s+(\d{1,9})\s+[-+.\deNa]+\s*"),
)
_TITLES = 2  # lines before that of the sizes, at most
_LOOKED_AT = 8  # entries that must be frame, column and number
_MOST_TIMES = 1000  # frames and columns for each number that is there


def is_sparse(lines: Lines) -> bool:
    """Whether lines are those of a sparse matrix.

    Parameters
    ----------
    lines : Lines
        Of the file, or its first ones.
    """
    return _sizes(lines) is not None


def read_sparse(path: Path, lines: Lines) -> Floats:
    """Return the positions of all points, shape (n_frames, n_points, 3), in the file's unit, NaN where unseen.

    Parameters
    ----------
    path : Path
        The file, for errors.
    lines : Lines
        Those of a sparse matrix.

    Raises
    ------
    FormatError
        If entries lie beyond the sizes, or points have two coordinates.
    """
    first, (n_frames, n_columns) = _sizes(lines) or (0, (0, 0))
    if n_columns % len(AXES) or "xypts" in path.name.lower():
        raise FormatError(
            path, first, "points have two coordinates: 2D; give the file of xyzpts that DLTdv saves beside"
        )
    entries = parse_rows(path, lines.numbered(first), len(AXES), None)
    places = entries[:, :2]
    if not ((places >= 1) & (places <= (n_frames, n_columns)) & (places == np.rint(places))).all():
        raise FormatError(path, first, f"there are entries beyond {n_frames} frames and {n_columns} columns")
    if n_frames * n_columns > _MOST_TIMES * len(entries):
        raise FormatError(
            path, first, f"{n_frames} frames and {n_columns} columns, but only {len(entries)} numbers of them"
        )
    frames, columns = places.astype(np.intp).T - 1
    found = np.full((n_frames, n_columns), np.nan)
    found[frames, columns] = entries[:, 2]
    return found.reshape(n_frames, -1, len(AXES))


def _sizes(lines: Lines) -> tuple[int, tuple[int, int]] | None:
    """Return the number of the line of sizes, and how many frames and columns it names, if entries follow."""
    some = [*islice(lines.numbered(), _TITLES + 1 + _LOOKED_AT)]
    first = next((at for at, (_, line) in enumerate(some[: _TITLES + 1]) if _SIZES.fullmatch(line)), len(some))
    entries = [_ENTRY.fullmatch(line) for _, line in some[first + 1 :]]
    if not entries:
        return None
    n_frames, n_columns, n_numbers = map(int, some[first][1].split())
    are_within = all(one and 0 < int(one[1]) <= n_frames and 0 < int(one[2]) <= n_columns for one in entries)
    return (
        (some[first][0], (n_frames, n_columns))
        if are_within and n_frames * n_columns <= _MOST_TIMES * n_numbers
        else None
    )
