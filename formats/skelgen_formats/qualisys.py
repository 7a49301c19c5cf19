"""Qualisys TSV: trajectories of markers, or poses of bodies, as Qualisys Track Manager exports them.

Layout, tab-separated text: header lines of a word in capitals and its values (newer files begin with ``FILE_VERSION``;
``NO_OF_FRAMES 6000``, ``FREQUENCY 100``, ``MARKER_NAMES hand_top hand_left ...``), then optionally one line with column
titles (``Frame  Time  hand_top X  hand_top Y ...``), then one line per frame: x, y, z of each marker in mm, after the
frame number and the time where these were exported. A marker that is unseen has empty cells, ``NULL`` or three zeros.
Decimal commas, as some machines write them, are understood, and commas or semicolons for tabs, as spreadsheets save it.

With ``DATA_INCLUDED 6D`` the header has ``BODY_NAMES``, and a body has 16 columns: X Y Z [mm], three angles, residual,
and the matrix that takes its axes to the world's, column by column (Rot[0] to Rot[8]).

A skeleton (``walk_s_Ann.tsv``) has ``SOLVER``, and ``REFERENCE GLOBAL`` or ``LOCAL``; behind frame and time each
segment has 8 columns, the first titled with its name and empty below: name X Y Z QX QY QZ QW.
"""

import re
from collections.abc import Sequence
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.bodies import blank_unseen, row_by_row, take_from_bodies
from skelgen_formats.lines import Lines, Sample, decoded_head, read_lines
from skelgen_formats.markers import scaled, take_from_markers, uncut, zeros_unseen
from skelgen_formats.options import POINTS, Format
from skelgen_formats.text import count_in, first_in, parse_rows, rate_in, stated_in, whole_lines, without_trailing_empty

_KEY = re.compile(r"[A-Z][A-Z0-9_]+")
_DELIMITERS = "\t;,"
_FIRST_KEY, _VERSION_KEY, _COUNT_KEY = "NO_OF_FRAMES", "FILE_VERSION", "NO_OF_BODIES"
_BODY_COLUMNS, _MATRIX_FROM = 16, 7  # of a body: x y z, three angles, residual, nine of the matrix
_SKELETON_KEY, _REFERENCE_KEY = "SOLVER", "REFERENCE"  # of skeletons' segments; whose axes they are in
_SEGMENT_TITLES = ("X", "Y", "Z", "QX", "QY", "QZ", "QW")
_INCLUDED = {"3D", "6D"}  # of the data that can be read
_LOOSE_KEYS = ("DESCRIPTION", "TIME_STAMP")  # of which nothing is read, and that scripts part from values by blanks
_LEADING_TITLES = ("frame", "time")
_MAX_LEADING = len(_LEADING_TITLES)
_MM = 1.0  # the format has no unit: Track Manager exports mm

_Header = dict[str, tuple[int, list[str]]]  # key -> line number and values


def read_qualisys(path: Path, sample: Sample | None = None) -> Trajectories | PointCloud | Poses:
    """Read an export of markers, bodies or a skeleton of Qualisys Track Manager.

    Parameters
    ----------
    path : Path
        The file.
    sample : Sample, optional
        Some frames only.

    Returns
    -------
    Trajectories
        Positions in mm; a `PointCloud` if no trajectory has a label; `Poses` of a 6D export or a skeleton.

    Raises
    ------
    FormatError
        If the header lacks what is needed, or lines are cut off.
    """
    lines = read_lines(path, sample)
    delimiter = _delimiter(lines)
    header, first = _header(lines, delimiter)
    included = " ".join(header.get("DATA_INCLUDED", (0, []))[1]).upper()
    of_bodies = "BODY_NAMES" in header or "6D" in included
    if _SKELETON_KEY in header:
        return _skeleton(path, lines, header, first, delimiter)
    if included and not _INCLUDED & {*included.split()}:
        what = f"holds {included}; export the 3D data of the markers from Track Manager instead"
        raise FormatError(path, header["DATA_INCLUDED"][0], what)
    if not header:
        what = "no header; export TSV from Track Manager with its header, in which the names stand"
        raise FormatError(path, 1, f"{what}, or write titles over the columns")
    notices: list[str] = []
    if of_bodies:
        _, names = stated_in(path, header, "BODY_NAMES")
        if _COUNT_KEY in header:
            line, value = first_in(path, header, _COUNT_KEY)
            if (announced := count_in(path, line, value, _COUNT_KEY)) != len(names):
                raise FormatError(path, line, f"{_COUNT_KEY} says {announced} and the line of names lists {len(names)}")
    else:
        # the first line may hold titles
        names = _markers(path, lines[min(first + 1, len(lines) - 1)], header, delimiter, notices)
    rate = rate_in(path, *first_in(path, header, "FREQUENCY"), "FREQUENCY")
    width = _BODY_COLUMNS if of_bodies else 3
    leading, first = _leading_cells(path, lines, first, width * len(names), delimiter)
    n_cells = leading + width * len(names)
    numbered = lines.rows(first, least=0 if leading else n_cells - 1)
    whole = whole_lines(numbered, len(lines), n_cells, delimiter, notices)
    rows = parse_rows(path, whole, n_cells, delimiter, leading=leading)
    rows = uncut(lines, rows, count_in(path, *first_in(path, header, _FIRST_KEY), _FIRST_KEY), notices)
    numbers = rows.reshape(len(rows), len(names), width)
    if not of_bodies:
        return take_from_markers(path, scaled(path, zeros_unseen(numbers), _MM), names, rate, notices)
    poses = row_by_row(numbers[:, :, :3], numbers[:, :, _MATRIX_FROM:])
    return take_from_bodies(path, poses, _MM, names, rate, notices)


