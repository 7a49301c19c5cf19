"""Poses of one body as numbers without titles, a row per frame, as datasets of TUM and KITTI have them.

A row holds a place and a unit quaternion, scalar last, ``x y z qx qy qz qw``; or the rows of a matrix of three rows and
four columns, or of four rows, whose rotation stands before its place; a time may stand first: TUM's rows are
``timestamp tx ty tz qx qy qz qw``, KITTI's twelve numbers. Rows are told by what they hold: a length of 1, or a
rotation. Lines that begin with ``#`` or ``%`` are comments; blanks, commas, semicolons or tabs part numbers.
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
_LAYOUTS = {7: _QUATERNION, 12: _MATRIX, 16: _MATRIX}
"""Columns of x, y, z and the quaternion, scalar first, or the matrix row by row, by the numbers of a row."""

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
    is_timed = width not in _LAYOUTS
    columns = [column + is_timed for column in _LAYOUTS[width - is_timed]]
    rows = parse_rows(path, _rows(lines.numbered()), width, None, [0, *columns])
    numbers = rows[:, np.newaxis, 1:]
    stamps = since_first(rows[:, 0], 0.0) if is_timed else None
    take = take_from_table(path, numbers, ["body"], stamps, options)
    layout = "x, y, z, qx, qy, qz, qw" if len(columns) == len(_QUATERNION) else "the rows of a matrix, place last"
    taken = f"numbers without titles are taken as {'time, ' * is_timed}{layout}"
    return replace(take, notices=(f"{taken}; titles over the columns state another order", *take.notices))


def _rows(numbered: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield lines that are neither blank nor comments, their numbers parted by blanks."""
    told = ((number, line.translate(_PARTING)) for number, line in numbered)
    return ((number, line) for number, line in told if line.strip() and not line.startswith(_COMMENTS))


def _width(numbered: Iterator[tuple[int, str]]) -> int:
    """Return how many numbers a row has, if the first rows are poses; else 0."""
    try:
        rows = [[float(cell) for cell in line.split()] for _, line in islice(numbered, _LOOKED_AT)]
    except ValueError:
        return 0
    width = len(rows[0]) if rows else 0
    is_timed = width not in _LAYOUTS
    if width - is_timed not in _LAYOUTS or any(len(row) != width for row in rows):
        return 0
    return width if all(_is_pose(row[is_timed:]) for row in rows) else 0


def _is_pose(row: Sequence[float]) -> bool:
    turn = np.array([row[column] for column in _LAYOUTS[len(row)][3:]])
    if not np.isfinite(row).all() or tuple(row[12:]) not in ((), _LAST_ROW):
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
    note="A row per frame: a time, if there is one, and x y z qx qy qz qw, or a matrix of three or four rows.",
)
