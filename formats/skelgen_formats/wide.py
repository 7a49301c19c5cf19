"""Wide tables: one row per frame, three columns per point, as scripts write them, in CSV or Parquet.

Titles are one line, ``name_x,name_y,name_z,...`` (also with a point, a blank or nothing between, any case, and a unit
behind: ``name_x_mm``, ``name X (m)``), as anipose and FreeMoCap write them; or two, the name over the first of the
columns X, Y, Z; or those of DeepLabCut in 3D, ``scorer``, ``bodyparts`` and ``coords``; or the five of an ASCII export
of Visual3D: file, signal, type, folder, and ``ITEM  X  Y  Z``. Other columns are left out.

Few such files state a frame rate or a unit: in lines of a word and a value before the titles (``Frequency: 100``,
``Units: mm``). Else the rate is that of a column with times, or 100 Hz is assumed, and the unit by the size of the
coordinates; options state both. Columns of forces, accelerations, angles and the like are no points and are left out.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import FormatError, MissingPackageError
from skelgen.files import open_regular
from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.rates import rate_of
from skelgen_formats.lines import decoded_head, read_lines
from skelgen_formats.markers import assumed_mm_per_unit, mm_per_unit, scaled, take_from_markers, zeros_unseen
from skelgen_formats.options import AUTO, POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.text import parse_rows, rate_in

ASSUMED_RATE = 100.0
"""Frame rate [Hz] of files that state none."""

QUOTED = re.compile(r'"([^"]*)"')
"""A cell in quotes, which may hold what parts cells."""

_TITLE = re.compile(r"(.{1,200}?)[ _.:-]?([xyzXYZ])(?:[ _]?[\[(]?(mm|cm|m)[\])]?)?")
_TURNED = re.compile(r"([xyzXYZ])[ _.:-]?(.{1,200})")  # the axis first: x_nose, X1
_AXES = "xyz"
_NO_PLACES = re.compile(
    r"(.*[_ .:-])?(l?acc|accel\w*|gyro?\w*|mag|magnet\w*|quat\w*|euler|rot|rotation|orientation|ang|angles?|angular"
    r"|omega|forces?|moments?|torques?|grf|vel|velocity|velocities|speed)([_ .:-].*)?",
    re.IGNORECASE,
)
_STATED = re.compile(r"(?:[a-z]+[ _]){0,3}(frequency|rate|framerate|fps|units?)\W*", re.IGNORECASE)
_PREAMBLE, _TITLE_LINES = 16, 8  # lines before the titles, and of titles, at most
_MOST_STATED = 2  # cells of a line before the titles: a word and a value
_TIMES = (
    *("time", "times", "timestamp", "timestamps", "t", "seconds", "zeit", "temps"),
    *("time_s", "time (s)", "time [s]", "time(s)"),
)
_VISUAL3D = ("TARGET", "LANDMARK")  # types of its signals that are points
_DEEPLABCUT = ("scorer", "individuals", "bodyparts", "coords")
_DELIMITERS = (",", ";", "\t")
_SLOWEST, _FASTEST = 1.0, 1e5  # Hz, of times in seconds
_FEWEST = 2  # points of a table that no word says what it is
_MOST_TIMES, _FREE_MEMORY = 100, 1 << 24  # what a Parquet file may hold, beside its size, in bytes


@dataclass
class _Columns:
    """Which columns are what: x, y, z of each point by name, times, unit and rate as stated, and what lies first."""

    points: dict[str, list[int]] = field(default_factory=dict)
    times: int | None = None
    unit: str = ""
    rate: str = ""
    n_cells: int = 0
    n_titles: int = 1
    notices: list[str] = field(default_factory=list)


def read_wide_csv(path: Path, options: Options) -> Trajectories | PointCloud:
    """Read a table of points.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `recorded_rate`, `recorded_unit` and `sample` count.

    Raises
    ------
    FormatError
        If the titles name no points, points have two coordinates, or a row is not as long as they are.
    """
    lines = read_lines(path, options.sample)
    delimiter, columns = _columns_of([line for _, line in islice(lines.numbered(), _PREAMBLE + _TITLE_LINES)])
    if columns is None:
        what = "no line of titles such as name_x, name_y, name_z was found; write them over the columns"
        raise FormatError(path, 1, what)
    if not columns.points and columns.notices:
        raise FormatError(path, 1, f"the columns are {columns.notices[0]}; nothing else is there")
    if not columns.points:
        raise FormatError(path, 1, "points have two coordinates: 2D; triangulate them first, e.g. with anipose")
    wanted = [column for triple in columns.points.values() for column in triple]
    times = [columns.times] if columns.times is not None else []
    n_cells = columns.n_cells
    numbered = list(islice(lines.numbered(), columns.n_titles))
    first = numbered[-1][0] if numbered else 0
    least = 0 if times else n_cells - 1  # without times, a row of empty cells is a frame in which nothing is seen
    numbers = _padded(lines.rows(first, least=least), delimiter, least)
    rows = parse_rows(path, numbers, n_cells, delimiter, wanted + times)
    positions = rows[:, : len(wanted)].reshape(len(rows), len(columns.points), 3)
    stamps = rows[:, -1] if times else None
    if times and options.sample and options.sample.n_left_out:
        head = islice(_padded(lines.numbered(first), delimiter, least), options.sample.most)
        stamps = parse_rows(path, head, n_cells, delimiter, times)[:, 0]
        columns.notices.append(f"the frame rate is that of the first {len(stamps)} time stamps")
    if columns.rate and options.recorded_rate == AS_RECORDED_RATE:
        options = replace(options, recorded_rate=rate_in(path, 1, columns.rate, "the frame rate"))
    take = take_from_table(path, positions, list(columns.points), stamps, options, columns.unit)
    return replace(take, notices=(*columns.notices, *take.notices))


def take_from_table(
    path: Path, positions: Floats, names: Sequence[str], times: Floats | None, options: Options, unit: str = ""
) -> Trajectories | PointCloud:
    """Return the take of positions of which no file says rate and unit for certain.

    Parameters
    ----------
    path : Path
        The file.
    positions : ndarray, shape (n_frames, n_points, 3)
        In the file's unit; NaN or three zeros where unseen.
    names : sequence of str, length n_points
        Of the points.
    times : ndarray, shape (n,), s, or None
        Time stamps, of some frames at least.
    options : Options
        `recorded_rate` and `recorded_unit` count.
    unit : str
        What the file says, or empty.
    """
    notices: list[str] = []
    positions = zeros_unseen(np.array(positions, dtype=np.float64))
    stated = options.recorded_unit if options.recorded_unit != AUTO else unit
    factor = mm_per_unit(path, "", stated) if stated else assumed_mm_per_unit(positions, notices)
    notices = [f"{notice}; `--recorded-unit` states another" for notice in notices]
    rate = options.recorded_rate
    if rate == AS_RECORDED_RATE and times is not None and np.isfinite(times).all() and (np.diff(times) > 0).all():
        by_times = rate_of(times)
        if len(times) > 1 and _SLOWEST < by_times < _FASTEST:  # else they count frames or milliseconds
            rate = by_times
    if rate == AS_RECORDED_RATE:
        rate = ASSUMED_RATE
        notices.append("the file states no frame rate; 100 Hz is assumed, `--recorded-rate` states another")
    return take_from_markers(path, scaled(path, positions, factor), names, rate, notices)


def _columns_of(head: Sequence[str]) -> tuple[str, _Columns | None]:
    """Return the delimiter and the columns that the titles name; None if they are no titles of points."""
    for delimiter in _DELIMITERS:
        every = [[cell.strip().strip('"') for cell in line.split(delimiter)] for line in head]
        last = next((at for at, row in enumerate(every) if sum(map(bool, row)) > _MOST_STATED), 0)
        starts = [] if ["endheader"] in [row[:1] for row in every] else range(min(last, _PREAMBLE) + 1)  # of OpenSim
        for first, find in product(starts if every else [], (_visual3d, _deeplabcut, _under_names, _in_one_line)):
            if len(every[first]) > 1 and (columns := find(every[first : first + _TITLE_LINES])) is not None:
                return delimiter, _with_preamble(columns, every[:first])
    return ",", None


def _with_preamble(columns: _Columns, before: list[list[str]]) -> _Columns:
    """Return the columns with what the lines before the titles state, and without what is no point."""
    no_points = [name for name in columns.points if _NO_PLACES.fullmatch(name)]
    if no_points:
        columns.notices.append(f"no points, and left out: {', '.join(no_points[:8])}")
    columns.points = {name: triple for name, triple in columns.points.items() if name not in no_points}
    columns.n_titles += len(before)
    for row in before:
        key, _, value = ":".join(filter(None, row)).partition(":")
        stated = _STATED.fullmatch(key)
        if stated and stated[1].lower().startswith("unit"):
            columns.unit = columns.unit or value.strip(": ")
        elif stated:
            columns.rate = value.strip(": Hzfps")
    return columns


def _in_one_line(rows: list[list[str]]) -> _Columns | None:
    titles = rows[0]
    if not any(_TITLE.fullmatch(title) for title in titles):
        titles = [f"{turned[2]}_{turned[1]}" if (turned := _TURNED.fullmatch(title)) else title for title in titles]
    found = _Columns(n_cells=len(titles))
    for first in range(len(titles) - 2):
        parts = [_TITLE.fullmatch(title) for title in titles[first : first + 3]]
        named = [(part[1], part[3]) for part in parts if part]
        if len(named) == 3 and len(set(named)) == 1 and [p[2].lower() for p in parts if p] == [*_AXES]:
            found.points.setdefault(named[0][0], [first, first + 1, first + 2])
            found.unit = named[0][1] or ""
    found.times = next((column for column, title in enumerate(titles) if title.lower() in _TIMES), None)
    return found if len(found.points) >= _FEWEST else None


def _under_names(rows: list[list[str]]) -> _Columns | None:
    """Names over the first of three columns X, Y, Z; frame and time may stand before."""
    if len(rows) < 2:
        return None
    names, axes = rows[0], [cell.lower() for cell in rows[1]]
    found = _Columns(n_cells=len(axes), n_titles=2)
    for first in range(min(len(names), len(axes) - 2)):
        if names[first] and axes[first : first + 3] == [*_AXES]:
            found.points.setdefault(names[first], [first, first + 1, first + 2])
    n_axes = sum(axis in _AXES for axis in axes if axis)
    titles = zip(names, axes, strict=False)
    found.times = next((at for at, pair in enumerate(titles) if any(one.lower() in _TIMES for one in pair)), None)
    return found if len(found.points) >= _FEWEST and n_axes == 3 * len(found.points) else None


def _deeplabcut(rows: list[list[str]]) -> _Columns | None:
    titled = {row[0].lower(): row for row in rows if row[0].lower() in _DEEPLABCUT}
    if "bodyparts" not in titled or "coords" not in titled:
        return None
    parts, coords = titled["bodyparts"], [cell.lower() for cell in titled["coords"]]
    people = titled.get("individuals", [""] * len(parts))
    found = _Columns(n_cells=len(coords), n_titles=len(titled))
    for first in range(1, min(len(parts), len(people), len(coords) - 2)):
        if coords[first : first + 3] == [*_AXES]:
            name = f"{people[first]}:{parts[first]}" if len(set(people[1:])) > 1 else parts[first]
            found.points.setdefault(name, [first, first + 1, first + 2])
    return found


def _visual3d(rows: list[list[str]]) -> _Columns | None:
    """Targets and landmarks of an ASCII export of Visual3D: of the first trial, and of the first folder of a signal."""
    if len(rows) < 5 or rows[4][0].upper() != "ITEM":
        return None
    files, names, kinds, _, axes = rows[:5]
    found = _Columns(n_cells=len(axes), n_titles=5)
    left_out = 0
    for first in range(1, min(map(len, rows[:5])) - 2):
        if kinds[first].upper() in _VISUAL3D and [axis.lower() for axis in axes[first : first + 3]] == [*_AXES]:
            triple = [first, first + 1, first + 2]
            left_out += files[first] != files[1] or found.points.setdefault(names[first], triple) != triple
    if left_out:
        found.notices.append(f"{left_out} signals of further trials or folders are left out; export them alone")
    found.times = next((at for at, name in enumerate(names) if at and name.upper() == "TIME"), None)
    return found if found.points else None


def _padded(lines: Iterable[tuple[int, str]], delimiter: str, least: int) -> Iterator[tuple[int, str]]:
    """Yield the lines with numbers, without quotes and what parts cells within them; blank ones are left out."""
    for number, line in lines:
        if line.strip(delimiter + " ") or 0 < least <= len(line):
            yield number, QUOTED.sub(lambda cell: cell[1].replace(delimiter, " "), line) if '"' in line else line


def _is_wide(head: bytes, path: Path) -> bool:
    lines = [line for line in decoded_head(head).splitlines() if line.strip()]
    return _columns_of(lines[: _PREAMBLE + _TITLE_LINES] or [""])[1] is not None


CSV = Format(
    name="wide-csv",
    title="Wide table of points, CSV",
    suffixes=(".csv",),
    holds="markers",
    sniff=_is_wide,
    read=read_wide_csv,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Columns name_x, name_y, name_z, as of anipose, FreeMoCap and DeepLabCut in 3D; rate and unit by option.",
)


def read_wide_parquet(path: Path, options: Options) -> Trajectories | PointCloud:
    """Read a table of points.

    Parameters
    ----------
    path, options
        See `read_wide_csv`, of which the errors are, too.

    Raises
    ------
    MissingPackageError
        If pyarrow is not installed.
    """
    try:
        from pyarrow import ArrowException, parquet  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise MissingPackageError(f"{path}: Parquet needs `pip install skelgen-mocap[tables]`") from error
    try:
        with open_regular(path) as stream:
            file = parquet.ParquetFile(stream)
            columns = _in_one_line([list(file.schema_arrow.names)])
            if columns is None:
                raise FormatError(path, "", "no columns such as name_x, name_y, name_z; name them so")
            wanted = [column for triple in columns.points.values() for column in triple]
            wanted += [columns.times] if columns.times is not None else []
            names = [file.schema_arrow.names[column] for column in wanted]
            twice = [name for name in names if file.schema_arrow.names.count(name) > 1]
            if twice:
                raise FormatError(path, "", f"two columns are called {twice[0]}")
            size = 8 * file.metadata.num_rows * len(names)
            if size > _MOST_TIMES * path.stat().st_size + _FREE_MEMORY:
                raise FormatError(path, "", f"announces {size} bytes of numbers, far more than such a file holds")
            table: Any = file.read(names)
        numbers = np.stack([_numbers(path, table.column(name)) for name in names], axis=1)
    except (ArrowException, OSError, ValueError) as error:
        raise FormatError(path, "", f"no Parquet file, or damaged: {' '.join(str(error).split())}") from error
    n_numbers = 3 * len(columns.points)
    frames = np.arange(len(numbers))
    positions = numbers[options.sample.of(frames) if options.sample else frames, :n_numbers]
    positions = positions.reshape(len(positions), len(columns.points), 3)
    times = numbers[:, -1] if columns.times is not None else None
    return take_from_table(path, positions, list(columns.points), times, options, columns.unit)


def _numbers(path: Path, column: Any) -> Floats:
    try:
        return np.asarray(column.to_numpy(), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FormatError(path, "", "a column of coordinates does not hold numbers") from error


PARQUET = Format(
    name="wide-parquet",
    title="Wide table of points, Parquet",
    suffixes=(".parquet",),
    holds="markers",
    sniff=lambda head, path: head.startswith(b"PAR1"),
    read=read_wide_parquet,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Columns as in wide-csv. Needs the extra `tables`.",
)
