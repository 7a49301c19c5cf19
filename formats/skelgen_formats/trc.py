"""TRC: marker trajectories as Motion Analysis writes and OpenSim reads them.

Layout, tab-separated text::

    PathFileType  4  (X/Y/Z)  walk.trc
    DataRate  CameraRate  NumFrames  NumMarkers  Units  OrigDataRate  OrigDataStartFrame  OrigNumFrames
    100  100  3514  11  mm  100  1  3514
    Frame#  Time  LFHD  (empty)  (empty)  RFHD ...      one name per three columns
                  X1    Y1       Z1       X2   ...
    (an empty line, which some programs leave out)
    1  0.00  246.329  -29.647  -6.82  ...               empty cells are unseen

Lines that begin with ``#`` are comments; three zeros are unseen, too. The names are taken in order, since some
programs put them one column off. Written numbers have as many digits as give the same float64 back.

Keys may stand before their values, ``DataRate=100``. The first line may be missing, and the column of frame numbers,
or that of times; without Units they are told by the size of the coordinates. Commas or blanks may stand for the tabs,
blanks between frame number and time alone, and doubled tabs for single ones; the line of coordinate names may be
missing, and names stand over each column (``knee_x``). NumMarkers may differ from the names: what Cortex names beyond
it are virtual markers, which it computed; columns without a name are unlabelled, a cloud if none has one. Where the
times make another rate than DataRate, they count.
"""

import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import replacing
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats, displayable
from skelgen.progress import Monitor, with_progress
from skelgen_formats.assumed_units import mm_per_recorded_unit
from skelgen_formats.lines import Lines, Sample, decoded_head, read_lines
from skelgen_formats.markers import (
    are_outputs,
    equal_unseen,
    more_than_announced,
    scaled,
    take_from_markers,
    zeros_unseen,
)
from skelgen_formats.options import (
    ALL_POINTS,
    AUTO,
    AXES,
    FILLED,
    MARKERS,
    POINTS,
    RATE,
    RECORDED_UNIT,
    UNIT,
    Format,
    Options,
    Writable,
    per_mm,
)
from skelgen_formats.text import (
    count_in,
    is_number,
    number_in,
    parse_rows,
    rate_in,
    whole_lines,
    without_trailing_empty,
)
from skelgen_formats.time_stamps import since_first
from skelgen_formats.writing import (
    check_markers,
    check_writable_names,
    marker_files,
    markers_to_write,
    positions_of,
    write_table,
)

_TITLE = "TRC"
_HEADER_LINES, _NAMES_LINE = 5, 3  # magic, keys, values, names, coordinate names
_LEADING_CELLS = 2  # frame number and time
_FIRST_LINE, _FIRST_KEY = "PathFileType", "DataRate"
_LEADING_TITLE = re.compile(r"(frame|time|time ?stamp|sample)s?\b.*", re.IGNORECASE)  # Frame#, Time, Times, Time (s)
_BY_AXIS = re.compile(r"(.{1,200})[ _.:-]([xyzXYZ])")
_APART = re.compile(r" {2,}")  # what a script put between two names instead of tabs
_DOUBLED, _BLANKS = re.compile(r"\t[\t ]*"), re.compile(r"(?<=\d) +(?=\d)")
_MOST_TIMES, _FEW_CELLS = 16, 1 << 20  # what rows may be padded to, in their own length; cells that any file may have
_TIME_OF_DAY = re.compile(r"^(\d+\D?)[\d:;.]*:[\d:;.]*")  # or a timecode, which the frame rate tells, too
_LAST_UNSEEN = " "  # OpenSim drops cells at the end of a line that hold nothing at all, and misses them
_TIMES_READ, _FEWEST_TIMES = 100, 3
_RATE_TOLERANCE = 0.05  # of the rate: times that are printed with two decimals make it by less
_ORIGINAL = 3  # of the keys are about the recording that the file was made of, which nobody reads
_KEYS = (
    *("DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units"),
    *("OrigDataRate", "OrigDataStartFrame", "OrigNumFrames"),
)


@dataclass(frozen=True)
class _Table:
    """What the header and the rows tell of the columns: what parts cells, each marker's name, how many are measured.

    Rows may have doubled tabs, too few cells (padded), a tab before the first cell (indented), or blanks between frame
    number and time (blank). Before the markers stand frame number and time, or only one of them.
    """

    delimiter: str
    names: list[str]
    n_measured: int
    leading: int = _LEADING_CELLS
    doubled: bool = False
    padded: bool = False
    indented: bool = False
    blank: bool = False

    @property
    def n_cells(self) -> int:
        """Cells of a row."""
        return self.leading + 3 * len(self.names)


