"""Tidy tables: one row per frame and point, as FreeMoCap (``..._by_frame.csv``) and scripts write them.

One line of titles names, in any order and case, a column of frames (or of times alone), one of names or numbers of
points, and ``x``, ``y``, ``z`` (also ``pos_x``, ``x_mm``, ``X (m)``); a second column of names, such as FreeMoCap's
model, parts points of one name. Without a column of names the points are a cloud; with ``qw``, ``qx``, ``qy``, ``qz``
they are bodies, also with ``roll``, ``pitch``, ``yaw`` or ``rx``, ``ry``, ``rz``. A row per coordinate has columns
``axis`` and ``value``, or names such as ``knee_x`` beside ``value``. Rate, unit and order of angles are those of a wide
table. Cells are parted by commas, semicolons, tabs, strokes or blanks. Where frames are no numbers, as names of images,
times tell them; where nothing tells them, the rows of a name follow each other.
"""

import math
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import counted
from skelgen_formats.flags import FEWEST_TOLD, RESIDUAL_OF_UNSEEN, Flag, are_unsure, is_seen, number_of
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.options import ANGLE_ORDER, AUTO, POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.row_owners import spread
from skelgen_formats.table_rows import FOLLOWING, notice_skipped, reread_with_marks, with_plain_numbers, without_remarks
from skelgen_formats.text import is_number, is_unseen, number_or_nan, seconds_of, unquoted
from skelgen_formats.tidy_heads import AXIS_IN_NAME, TidyHead, find_tidy_head
from skelgen_formats.time_stamps import since_first
from skelgen_formats.title_lines import UNREAD_QUATERNION
from skelgen_formats.turn_titles import AXES, numbered_quaternions
from skelgen_formats.wide import take_from_head, with_stated_rate

_HIDDEN = -np.inf  # in place of a grade
_FLAGS = {"flag": Flag(), "hidden": Flag(hides=True), "state": Flag(in_words=True)}
_GRADE = Flag(is_graded=True)
_LONG_STEP = 1000.0  # frames; where more are missing, it does not matter how many


@dataclass
class _Rows:
    """What rows hold: of each the frame, trial, point, numbers and grade; names of points, times by frame, notices."""

    frames: "array[float]" = field(default_factory=lambda: array("d"))
    trials: "array[int]" = field(default_factory=lambda: array("q"))
    points: "array[int]" = field(default_factory=lambda: array("q"))
    numbers: "array[float]" = field(default_factory=lambda: array("d"))
    grades: "array[float]" = field(default_factory=lambda: array("d"))
    names: dict[tuple[str, ...], int] = field(default_factory=dict)
    takes: dict[str, int] = field(default_factory=dict)
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
    at, body = head.at, head.bodies[0]
    if options.points != AUTO:
        body.angles.clear()
    if body.turn and not body.is_turned and not body.has_angles:
        head.notices.append("quaternions of which no title names one of w, x, y, z are left out")
    head.notices += [UNREAD_QUATERNION] if numbered_quaternions(head.titles) else []
    rows = reread_with_marks(head, lambda: _rows(path, lines, head))
    if "side" in at and "group" not in at and len(rows.frames) > len({*zip(rows.frames, rows.points, strict=True)}):
        at["group"] = at["side"]
        rows = _rows(path, lines, head)
    head.notices += rows.notices
    frames, n_names, width = np.frombuffer(rows.frames), len(rows.names), len(head.columns)
    if not np.isfinite(frames).all():
        raise FormatError(path, "", "holds rows without a frame")
    if len(rows.takes) > 1:
        head.notices.append(f"{head.titles[at['trial']]} changes: {FOLLOWING}")
        frames = frames + np.frombuffer(rows.trials, dtype=np.int64) * (np.ptp(frames) + 1.0)
    every, places = np.unique(frames, return_inverse=True)
    if "name" not in at and n_names == 1 and width == len(AXES):
        what = "one position per frame, and no column of names: a single point has no skeleton"
        raise FormatError(path, 1, "; ".join([what, *head.notices]))
    points = np.frombuffer(rows.points, dtype=np.int64)
    _check_rows(path, head, places, points)
    if head.frames is not None and len(rows.takes) < 2:
        notice_skipped(Counter(np.diff(every).clip(max=_LONG_STEP).astype(int).tolist()), head.notices)
    cells = _sure(np.frombuffer(rows.numbers).reshape(-1, width), np.frombuffer(rows.grades), points, head)
    shape = (len(every), n_names * _n_points_of_name(head))
    numbers = spread(path, cells, np.stack([places, points], axis=1), shape)
    times = np.array([rows.times[frame] for frame in every.tolist() if frame in rows.times])  # of the first trial
    stamps = since_first(times, head.clock.second, head.clock.counts_frames) if len(times) and head.clock else None
    bodies = [f"body {number + 1}" if number else "body" for number in range(n_names)]
    names = bodies if width > len(AXES) and "name" not in at else _distinct([*rows.names])
    numbers = numbers.reshape(len(every), n_names, width * _n_points_of_name(head))
    if stamps is None or stamps.rate([]) == AS_RECORDED_RATE:
        options = with_stated_rate(path, head, options, None)
    return take_from_head(path, numbers, names, head, stamps, options)