def _skeleton(path: Path, lines: Lines, header: _Header, first: int, delimiter: str) -> Poses:
    """Return the segments of a skeleton as bodies: a column that names each, then its place and quaternion."""
    if " ".join(header.get(_REFERENCE_KEY, (0, []))[1]).upper() == "LOCAL":
        what = "segments are in coordinates of their parents; export the skeleton with the reference Global"
        raise FormatError(path, header[_REFERENCE_KEY][0], what)
    titles = [cell.strip() for cell in lines[first].split(delimiter)] if first < len(lines) else []
    found = [at for at in range(len(titles)) if tuple(titles[at + 1 : at + 8]) == _SEGMENT_TITLES]
    if not found:
        what = (
            "a skeleton without the line of titles of its segments, which follows the header in Track Manager's export"
        )
        raise FormatError(path, first + 1, what)
    notices: list[str] = []
    whole = whole_lines(lines.rows(first + 1), len(lines), len(titles), delimiter, notices)
    columns = [at + step for at in found for step in (1, 2, 3, 7, 4, 5, 6)]
    rows = parse_rows(path, whole, len(titles), delimiter, columns)
    rows = uncut(lines, rows, count_in(path, *first_in(path, header, _FIRST_KEY), _FIRST_KEY), notices)
    numbers = blank_unseen(rows.reshape(len(rows), len(found), len(_SEGMENT_TITLES)))
    names, rate = [titles[at] for at in found], rate_in(path, *first_in(path, header, "FREQUENCY"), "FREQUENCY")
    return take_from_bodies(path, numbers, _MM, names, rate, notices)


def _delimiter(lines: Lines) -> str:
    """Return what parts the words of the first line from each other."""
    _, first = next(lines.numbered(), (0, ""))
    return next((delimiter for delimiter in _DELIMITERS if delimiter in first), _DELIMITERS[0])


def _header(lines: Lines, delimiter: str) -> tuple[_Header, int]:
    header: _Header = {}
    for number, line in lines.numbered():
        cells = [cell.strip() for cell in line.split(delimiter)]
        if cells[0].startswith(_LOOSE_KEYS):
            continue
        if not _KEY.fullmatch(cells[0]):
            return header, number - 1
        if cells[0] not in header:
            header[cells[0]] = (number, without_trailing_empty(cells[1:]))
    return header, len(lines)


def _markers(path: Path, row: str, header: _Header, delimiter: str, notices: list[str]) -> list[str]:
    """Return the names of markers; where NO_OF_MARKERS says another number, the columns of a row decide."""
    if "NO_OF_MARKERS" not in header or "MARKER_NAMES" not in header:
        return stated_in(path, header, "MARKER_NAMES")[1]
    line, value = first_in(path, header, "NO_OF_MARKERS")
    announced, names = count_in(path, line, value, "NO_OF_MARKERS"), header["MARKER_NAMES"][1]
    if announced == len(names):
        return names
    widths = {row.count(delimiter) + 1, row.count(delimiter) + 1 - row.endswith(delimiter)}
    fitting = [
        count for count in (len(names), announced) if any(0 <= width - 3 * count <= _MAX_LEADING for width in widths)
    ]
    if not fitting or not fitting[0]:
        raise FormatError(path, line, f"NO_OF_MARKERS says {announced} and the line of names lists {len(names)}")
    notices.append(f"NO_OF_MARKERS says {announced}, {len(names)} are named, and {fitting[0]} have columns")
    return [*names, *(f"unlabelled {n + 1}" for n in range(len(names), fitting[0]))][: fitting[0]]


def _leading_cells(path: Path, lines: Sequence[str], first: int, n_cells: int, delimiter: str) -> tuple[int, int]:
    """Return how many cells precede the positions, and the index of the first data line."""
    if first == len(lines):
        raise FormatError(path, first, "the file ends after its header; the frames are missing")
    titles = [cell.strip().lower() for cell in lines[first].split(delimiter)]
    if titles[0] in (*_LEADING_TITLES, "x") or titles[0].endswith(" x"):
        return sum(title in _LEADING_TITLES for title in titles[:_MAX_LEADING]), first + 1
    leading = len(without_trailing_empty(titles)) - n_cells
    return max(0, min(leading, _MAX_LEADING)), first


def _is_qualisys(head: bytes, path: Path) -> bool:
    text = decoded_head(head).lstrip()
    return text.startswith(_FIRST_KEY) or (text.startswith(_VERSION_KEY) and _FIRST_KEY in text)


FORMAT = Format(
    name="qualisys",
    title="Qualisys TSV",
    suffixes=(".tsv",),
    holds="markers",
    sniff=_is_qualisys,
    read=lambda path, options: read_qualisys(path, options.sample),
    options=(POINTS,),
    note="3D, 6D or skeleton of Qualisys Track Manager, in mm; empty cells and three zeros are unseen.",
)
