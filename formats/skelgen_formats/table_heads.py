"""What the lines above a table of points say: which columns are whose, which is time, rate, unit, and where it begins.

Titles are one line (see `skelgen_formats.titles`), or two, the name over the first or over each of the columns X, Y, Z
(Mokka has units between them); or those of DeepLabCut in 3D, ``scorer``, ``bodyparts`` and ``coords``; or the five of
an ASCII export of Visual3D: file, signal, type, folder, and ``ITEM  X  Y  Z``. Before them may stand lines of a word
and a value (``Frequency: 100``, ``Units: mm``, ``// fs=100``), behind them one of units, or the name of the index that
pandas writes.
"""

import contextlib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement, groupby, product
from operator import mul

from skelgen_formats.body_columns import Body
from skelgen_formats.clock_titles import Clock, clock_of, is_frame
from skelgen_formats.options import MM_PER_UNIT
from skelgen_formats.text import is_number, seconds_of, unquoted, without_trailing_empty
from skelgen_formats.titles import axis_alone, bodies_of, not_taken, spelt, undoubled, with_axes
from skelgen_formats.turn_titles import AXES, angle_alone, component_alone, numbered_quaternions

HEAD_LINES = 24
"""Lines that are looked through for titles."""

_PREAMBLE = 16  # lines before the titles, at most
_TITLE_LINES = HEAD_LINES - _PREAMBLE
_FEWEST = 2  # points of a table that no word says what it is
DELIMITERS = (",", ";", "\t", "|", None)
"""What may part cells, None for blanks."""

_NO_PLACES = re.compile(
    r"(.*[_ .:/-])?(l?acc|accel\w*|gyro?\w*|mag|magnet\w*|quat\w*|euler\w*|rot|rotation|orientation|ang|angles?|angular"
    r"|omega|forces?|moments?|torques?|grf|fp\d+|force_?plate\d*|dir|direction|velo?|velocity|velocities|speed"
    r"|jerk|std\w*|sigma|cov\w*)([_ .:/-].*)?",
    re.IGNORECASE,
)
_SENSED = re.compile(r".*[a-z](Acc|Accel\w*|Gyr\w*|Mag|Magnet\w*|Vel|Velocity)")  # FreeAcc
_STATED = re.compile(
    r"(?:[a-z]+[ _]){0,3}(frequency|rate|framerate|fps|fs|units?)(?: ?[\[(](?:hz|fps|1/s)[\])])?\W*", re.IGNORECASE
)
_APART = re.compile(r" {2,}")  # two statements in a line
CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
"""Where words of one title meet: posUnit, SegmentName."""

_OWNER = re.compile(
    r"id|(?:body|person|people|subject|individual|user|player|actor|skeleton|track(?:ing)?)(?:[ _]?track(?:ing)?)?"
    r"[ _]?(?:id|idx|index|no|number|name)?",
    re.IGNORECASE,
)
_NAMING = re.compile(r"(.+?)[._](?:(?:marker|rigid_?body|body|subject)_?)?(?:name|child_frame_id)")
_LOCAL = re.compile(r"(?<![A-Za-z])[Ll]ocal(?![a-z])|(?<=[a-z])Local(?![a-z])")
UNREAD_QUATERNION = "quaternions are left out until titles say which number is w (qw, qx, qy, qz)"
"""A notice of quaternions whose components are numbered."""

_OWNING = re.compile(
    r"(?:joint|marker|bone|segment|body|keypoint|landmark|sensor|point|finger|hand|side)[ _]?(?:name|label|type)?",
    re.IGNORECASE,
)
_NUMBERED = "X, Y and Z stand several times without names in their line: points are numbered"
_IN_THREES = "three columns under one name are taken as x, y and z"
_UNIT_TOLERANCE = 1e-3  # of the length of quaternions, which are printed with a few digits
_COMMENT = "#%"  # what stands before the titles that numpy and ROS write
_VISUAL3D = ("TARGET", "LANDMARK")  # types of its signals that are points
_DEEPLABCUT = ("scorer", "individuals", "bodyparts", "coords")


@dataclass
class Head:
    """What the lines above the numbers say.

    Attributes
    ----------
    bodies : list of Body
        Points and bodies, with their columns.
    delimiter : str or None
        What parts cells, None for blanks.
    frames : int or None
        Column with frame numbers.
    clock : Clock or None
        Columns with times.
    unit, rate : str
        Unit of length and frame rate as stated, empty if they are not.
    n_cells, n_lines : int
        Cells of a row, and lines above the first.
    titles : sequence of str
        Of the columns, where they stand in one line.
    owners : list of int
        Columns that say whose row it is, where rows of several take turns.
    notices : list of str
        What is left out.
    """

    bodies: list[Body]
    delimiter: str | None = None
    frames: int | None = None
    clock: Clock | None = None
    unit: str = ""
    rate: str = ""
    n_cells: int = 0
    n_lines: int = 1
    titles: Sequence[str] = ()
    owners: list[int] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)

    @property
    def counts(self) -> int | None:
        """The column of frame numbers, else that of times."""
        return self.frames if self.frames is not None else self.clock.column if self.clock else None


