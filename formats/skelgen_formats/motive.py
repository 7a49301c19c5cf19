"""Motive CSV: markers, rigid bodies and bones as OptiTrack Motive exports them, format versions 1.2 to 1.25.

Layout, comma-separated text::

    Format Version,1.23,Take Name,walk,...,Export Frame Rate,120.000000,...,Length Units,Meters,...
                                                          (an empty line)
    ,,Marker,Marker,Marker,Rigid Body,...                 what each column belongs to
    ,Name,Skeleton1:LFHD,Skeleton1:LFHD,...               whose column it is
    ,ID,...                                               (newer ones have a line Parent, too; older ones lack some)
    ,,Position,Position,Position,Rotation,...             what is measured
    Frame,Time (Seconds),X,Y,Z,X,...                      (a column TimeCode may follow)
    0,0.000000,0.123,1.456,-0.789,...                     empty cells are unseen

Until 1.22 no line has a word such as Name or ID at its beginning; 1.25 has Type before the first. Columns of type
``Marker`` are read; where there are none, those of type ``Rigid Body Marker``, ``Bone Marker`` and the like, which are
where Motive's model puts the markers; where there are none of these, or with the option `bodies`, the bodies: columns
of type ``Rigid Body`` and ``Bone`` with a position and a quaternion, X Y Z W, or with angles in degrees, X Y Z, which
turn a body about its own axes in the order that Rotation Type names. Motive has y up; coordinates stay as they are.
Where the first line is cut off the times tell the rate, and metres are assumed.
Machines that use decimal commas export with semicolons; both are understood. A file that is cut off is read so far.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.progress import counted
from skelgen_formats.bodies import blank_unseen, take_from_bodies, turned_by_angles
from skelgen_formats.lines import Lines, Sample, decoded_head, read_lines
from skelgen_formats.markers import mm_per_unit, scaled, take_from_markers, uncut
from skelgen_formats.options import BODIES, POINTS, Format
from skelgen_formats.text import count_in, parse_rows, rate_in, split_cells, whole_lines
from skelgen_formats.time_stamps import since_first

_FIRST_CELL = "Format Version"
_MARKER_TYPES = ("Marker", "Rigid Body Marker", "Bone Marker")  # in the order of preference: measured before modelled
_BODY_TYPES = ("Rigid Body", "Bone")
_AXES_LINE = re.compile(r'Frame"?([,;\t])"?Time')
_MOST_QUANTITIES = 5  # Position, Rotation, errors, and nothing
_TIMES_READ = 200
_MAX_TITLE_LINES = 12  # the version with most has 7 before the frames
_FEWEST_TITLE_LINES = 3  # type, name, quantity
_DEFAULT_UNIT = "meters"  # what Motive exports by default
_QUATERNION, _LOCAL = "Quaternion", "Local"  # type of rotations, and coordinates in the axes of the parent
_ORDER = re.compile(r"(?!.*(.).*\1)[XYZ]{3}")  # of angles: XYZ, ZYX and so on
_PLACE, _TURN, _ANGLES = ("Position", "XYZ"), ("Rotation", "WXYZ"), ("Rotation", "XYZ")


@dataclass(frozen=True)
class _Titles:
    """The lines above the frames: for each column its type, name, ID, quantity and axis."""

    kinds: list[str]
    names: list[str]
    ids: list[str]
    quantities: list[str]
    axes: list[str]
    first: int  # index of the first line with numbers


@dataclass(frozen=True)
class _Item:
    """A marker or a body: its name, and its columns by quantity and axis."""

    name: str
    columns: dict[tuple[str, str], int]

    def of(self, quantity: str, axes: str) -> list[int]:
        """Columns of a quantity along some axes; empty if one is missing."""
        found = [self.columns[quantity, axis] for axis in axes if (quantity, axis) in self.columns]
        return found if len(found) == len(axes) else []


def read_motive(path: Path, bodies: bool = False, sample: Sample | None = None) -> Trajectories | PointCloud | Poses:
    """Read the markers, or the bodies, of a Motive export.

    Parameters
    ----------
    path : Path
        The file.
    bodies : bool
        Whether bodies are read although there are markers.
    sample : Sample, optional
        Some frames only.

    Returns
    -------
    Trajectories
        Positions in mm, y up; a `PointCloud` if no trajectory has a label; `Poses` if only bodies were exported.

    Raises
    ------
    FormatError
        If the header is not that of Motive, neither markers nor bodies were exported, or bodies in coordinates of their
        parents.
    """
    lines = read_lines(path, sample)
    has_header = _has_header(lines[0])
    delimiter = "" if has_header else _parting(lines[:_MAX_TITLE_LINES])
    delimiter = delimiter or _delimiter(path, lines[0])
    cells = split_cells(path, lines[0], 1, delimiter) if has_header else []
    header = dict(zip(cells[0::2], cells[1::2], strict=False))
    titles = _titles(path, lines, delimiter, first=int(has_header))
    notices: list[str] = []
    rate = _rate(path, header) if has_header else _rate_of_times(path, lines, titles, delimiter)
    unit = header.get("Length Units", "")
    if not unit:
        notices.append("the header names no length unit; metres are assumed")
    factor = mm_per_unit(path, 1, unit or _DEFAULT_UNIT)
    items = [] if bodies else _markers(titles, notices)
    if items and header.get("Coordinate Space") == _LOCAL:
        notices.append("the file says that its coordinates are local; those of markers are taken as the world's")
    order = header.get("Rotation Type", "").upper()
    turn = _ANGLES if _ORDER.fullmatch(order) else _TURN
    kinds = [_PLACE] if items else [_PLACE, turn]
    items = items or _bodies(path, header, titles, turn, notices)
    wanted = [column for item in items for quantity, axes in kinds for column in item.of(quantity, axes)]
    whole = whole_lines(lines.rows(titles.first), len(lines), len(titles.axes), delimiter, notices)
    rows = parse_rows(path, whole, len(titles.axes), delimiter, wanted)
    if announced := header.get("Total Exported Frames"):
        rows = uncut(lines, rows, count_in(path, 1, announced, "Total Exported Frames"), notices)
    width = sum(len(axes) for _, axes in kinds)
    numbers, names = rows.reshape(len(rows), len(items), width), [item.name for item in items]
    if kinds == [_PLACE]:
        return take_from_markers(path, scaled(path, numbers, factor), names, rate, notices)
    numbers = blank_unseen(numbers)
    if turn == _ANGLES:
        numbers = turned_by_angles(numbers, order.lower(), "deg", notices, is_sure=True)
    return take_from_bodies(path, numbers, factor, names, rate, notices)


def _delimiter(path: Path, line: str) -> str:
    rest = line.strip().lstrip('"').removeprefix(_FIRST_CELL).lstrip('"')
    if not _has_header(line) or rest[:1] not in (",", ";", "\t"):
        raise FormatError(path, 1, f"an export of Motive begins with {_FIRST_CELL!r}; this file does not")
    return rest[0]


def _has_header(line: str) -> bool:
    return line.strip().lstrip('"').startswith(_FIRST_CELL)


def _parting(lines: Sequence[str]) -> str:
    """Return what parts cells in an export without its header, as people cut it off; empty if this is none."""
    filled = [line for line in lines if line.strip(",;\t ")]
    for n_above, (above, line) in enumerate(pairwise(filled), start=1):
        found = _AXES_LINE.match(line.strip().lstrip('"'))
        words = {cell.strip(' "') for cell in above.split(found[1])} if found else set()
        if found and "Position" in words and len(words) <= _MOST_QUANTITIES and n_above >= _FEWEST_TITLE_LINES:
            return found[1]
    return ""


def _rate_of_times(path: Path, lines: Lines, titles: _Titles, delimiter: str) -> float:
    """Return the frame rate of the column of times, which is all that an export without its header says."""
    first = islice(lines.numbered(titles.first), _TIMES_READ)
    has_times = titles.axes[1:2] == ["TIME (SECONDS)"]
    times = parse_rows(path, first, len(titles.axes), delimiter, [1])[:, 0] if has_times else np.zeros(0)
    if rate := since_first(times, 1.0).rate([]):
        return rate
    raise FormatError(path, 1, f"the line that begins with {_FIRST_CELL!r} is missing, and no times tell the rate")


def _rate(path: Path, header: Mapping[str, str]) -> float:
    for key in ("Export Frame Rate", "Capture Frame Rate"):
        if header.get(key):
            return rate_in(path, 1, header[key], key)
    raise FormatError(path, 1, "the header names neither an export nor a capture frame rate")


def _titles(path: Path, lines: Sequence[str], delimiter: str, first: int) -> _Titles:
    rows: list[list[str]] = []
    for index, line in enumerate(lines[first : _MAX_TITLE_LINES + 1], start=first):
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
    has_ids = "ID" in labels or (not any(labels) and len(rows) > _FEWEST_TITLE_LINES)
    ids = padded[labels.index("ID") if "ID" in labels else 2] if has_ids else [""] * width
    return _Titles(padded[0], names, ids, padded[-1], [axis.upper() for axis in axes], first)


def _markers(titles: _Titles, notices: list[str]) -> list[_Item]:
    """Return the markers; measured ones, or else those of the models."""
    others = [kind for kind in dict.fromkeys(titles.kinds) if kind.lower().endswith("marker")]
    for kind in dict.fromkeys([*_MARKER_TYPES, *others]):
        items = [item for item in _items(titles, (kind,)) if item.of(*_PLACE)]
        if items:
            if kind != _MARKER_TYPES[0]:
                notices.append("no measured markers were exported; those of the bodies' models are taken")
            left_out = sorted({other for other in titles.kinds[2:] if other and other != kind})
            if left_out:
                hint = "; `--bodies` reads the bodies instead" if {*left_out} & {*_BODY_TYPES} else ""
                notices.append(f"columns left out: {', '.join(left_out)}{hint}")
            return items
    return []


def _bodies(
    path: Path, header: Mapping[str, str], titles: _Titles, turn: tuple[str, str], notices: list[str]
) -> list[_Item]:
    """Return the rigid bodies and bones with position and rotation, a quaternion or angles."""
    items = [item for item in _items(titles, _BODY_TYPES) if item.of(*_PLACE)]
    whole = [item for item in items if item.of(*turn)]
    rotation, space = header.get("Rotation Type", _QUATERNION), header.get("Coordinate Space", "Global")
    if items and rotation != _QUATERNION and turn == _TURN:
        what = f"rotations are of the type {rotation[:20]}; export with Rotation Type Quaternion, or with markers"
        raise FormatError(path, 1, what)
    if not whole:
        found = ", ".join(sorted({kind for kind in titles.kinds[2:] if kind})) or "nothing"
        what = f"no Marker columns and no whole bodies, only {found}; export with markers switched on"
        raise FormatError(path, titles.first, what)
    if space == _LOCAL:
        raise FormatError(path, 1, "coordinates are local to the parent; export with global (world) coordinates")
    if len(whole) < len(items):
        one, several = "body without a rotation is left out", "bodies without a rotation are left out"
        notices.append(counted(len(items) - len(whole), one, several))
    return whole


def _items(titles: _Titles, kinds: Sequence[str]) -> list[_Item]:
    """Return what has columns of some types, in the order of the file; unnamed ones are left out."""
    items: dict[tuple[str, str, str], list[_Item]] = {}
    columns = zip(titles.kinds, titles.names, titles.ids, titles.quantities, titles.axes, strict=True)
    for column, (kind, name, identity, quantity, axis) in enumerate(columns):
        if kind not in kinds or not name:
            continue
        same = items.setdefault((kind, name, identity), [_Item(name, {})])
        if (quantity, axis) in same[-1].columns:  # another one of this name
            same.append(_Item(name, {}))
        same[-1].columns[quantity, axis] = column
    return sorted((item for same in items.values() for item in same), key=lambda item: min(item.columns.values()))


def _is_motive(head: bytes, path: Path) -> bool:
    text = decoded_head(head)
    return _has_header(text.lstrip()) or bool(_parting(text.splitlines()[:_MAX_TITLE_LINES]))


FORMAT = Format(
    name="motive",
    title="OptiTrack Motive CSV",
    suffixes=(".csv",),
    holds="markers",
    sniff=_is_motive,
    read=lambda path, options: read_motive(path, options.bodies, options.sample),
    options=(POINTS, BODIES),
    note="Versions 1.2 to 1.25, any length unit, y stays up; rigid bodies and bones where there are no markers.",
)
