"""Tidy tables: one row per frame and point, as FreeMoCap (``..._by_frame.csv``) and scripts write them.

One line of titles names, in any order and case, a column of frames (or of times alone), one of names or numbers of
points, and ``x``, ``y``, ``z`` (also ``pos_x``, ``x_mm``, ``X (m)``); a second column of names, such as FreeMoCap's
model, parts points of one name. Without a column of names the points are a cloud; with ``qw``, ``qx``, ``qy``, ``qz``
they are bodies, also with ``roll``, ``pitch``, ``yaw`` or ``rx``, ``ry``, ``rz``. A row per coordinate has columns
``axis`` and ``value``, or names such as ``knee_x`` beside ``value``. Rate, unit and order of angles are those of a wide
table. Cells are parted by commas, semicolons, tabs, strokes or blanks. Where frames are no numbers, as names of images,
times tell them.
"""

from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import counted
from skelgen_formats.assumed_units import notice_landmarks
from skelgen_formats.bodies import BY_ROWS, with_quaternions, with_quaternions_of_matrices
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.options import ANGLE_ORDER, AUTO, POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.table_heads import UNREAD_QUATERNION
from skelgen_formats.table_rows import notice_skipped, without_remarks
from skelgen_formats.text import is_number, is_unseen, number_in, seconds_of, unquoted
from skelgen_formats.tidy_heads import AXIS_IN_NAME, TidyHead, find_tidy_head
from skelgen_formats.time_stamps import since_first
from skelgen_formats.turn_titles import AXES, COMPONENTS, angle_alone, cells_of, numbered_quaternions, order_of
from skelgen_formats.wide import take_from_table

_UNSEEN_FLAGS, _HIDDEN_FLAGS = ("0", "false", "0.0"), ("1", "true", "1.0")
_LONG_STEP = 1000.0  # frames; where more are missing, it does not matter how many
_MOST_TIMES, _FREE_NUMBERS = 16, 1 << 20  # positions that a table may have beside its rows: others are unseen


@dataclass
class _Rows:
    """What the rows hold: of each the frame, the point and its numbers; names of points, times by frame, notices."""

    frames: "array[float]" = field(default_factory=lambda: array("d"))
    points: "array[int]" = field(default_factory=lambda: array("q"))
    numbers: "array[float]" = field(default_factory=lambda: array("d"))
    names: dict[tuple[str, ...], int] = field(default_factory=dict)
    times: dict[float, float] = field(default_factory=dict)
    notices: list[str] = field(default_factory=list)


def read_tidy(path: Path, lines: Lines, options: Options) -> Trajectories | PointCloud | Poses:
    """Read a tidy table of points or bodies from its lines.

    Parameters
    ----------
    path : Path
        The file, for errors.
    lines : Lines
        Of the table.
    options : Options
        `recorded_rate` and `recorded_unit` count.

    Raises
    ------
    FormatError
        If the titles name no frames and coordinates, or a row is not as long as they are.
    """
    head = find_tidy_head(lines)
    if head is None:
        what = "the titles name no frame (or time), name (such as keypoint), x, y and z; write them over the columns"
        raise FormatError(path, 1, what)
    if options.points != AUTO:
        head.at = {what: column for what, column in head.at.items() if what[0] != "r"}
    rows, at = _rows(path, lines, head), head.at
    if "side" in at and "group" not in at and len(rows.frames) > len({*zip(rows.frames, rows.points, strict=True)}):
        at["group"] = at["side"]
        rows = _rows(path, lines, head)
    every, places = np.unique(np.frombuffer(rows.frames), return_inverse=True)
    n_names = len(rows.names)
    if np.isnan(every).any() or len(every) * n_names > _MOST_TIMES * len(rows.frames) + _FREE_NUMBERS:
        what = (
            f"{n_names} points in {len(every)} frames, but only {len(rows.frames)} positions, or some without a frame"
        )
        raise FormatError(path, "", what)
    width = len(_numbered(at))
    if "name" not in at and n_names == 1 and width == len(AXES):
        unread = f"; {UNREAD_QUATERNION}" if numbered_quaternions(head.titles) else ""
        what = "one position per frame, and no column of names: a single point has no skeleton"
        raise FormatError(path, 1, f"{what}{unread}")
    notices = rows.notices + ([] if "axis" in at else _doubts(path, rows, places, "name" in at, width))
    if "frame" in at:
        notice_skipped(Counter(np.diff(every).clip(max=_LONG_STEP).astype(int).tolist()), notices)
    numbers = _spread(rows, places, (len(every), n_names, width), by_axis="axis" in at)
    times = np.array([rows.times[frame] for frame in every.tolist() if rows.times])
    stamps = since_first(times, head.clock.second) if len(times) and head.clock else None
    numbers = _turned(path, numbers, head, options, notices)
    bodies = [f"body {number + 1}" if number else "body" for number in range(n_names)]
    names = bodies if width > len(AXES) and "name" not in at else _distinct([*rows.names])
    take = take_from_table(path, numbers, names, stamps, options, head.unit)
    notices += take.notices
    if not head.unit and options.recorded_unit == AUTO:
        notice_landmarks(head.titles, numbers, notices)
    return replace(take, notices=tuple(notices))


def _spread(rows: _Rows, places: Ints, shape: tuple[int, int, int], *, by_axis: bool) -> Floats:
    """Return the numbers of all points in all frames, of this shape; of the last row where a point has several."""
    numbers = np.full(shape, np.nan)
    points, cells = np.frombuffer(rows.points, dtype=np.int64), np.frombuffer(rows.numbers).reshape(-1, shape[2])
    if not by_axis:
        numbers[places, points] = cells
        return numbers
    for axis in range(shape[2]):
        has = ~np.isnan(cells[:, axis])
        numbers[places[has], points[has], axis] = cells[has, axis]
    return numbers


