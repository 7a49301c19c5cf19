"""DTrack: bodies and single markers in the text that ART's DTrack sends, as recorders write it to a file.

Layout, one line per kind and frame::

    fr 21753                                         a frame begins
    ts 39596.024831                                  its time [s]
    6dcal 2                                          (and other lines, which are left out)
    6d 1 [0 1.000][326.848 -187.216 109.503 -160.47 -3.69 -7.09][-0.940508 -0.339238 -0.018150 ...]
    3d 2 [79 1.000][210.730 -90.669 -108.554][83 1.000][...]

A body (``6d``) has its number and quality, position [mm] and three angles, and the matrix that takes its axes to the
world's, column by column; ``6di``, of hybrid bodies, has number, state and error, position, and the matrix. A body that
is not tracked is not listed, or has a quality below 0. Single markers (``3d``), which belong to no body, are read where
there are no bodies, or where points are asked for.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.bodies import row_by_row
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.options import AUTO, POINTS, RECORDED_RATE, Format, Options
from skelgen_formats.row_owners import array_from_records
from skelgen_formats.time_stamps import since_first
from skelgen_formats.wide import take_from_table

_FRAME, _TIME = "fr", "ts"
_BODY_KINDS, _MARKERS = ("6d", "6di"), "3d"
_BRACKET = re.compile(r"\[([^\[\]]*)\]")
_FIRST = re.compile(r"fr \d+\s*\n(?:.*\n){0,8}?(?:ts|6d\w*|3d) ")
_PLACE, _MATRIX = 3, 9
_UNTRACKED = -1.0  # quality
_MOST_BODIES = 1000

_Records = list[dict[int, list[float]]]  # of each frame: position and matrix of its bodies, or position of its markers


def read_dtrack(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the bodies, or the single markers, of a recording of DTrack.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `points` and `recorded_rate` count.

    Raises
    ------
    FormatError
        If a line is not as DTrack writes it, or there is neither a body nor a marker.
    """
    lines = read_lines(path)
    times, bodies, markers = _records(path, lines)
    stamps = since_first(np.array(times), 1.0) if len(times) == len(bodies) else None
    if any(bodies) and options.points == AUTO:
        numbers = sorted({number for frame in bodies for number in frame})
        found = array_from_records(path, bodies, numbers, _PLACE + _MATRIX)
        poses = row_by_row(found[:, :, :_PLACE], found[:, :, _PLACE:])
        return take_from_table(path, poses, [f"body {number + 1}" for number in numbers], stamps, options, "mm")
    if not any(markers):
        raise FormatError(path, "", "lists no body (6d) and no single marker (3d); switch them on in DTrack's output")
    positions = array_from_records(path, markers, list(range(max(map(len, markers)))), _PLACE)
    names = [f"*{number + 1}" for number in range(positions.shape[1])]
    return take_from_table(path, positions, names, stamps, options, "mm")


def _records(path: Path, lines: Lines) -> tuple[list[float], _Records, _Records]:
    """Return times, bodies and markers of the frames; a last frame that is cut off is left out."""
    times: list[float] = []
    bodies: _Records = []
    markers: _Records = []
    for number, line in lines.numbered():
        kind, _, rest = line.strip().partition(" ")
        if kind == _FRAME:
            bodies.append({})
            markers.append({})
        elif kind == _TIME and len(times) < len(bodies):
            times += [item[0] for item in _numbers(path, number, [rest])]
        elif kind in _BODY_KINDS and bodies:
            for head, place, matrix in _items(path, number, rest, 3):
                if head[1] > _UNTRACKED and _is_body(path, number, head, place, matrix):
                    bodies[-1][int(head[0])] = place[:_PLACE] + matrix
        elif kind == _MARKERS and markers:
            for at, (_, place) in enumerate(_items(path, number, rest, 2)):
                if len(place) < _PLACE:
                    raise FormatError(path, number, f"a marker has {len(place)} numbers where three belong")
                markers[-1][at] = place[:_PLACE]
    return times, bodies, markers


def _is_body(path: Path, number: int, head: list[float], place: list[float], matrix: list[float]) -> bool:
    if len(matrix) != _MATRIX or len(place) < _PLACE or not 0 <= head[0] < _MOST_BODIES:
        what = f"a body has {len(place)} and {len(matrix)} numbers where position, angles and a matrix belong"
        raise FormatError(path, number, what)
    return True


def _items(path: Path, number: int, text: str, size: int) -> Iterator[list[list[float]]]:
    """Yield the brackets of each body or marker of a line."""
    found = list(_numbers(path, number, _BRACKET.findall(text)))
    if len(found) % size or any(len(numbers) < 2 for numbers in found):
        raise FormatError(path, number, f"{len(found)} brackets, where {size} belong to each; the file may be cut off")
    for first in range(0, len(found), size):
        yield found[first : first + size]


def _numbers(path: Path, number: int, texts: list[str]) -> Iterator[list[float]]:
    try:
        for text in texts:
            yield [float(word) for word in text.split()] or [np.nan]
    except ValueError as error:
        raise FormatError(path, number, f"a word is no number: {error}"[:120]) from error


FORMAT = Format(
    name="dtrack",
    title="ART DTrack text",
    suffixes=(".dtrack.txt",),
    holds="poses",
    sniff=lambda head, path: _FIRST.match(decoded_head(head).lstrip().replace("\r", "")) is not None,
    read=read_dtrack,
    options=(POINTS, RECORDED_RATE),
    note="Bodies of ART's DTrack, or single markers where there are none, in mm; fingers and tools are left out.",
)
