"""Nexus CSV: marker trajectories as Vicon Nexus exports them in ASCII.

Layout, comma-separated text (or tab-separated, as .txt), blocks one after the other with empty lines between::

    (two empty lines, in newer versions)
    Trajectories                                 the block; Model Outputs, Devices, Joints, Segments, Events go likewise
    100                                          its rate in Hz
    ,,Ann:LASI,,,Ann:RASI,,,...                  the name stands over the first column of a marker
    Frame,Sub Frame,X,Y,Z,X,Y,Z,...              velocities and accelerations are titled X', X'' and so on
    ,,mm,mm,mm,mm,mm,mm,...
    1,0,44.1628,-276.862,675.697,...             empty cells are unseen; rows may end before them
    (an empty line)

Trajectories is read; where there is none, the bodies of Objects (of Vicon Tracker) or Segments::

    ,,Wand:Wand,,,,,,,                           or: Global Angle (Quaternion) Wand:Wand
    Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ         global; in any order
    ,,deg,deg,deg,,mm,mm,mm                      deg or rad of angles

Without RW they are rotation vectors, which Vicon calls helical and exports by default, or angles R = Rx Ry Rz where the
title says ``(EulerXYZ)``; the option `angle_order` states another order.

Frames that the file leaves out are unseen. Workstation and early versions of Nexus write
``TRAJECTORIES``, ``100,Hz``, ``,LASI,,,RASI,,,`` and ``Field #,X,Y,Z,X,Y,Z,...`` without sub-frames and units.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Floats
from skelgen.progress import counted
from skelgen_formats.bodies import blank_unseen, take_from_bodies, turned_by_angles
from skelgen_formats.lines import Lines, Sample, decoded_head, read_lines
from skelgen_formats.markers import mm_per_unit, scaled, take_from_markers
from skelgen_formats.options import ANGLE_ORDER, AUTO, POINTS, ROTATION_VECTOR, Format
from skelgen_formats.table_rows import padded_rows
from skelgen_formats.text import parse_rows, rate_in, split_cells

BLOCKS = (
    *("Trajectories", "Model Outputs", "Devices", "Joints", "Segments", "Events", "Forces"),
    *("Objects", "Angles", "Moments", "Powers", "Scalars", "Trajectory Count"),
)
"""Titles of the blocks of an export."""

_DELIMITERS = ",\t;"
_AXES = ("X", "Y", "Z")
_BODIES = ("Objects", "Segments")
_TURN, _PLACE = ("RW", "RX", "RY", "RZ"), ("TX", "TY", "TZ")
_ANGLES = _TURN[1:]
_REPRESENTATION = re.compile(r"^Global Angle \(([^)]*)\)")
_LEADING_TITLES = ("Frame", "Field #")  # of the first column; the second may be that of sub-frames
_TITLE_LINES = 12  # within which the titles of the first block stand
_LONGEST_TITLE = 256  # bytes of a block's title with what a spreadsheet parts cells by behind it
_MOST_TIMES = 4  # frames in the take for one in the file, at most


class _Block(NamedTuple):
    """A block: its title, and the index of the line behind it."""

    title: str
    first: int


def read_nexus(path: Path, sample: Sample | None = None, angle_order: str = AUTO) -> Trajectories | PointCloud | Poses:
    """Read the trajectories, or else the bodies, of an ASCII export of Vicon Nexus or Tracker.

    Parameters
    ----------
    path : Path
        The file.
    sample : Sample, optional
        Some frames only.
    angle_order : str
        How three angles turn a body, a choice of `ANGLE_ORDER`.

    Returns
    -------
    Trajectories
        Positions in mm; a `PointCloud` if no trajectory has a label; `Poses` if only bodies were exported.

    Raises
    ------
    FormatError
        If neither was exported, or their header is not as the layout demands.
    """
    lines = read_lines(path, sample)
    blocks = list(_blocks(lines))
    chosen = _chosen(path, blocks)
    title = chosen.title
    head = [numbered for numbered, _ in zip(lines.numbered(chosen.first), range(4), strict=False)]
    if len(head) < 3:
        raise FormatError(path, len(lines), f"the header of the block {title} is cut off")
    delimiter = _delimiter(path, *head[2])
    stated = head[0][1].strip(_DELIMITERS + ' "').removesuffix("Hz").strip(_DELIMITERS + ' "')
    rate = rate_in(path, head[0][0], stated, "the rate of the trajectories")
    names, titles = (split_cells(path, line, number, delimiter) for number, line in head[1:3])
    columns = _columns(path, head[2][0], names, titles, title)
    others = [block.title for block in blocks if block.title != title]
    notices = [f"blocks left out: {', '.join(others)}"] if others else []
    unit, behind = _unit(path, head, columns, delimiter, notices)
    wanted = [0, *(column for triple in columns.values() for column in triple)]
    whole = padded_rows(_rows(lines, behind), len(lines), len(titles), delimiter, notices)
    rows = parse_rows(path, whole, len(titles), delimiter, wanted)
    if not len(rows):
        raise FormatError(path, len(lines), f"the block {title} holds no frame")
    with np.errstate(invalid="ignore"):  # of frames whose numbers are infinite
        n_frames = rows[-1, 0] - rows[0, 0] + 1
    if lines.is_sampled and n_frames != lines.count(rows):
        raise FormatError(path, "", "frames are left out; which, only the whole file tells")
    rows = rows if lines.is_sampled else _every_frame(rows, notices)
    numbers = rows[:, 1:].reshape(len(rows), len(columns), -1)
    names_in_file = [names[first] for first in columns]
    if title == BLOCKS[0]:
        return take_from_markers(path, scaled(path, numbers, unit), names_in_file, rate, notices)
    bodies = [_body_name(name) for name in names_in_file]
    numbers = blank_unseen(numbers)
    if numbers.shape[2] == len(_PLACE) + len(_ANGLES):
        cells = head[3][1].split(delimiter) if behind == head[2][0] + 1 else []  # there is a line of units
        angle_unit = [*cells, *[""] * len(titles)][next(iter(columns.values()))[len(_PLACE)]].strip(' "').lower()
        numbers = _with_quaternions(numbers, names_in_file[0], angle_unit, angle_order, notices)
    return take_from_bodies(path, numbers, unit, bodies, rate, notices)


def _chosen(path: Path, blocks: Sequence[_Block]) -> _Block:
    """Return the first block of trajectories, or else of bodies."""
    found = [block for block in blocks if block.title == BLOCKS[0]]
    found = found or [block for block in blocks if block.title in _BODIES]
    if not found:
        there = ", ".join(dict.fromkeys(block.title for block in blocks)) or "none"
        what = f"no block {BLOCKS[0]}, only {there}; export ASCII with trajectories switched on"
        raise FormatError(path, "", what)
    return found[0]


def _with_quaternions(numbers: Floats, title: str, unit: str, angle_order: str, notices: list[str]) -> Floats:
    """Return places and unit quaternions, shape (n_frames, n_bodies, 7), of places and angles; says what is assumed."""
    stated = _REPRESENTATION.search(title)
    of_title = {"helical": ROTATION_VECTOR, "eulerxyz": "xyz"}.get(stated[1].lower().replace(" ", "") if stated else "")
    order = angle_order if angle_order != AUTO else of_title or ROTATION_VECTOR
    is_sure = bool(of_title) or angle_order != AUTO
    if not is_sure:
        what = "rotations are taken as helical angles, as Vicon exports them by default"
        notices.append(f"{what}; `--angle-order xyz` takes them as Euler angles")
    return turned_by_angles(numbers, order, unit, notices, is_sure=is_sure)


def _body_name(title: str) -> str:
    """Return the name of a body: Wand of the title ``Global Angle (Quaternion) Wand:Wand``."""
    subject, _, segment = re.sub(r"^Global Angle \([^)]*\) *", "", title).partition(":")
    return subject if subject == segment or not segment else f"{subject}:{segment}"


def _blocks(lines: Lines) -> Iterator[_Block]:
    for number, line in lines.few(_LONGEST_TITLE):
        title = _title(line)
        if title in BLOCKS:
            yield _Block(title, number)


def _title(line: str) -> str:
    """The title of a block as it stands in `BLOCKS`, if the line is one."""
    text = line.strip(_DELIMITERS + ' "')
    return text.title() if text.isupper() else text


def _delimiter(path: Path, number: int, titles: str) -> str:
    first = titles.strip().lstrip('"')
    rest = first.removeprefix("Frame").removeprefix("Field #").lstrip('"')
    if not first.startswith(_LEADING_TITLES) or rest[:1] not in tuple(_DELIMITERS):
        raise FormatError(path, number, "the line Frame,Sub Frame,X,Y,Z belongs here")
    return rest[0]


def _columns(path: Path, number: int, names: Sequence[str], titles: Sequence[str], block: str) -> dict[int, list[int]]:
    """Return the columns of each marker, x y z, or body, place and rotation, by the column under its name."""
    named = [first for first in range(1, min(len(names), len(titles))) if names[first]]
    columns: dict[int, list[int]] = {}
    turn = _TURN if _TURN[0] in titles else _ANGLES
    for first, end in zip(named, [*named[1:], len(titles)][: len(named)], strict=True):
        own = list(titles[first:end])
        if block == BLOCKS[0] and tuple(own[:3]) == _AXES:
            columns[first] = [first, first + 1, first + 2]
        elif block in _BODIES and {*_PLACE, *turn} <= {*own}:
            columns[first] = [first + own.index(axis) for axis in (*_PLACE, *turn)]
    if not columns and block == BLOCKS[0]:
        raise FormatError(path, number, "no name stands over three columns X, Y, Z; trajectories were not exported")
    if not columns:
        what = f"no name in the block {block} stands over RX, RY, RZ, TX, TY, TZ"
        raise FormatError(path, number, f"{what}; export global rotations and translations, or trajectories")
    return columns


def _unit(
    path: Path, head: Sequence[tuple[int, str]], columns: dict[int, list[int]], delimiter: str, notices: list[str]
) -> tuple[float, int]:
    """Return mm per unit, and the index of the first line with numbers; a line of units may be missing."""
    number, line = head[3] if len(head) > 3 else (head[2][0] + 1, "")
    cells = split_cells(path, line, number, delimiter)
    first = next(iter(columns.values()))[0]
    if len(cells) > first and cells[0] == "" and cells[first].isalpha():
        return mm_per_unit(path, number, cells[first]), number
    notices.append("the file names no length unit; mm is assumed, which Nexus exports")
    return 1.0, number - 1


def _rows(lines: Lines, first: int) -> Iterator[tuple[int, str]]:
    """Yield the rows of a block, up to the next empty line, without the quotes of a spreadsheet."""
    for number, line in lines.rows(first, block=True):
        if not line.strip(_DELIMITERS + " "):
            return
        yield number, line.replace('"', "")


def _every_frame(rows: Floats, notices: list[str]) -> Floats:
    """Return rows for all frames from the first to the last, those that the file leaves out NaN."""
    frames = rows[:, 0]
    if len(rows) < 2 or not np.isfinite(frames).all() or (np.diff(frames) <= 0).any() or (frames % 1).any():
        return rows
    n_frames = int(frames[-1] - frames[0]) + 1
    if n_frames == len(rows) or n_frames > _MOST_TIMES * len(rows):
        return rows
    missing = counted(n_frames - len(rows), "frame is", "frames are")
    notices.append(f"{missing} left out in the file: nothing is seen then")
    every = np.full((n_frames, rows.shape[1]), np.nan)
    every[(frames - frames[0]).astype(np.intp)] = rows
    return every


def _is_nexus(head: bytes, path: Path) -> bool:
    head_lines = decoded_head(head).splitlines()[:_TITLE_LINES]
    lines = [line for line in head_lines if line.strip(_DELIMITERS + ' "')][:2]
    titled = bool(lines) and _title(lines[0]) in BLOCKS
    if any(_title(line) in BLOCKS for line in head_lines) and any(
        line.strip().lstrip('"').startswith("Frame") and "Sub Frame" in line for line in head_lines
    ):
        return True
    rate = lines[1].replace("Hz", "").strip(_DELIMITERS + ' "') if titled and len(lines) > 1 else "0"
    return titled and rate.replace(".", "", 1).isdigit()


FORMAT = Format(
    name="nexus",
    title="Vicon Nexus CSV",
    suffixes=(".csv",),
    holds="markers",
    sniff=_is_nexus,
    read=lambda path, options: read_nexus(path, options.sample, options.angle_order),
    options=(POINTS, ANGLE_ORDER),
    note="ASCII export of Trajectories, any unit, or of bodies (Objects, Segments); other blocks are left out.",
)