def read_trc(
    path: Path, points: str = MARKERS, sample: Sample | None = None, recorded_unit: str = AUTO
) -> Trajectories | PointCloud:
    """Read a TRC file.

    Parameters
    ----------
    path : Path
        The file.
    points : str
        `ALL_POINTS` to read virtual markers, too.
    sample : Sample, optional
        Some frames only.
    recorded_unit : str
        Unit of lengths where the file names none; `AUTO` tells it by their size.

    Returns
    -------
    Trajectories
        Positions in mm; or a `PointCloud` if no trajectory has a label.

    Raises
    ------
    FormatError
        If the header is not that of a TRC file, a line has the wrong number of cells, or there is no frame.
    """
    lines = read_lines(path, sample)
    start = _header_start(path, lines)
    delimiter = _delimiter(lines, start)
    header, start = _pairs(lines, start, delimiter) or (_header(path, lines, start, delimiter), start)
    delimiter = _delimiter(lines, start) if delimiter == " " else delimiter
    announced = count_in(path, start + 3, _value(path, header, "nummarkers", start) or "0", "NumMarkers")
    stated = number_in(path, start + 3, _value(path, header, "datarate", start), "DataRate")
    unit = _value(path, header, "units", start)
    notices: list[str] = []
    table = _table(path, lines, start, delimiter, announced, notices)
    if not table.names:
        raise FormatError(path, start + 4, "no marker is named and none has columns: nothing can be read from it")
    rate = _rate(path, lines, start, table, stated, notices)
    whole = whole_lines(_rows(lines, start, table), len(lines), table.n_cells, delimiter, notices)
    rows = parse_rows(path, whole, table.n_cells, delimiter, leading=table.leading)
    if n_frames := _value(path, header, "numframes", start):  # a template may leave it empty
        _check_length(lines, count_in(path, start + 3, n_frames, "NumFrames"), rows, notices)
    positions = equal_unseen(zeros_unseen(rows.reshape(len(rows), len(table.names), 3)), notices)
    unit = "" if is_number(unit) else unit  # where none stands, the next value may be taken for it
    factor = mm_per_recorded_unit(path, start + 3, unit, positions, recorded_unit, notices)
    virtual = (np.arange(len(table.names)) >= table.n_measured) | are_outputs(table.names)
    computed = None if points == ALL_POINTS else virtual
    return take_from_markers(path, scaled(path, positions, factor), table.names, rate, notices, computed)


def _rate(path: Path, lines: Lines, start: int, table: _Table, stated: float, notices: list[str]) -> float:
    """Return the frame rate that the header states, or that of the first times where these make another one."""
    rows = islice(_rows(lines, start, table), _TIMES_READ)
    whole = whole_lines(rows, len(lines), table.n_cells, table.delimiter, [])
    times = parse_rows(path, whole, table.n_cells, table.delimiter, [table.leading - 1])[:, 0]
    other_units: list[str] = []
    measured = 0.0 if lines.is_sampled or len(times) < _FEWEST_TIMES else since_first(times, 0.0).rate(other_units)
    if not measured or other_units or abs(measured - stated) <= _RATE_TOLERANCE * stated:
        return rate_in(path, start + 3, repr(stated), "DataRate")
    notices.append(f"DataRate says {stated:g} Hz; the times make {measured:g} Hz, which is taken")
    return measured


def _delimiter(lines: Lines, start: int) -> str:
    """Return what parts cells: a tab, a comma, a semicolon, or blanks in a file without any tab in its titles."""
    if (parting := lines[start + 1].strip()[len(_FIRST_KEY) :][:1]) in (",", ";"):
        return parting
    return "\t" if "\t" in lines[start + 1] + lines[start + 3] else " "


