"""CSV 1.1 of OptiTrack's Tracking Tools, Arena and first Motive: a line for each frame lists what is tracked in it.

Layout, comma-separated text::

    comment,...                                      (many lines)
    righthanded                                      or lefthanded: z points the other way
    info,version,1.1
    info,framecount,1200                             (and other lines of this kind)
    rigidbody,"Wand",1,3,...                         name and number of a body
    frame,0,0.000000,1,1,0.1,0.2,0.3,0.0,0.0,0.0,1.0,0.0,0.0,0.0,3,0.11,0.21,0.31,1,Wand_1,...

A frame has its number, time [s], number of bodies; of each its number, place [m], quaternion x, y, z, w, yaw, pitch and
roll; then the number of markers, and of each its place, number and name; early versions lack these two. Other lines
that begin with ``rigidbody`` tell the same again. Markers are read; bodies where there are none, or with the option
`bodies`.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.lines import decoded_head, read_lines
from skelgen_formats.options import BODIES, POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.row_owners import array_from_records
from skelgen_formats.text import count_in, is_number, number_in, number_or_nan, split_cells
from skelgen_formats.time_stamps import since_first
from skelgen_formats.wide import take_from_table

_FRAME, _BODY, _LEFT = "frame", "rigidbody", "lefthanded"
_FIRST_WORDS = ("comment,", "info,version", "righthanded", _LEFT)
_BODY_CELLS, _FIRST_BODY = 11, 4
_POSE = (1, 2, 3, 7, 4, 5, 6)  # of these cells: place, and quaternion, scalar first
_MIRROR = np.array([1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0])  # of z, and of a pose in it
_MARKER_CELLS = range(3, 6)

_Record = dict[str, list[float]]


def read_tracking_tools(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the markers, or the bodies, of an export.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `points`, `bodies`, `recorded_rate` and `recorded_unit` count.

    Raises
    ------
    FormatError
        If a frame does not hold what it announces, or there is none.
    """
    names: dict[str, str] = {}
    times: list[float] = []
    bodies: list[_Record] = []
    markers: list[_Record] = []
    mirror = np.ones(len(_POSE))
    for number, line in read_lines(path).numbered():
        word = line.partition(",")[0].strip().lower()
        cells = split_cells(path, line, number, ",") if word in (_FRAME, _BODY) else []
        if word == _LEFT:
            mirror = _MIRROR
        elif word == _BODY and len(cells) > 2 and not is_number(cells[1]):
            names[cells[2]] = cells[1]
        elif word == _FRAME:
            time, *found = _frame(path, number, cells)
            times.append(time)
            bodies.append(found[0])
            markers.append(found[1])
    records = bodies if options.bodies or not any(markers) else markers
    keys = [*dict.fromkeys(key for record in records for key in record)]
    width = len(_POSE) if records is bodies else 3
    numbers = array_from_records(path, records, keys, width) * mirror[:width]
    titles = [names.get(key, f"body {key}") if records is bodies else key for key in keys]
    take = take_from_table(path, numbers, titles, since_first(np.array(times), 1.0), options, "m")
    notice = ["the file counts z the other way (lefthanded), which is turned round"] if mirror is _MIRROR else []
    return replace(take, notices=(*notice, *take.notices))


def _frame(path: Path, number: int, cells: list[str]) -> tuple[float, _Record, _Record]:
    """Return the time, bodies and markers of a frame; markers without a name of their own are numbered."""
    told = [*cells, "", "", "", ""]
    time = number_in(path, number, told[2], "the time")
    n_bodies = count_in(path, number, told[3], "the number of bodies")
    at = _FIRST_BODY + _BODY_CELLS * n_bodies
    n_markers = count_in(path, number, [*cells, "0"][at], "the number of markers") if at <= len(cells) else -1
    width = min((len(cells) - at - 1) // n_markers, _MARKER_CELLS[-1]) if n_markers > 0 else _MARKER_CELLS[0]
    if width not in _MARKER_CELLS or n_markers < 0:
        raise FormatError(path, number, f"{len(cells)} cells do not hold the bodies and markers that they announce")
    starts = range(_FIRST_BODY, at, _BODY_CELLS)
    poses = {
        cells[one]: [number_or_nan(path, number, cells[one + cell], "a coordinate") for cell in _POSE] for one in starts
    }
    found: _Record = {}
    for count, one in enumerate(range(at + 1, at + 1 + width * n_markers, width), start=1):
        name = "" if width < _MARKER_CELLS[-1] else cells[one + width - 1]
        key = name if name and name not in found else f"*{count}"
        found[key] = [number_or_nan(path, number, cell, "a coordinate") for cell in cells[one : one + 3]]
    return time, poses, found


def _is_tracking_tools(head: bytes, path: Path) -> bool:
    lines = decoded_head(head).lstrip().lower().splitlines()
    told = any(line.startswith((f"{_FRAME},", _FIRST_WORDS[1])) for line in lines)
    return told and lines[0].startswith(_FIRST_WORDS)


FORMAT = Format(
    name="tracking-tools",
    title="OptiTrack CSV 1.1 (Tracking Tools, Arena)",
    suffixes=(".csv",),
    holds="markers",
    sniff=_is_tracking_tools,
    read=read_tracking_tools,
    options=(POINTS, BODIES, RECORDED_RATE, RECORDED_UNIT),
    note="A line for each frame, in metres; markers with names are trajectories, others points; else rigid bodies.",
)
