"""Tables whose cells are vectors: the storage of OpenSim with ``DataType=Vec3``, and what scripts write of lists.

In OpenSim's files, behind a header that ends with ``endheader``, cells are parted by tabs, and hold ``0.1,0.2,0.3``. In
others they hold ``(0.1, 0.2, 0.3)`` or ``[0.1 0.2 0.3]``, in quotes or not, or ``X=0.1 Y=0.2 Z=0.3``, below titles that
are names of points. Each vector is spread over three columns, name_x, name_y, name_z, one of four numbers and unit
length, as Unity writes rotations, over name_qx, name_qy, name_qz, name_qw, a list of vectors over name_1_x and so on;
and the table is read as `skelgen_formats.wide` does.
"""

import contextlib
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.options import BODIES, POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.text import is_number, unquoted
from skelgen_formats.tidy import read_tidy
from skelgen_formats.tidy_heads import find_tidy_head
from skelgen_formats.turn_titles import AXES, quaternion_of
from skelgen_formats.wide import read_table

_END_OF_HEADER, _TYPE = "endheader", re.compile(r"\s*DataType\s*=\s*(\w+)\s*", re.IGNORECASE)
_VECTOR = re.compile(r"(?:array|Vector3?)?[\[(]{1,3}([^\[\]()]{0,200})[\])]{1,3}")
_NUMBER = r"\s*[=:]\s*([-+.\de]+)"
_LABELLED = re.compile(
    rf"(?:[({{]\s*)?(['\"]?)x\1{_NUMBER}[,;\s]+\1y\1{_NUMBER}[,;\s]+\1z\1{_NUMBER}(?:[,;\s]+\1w\1{_NUMBER})?[)}}]?",
    re.IGNORECASE,
)  # X=1.0 Y=2.0 Z=3.0 of Unreal, {'x': 1.0, 'y': 2.0, 'z': 3.0} of Python
_PARTING = re.compile(r"[,;\s]+")
_BETWEEN_VECTORS = "  "  # of a list, in a cell whose numbers are parted by one blank
_DELIMITERS = ";\t,"
_QUATERNION = ("qx", "qy", "qz", "qw")
_LOOKED_AT = 1024  # rows: scripts write empty lists until they see something
_UNIT_TOLERANCE = 1e-3  # of the length of quaternions
_PATH_IN_NAME = re.compile(r"(?:.*/)?([^/|]+)(?:\|.*)?")  # of OpenSim's outputs: /markerset/LASI|location


def read_vector_lines(path: Path, lines: Lines, options: Options) -> Trajectories | PointCloud | Poses:
    """Read a table of vectors from its lines.

    Parameters
    ----------
    path : Path
        The file, for errors.
    lines : Lines
        Of the table.
    options : Options
        `points`, `recorded_rate` and `recorded_unit` count.

    Raises
    ------
    FormatError
        If no column holds vectors, or a row is not as long as the titles.
    """
    at = _first_row(lines[:_LOOKED_AT])
    if at is None:
        raise FormatError(path, 1, "no cells with vectors such as (1.0, 2.0, 3.0) below titles were found")
    names, delimiter = _titles(lines, at)
    first = [_cells(line, delimiter) for line in lines[at : at + _LOOKED_AT]]
    columns = [[row[column] for row in first if column < len(row)] for column in range(len(names))]
    sizes = [max((len(cell.split()) for cell in column), default=0) for column in columns]
    ends = [_ends(column, size) for column, size in zip(columns, sizes, strict=True)]
    others = [name for name, size, end in zip(names, sizes, ends, strict=True) if size > len(AXES) and not end]
    text = "\n".join(_spread(path, lines, at, delimiter, ends))
    spread = Lines(path, text.encode(), "utf-8")
    take = (read_table if find_tidy_head(spread) is None else read_tidy)(path, spread, options)
    notices = [f"vectors of more than three numbers are left out: {', '.join(others[:8])}"] if others else []
    notices += ["vectors of four numbers are taken as quaternions x, y, z, w"] if _QUATERNION in ends else []
    return replace(take, notices=(*notices, *take.notices))


def _first_row(lines: Sequence[str]) -> int | None:
    """Return the index of the first line with vectors, below a line of titles."""
    for index, line in enumerate(lines):
        if line.strip(",;\t ") == _END_OF_HEADER:
            kinds = [match[1].lower() for match in map(_TYPE.fullmatch, lines[:index]) if match]
            return index + 2 if kinds == ["vec3"] and index + 2 < len(lines) else None
        if index and lines[index - 1].strip() and _has_vector(line, or_empty=True):
            names, delimiter = _titles(lines, index)
            is_table = len(_cells(line, delimiter)) == len(names) > 1 and not all(map(is_number, names[1:]))
            return index if is_table and any(map(_has_vector, lines[index:])) else None
    return None