def _table(path: Path, lines: Lines, start: int, delimiter: str, announced: int, notices: list[str]) -> _Table:
    """Return the columns that names, NumMarkers and the rows agree on; say so where they do not."""
    titles = [
        cell.strip() for cell in (lines[start + 3].split() if delimiter == " " else lines[start + 3].split(delimiter))
    ]
    apart = [part for title in titles for part in _APART.split(title) if part]
    if len([*filter(None, titles)]) < _LEADING_CELLS + announced <= len(apart):
        titles = apart
    filled = [at for at, title in enumerate(titles) if title]
    leading = [at for at in filled[:_LEADING_CELLS] if _LEADING_TITLE.fullmatch(titles[at])]
    places = [at for at in filled if at not in leading]
    names = [titles[at] for at in places]
    if (points := _named_by_axis(names)) and announced != len(names):
        names, places = points, places[::3]
    table = _Table(delimiter, names, len(names))
    _, first = next(_rows(lines, start, table), (0, ""))
    if len(first.partition(delimiter)[0].split()) == _LEADING_CELLS:
        table = replace(table, blank=True)
    widths = [_filled(line, delimiter) for _, line in islice(_rows(lines, start, table), _TIMES_READ)]
    if len(leading) == 1 and max(widths, default=0) == table.n_cells - 1:
        table = replace(table, leading=1)
    if first.startswith(delimiter) and first.count(delimiter) == table.n_cells:
        table, first = replace(table, indented=True), first[1:]
    if _filled(first, delimiter) > table.n_cells == len(first.replace(delimiter, " ").split()):
        notices.append("cells are parted by doubled tabs, which are taken as single ones")
        table = replace(table, doubled=True)
    if len(names) == announced > 0 or not first:
        return table
    count = _count(path, lines, start, table, announced)
    notices.append(f"NumMarkers says {announced}, {len(names)} markers are named, and {count} have columns")
    if len(names) >= count:
        is_virtual = 0 < announced < count
        return replace(table, names=names[:count], n_measured=announced if is_virtual else count, padded=True)
    columns = [(at - _LEADING_CELLS) // 3 for at in places]
    columns = columns if len({*columns}) == len(columns) and max(columns, default=0) < count else [*range(len(names))]
    every = dict(zip(columns, names, strict=True))
    return replace(
        table, names=[every.get(n, f"unlabelled {n + 1}") for n in range(count)], n_measured=count, padded=True
    )


def _named_by_axis(names: Sequence[str]) -> list[str]:
    """Return the points of titles such as knee_x, knee_y, knee_z; empty if they are not so."""
    found = [_BY_AXIS.fullmatch(name) for name in names]
    parts = [(match[1], match[2].lower()) for match in found if match]
    points = [part[0] for part in parts[::3]]
    return points if parts and parts == [(point, axis) for point in points for axis in "xyz"][: len(names)] else []


def _count(path: Path, lines: Lines, start: int, table: _Table, announced: int) -> int:
    """Return for how many markers there are columns: as many as are named, or announced, or as the longest row has."""
    filled = array("q", (_filled(line, table.delimiter) for _, line in _rows(lines, start, table)))
    longest = -(-max(max(filled) - table.leading, 0) // 3)
    named = len(table.names)
    count = next((count for count in sorted((named, announced)) if longest <= count <= named and count), longest)
    if len(filled) * count > _MOST_TIMES * sum(filled) + _FEW_CELLS:
        what = f"{len(filled)} rows, most of them far shorter than the {count} markers of the longest or of the header"
        raise FormatError(path, start + 4, what)
    return count


def _filled(line: str, delimiter: str) -> int:
    """Number of a line's cells up to the last that is not blank."""
    return line.rstrip(delimiter + " \r").count(delimiter) + 1


def _rows(lines: Lines, start: int, table: _Table) -> Iterator[tuple[int, str]]:
    """Yield the lines with numbers as `parse_rows` wants them; the line of coordinate names may be left out."""
    axes = lines[start + _HEADER_LINES - 1].split()
    has_axes = not axes or not axes[0].replace(".", "", 1).isdigit()
    for number, line in lines.rows(start + _HEADER_LINES - (not has_axes)):
        if line.startswith("#") or not line.strip(table.delimiter + " "):
            continue
        cells = line.removeprefix(table.delimiter) if table.indented else line
        cells = _BLANKS.sub(table.delimiter, cells, count=1) if table.blank else cells
        cells = _DOUBLED.sub(table.delimiter, cells) if table.doubled else cells
        if table.delimiter == " " or table.delimiter not in cells:
            cells = table.delimiter.join(cells.split())
        cells = _TIME_OF_DAY.sub(r"\1", cells, count=1) if ":" in cells else cells
        missing = table.n_cells - 1 - cells.count(table.delimiter) if table.padded else 0
        yield number, cells + table.delimiter * missing


def write_trc(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write labelled markers as TRC; unseen markers are empty cells.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        What to write; the positions of `Filled` are written if `options` want filled ones.
    path : Path
        The file.
    options : Options
        Of the format.
    monitor : Monitor
        Shows progress; may cancel.

    Raises
    ------
    WriteError
        If the value is another one, a name cannot be written, or the file.
    MissingResultError
        If a stage has not run whose result is written.
    """
    markers = markers_to_write(value, _TITLE, options.filled, monitor)
    take = positions_of(markers)
    names = check_writable_names(path, take.names, "\t", str.strip)
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(_header_text(path, take, names, options.unit))
        frames = zip(take.times.tolist(), take.positions * per_mm(options.unit), strict=True)
        for number, (time, row) in enumerate(with_progress(frames, take.n_frames, monitor), start=1):
            cells = ["" if x != x else repr(x) for x in row.ravel().tolist()]  # noqa: PLR0124 - NaN differs from itself
            cells[-1:] = [cells[-1] or _LAST_UNSEEN] if cells else []
            stream.write(f"{number}\t{time!r}\t" + "\t".join(cells) + "\n")
    write_table(markers, path)


def _header_start(path: Path, lines: Lines) -> int:
    """Return the index of the first line; of the one before the keys where it is missing."""
    for number, line in lines.numbered():
        is_keys = _begins(line, _FIRST_KEY)
        if is_keys or _begins(line, _FIRST_LINE):
            if len(lines) < number - 1 - is_keys + _HEADER_LINES:
                raise FormatError(path, len(lines), "the header is cut off; five lines belong to it")
            return number - 1 - is_keys
        if not line.startswith("#"):
            break
    raise FormatError(path, 1, f"a TRC file begins with {_FIRST_LINE}; this one does not")


def _begins(line: str, word: str) -> bool:
    return line.lstrip().lower().startswith(word.lower())


def _is_trc(head: bytes, path: Path) -> bool:
    lines = decoded_head(head).split("\n")[:20]
    is_keys = (_begins(line, _FIRST_KEY) and "nummarkers" in line.lower() for line in lines)
    return any(_begins(line, _FIRST_LINE) for line in lines) or any(is_keys)


def _pairs(lines: Lines, start: int, delimiter: str) -> tuple[dict[str, str], int] | None:
    """Return what keys before their values say, and the index from which the names are as far as from two lines."""
    known, found, end = {*map(str.lower, _KEYS)}, dict[str, str](), start + 1
    for line in lines[start + 1 : start + 1 + len(_KEYS)]:
        cells = [part.strip() for cell in line.split(delimiter) if cell.strip() for part in cell.split("=", 1)]
        keys = [cell.lower() for cell in cells[::2]]
        if not keys or len(cells) % 2 or not known.issuperset(keys) or known & {*map(str.lower, cells[1::2])}:
            break
        found |= zip(keys, cells[1::2], strict=True)
        end += 1
    return (found, end - _NAMES_LINE) if found else None


def _header(path: Path, lines: Sequence[str], start: int, delimiter: str) -> dict[str, str]:
    keys, values = ([cell.strip() for cell in lines[start + row].split(delimiter)] for row in (1, 2))
    if len(values) < len([*filter(None, keys)]):  # some write blanks between a few of them
        values = lines[start + 2].replace(delimiter, " ").split()
    named, filled = [key for key in keys if key], [value for value in values if value]
    if len(named) == len(filled):  # doubled tabs need not stand in the same places
        keys, values = named, filled
    needed = len(_KEYS) - _ORIGINAL
    if len(without_trailing_empty(keys)) > len(values) and not needed <= len(filled) <= len(_KEYS):
        raise FormatError(path, start + 3, f"{len(values)} values where the line above names {len(keys)}")
    return {key.lower(): value for key, value in zip(keys, values, strict=False) if key}


def _value(path: Path, header: dict[str, str], key: str, start: int) -> str:
    if key not in header:
        raise FormatError(path, start + 2, f"the header does not name {key}; it names {', '.join(header)[:120]}")
    return header[key]


def _check_length(lines: Lines, announced: int, rows: Floats, notices: list[str]) -> None:
    # People shorten TRC files by hand and leave the header as it is, so fewer frames are no proof of damage.
    n_frames = lines.count(rows)
    if n_frames == announced:
        return
    notices.append(more_than_announced(n_frames, announced))
    if 0 < n_frames < announced and lines[-1].strip():
        rows[-1, -1] = np.nan  # the marker's other coordinates follow when half-seen markers become unseen
        notices.append("the last line has no line end, so its last marker, which may be cut off, is taken as unseen")


def _header_text(path: Path, take: Trajectories, names: Sequence[str], unit: str) -> str:
    values = [take.rate, take.rate, take.n_frames, take.n_markers, unit, take.rate, 1, take.n_frames]
    coordinates = [f"{axis}{number}" for number in range(1, take.n_markers + 1) for axis in "XYZ"]
    rows = [(_FIRST_LINE, "4", "(X/Y/Z)", displayable(path.name)), _KEYS, map(str, values)]
    titles = "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t"
    return "\n".join([*("\t".join(row) for row in rows), titles, "\t\t" + "\t".join(coordinates), "", ""])


FORMAT = Format(
    name="trc",
    title="TRC (Motion Analysis, OpenSim)",
    suffixes=(".trc",),
    holds="markers",
    sniff=_is_trc,
    read=lambda path, options: read_trc(path, options.points, options.sample, options.recorded_unit),
    write=write_trc,
    check=lambda value, options: check_markers(value, _TITLE, options.filled),
    files=lambda path, options: marker_files(path, options.filled),
    keeps=("markers", "names"),
    options=(POINTS, RECORDED_UNIT, AXES, UNIT, RATE, FILLED),
    note="Unit from the header, else by size; empty cells and three zeros are unseen; written with full precision.",
)
