"""Qualisys TSV: marker trajectories as Qualisys Track Manager exports them.

Layout, tab-separated text: header lines of a word in capitals and its values (``NO_OF_FRAMES 6000``,
``FREQUENCY 100``, ``MARKER_NAMES hand_top hand_left ...``), then optionally one line with column titles
(``Frame  Time  hand_top X  hand_top Y ...``), then one line per frame: x, y, z of each marker in mm, after the frame
number and the time where these were exported. A marker that is unseen has empty cells, ``NULL`` or three zeros.
Decimal commas, as some machines write them, are understood.
"""

import re
from collections.abc import Sequence
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Trajectories
from skelgen_formats.markers import check_frames, scaled, take_from_markers, zeros_unseen
from skelgen_formats.options import Format
from skelgen_formats.text import Lines, count_in, decoded_head, parse_rows, rate_in, read_lines, without_trailing_empty

_KEY = re.compile(r"[A-Z][A-Z0-9_]+")
_FIRST_KEY = "NO_OF_FRAMES"
_LEADING_TITLES = ("frame", "time")
_MAX_LEADING = len(_LEADING_TITLES)
_MM = 1.0  # the format has no unit: Track Manager exports mm

_Header = dict[str, tuple[int, list[str]]]  # key -> line number and values


def read_qualisys(path: Path) -> Trajectories | PointCloud:
    """Read a 3-D export of Qualisys Track Manager.

    Returns
    -------
    Trajectories
        Positions in mm; or a `PointCloud` if no trajectory has a label.

    Raises
    ------
    FormatError
        If the header lacks what is needed, the file holds 6DOF data, or lines are cut off.
    """
    lines = read_lines(path)
    header, first = _header(lines)
    included = " ".join(header.get("DATA_INCLUDED", (0, []))[1]).upper()
    if "BODY_NAMES" in header or "6D" in included:
        line = header.get("BODY_NAMES", header.get("DATA_INCLUDED", (1, [])))[0]
        raise FormatError(path, line, "holds 6DOF bodies; export the 3D data of the markers from Track Manager instead")
    _, names = _entry(path, header, "MARKER_NAMES")
    rate_line, rate_text = _entry(path, header, "FREQUENCY")
    rate = rate_in(path, rate_line, rate_text[0], "FREQUENCY")
    _check_marker_count(path, header, len(names))
    leading, first = _leading_cells(path, lines, first, len(names))
    rows = parse_rows(path, lines.numbered(first), leading + 3 * len(names), "\t", leading=leading)
    notices: list[str] = []
    frames_line, frames = _entry(path, header, _FIRST_KEY)
    check_frames(path, frames_line, count_in(path, frames_line, frames[0], _FIRST_KEY), len(rows), notices)
    positions = zeros_unseen(rows.reshape(len(rows), len(names), 3))
    return take_from_markers(path, scaled(path, positions, _MM), names, rate, notices)


def _header(lines: Lines) -> tuple[_Header, int]:
    header: _Header = {}
    for number, line in lines.numbered():
        cells = [cell.strip() for cell in line.split("\t")]
        if not _KEY.fullmatch(cells[0]):
            return header, number - 1
        if cells[0] not in header:
            header[cells[0]] = (number, without_trailing_empty(cells[1:]))
    return header, len(lines)


def _entry(path: Path, header: _Header, key: str) -> tuple[int, list[str]]:
    if key not in header or not header[key][1]:
        raise FormatError(path, header.get(key, ("", []))[0], f"the header line {key} is missing or empty")
    return header[key]


def _check_marker_count(path: Path, header: _Header, n_names: int) -> None:
    if "NO_OF_MARKERS" not in header:
        return
    line, values = _entry(path, header, "NO_OF_MARKERS")
    announced = count_in(path, line, values[0], "NO_OF_MARKERS")
    if announced != n_names:
        raise FormatError(path, line, f"NO_OF_MARKERS says {announced} and MARKER_NAMES lists {n_names}")


def _leading_cells(path: Path, lines: Sequence[str], first: int, n_names: int) -> tuple[int, int]:
    """Return how many cells precede the positions, and the index of the first data line."""
    if first == len(lines):
        raise FormatError(path, first, "the file ends after its header; the frames are missing")
    titles = [cell.strip().lower() for cell in lines[first].split("\t")]
    if titles[0] in _LEADING_TITLES or titles[0].endswith(" x"):
        return sum(title in _LEADING_TITLES for title in titles[:_MAX_LEADING]), first + 1
    leading = len(without_trailing_empty(titles)) - 3 * n_names
    return max(0, min(leading, _MAX_LEADING)), first


FORMAT = Format(
    name="qualisys",
    title="Qualisys TSV",
    suffixes=(".tsv",),
    holds="markers",
    sniff=lambda head, path: decoded_head(head).lstrip().startswith(_FIRST_KEY),
    read=lambda path, options: read_qualisys(path),
    note="3D export of Qualisys Track Manager, in mm; empty cells and three zeros are unseen; no 6DOF.",
)
