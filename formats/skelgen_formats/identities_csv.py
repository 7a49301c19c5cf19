"""Identities CSV: which point in which frame is which marker, as the user says; skelgen's own layout.

Layout, comma-separated text with a header that names the columns, in any order::

    # lines that begin with # are ignored
    name,frame,x,y,z
    LKNE,0,120.4,33.0,510.2
    LKNE,812,-300.1,41.7,508.8
    nobody,57,0.0,0.0,12.5

Columns are ``name`` (``nobody`` for a point that is no marker); ``frame``, or ``first_frame``, from 0; the position
``x``, ``y``, ``z`` [mm], or ``point``, its index within the frame from 0; and, if wanted, ``last_frame``, which may be
empty. It is no take and therefore none of the registered formats: `read_identities` reads it.
"""

from collections.abc import Mapping
from pathlib import Path

from skelgen.errors import FormatError, InputError
from skelgen.model.corrections import Identities, Identity
from skelgen.progress import counted
from skelgen_formats.lines import read_lines
from skelgen_formats.text import count_in, number_in, split_cells

_COLUMNS = ("name", "frame", "last_frame", "x", "y", "z", "point")
_SYNONYMS = {"first_frame": "frame", "marker": "name", "label": "name", "index": "point"}
_AXES = ("x", "y", "z")
_COMMENT = "#"


def read_identities(path: Path | str) -> Identities:
    """Read a file of identities.

    Parameters
    ----------
    path : Path or str
        The file.

    Raises
    ------
    FormatError
        If a column is missing or unknown, or a line does not fit, with the line's number.
    """
    path = Path(path)
    filled = (numbered for numbered in read_lines(path).numbered() if numbered[1].strip(" \t,;"))
    lines = ((number, line) for number, line in filled if not line.lstrip().startswith(_COMMENT))
    number, header = next(lines, (0, ""))
    if not header:
        raise FormatError(path, "", "holds no line but comments; a header such as 'name,frame,x,y,z' was expected")
    columns = _columns(path, number, split_cells(path, header, number, ","))
    entries = tuple(_entry(path, number, line, columns) for number, line in lines)
    if not entries:
        raise FormatError(path, "", "holds a header and no identity below it")
    return Identities(entries, str(path))


def _columns(path: Path, number: int, cells: list[str]) -> tuple[str, ...]:
    names = tuple(_SYNONYMS.get(cell.lower(), cell.lower()) for cell in cells)
    unknown = [cell for cell, name in zip(cells, names, strict=True) if name not in _COLUMNS]
    if unknown:
        raise FormatError(path, number, f"the column {unknown[0]!r} is unknown; columns are {', '.join(_COLUMNS)}")
    if len(set(names)) < len(names):
        raise FormatError(path, number, "a column stands there twice")
    axes = set(_AXES) & set(names)
    if not {"name", "frame"} <= set(names) or not (axes or "point" in names) or 0 < len(axes) < len(_AXES):
        raise FormatError(path, number, "the columns name, frame and x, y, z, all three (or point), are needed")
    return names


def _entry(path: Path, number: int, line: str, columns: tuple[str, ...]) -> Identity:
    cells = split_cells(path, line, number, ",")
    if len(cells) != len(columns):
        what = f"{counted(len(cells), 'cell')} where {len(columns)} belong: {', '.join(columns)}"
        raise FormatError(path, number, what)
    row = dict(zip(columns, cells, strict=True))
    by_position = any(row.get(axis) for axis in _AXES)
    position = tuple(number_in(path, number, row[axis], axis) for axis in _AXES) if by_position else None
    try:
        return Identity(
            row["name"],
            count_in(path, number, row["frame"], "frame"),
            position=(position[0], position[1], position[2]) if position else None,
            point=_count(path, number, row, "point"),
            last_frame=_count(path, number, row, "last_frame"),
            line=number,
        )
    except InputError as error:
        raise FormatError(path, number, str(error)) from error


def _count(path: Path, number: int, row: Mapping[str, str], column: str) -> int | None:
    text = row.get(column, "")
    return count_in(path, number, text, column) if text else None