def _has_vector(line: str, *, or_empty: bool = False) -> bool:
    """Whether a line holds a vector, or brackets with nothing in them."""
    found = [_PARTING.split(text.strip()) for text in _VECTOR.findall(_bracketed(line))]
    return any(or_empty if parts == [""] else len(parts) == len(AXES) and all(map(is_number, parts)) for parts in found)


def _bracketed(line: str) -> str:
    """Return a line with vectors in brackets where their numbers have names."""
    return _LABELLED.sub(lambda cell: f"({' '.join(filter(None, cell.groups()[1:]))})", line)


def _titles(lines: Sequence[str], at: int) -> tuple[list[str], str]:
    """Return the names of columns, and what parts their cells: tabs in OpenSim's files."""
    line = lines[at - 1]
    is_storage = at > 1 and lines[at - 2].strip(",;\t ") == _END_OF_HEADER
    delimiter = "\t" if is_storage else max(_DELIMITERS, key=line.count)
    return [cell.strip().strip('"') for cell in unquoted(line, delimiter).split(delimiter)], delimiter


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a row; blanks part the numbers of a vector."""
    if delimiter == "\t":
        line = line.replace(",", " ")
    plain = _VECTOR.sub(lambda vector: " ".join(_PARTING.split(vector[1].strip())), _bracketed(line))
    return [cell.strip().strip('"') for cell in unquoted(plain, delimiter).split(delimiter)]


def _ends(cells: Sequence[str], size: int) -> tuple[str, ...]:
    """Return how the titles of a column's numbers end: those of a vector, of several, of a quaternion, or none."""
    if not all(is_number(word) for cell in cells for word in cell.split()):
        return ()
    if size % len(AXES) == 0 and any(_BETWEEN_VECTORS in cell for cell in cells):
        return tuple(f"{number + 1}_{axis}" for number in range(size // len(AXES)) for axis in AXES)
    lengths = []
    for cell in (cell for cell in map(str.split, cells) if size == len(cell) == len(_QUATERNION)):
        with contextlib.suppress(ValueError):
            lengths.append(math.hypot(*map(float, cell)))
    if lengths and all(abs(length - 1.0) < _UNIT_TOLERANCE for length in lengths):
        return _QUATERNION
    return tuple(AXES) if size == len(AXES) else ()


def _spread(path: Path, lines: Lines, at: int, delimiter: str, ends: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield the lines with columns of such ends for each vector, parted by tabs; those above the titles as they are."""
    for index in range(at - 1):
        yield "" if lines[index].strip(",;\t ") == _END_OF_HEADER else lines[index]
    names, _ = _titles(lines, at)
    titled = [[_titled(_plain(name), end) for end in some] for name, some in zip(names, ends, strict=True)]
    yield "\t".join(_row(titled, names))
    for index in range(at, len(lines)):
        cells = _cells(lines[index], delimiter)
        if any(cells) and len(cells) != len(names):
            raise FormatError(path, index + 1, f"{len(cells)} cells where {len(names)} belong; the file may be cut off")
        parts = [cell.split() for cell in cells]
        vectors = [
            part if len(part) == len(some) else [""] * len(some) for part, some in zip(parts, ends, strict=False)
        ]
        yield "\t".join(_row(vectors, cells)) if any(cells) else ""


def _row(vectors: Sequence[list[str]], cells: Sequence[str]) -> list[str]:
    """Return the cells of a row, those of vectors as their numbers."""
    return [part for vector, cell in zip(vectors, cells, strict=False) for part in vector or [cell]]


def _titled(name: str, end: str) -> str:
    """Return the title of a number, such as HeadRotation_x where the name says that it is of a rotation."""
    return short if quaternion_of(short := f"{name}_{end[-1]}") else f"{name}_{end}"


def _plain(name: str) -> str:
    """Return the name of a point without the path of its component and the name of its output."""
    match = _PATH_IN_NAME.fullmatch(name)
    return match[1] if match else name


def _has_vectors(head: bytes, path: Path) -> bool:
    is_json = head.lstrip().startswith((b"{", b"["))
    return not is_json and _first_row(decoded_head(head).splitlines()[:_LOOKED_AT]) is not None


FORMAT = Format(
    name="vector-csv",
    title="Table of vectors",
    suffixes=(".csv",),
    holds="markers",
    sniff=_has_vectors,
    read=lambda path, options: read_vector_lines(path, read_lines(path), options),
    options=(POINTS, BODIES, RECORDED_RATE, RECORDED_UNIT),
    note="A vector per cell, or a list of them: .sto of OpenSim with DataType=Vec3, or (1.0, 2.0, 3.0) of scripts.",
)