def find_head(lines: Sequence[str]) -> Head | None:
    """Return what titles say, or None if there are none of points.

    Parameters
    ----------
    lines : sequence of str
        The first `HEAD_LINES` of a file that are not blank.
    """
    for delimiter in DELIMITERS:
        every = [_cells(line, delimiter) for line in lines]
        if ["endheader"] in [row[:1] for row in every]:  # of OpenSim
            continue
        starts = [at for at, row in enumerate(every[: _PREAMBLE + 1]) if len(row) > 1]
        others = (_deeplabcut, _under_names, in_one_line)
        for first, find in product(starts, (_visual3d,) if _is_visual3d(every) else others):
            if (head := find(every[first : first + _TITLE_LINES])) is not None:
                head.delimiter, head.n_lines = delimiter, head.n_lines + first
                _read_preamble(head, every[:first])
                _pass_further_titles(head, every)
                _read_names(head, every)
                _read_rows(head, every)
                if _stand_over_rows(head, every):
                    _drop_turns(head, every[head.n_lines :])
                    _drop_directions(head, every[head.n_lines :])
                    _drop_no_places(head)
                    return head
    return None


def _stand_over_rows(head: Head, every: Sequence[Sequence[str]]) -> bool:
    """Whether what follows the titles may be a row of their table: with a number, or as many cells but no titles."""
    behind = every[head.n_lines : head.n_lines + 1]
    return all(
        any(map(is_number, row)) if in_one_line([row]) else len(row) == head.n_cells or any(map(is_number, row))
        for row in behind
    )


def _cells(line: str, delimiter: str | None) -> list[str]:
    text = line.lstrip(_COMMENT + " ") if line.startswith(tuple(_COMMENT)) else line
    return [cell.strip().strip('"') for cell in unquoted(text, delimiter).split(delimiter)] or [""]


def _read_preamble(head: Head, before: list[list[str]]) -> None:
    texts = [
        row if sum(":" in cell or "=" in cell for cell in row) > 1 else [":".join(filter(None, row))] for row in before
    ]
    for text in (part for row in texts for cell in row for part in _APART.split(cell)):
        key, _, value = text.lstrip("/ ").replace("=", ":", 1).partition(":")
        key = CAMEL.sub(" ", key.strip())
        stated = _STATED.fullmatch(key)
        if stated and stated[1].lower().startswith("unit"):
            head.unit = head.unit or value.strip(": ")
        elif stated and not key.lower().startswith("analog"):
            head.rate = head.rate or value.strip(": Hzfps")


def _pass_further_titles(head: Head, every: list[list[str]]) -> None:
    """Pass over lines behind the titles that hold words alone: units, or the name of an index."""
    for row in every[head.n_lines :]:
        words = [cell for cell in row if cell]
        if not words or any(is_number(cell) or not cell.strip("[]()").isalpha() for cell in words):
            return
        columns = [column for body in head.bodies for column in body.place.values() if column < len(row)]
        units = {row[column].strip("[]()").lower() for column in columns} - {""}  # of rotations
        if len(units) > 1 or not units <= {*MM_PER_UNIT}:
            return
        head.unit = head.unit or next(iter(units), "")
        head.n_cells = max(head.n_cells, len(without_trailing_empty(row)))
        head.n_lines += 1


def _read_names(head: Head, every: list[list[str]]) -> None:
    """Call points as cells of the first row do where a column is theirs: ROS has ``markers0.marker_name``."""
    row = [*every, []][head.n_lines]
    titles = every[head.n_lines - 1]
    cells = [(title.lower(), cell) for title, cell in zip(titles, row, strict=False) if cell]
    named = [(match[1], cell) for title, cell in cells if (match := _NAMING.fullmatch(title))]
    for body in head.bodies:
        owners = (body.name.lower(), body.name.lower().rpartition(".")[0])  # rigidbodies0.pose
        body.name = next((cell for owner in owners for name, cell in named if name == owner), body.name)
    owning = [(at, row[at]) for at, title in enumerate(titles[: len(row)]) if _OWNING.fullmatch(title)]
    if _NUMBERED in head.notices and len(owning) == len(head.bodies) and not any(is_number(cell) for _, cell in owning):
        head.notices.remove(_NUMBERED)
        by_columns = sorted(head.bodies, key=lambda body: min(body.every_column))
        for body, (_, cell) in zip(by_columns, owning, strict=True):
            body.name = cell


