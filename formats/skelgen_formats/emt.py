"""EMT: tracks of points as text, as BTS SMART writes them beside its TDF.

Layout, tab-separated text, cells padded with blanks::

    BTS ASCII format
    (an empty line)
    Type:           3D point tracks            other types hold forces, muscle signals, angles and events
    Measure unit:   m
    (an empty line)
    Tracks:         2
    Frequency:      100 Hz
    Frames:         513
    Start time:     0.000
    (an empty line)
     Frame    Time   c7.X   c7.Y   c7.Z   sacrum.X ...
         0   0.000  0.123 ...                  blank cells are unseen; empty lines may follow
"""

import re
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Trajectories
from skelgen_formats.lines import Lines, Sample, decoded_head, read_lines
from skelgen_formats.markers import mm_per_unit, scaled, take_from_markers, uncut
from skelgen_formats.options import POINTS, Format
from skelgen_formats.text import count_in, first_in, parse_rows, rate_in, whole_lines, without_trailing_empty

_FIRST_LINE = "BTS ASCII"
_KEY = re.compile(r"\w[\w ]*")
_TITLE = re.compile(r"(.{1,200})[.]([XYZ])")

_Header = dict[str, tuple[int, list[str]]]  # key in small letters -> line number and value


def read_emt(path: Path, sample: Sample | None = None) -> Trajectories | PointCloud:
    """Read the tracks of points of an EMT file.

    Parameters
    ----------
    path : Path
        The file.
    sample : Sample, optional
        Some frames only.

    Returns
    -------
    Trajectories
        Positions in mm; or a `PointCloud` if no track has a label.

    Raises
    ------
    FormatError
        If the file holds no tracks of points, or is damaged.
    """
    lines = read_lines(path, sample)
    header, number = _header(path, lines)
    titles = [title.strip() for title in without_trailing_empty(lines[number - 1].split("\t"))]
    names = {titles.index(f"{name}.X"): name for name in _points(titles)}
    if not names:
        kind = "".join(header.get("type", (0, ["data"]))[1])[:40]
        what = f"holds {kind}, no points; export the 3D tracks of points from SMART, or C3D"
        raise FormatError(path, number, what)
    columns = [titles.index(f"{name}.{axis}") for name in names.values() for axis in "XYZ"]
    unit, (line, rate), frames = (first_in(path, header, key) for key in ("measure unit", "frequency", "frames"))
    rate_hz = rate_in(path, line, rate.removesuffix("Hz").strip(), "Frequency")
    notices: list[str] = []
    rows = parse_rows(
        path, whole_lines(lines.rows(number), len(lines), len(titles), "\t", notices), len(titles), "\t", columns
    )
    rows = uncut(lines, rows, count_in(path, *frames, "Frames"), notices)
    positions = scaled(path, rows.reshape(len(rows), len(names), 3), mm_per_unit(path, *unit))
    return take_from_markers(path, positions, list(names.values()), rate_hz, notices)


def _header(path: Path, lines: Lines) -> tuple[_Header, int]:
    """Return the keys, and the number of the line with the titles of the columns."""
    header: _Header = {}
    for number, line in lines.numbered(1):
        key, colon, value = line.strip().partition(":")
        if not colon or _KEY.fullmatch(key) is None:
            return header, number
        header.setdefault(key.strip().lower(), (number, [*filter(None, [value.strip()])]))
    raise FormatError(path, len(lines), "the file ends within its header")


def _points(titles: list[str]) -> list[str]:
    """Return the names of tracks with all three coordinates."""
    found = [match[1] for title in titles if (match := _TITLE.fullmatch(title))]
    return [name for name in dict.fromkeys(found) if {f"{name}.{axis}" for axis in "XYZ"} <= {*titles}]


FORMAT = Format(
    name="emt",
    title="BTS EMT",
    suffixes=(".emt",),
    holds="markers",
    sniff=lambda head, path: decoded_head(head).lstrip().startswith(_FIRST_LINE),
    read=lambda path, options: read_emt(path, options.sample),
    options=(POINTS,),
    note="3D tracks of BTS SMART as text, unit from the file; blank cells are unseen.",
)
