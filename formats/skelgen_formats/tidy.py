"""Tidy tables: one row per frame and point, as FreeMoCap (``..._by_frame.csv``) and scripts write them.

One line of titles names, in any order and case, a column of frames (or of times alone), one of names, and ``x``, ``y``,
``z``; a second column of names, such as FreeMoCap's model, parts points of one name. Rate and unit are those of a wide
table: no such file states them.
"""

from array import array
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Trajectories
from skelgen.progress import counted
from skelgen_formats.lines import decoded_head, read_lines
from skelgen_formats.options import POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.text import number_in
from skelgen_formats.wide import QUOTED, take_from_table

_FRAMES = ("frame", "frame_number", "frame_id", "frame_idx", "frame_index", "frames")
_TIMES = ("time", "timestamp", "time_s", "seconds", "t")
_NAMES = ("keypoint", "marker", "bodypart", "landmark", "joint", "point", "name", "label", "marker_name", "joint_name")
_GROUPS = ("model", "individual", "person", "subject", "track", "person_id")
_DELIMITERS = ",;\t"
_MOST_TIMES, _FREE_NUMBERS = 16, 1 << 20  # positions that a table may have beside its rows: others are unseen


def read_tidy(path: Path, options: Options) -> Trajectories | PointCloud:
    """Read a tidy table of points.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `recorded_rate` and `recorded_unit` count.

    Raises
    ------
    FormatError
        If the titles name no frames, names and coordinates, or a row is not as long as they are.
    """
    lines = read_lines(path)
    delimiter = next((one for one in _DELIMITERS if _columns(lines[0], one)), "")
    if not delimiter:
        what = "the titles name no frame (or time), name (such as keypoint), x, y and z; write them over the columns"
        raise FormatError(path, 1, what)
    at = _columns(lines[0], delimiter)
    frames, points, names, numbers = array("d"), array("q"), dict[tuple[str, ...], int](), array("d")
    times: dict[float, float] = {}
    for number, line in lines.numbered(1):
        text = QUOTED.sub(lambda cell: cell[1].replace(delimiter, " "), line) if '"' in line else line
        cells = text.split(delimiter)
        if len(cells) <= max(at.values()):
            raise FormatError(
                path, number, f"{counted(len(cells), 'cell is', 'cells are')} too few; the file may be cut off"
            )
        frames.append(_number(path, number, cells[at["frame"]], "the frame"))
        points.append(
            names.setdefault(tuple(cells[at[what]].strip() for what in ("name", "group") if what in at), len(names))
        )
        if "time" in at and frames[-1] not in times:
            times[frames[-1]] = _number(path, number, cells[at["time"]], "the time")
        numbers.extend(_number(path, number, cells[at[axis]], "a coordinate") for axis in "xyz")
    every, places = np.unique(np.frombuffer(frames), return_inverse=True)
    if np.isnan(every).any() or len(every) * len(names) > _MOST_TIMES * len(frames) + _FREE_NUMBERS:
        what = f"{len(names)} points in {len(every)} frames, but only {len(frames)} positions, or some without a frame"
        raise FormatError(path, "", what)
    positions = np.full((len(every), len(names), 3), np.nan)
    positions[places, np.frombuffer(points, dtype=np.int64)] = np.frombuffer(numbers).reshape(-1, 3)
    stamps = np.array([times[frame] for frame in every.tolist()]) if times else None
    return take_from_table(path, positions, _distinct([*names]), stamps, options)


def _columns(line: str, delimiter: str) -> dict[str, int]:
    """Return the columns of frames, times, names, groups and coordinates; empty if one that is needed is missing."""
    titles = [cell.strip().strip('"') for cell in line.split(delimiter)]
    wanted = {"x": ("x",), "y": ("y",), "z": ("z",), "frame": _FRAMES + _TIMES, "name": _NAMES}
    found = {what: _place(titles, known) for what, known in (wanted | {"time": _TIMES, "group": _GROUPS}).items()}
    places = {what: place for what, place in found.items() if place is not None}
    return places if places.keys() >= wanted.keys() else {}


def _place(titles: Sequence[str], wanted: Sequence[str]) -> int | None:
    """Return the column of the first title that is there."""
    plain = [title.lower() for title in titles]
    return next((plain.index(title) for title in wanted if title in plain), None)


def _number(path: Path, number: int, cell: str, what: str) -> float:
    try:
        return float(cell)
    except ValueError:
        unseen = cell.strip().lower() in ("", "nan", "none", "null", "na")
        return np.nan if unseen else number_in(path, number, cell, what)


def _distinct(points: Sequence[tuple[str, ...]]) -> list[str]:
    """Return the names of points, those that stand in two groups with their group before them."""
    count = Counter(point[0] for point in points)
    return [point[0] if count[point[0]] == 1 else "_".join(reversed(point)) for point in points]


FORMAT = Format(
    name="tidy-csv",
    title="Tidy table of points, CSV",
    suffixes=(".csv",),
    holds="markers",
    sniff=lambda head, path: any(_columns((decoded_head(head).splitlines() or [""])[0], one) for one in _DELIMITERS),
    read=read_tidy,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="A row per frame and point: frame, name, x, y, z, as of FreeMoCap by frame; rate and unit by option.",
)
