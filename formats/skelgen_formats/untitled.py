"""Poses of one body as numbers without titles, a row per frame, as datasets of TUM and KITTI have them.

A row holds a place and a unit quaternion, scalar last, ``x y z qx qy qz qw``; or the rows of a matrix of three rows and
four columns, or of four rows, whose rotation stands before its place; a time may stand first: TUM's rows are
``timestamp tx ty tz qx qy qz qw``, KITTI's twelve numbers. A matrix of four rows may stand on four lines, below three
counters, as logs of Redwood have them, or not. Rows are told by what they hold: a length of 1, or a rotation. Lines
that begin with ``#`` or ``%`` are comments; blanks, commas, semicolons or tabs part numbers.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.lines import decoded_head, read_lines
from skelgen_formats.options import RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.text import parse_rows
from skelgen_formats.time_stamps import since_first
from skelgen_formats.wide import take_from_table

_COMMENTS, _PARTING = ("#", "%"), str.maketrans(",;", "  ")
_LOOKED_AT = 24  # rows that must be poses
_QUATERNION, _MATRIX = (0, 1, 2, 6, 3, 4, 5), (3, 7, 11, 0, 1, 2, 4, 5, 6, 8, 9, 10)
_LAYOUTS = {7: (0, _QUATERNION), 12: (0, _MATRIX), 16: (0, _MATRIX), 19: (3, _MATRIX)}
_LAYOUTS |= {1 + width: (1, _LAYOUTS[width][1]) for width in (7, 12, 16)}
# By the numbers of a row: how many stand before the pose, a time or counters; and the columns of x, y, z and the
# quaternion, scalar first, or the matrix row by row.
_ON_MORE_LINES = {4: 3, 3: 4, 1: 4}  # behind lines of so many numbers: a matrix's rest, or one below counters or a time
_TOLERANCE, _LAST_ROW = 1e-3, (0.0, 0.0, 0.0, 1.0)  # of lengths and products of numbers that are printed


def read_untitled(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the poses of a body.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `recorded_rate` and `recorded_unit` count.

    Raises
    ------
    FormatError
        If rows are no poses, or not of the same length.
    """
    lines = read_lines(path)
    width = _width(_rows(lines.numbered()))
    if not width:
        what = "a time, if there is one, and a place with a quaternion, x y z qx qy qz qw, or a matrix belong there"
        raise FormatError(path, 1, f"rows are no poses: {what}")
    leading, columns = _LAYOUTS[width]
    rows = parse_rows(path, _rows(lines.numbered()), width, None, [0, *(leading + column for column in columns)])
    numbers = rows[:, np.newaxis, 1:]
    stamps = since_first(rows[:, 0], 0.0) if leading == 1 else None
    take = take_from_table(path, numbers, ["body"], stamps, options)
    layout = "x, y, z, qx, qy, qz, qw" if columns is _QUATERNION else "the rows of a matrix, place last"
    taken = f"numbers without titles are taken as {'time, ' * (leading == 1)}{layout}"
    return replace(take, notices=(f"{taken}; titles over the columns state another order", *take.notices))


def _rows(numbered: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield the numbers of each frame, parted by blanks; neither blank lines nor comments count."""
    told = ((number, line) for number, line in numbered if line.strip() and not line.startswith(_COMMENTS))
    for number, line in told:
        numbers = line.translate(_PARTING).split()
        rest = islice(told, _ON_MORE_LINES.get(len(numbers), 0))
        yield number, " ".join([*numbers, *(more.translate(_PARTING) for _, more in rest)])


def _width(numbered: Iterator[tuple[int, str]]) -> int:
    """Return how many numbers a row has, if the first rows are poses; else 0."""
    try:
        rows = [[float(cell) for cell in line.split()] for _, line in islice(numbered, _LOOKED_AT)]
    except ValueError:
        return 0
    width = len(rows[0]) if rows else 0
    is_pose = width in _LAYOUTS and all(len(row) == width and _is_pose(row, *_LAYOUTS[width]) for row in rows)
    return width if is_pose else 0


def _is_pose(row: Sequence[float], leading: int, columns: Sequence[int]) -> bool:
    turn = np.array([row[leading + column] for column in columns[3:]])
    if not np.isfinite(row).all() or tuple(row[leading + 12 :]) not in ((), _LAST_ROW):
        return False
    with np.errstate(over="ignore"):
        if len(turn) == len(_LAST_ROW):
            return bool(abs(turn @ turn - 1.0) < 2 * _TOLERANCE)
        rotation = turn.reshape(3, 3)
        return bool(np.abs(rotation @ rotation.T - np.eye(3)).max() < 2 * _TOLERANCE and np.linalg.det(rotation) > 0)


FORMAT = Format(
    name="untitled-poses",
    title="Poses without titles (TUM, KITTI)",
    suffixes=(".tum", ".kitti"),
    holds="poses",
    sniff=lambda head, path: _width(_rows(enumerate(decoded_head(head).splitlines()))) > 0,
    read=read_untitled,
    options=(RECORDED_RATE, RECORDED_UNIT),
    note="A row per frame, or four lines: a time, if there is one, and x y z qx qy qz qw, or a matrix of 3 or 4 rows.",
)
