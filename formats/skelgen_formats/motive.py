"""Motive CSV: marker trajectories as OptiTrack Motive exports them.

Layout, comma-separated text::

    Format Version,1.23,Take Name,walk,...,Export Frame Rate,120.000000,...,Length Units,Meters,...
                                                          (an empty line)
    ,,Marker,Marker,Marker,Rigid Body,...                 what each column belongs to
    ,Name,Skeleton1:LFHD,Skeleton1:LFHD,...               whose column it is
    ,ID,...                                               (from 1.24 on also a line Parent; older ones lack some)
    ,,Position,Position,Position,Rotation,...             what is measured
    Frame,Time (Seconds),X,Y,Z,X,...
    0,0.000000,0.123,1.456,-0.789,...                     empty cells are unseen

Columns of type ``Marker`` are read; where there are none, those of type ``Rigid Body Marker``, which are where
Motive's model puts the markers. Bodies and bones are left out with a notice. Motive has y up; coordinates stay as they
are. Machines that use decimal commas export with semicolons; both are understood.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Trajectories
from skelgen_formats.markers import check_frames, mm_per_unit, scaled, take_from_markers
from skelgen_formats.options import Format
from skelgen_formats.text import count_in, decoded_head, parse_rows, rate_in, read_lines, split_cells

_FIRST_CELL = "Format Version"
_MARKER_TYPES = ("Marker", "Rigid Body Marker")  # in the order of preference: measured before modelled
_MAX_TITLE_LINES = 12  # the version with most has 7 before the frames
_FEWEST_TITLE_LINES = 3  # type, name, quantity
_DEFAULT_UNIT = "meters"  # what Motive exports by default
_AXES = ("X", "Y", "Z")


@dataclass(frozen=True)
class _Titles:
    """The lines above the frames: for each column its type, name, ID, quantity and axis."""

    kinds: list[str]
    names: list[str]
    ids: list[str]
    quantities: list[str]
    axes: list[str]
    first: int  # index of the first line with numbers


def read_motive(path: Path) -> Trajectories | PointCloud:
    """Read the markers of a Motive export.

    Returns
    -------
    Trajectories
        Positions in mm, y up; or a `PointCloud` if no trajectory has a label.

    Raises
    ------
    FormatError
        If the header is not that of Motive, no marker was exported, or lines are cut off.
    """
    lines = read_lines(path)
    delimiter = _delimiter(path, lines[0])
    cells = split_cells(path, lines[0], 1, delimiter)
    header = dict(zip(cells[0::2], cells[1::2], strict=False))
    titles = _titles(path, lines, delimiter)
    notices: list[str] = []
    columns = _marker_columns(path, titles, notices)
    rate = _rate(path, header)
    unit = header.get("Length Units", "")
    if not unit:
        notices.append("the header names no length unit; metres are assumed")
    wanted = [column for triple in columns.values() for column in triple]
    rows = parse_rows(path, lines.numbered(titles.first), len(titles.axes), delimiter, wanted)
    if "Total Exported Frames" in header:
        announced = count_in(path, 1, header["Total Exported Frames"], "Total Exported Frames")
        check_frames(path, 1, announced, len(rows), notices)
    positions = rows.reshape(len(rows), len(columns), 3)
    factor = mm_per_unit(path, 1, unit or _DEFAULT_UNIT)
    return take_from_markers(path, scaled(path, positions, factor), list(columns), rate, notices)


def _delimiter(path: Path, line: str) -> str:
    rest = line.strip().lstrip('"').removeprefix(_FIRST_CELL).lstrip('"')
    if not line.strip().lstrip('"').startswith(_FIRST_CELL) or rest[:1] not in (",", ";", "\t"):
        raise FormatError(path, 1, f"an export of Motive begins with {_FIRST_CELL!r}; this file does not")
    return rest[0]


def _rate(path: Path, header: Mapping[str, str]) -> float:
    for key in ("Export Frame Rate", "Capture Frame Rate"):
        if header.get(key):
            return rate_in(path, 1, header[key], key)
    raise FormatError(path, 1, "the header names neither an export nor a capture frame rate")


def _titles(path: Path, lines: Sequence[str], delimiter: str) -> _Titles:
    rows: list[list[str]] = []
    for index, line in enumerate(lines[1 : _MAX_TITLE_LINES + 1], start=1):
        cells = split_cells(path, line, index + 1, delimiter)
        if cells and cells[0] == "Frame":
            return _arranged(path, rows, cells, index + 1)
        if any(cells):
            rows.append(cells)
    raise FormatError(path, min(len(lines), _MAX_TITLE_LINES), "no line with 'Frame,Time' was found above the frames")


def _arranged(path: Path, rows: list[list[str]], axes: list[str], first: int) -> _Titles:
    width = len(axes)
    padded = [(row + [""] * width)[:width] for row in rows]
    labels = [row[1] if width > 1 else "" for row in padded]
    unnamed = "Name" not in labels and any(labels)  # older exports label none of these lines
    if len(rows) < _FEWEST_TITLE_LINES or unnamed:
        raise FormatError(path, first, "above the frames belong lines with type, name and quantity of each column")
    names = padded[labels.index("Name") if "Name" in labels else 1]
    ids = padded[labels.index("ID")] if "ID" in labels else [""] * width
    return _Titles(padded[0], names, ids, padded[-1], axes, first)


def _marker_columns(path: Path, titles: _Titles, notices: list[str]) -> dict[str, list[int]]:
    """Return the x, y, z columns of each marker by name."""
    for kind in _MARKER_TYPES:
        columns = _columns_of(path, titles, kind)
        if columns:
            if kind != _MARKER_TYPES[0]:
                notices.append("no measured markers were exported; those of the rigid bodies' models are taken")
            left_out = sorted({other for other in titles.kinds[2:] if other and other != kind})
            if left_out:
                notices.append(f"columns left out: {', '.join(left_out)}")
            return columns
    found = ", ".join(sorted({kind for kind in titles.kinds[2:] if kind})) or "nothing"
    raise FormatError(path, titles.first, f"no Marker columns, only {found}; export with markers switched on")


def _columns_of(path: Path, titles: _Titles, kind: str) -> dict[str, list[int]]:
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for column, axis in enumerate(titles.axes):
        if titles.kinds[column] == kind and titles.quantities[column] == "Position" and axis in _AXES:
            axes = groups.setdefault((titles.names[column], titles.ids[column]), {})
            if axis in axes:
                what = f"two markers are labelled {titles.names[column][:60]!r}; rename one"
                raise FormatError(path, titles.first, what)
            axes[axis] = column
    columns: dict[str, list[int]] = {}
    for (name, _), axes in groups.items():
        if len(axes) != len(_AXES) or not name:
            raise FormatError(path, titles.first, f"the marker {name[:60]!r} has no name or not all of X, Y and Z")
        if name in columns:
            raise FormatError(path, titles.first, f"two markers are labelled {name[:60]!r}; rename one")
        columns[name] = [axes[axis] for axis in _AXES]
    return columns


FORMAT = Format(
    name="motive",
    title="OptiTrack Motive CSV",
    suffixes=(".csv",),
    holds="markers",
    sniff=lambda head, path: decoded_head(head).lstrip().lstrip('"').startswith(_FIRST_CELL),
    read=lambda path, options: read_motive(path),
    note="Export with Marker columns, any length unit; y stays up; bodies and bones are left out with a notice.",
)
