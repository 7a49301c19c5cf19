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
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import replacing
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats, displayable
from skelgen.progress import SILENT, Monitor, with_progress
from skelgen_formats.markers import (
    check_markers,
    check_writable_names,
    marker_files,
    markers_to_write,
    mm_per_unit,
    positions_of,
    scaled,
    take_from_markers,
    write_table,
    zeros_unseen,
)
from skelgen_formats.options import AXES, FILLED, RATE, UNIT, Format, Writable, per_mm
from skelgen_formats.text import Lines, count_in, decoded_head, parse_rows, rate_in, read_lines, without_trailing_empty

_TITLE = "TRC"
_HEADER_LINES = 5  # magic, keys, values, names, coordinate names
_LEADING_CELLS = 2  # frame number and time
_FIRST_LINE = "PathFileType"
_LAST_UNSEEN = " "  # OpenSim drops cells at the end of a line that hold nothing at all, and misses them
_KEYS = (
    *("DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units"),
    *("OrigDataRate", "OrigDataStartFrame", "OrigNumFrames"),
)


def read_trc(path: Path) -> Trajectories | PointCloud:
    """Read a TRC file.

    Returns
    -------
    Trajectories
        Positions in mm; or a `PointCloud` if no trajectory has a label.

    Raises
    ------
    FormatError
        If the header is not that of a TRC file, a line has the wrong number of cells, or there is no frame.
    """
    lines = read_lines(path)
    start = _header_start(path, lines)
    header = _header(path, lines, start)
    n_markers = count_in(path, start + 3, _value(path, header, "nummarkers", start), "NumMarkers")
    names = [cell.strip() for cell in lines[start + 3].split("\t")[_LEADING_CELLS:] if cell.strip()]
    if len(names) != n_markers:
        raise FormatError(path, start + 4, f"{len(names)} marker names where NumMarkers says {n_markers}")
    rate = rate_in(path, start + 3, _value(path, header, "datarate", start), "DataRate")
    factor = mm_per_unit(path, start + 3, _value(path, header, "units", start))
    frames = (numbered for numbered in lines.numbered(start + _HEADER_LINES) if not numbered[1].startswith("#"))
    rows = parse_rows(path, frames, _LEADING_CELLS + 3 * n_markers, "\t", leading=_LEADING_CELLS)
    notices: list[str] = []
    announced = count_in(path, start + 3, _value(path, header, "numframes", start), "NumFrames")
    _check_length(lines, announced, rows, notices)
    positions = zeros_unseen(rows.reshape(len(rows), n_markers, 3))
    return take_from_markers(path, scaled(path, positions, factor), names, rate, notices)


def write_trc(
    value: Writable, path: Path, filled: bool = False, unit: str = "mm", monitor: Monitor = SILENT
) -> list[Path]:
    """Write labelled markers as TRC; unseen markers are empty cells.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        What has labelled markers.
    path : Path
        The file.
    filled : bool
        Whether filled positions are written too, and the table that says which they are.
    unit : str
        Of the lengths in the file: ``mm``, ``cm`` or ``m``.
    monitor : Monitor
        Shows progress; may cancel.

    Raises
    ------
    WriteError
        If the value has no labelled markers, or a name holds a tab or line end.
    """
    markers = markers_to_write(value, _TITLE, filled, monitor)
    take = positions_of(markers)
    names = check_writable_names(path, take.names, "\t", str.strip)
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(_header_text(path, take, names, unit))
        frames = zip(take.times.tolist(), take.positions * per_mm(unit), strict=True)
        for number, (time, row) in enumerate(with_progress(frames, take.n_frames, monitor), start=1):
            cells = ["" if x != x else repr(x) for x in row.ravel().tolist()]  # noqa: PLR0124 - NaN differs from itself
            cells[-1:] = [cells[-1] or _LAST_UNSEEN] if cells else []
            stream.write(f"{number}\t{time!r}\t" + "\t".join(cells) + "\n")
    return [path, *write_table(markers, path)]


def _header_start(path: Path, lines: Lines) -> int:
    for number, line in lines.numbered():
        if line.startswith(_FIRST_LINE):
            if len(lines) < number - 1 + _HEADER_LINES:
                raise FormatError(path, len(lines), "the header is cut off; five lines belong to it")
            return number - 1
        if not line.startswith("#"):
            break
    raise FormatError(path, 1, f"a TRC file begins with {_FIRST_LINE}; this one does not")


def _header(path: Path, lines: Sequence[str], start: int) -> dict[str, str]:
    keys = [cell.strip().lower() for cell in lines[start + 1].split("\t")]
    values = [cell.strip() for cell in lines[start + 2].split("\t")]
    if len(without_trailing_empty(keys)) > len(values):
        raise FormatError(path, start + 3, f"{len(values)} values where the line above names {len(keys)}")
    return dict(zip(keys, values, strict=False))


def _value(path: Path, header: dict[str, str], key: str, start: int) -> str:
    if key not in header:
        raise FormatError(path, start + 2, f"the header does not name {key}; it names {', '.join(header)[:120]}")
    return header[key]


def _check_length(lines: Sequence[str], announced: int, rows: Floats, notices: list[str]) -> None:
    # People shorten TRC files by hand and leave the header as it is, so fewer frames are no proof of damage.
    if len(rows) == announced:
        return
    notices.append(f"{len(rows)} frames were read although the header announces {announced}")
    if 0 < len(rows) < announced and lines[-1].strip():
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
    sniff=lambda head, path: any(line.startswith(_FIRST_LINE) for line in decoded_head(head).split("\n")[:20]),
    read=lambda path, options: read_trc(path),
    write=lambda value, path, options, monitor: write_trc(value, path, options.filled, options.unit, monitor),
    check=lambda value, options: check_markers(value, _TITLE, options.filled),
    files=lambda path, options: marker_files(path, options.filled),
    keeps=("markers", "names"),
    options=(AXES, UNIT, RATE, FILLED),
    note="Units mm, cm, m from the header; empty cells and three zeros are unseen; written with full precision.",
)