def _turned(path: Path, numbers: Floats, head: TidyHead, options: Options, notices: list[str]) -> Floats:
    """Return places alone, or with quaternions for angles and matrices."""
    at = head.at
    if numbers.shape[2] == len(AXES) * 2:
        _, order, angle_unit = angle_alone(head.titles[at["rx"]]) or ("", "", "")
        order = order or order_of({axis: at[f"r{axis}"] for axis in AXES})
        return with_quaternions(numbers, order, angle_unit, options, notices)
    if numbers.shape[2] == len(AXES) * 4:
        notices += [BY_ROWS] if "m8" in at else []
        return with_quaternions_of_matrices(path, numbers)
    return numbers


def _numbered(at: dict[str, int]) -> list[int]:
    """Return the columns of x, y, z, and of the quaternion, the matrix or the three angles if these are whole."""
    turn = [at[f"q{component}"] for component in COMPONENTS if f"q{component}" in at]
    angles = [at[f"r{axis}"] for axis in AXES if f"r{axis}" in at]
    matrix = cells_of({what[1:]: column for what, column in at.items() if what[0] == "m"})
    whole = (part for part, n in ((turn, len(COMPONENTS)), (matrix, 9), (angles, len(AXES))) if len(part) == n)
    return [*(at.get(axis, at.get("value", 0)) for axis in AXES), *next(whole, [])]


def _doubts(path: Path, rows: _Rows, places: Ints, are_named: bool, width: int) -> list[str]:
    """Say which rows are of one point in one frame; refuse bodies that nothing tells apart where some are missing."""
    n_points = np.bincount(places)
    if not are_named and width > len(AXES) and len(set(n_points.tolist())) > 1:
        what = f"{n_points.min()} to {n_points.max()} bodies per frame, and no column says which; name them in one"
        raise FormatError(path, 1, what)
    pairs = places * len(rows.names) + np.frombuffer(rows.points, dtype=np.int64)
    twice = len(pairs) - len(np.unique(pairs))
    repeated = f"{counted(twice, 'row is', 'rows are')} of a point that its frame has already; the last counts"
    return [f"{repeated} (write a file for each trial, if there are several)"] if twice else []


def _rows(path: Path, lines: Lines, head: TidyHead) -> _Rows:
    at, clock = head.at, head.clock
    rows, columns, count = _Rows(), _numbered(at), Counter[float]()
    parts = [at[what] for what in ("name", "group") if what in at]
    plain = ((number, unquoted(line, head.delimiter)) for number, line in lines.numbered(head.first + 1))
    counted_by = at.get("frame", clock.column if clock else None)
    for number, line in without_remarks(plain, head.delimiter, counted_by, rows.notices):
        cells = line.split(head.delimiter)
        further = len(head.titles) if head.delimiter else len(cells)
        if len(cells) <= max(at.values()) or any(map(str.strip, cells[further:])) or further < len(head.titles):
            what = f"{counted(len(cells), 'cell is', 'cells are')} too few or many; the file may be cut off"
            raise FormatError(path, number, f"{what}, or have decimal commas: export with decimal points")
        time = clock.moment(cells) if clock else ""
        if clock and not rows.frames and "frame" in at and not is_number(cells[at["frame"]].strip()):
            del at["frame"]  # names of images
        if clock and not rows.frames and not is_number(cells[clock.column].strip()):
            head.clock = replace(clock, second=1.0)
        along = cells[at["axis"]].strip().lower()[-1:] if "axis" in at else ""
        if along and at["axis"] == at["name"]:
            cells[at["name"]] = AXIS_IN_NAME.sub("", cells[at["name"]].strip())
        frame = _number(path, number, seconds_of(cells[at["frame"]]) if "frame" in at else time, "the frame")
        count[frame] += 1
        name = tuple(cells[part].strip() for part in parts) if "name" in at else (f"*{count[frame]}",)
        rows.frames.append(frame)
        rows.points.append(rows.names.setdefault(name, len(rows.names)))
        if clock and frame not in rows.times:
            rows.times[frame] = _number(path, number, time, "the time")
        is_hidden = "flag" in at and cells[at["flag"]].strip().lower() in _UNSEEN_FLAGS
        is_hidden |= "hidden" in at and cells[at["hidden"]].strip().lower() in _HIDDEN_FLAGS
        seen = [_number(path, number, cells[column], "a coordinate") for column in columns]
        if "axis" in at:
            seen = [value if axis == along else np.nan for axis, value in zip(AXES, seen, strict=True)]
        rows.numbers.extend([np.nan] * len(columns) if is_hidden else seen)
    return rows


def _number(path: Path, number: int, cell: str, what: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan if is_unseen(cell.strip()) else number_in(path, number, cell, what)


def _distinct(points: Sequence[tuple[str, ...]]) -> list[str]:
    """Return the names of points, those that stand in two groups with their group before them."""
    count = Counter(point[0] for point in points)
    return [point[0] if count[point[0]] == 1 else "_".join(reversed(point)) for point in points]


FORMAT = Format(
    name="tidy-csv",
    title="Tidy table of points, CSV",
    suffixes=(".csv",),
    holds="markers",
    sniff=lambda head, path: find_tidy_head(decoded_head(head).splitlines()) is not None,
    read=lambda path, options: read_tidy(path, read_lines(path), options),
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT, ANGLE_ORDER),
    note="A row per frame and point: frame, name, x, y, z; without names a cloud, with qw, qx, qy, qz, or roll, pitch,"
    " yaw, bodies.",
)