def _read_rows(head: Head, every: list[list[str]]) -> None:
    """Find out whether rows of several take turns, and leave out flags that hold no 0 or 1."""
    rows = every[head.n_lines :]
    for body in head.bodies:
        is_flag = body.flag is None or all(row[body.flag : body.flag + 1] in (["0"], ["1"]) for row in rows[:1])
        body.flag = body.flag if is_flag or body.is_graded else None
    if head.frames is not None and not all(is_number(row[head.frames]) for row in rows[:1] if head.frames < len(row)):
        head.frames = None  # ROS has frame_id, of coordinates
    head.owners = _owners(head, every[head.n_lines - 1], rows)


def _owners(head: Head, titles: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the columns that say whose row it is; none if rows do not take turns."""
    columns = {at: [row[at] for row in rows if at < len(row)] for at in range(len(titles))}
    named = {at for at, title in enumerate(titles) if _OWNER.fullmatch(title) or _OWNING.fullmatch(title)}
    words = {at for at, cells in columns.items() if not any(map(is_number, map(seconds_of, cells)))}
    frames = columns.get(-1 if head.frames is None else head.frames, [])[:2]
    differing = {at for at in words if len({*frames}) < len(frames) and len({*columns[at][:2]}) > 1}
    recurring = {
        at for at in named if _OWNER.fullmatch(titles[at]) and len({*columns[at]}) < len([*groupby(columns[at])])
    }
    taking_turns = differing | recurring
    return sorted((named & words if taking_turns & named else set()) or taking_turns)


def _leave_out(head: Head, bodies: Sequence[Body], what: str) -> None:
    """Drop bodies and say what they are."""
    if bodies:
        head.notices.append(f"{what}, and left out: {', '.join(body.name for body in bodies[:8])}")
    head.bodies = [body for body in head.bodies if body not in bodies]


def _drop_turns(head: Head, rows: Sequence[Sequence[str]]) -> None:
    """Drop points of four columns of unit length, quaternions whose scalar no title tells, and axes of a body."""
    fourths = [(body, body.fourth) for body in head.bodies if body.fourth is not None]
    lengths = [(body, _lengths([*body.place.values(), fourth], rows)[:1]) for body, fourth in fourths]
    turns = [body for body, first in lengths if first and abs(first[0] - 1.0) < _UNIT_TOLERANCE]
    _leave_out(head, turns, "quaternions without positions")
    if len(head.bodies) == len(AXES) and rows:
        with contextlib.suppress(ValueError, IndexError):
            axes = [[float(rows[0][body.place[axis]].replace(",", ".")) for axis in AXES] for body in head.bodies]
            products = [sum(map(mul, first, second)) for first, second in combinations_with_replacement(axes, 2)]
            off = max(abs(one - wanted) for one, wanted in zip(products, (1, 0, 0, 1, 0, 1), strict=True))
            _leave_out(head, head.bodies if off < _UNIT_TOLERANCE else [], "axes of a body without its position")


def _drop_directions(head: Head, rows: Sequence[Sequence[str]]) -> None:
    """Drop points of unit length in every row, beside others: directions of gazes, noses or normals."""
    lengths = [(body, _lengths([*body.place.values()], rows)) for body in head.bodies if not body.turn]
    found = [body for body, own in lengths if len(own) > 2 and max(abs(x - 1.0) for x in own) < _UNIT_TOLERANCE]
    _leave_out(head, found if len(found) < len(head.bodies) else [], "directions, of the length 1")


def _lengths(columns: Sequence[int], rows: Sequence[Sequence[str]]) -> list[float]:
    """Return the lengths of the vectors in some columns, of the rows in which they hold numbers."""
    lengths = []
    for row in rows:
        with contextlib.suppress(ValueError, IndexError):
            lengths.append(math.hypot(*(float(row[column].replace(",", ".")) for column in columns)))
    return [length for length in lengths if math.isfinite(length)]


def _drop_no_places(head: Head) -> None:
    """Drop what is no point: forces, accelerations, angles and the like."""
    points = [body for body in head.bodies if not body.is_turned and not body.has_angles]
    left_out = [body for body in points if _NO_PLACES.fullmatch(body.name) or _SENSED.fullmatch(body.name)]
    is_single = len(head.bodies) - len(left_out) < _FEWEST  # it has no skeleton
    _leave_out(head, points if left_out and is_single else left_out, "no points")
    angles = [body.name for body in head.bodies if body.turn and not body.is_turned]
    if angles:
        head.notices.append(f"rotations other than unit quaternions are left out: {', '.join(angles[:8])}")


def in_one_line(rows: Sequence[Sequence[str]]) -> Head | None:
    """Return what a single line of titles says, or None if they are not those of points.

    Parameters
    ----------
    rows : sequence of sequences of str
        Lines from that of the titles on, without quotes.
    """
    titles = without_trailing_empty(rows[0])
    bodies, notices = bodies_of(titles), []
    if not bodies and (titled := with_axes(titles)):
        titles, bodies, notices = titled, bodies_of(titled), [_IN_THREES]
    if len(bodies) < _FEWEST and not any(body.is_turned or body.has_angles for body in bodies):
        return None
    unit = next((body.unit for body in bodies if body.unit), "")
    found = Head(bodies, n_cells=len(titles), titles=titles, unit=unit, notices=notices)
    _find_times(found, titles)
    if undoubled(spelt(titles)) != spelt(titles):
        found.notices.append(_NUMBERED)
    found.notices += not_taken(titles, bodies)
    if unread := numbered_quaternions(titles):
        found.notices.append(f"{UNREAD_QUATERNION}: {', '.join(unread[:8])}")
    if any(_LOCAL.search(titles[column]) for body in bodies for column in body.place.values()):
        found.notices.append("positions called local are taken as ones in the room; those of a child may not be")
    return found


def _find_times(head: Head, titles: Sequence[str]) -> None:
    head.frames = next((at for at, title in enumerate(titles) if is_frame(title)), None)
    head.clock = clock_of(titles)


def _under_names(rows: list[list[str]]) -> Head | None:
    """Names over the first of three columns X, Y, Z, or over each; frame and time may stand before."""
    if len(rows) < 3:
        return None
    units = {word.lower() for word in rows[1] if word} - {"s"}
    has_units = len(units) == 1 and units <= {*MM_PER_UNIT}  # between names and axes, as Mokka has them
    axes = without_trailing_empty(rows[1 + has_units])
    names = [*rows[0], *[""] * len(axes)][: len(axes)]
    if sum(axis_alone(axis) is not None for axis in axes) < _FEWEST * len(AXES):
        return None
    letters = [(axis_alone(axis) or ("", ""))[0] for axis in axes]
    for column in range(len(axes) - 2):  # a name may stand over y alone, where cells were merged
        if letters[column : column + 3] == [*AXES] and not names[column]:
            names[column : column + 3] = [next(filter(None, names[column : column + 3]), "")] * 3
    for column in range(1, len(axes)):
        if not names[column] and (
            axis_alone(axes[column]) or angle_alone(axes[column]) or component_alone(axes[column])
        ):
            names[column] = names[column - 1]
    titles = [f"{name}_{axis}" if name and axis else axis or name for name, axis in zip(names, axes, strict=True)]
    bodies = bodies_of(titles)
    if len(bodies) < _FEWEST:
        return None
    unit = units.pop() if has_units else bodies[0].unit
    found = Head(bodies, n_cells=len(axes), n_lines=2 + has_units, unit=unit)
    _find_times(found, [axis if clock_of([axis]) else name for name, axis in zip(names, axes, strict=True)])
    return found


def _triples(names: Sequence[str], axes: Sequence[str], first: int) -> list[Body]:
    """Points whose columns stand side by side."""
    lower = [axis.lower() for axis in axes]
    starts = (at for at in range(first, min(len(names), len(axes) - 2)) if lower[at : at + 3] == [*AXES])
    return [Body(names[at], place={axis: at + step for step, axis in enumerate(AXES)}) for at in starts]


def _deeplabcut(rows: list[list[str]]) -> Head | None:
    titled = {row[0].lower(): row for row in rows if row[0].lower() in _DEEPLABCUT}
    if "bodyparts" not in titled or "coords" not in titled:
        return None
    parts, coords = titled["bodyparts"], titled["coords"]
    people = titled.get("individuals", [""] * len(parts))
    several = len(set(people[1:])) > 1
    names = [f"{person}:{part}" if several else part for person, part in zip(people, parts, strict=False)]
    return Head(_triples(names, coords, 1), n_cells=len(coords), n_lines=len(titled))


def _is_visual3d(rows: list[list[str]]) -> bool:
    return len(rows) > 4 and rows[4][0].upper() == "ITEM"


def _visual3d(rows: list[list[str]]) -> Head | None:
    """Targets and landmarks of an ASCII export of Visual3D: of the first trial, and of the first folder of a signal."""
    if not _is_visual3d(rows):
        return None
    files, names, kinds, _, axes = rows[:5]
    found = Head([], n_cells=len(axes), n_lines=5)
    left_out = 0
    for body in _triples(names[: min(map(len, rows[:5]))], axes, 1):
        first = body.place["x"]
        if kinds[first].upper() not in _VISUAL3D:
            continue
        if files[first] != files[1] or body.name in [other.name for other in found.bodies]:
            left_out += 1
        else:
            found.bodies.append(body)
    if left_out:
        found.notices.append(f"{left_out} signals of further trials or folders are left out; export them alone")
    times = (at for at, name in enumerate(names) if at and name.upper() == "TIME")
    found.clock = next((Clock(at, 0.0) for at in times), None)
    return found if found.bodies else None
