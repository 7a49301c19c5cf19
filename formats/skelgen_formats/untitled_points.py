"""Positions of points as numbers without titles, a row per frame: which columns are whose is told by how points move.

Beside coordinates there may be frame numbers and times, at most two columns before and two behind, which rise evenly.
The rest is ``x y z`` of each point in turn, ``x y z`` and how sure it is, or all ``x``, all ``y`` and all ``z``. It is
the layout in which points keep their distance to another one, as those of a body do; where none or several do, the
numbers are not read. A comment may name the points. Numbers of DLTdv stand in a row each (see
`skelgen_formats.sparse_points`), or as x, y, z of each point in a file called ``xyzpts``, where no layout is found.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Floats
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.markers import zeros_unseen
from skelgen_formats.options import POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.sparse_points import is_sparse, read_sparse
from skelgen_formats.text import parse_rows, without_trailing_empty
from skelgen_formats.time_stamps import since_first
from skelgen_formats.turn_titles import AXES
from skelgen_formats.wide import take_from_table

_OF_DLTDV = "xyzpts"  # in names of its files, with x, y, z of each point in turn
_COMMENTS, _DELIMITERS = ("#", "%", "//"), ";\t,"
_FEWEST_OF_DLTDV = 2  # points
_FEWEST_FRAMES, _FEWEST_POINTS, _MOST_COUNTS = 8, 4, 2  # the latter on either side
_LOOKED_AT = 64  # frames, and points
_EVEN = 1e-2  # of their median, that steps of frames or times differ by
_RIGID, _SURELY_OTHER = 0.1, 0.005  # of distances to a companion: they vary by so much, or are of other points
_CLEARER = 2.0  # how much more than in the best layout they vary in others
_MOVING = 0.2  # of how far the point moves that moves most
_SURE = 2.0  # the largest that says how sure a point is: 0, 1 and 2 of a Kinect


def positions_of_columns(rows: Floats) -> tuple[Floats, Floats | None, str] | None:
    """Return positions, times or frame numbers if any, and the layout in words; None if points keep no distance.

    Parameters
    ----------
    rows : ndarray, shape (n_frames, n_columns)
        As they stand in the file.

    Returns
    -------
    (ndarray, shape (n_frames, n_points, 3), ndarray or None, str) or None
    """
    if len(rows) < _FEWEST_FRAMES or rows.shape[1] < _FEWEST_POINTS * len(AXES):
        return None
    n_columns = rows.shape[1]
    first = next(at for at in range(_MOST_COUNTS + 1) if at == _MOST_COUNTS or not _counts(rows[:, at]))
    last = next(at for at in range(_MOST_COUNTS + 1) if at == _MOST_COUNTS or not _counts(rows[:, n_columns - 1 - at]))
    numbers = rows[:, first : n_columns - last]
    counts = [rows[:, at] for at in (*range(first), *range(n_columns - last, n_columns))]
    layouts = [*_layouts(numbers)]
    varies = np.array([_rigidity(positions) for positions, _ in layouts])
    if not len(varies) or np.isnan(varies).any():
        return None
    best, *others = np.argsort(varies).tolist()
    if varies[best] > _RIGID or (varies[others] < max(_CLEARER * varies[best], _SURELY_OTHER)).any():
        return None
    times = next((one for one in counts if not (one == np.rint(one)).all()), counts[0] if counts else None)
    return layouts[best][0], times, f"{'frame or time, ' * bool(counts)}{layouts[best][1]}"


def _counts(column: Floats) -> bool:
    """Whether numbers rise evenly, as frame numbers and times do."""
    steps = np.diff(column)
    usual = np.median(steps)
    return bool(usual > 0 and np.abs(steps - usual).max() < _EVEN * usual)


def _layouts(numbers: Floats) -> Iterator[tuple[Floats, str]]:
    """Yield positions as they may stand in columns, and the layout in words."""
    n_frames, n_columns = numbers.shape
    if n_columns % len(AXES) == 0:
        yield numbers.reshape(n_frames, -1, len(AXES)), "x, y, z of each point"
        yield numbers.reshape(n_frames, len(AXES), -1).swapaxes(1, 2), "all x, all y, all z"
    if n_columns % (len(AXES) + 1) == 0:
        graded = numbers.reshape(n_frames, -1, len(AXES) + 1)
        if ((graded[..., 3] >= 0) & (graded[..., 3] <= _SURE)).all():
            yield graded[..., : len(AXES)], "x, y, z of each point and how sure it is"


def _rigidity(positions: Floats) -> float:
    """Return by how much of itself the distance of a point to its steadiest companion varies, of the median point.

    NaN if too few points move to tell.
    """
    some = np.linspace(0, len(positions) - 1, min(len(positions), _LOOKED_AT)).astype(np.intp)
    few = zeros_unseen(positions[some, :_LOOKED_AT].copy())
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        spreads = np.ma.masked_invalid(few).std(axis=0).max(axis=1).filled(0.0)
        few = few[:, spreads > _MOVING * spreads.max(initial=0.0)]  # what stands still keeps distances anyhow
        distances = np.ma.masked_invalid(np.linalg.norm(few[:, :, np.newaxis] - few[:, np.newaxis], axis=-1))
        varies = distances.std(axis=0) / distances.mean(axis=0)
    if few.shape[1] < _FEWEST_POINTS:
        return np.nan
    np.fill_diagonal(varies, np.ma.masked)
    return float(np.median(varies.min(axis=1).filled(np.inf)))


def _rows(path: Path, lines: Lines) -> Floats:
    first = next((line for line in lines if _is_row(line)), "")
    delimiter = next((one for one in _DELIMITERS if one in first), None)
    numbered = ((number, line) for number, line in lines.numbered() if _is_row(line))
    cells = first.split(delimiter)
    width = len(without_trailing_empty(cells))
    if width < len(cells):  # points that are unseen at first, or a delimiter behind each row
        widths = (len(without_trailing_empty(line.split(delimiter))) for line in lines if _is_row(line))
        width = min(max(widths), len(cells))
    if width < (_FEWEST_OF_DLTDV if _is_of_dltdv(path) else _FEWEST_POINTS) * len(AXES):
        raise FormatError(path, 1, f"numbers without titles, and {width} columns where 12 belong to four points")
    return parse_rows(path, numbered, width, delimiter)


def _is_row(line: str) -> bool:
    return bool(line.strip()) and not line.startswith(_COMMENTS)


def read_untitled_points(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the points of a table without titles.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `points`, `recorded_rate` and `recorded_unit` count.

    Raises
    ------
    FormatError
        If points keep no distance in any layout, or in several.
    """
    lines = read_lines(path)
    if is_sparse(lines):
        positions = read_sparse(path, lines)
        return take_from_table(path, positions, _numbered(positions), None, options)
    rows = _rows(path, lines)
    found = positions_of_columns(rows)
    if found is None and _is_of_dltdv(path) and rows.shape[1] % len(AXES) == 0:
        positions = rows.reshape(len(rows), -1, len(AXES))
        return take_from_table(path, positions, _numbered(positions), None, options)
    if found is None:
        what = "write over the columns which point's they are: name_x, name_y, name_z"
        raise FormatError(path, 1, f"numbers without titles, and no layout in which points keep distances: {what}")
    positions, times, layout = found
    told = (line.strip("#%/ ").replace(",", " ").split() for line in lines if line.startswith(_COMMENTS))
    numbered = _numbered(positions)
    names = next((words for words in told if len({*words}) == len(words) == len(numbered)), numbered)
    stamps = None if times is None else since_first(times, 0.0)
    take = take_from_table(path, positions, names, stamps, options)
    taken = f"numbers without titles are taken as {layout}, as points then keep their distances"
    return replace(take, notices=(f"{taken}; titles over the columns state another layout", *take.notices))


def _is_of_dltdv(path: Path) -> bool:
    return _OF_DLTDV in path.name.lower()


def _numbered(positions: Floats) -> list[str]:
    return [f"point {number + 1}" for number in range(positions.shape[1])]


def _is_untitled(head: bytes, path: Path) -> bool:
    text = decoded_head(head)
    if is_sparse(Lines(path, text.encode(), "utf-8")):
        return True
    lines = [line for line in text.splitlines() if _is_row(line)][:_FEWEST_FRAMES]
    try:
        rows = _rows(path, Lines(path, "\n".join(lines).encode(), "utf-8"))
    except FormatError:
        return False
    return len(rows) >= _FEWEST_FRAMES


FORMAT = Format(
    name="untitled-points",
    title="Points without titles",
    suffixes=(".points.txt",),
    holds="markers",
    sniff=_is_untitled,
    read=read_untitled_points,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Numbers alone, a row per frame: x, y, z of each point, or all x, all y, all z, if points keep distances so.",
)