def _sure(cells: Floats, grades: Floats, points: Ints, head: TidyHead) -> Floats:
    """Return the numbers of rows, NaN where a point is hidden, or has the grade 0, if that is not the grade of all.

    Rows without a grade are of a point that is unseen there, if it has one in at least half of its rows.
    """
    is_empty, is_hidden = np.isnan(grades), grades == _HIDDEN
    is_told = np.bincount(points, weights=~is_empty) >= FEWEST_TOLD * np.bincount(points)
    unsure = are_unsure(np.where(is_hidden, 0.0, grades)) | (is_empty & is_told[points])
    unsure = is_hidden if unsure.all() else unsure
    if unsure.any():
        positions = counted(int(unsure.sum()) // _n_points_of_name(head), "position is", "positions are")
        told = "flags" if (is_hidden == unsure).all() else "flags or confidences"
        head.notices.append(f"{positions} unseen, as the columns of {told} say")
    return np.where(unsure[:, np.newaxis], np.nan, cells)


def _n_points_of_name(head: TidyHead) -> int:
    """Three where each coordinate has a row."""
    return len(AXES) if "value" in head.at else 1


def _check_rows(path: Path, head: TidyHead, places: Ints, points: Ints) -> None:
    """Say which rows are of one point in one frame; refuse bodies that nothing tells apart where some are missing."""
    n_points = np.bincount(places)
    if "name" not in head.at and len(head.columns) > len(AXES) and len({*n_points.tolist()}) > 1:
        what = f"{n_points.min()} to {n_points.max()} bodies per frame, and no column says which; name them in one"
        raise FormatError(path, 1, what)
    if twice := len(points) - len(np.unique(places * (points.max(initial=0) + 1) + points)):
        repeated = f"{counted(twice, 'row is', 'rows are')} of a point that its frame has already; the last counts"
        head.notices.append(f"{repeated} (write a file for each trial, if there are several)")


def _rows(path: Path, lines: Lines, head: TidyHead) -> _Rows:
    at, clock = head.at, head.clock
    rows, columns, count, left_out = _Rows(), head.columns, Counter[tuple[object, ...]](), 0
    flags = [(at[what], flag) for what, flag in _FLAGS.items() if what in at]
    parts = [at[what] for what in ("name", "group") if what in at and "name" in at]
    for number, cells in _cells(path, lines, head, rows.notices):
        time = clock.moment(cells) if clock else ""
        if clock and not rows.frames:
            if head.frames is not None and not is_number(cells[head.frames].strip()):
                head.frames = None  # names of images
            head.clock = clock.told_by(cells[clock.column])
        along = AXES.find(cells[at["axis"]].strip().lower()[-1:] or " ") if "value" in at else 0
        if "value" in at and at["axis"] == at["name"]:
            cells[at["name"]] = AXIS_IN_NAME.sub("", cells[at["name"]].strip())
        if along < 0:
            left_out += 1
            continue
        moment = time if head.frames is None else seconds_of(cells[head.frames])
        name = tuple(cells[part].strip() for part in parts)
        # without frames and times, the rows of a name follow each other
        frame = float(count[name, along]) if head.counts is None else number_or_nan(path, number, moment, "the frame")
        count[name, along] += 1
        count[frame,] += 1
        name = name or (f"*{count[frame,]}",)
        rows.frames.append(frame)
        rows.trials.append(rows.takes.setdefault(cells[at["trial"]] if "trial" in at else "", len(rows.takes)))
        rows.points.append(rows.names.setdefault(name, len(rows.names)) * _n_points_of_name(head) + along)
        if clock and frame not in rows.times:
            rows.times[frame] = number_or_nan(path, number, time, "the time")
        numbers = [number_or_nan(path, number, cells[column], "a coordinate") for column in columns]
        rows.numbers.extend(numbers)
        is_hidden = any(is_seen(cells[column], flag) is False for column, flag in flags)
        rows.grades.append(_HIDDEN if is_hidden else _grade(path, number, at, cells))
    if left_out:
        rows.notices.append(f"{counted(left_out, 'row is', 'rows are')} of no x, y or z, and left out")
    return rows


def _grade(path: Path, number: int, at: Mapping[str, int], cells: Sequence[str]) -> float:
    """How surely a point is seen by its confidence, in numbers or words, and by its residual; NaN if nothing says."""
    grade, residual = (cells[at[what]].strip() if what in at else "1" for what in ("grade", "residual"))
    if is_number(residual) and number_or_nan(path, number, residual, "a residual") == RESIDUAL_OF_UNSEEN:
        return 0.0
    if "flag" in at and is_unseen(cells[at["flag"]].strip()):
        return math.nan
    return number_of(grade, _GRADE)


def _cells(path: Path, lines: Lines, head: TidyHead, notices: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each row, and its number; all that are wanted are there."""
    n_cells = max(*head.at.values(), *head.columns, head.frames or 0) + 1
    plain = ((number, unquoted(line, head.delimiter)) for number, line in lines.numbered(head.n_lines))
    for number, line in without_remarks(with_plain_numbers(plain, head, head.columns), head, notices):
        cells = line.split(head.delimiter)
        further = len(head.titles) if head.delimiter else len(cells)
        if len(cells) < n_cells or any(map(str.strip, cells[further:])) or further < len(head.titles):
            what = f"{counted(len(cells), 'cell is', 'cells are')} too few or many; the file may be cut off"
            raise FormatError(path, number, f"{what}, or have decimal commas: export with decimal points")
        yield number, cells


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
