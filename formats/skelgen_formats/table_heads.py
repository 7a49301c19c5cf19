"""What the lines above a table of points say: which columns are whose, which is time, rate, unit, and where it begins.

Before the titles (see `skelgen_formats.title_lines`) may stand lines of words and values (``Frequency: 100``,
``Units: mm``, ``// fs=100``), behind them one of units, or the name of the index that pandas writes. Rows may begin
with their number, over which R writes no title.
"""

import contextlib
import math
import re
from collections.abc import Sequence
from itertools import chain, combinations_with_replacement, groupby, pairwise, product
from operator import mul

from skelgen_formats.body_columns import Body
from skelgen_formats.cell_marks import mark_in, unit_behind
from skelgen_formats.clock_titles import Clock, clock_of, is_frame
from skelgen_formats.flags import is_of_flag
from skelgen_formats.markers import mm_of_unit
from skelgen_formats.options import MM_PER_UNIT
from skelgen_formats.text import (
    is_number,
    is_unseen,
    seconds_of,
    unquoted,
    without_trailing_empty,
    words_of,
)
from skelgen_formats.title_lines import (
    NUMBERED,
    Head,
    deeplabcut,
    in_one_line,
    in_threes,
    is_visual3d,
    names_of_threes,
    under_bodies,
    under_names,
    visual3d,
)
from skelgen_formats.turn_titles import AXES, BETWEEN

HEAD_LINES = 32
"""Lines that are looked through for titles."""

_PREAMBLE = 24  # lines before the titles, at most
_TITLE_LINES = HEAD_LINES - _PREAMBLE
_FEWEST, _LEVELS = 2, 2  # points of a table that no word says what it is; lines of names above others
DELIMITERS = (",", ";", "\t", "|", None)
"""What may part cells, None for blanks."""

_NO_PLACES = re.compile(
    r"(.*[_ .:/-])?(l?acce?|accel\w*|gyro?\w*|mag|magnet\w*|quat\w*|euler\w*|rot|rotation|orientation|ang|angles?"
    r"|angular|theta|omega|forces?|moments?|torques?|grf|fp\d+|force_?plate\d*|dir|direction|velo?|velocity|velocities|speed"
    r"|jerk|bias\w*|scale|colou?r|std\w*|sigma|cov\w*)([_ .:/-].*)?",
    re.IGNORECASE,
)
_IN_ROOM = re.compile(rf"(.+){BETWEEN}world")
_SENSED = re.compile(r".*[a-z](Acc|Accel\w*|Gyr\w*|Mag|Magnet\w*|Vel|Velocity)")  # FreeAcc
_RATE, _STEP = ("|".join(words_of("times")[kind]) for kind in ("rate", "step"))
_STATED = re.compile(
    rf"(?:[^\W\d_]{{1,40}}[ _]){{0,3}}(?:({_RATE})|({_STEP})|units?)"
    r"(?:[ _]?[\[(]?(?:hz|fps|1/s|samples?/s(?:ec)?|(m?s(?:ec)?))[\])]?)?\W*",
    re.IGNORECASE,
)
_OF_OTHERS = re.compile(r"analog|cut.?off|filter|pass\b|corner|heart|baud|bit|emg|force|stride|cadence", re.IGNORECASE)
_APART = re.compile(r" {2,}")  # two statements in a line
CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
"""Where words of one title meet: posUnit, SegmentName."""

_OWNER = re.compile(
    r"id|(?:body|person|people|subject|individual|user|player|actor|skeleton|track(?:ing)?)(?:[ _]?track(?:ing)?)?"
    r"[ _]?(?:id|idx|index|no|number|name)?",
    re.IGNORECASE,
)
_NAMING = re.compile(r"(.+?)[._](?:(?:marker|rigid_?body|body|subject)_?)?(?:name|child_frame_id)")
_OWNING = re.compile(
    r"(?:joint|marker|bone|segment|body|keypoint|landmark|sensor|point|finger|hand|side)[ _]?(?:name|label|type)?",
    re.IGNORECASE,
)
_EVEN = 2.0  # how much longer than the shortest one a step from time to time is, at most
_UNIT_TOLERANCE = 1e-3  # of the length of quaternions, which are printed with a few digits
_COMMENT = "#%"  # what stands before the titles that numpy and ROS write
_STRICT, _LOOSE = (deeplabcut, under_bodies, under_names, in_one_line), (in_threes, names_of_threes)
_STATES = re.compile(r"[:=]\s*\S")


def find_head(lines: Sequence[str]) -> Head | None:
    """Return what titles say, or None if there are none of points.

    Parameters
    ----------
    lines : sequence of str
        The first `HEAD_LINES` of a file that are not blank.
    """
    for delimiter in DELIMITERS:
        every = with_row_names([_cells(line, delimiter) for line in lines])
        if ["endheader"] in [row[:1] for row in every]:  # of OpenSim
            continue
        starts = [at for at, row in enumerate(every[: _PREAMBLE + 1]) if len(row) > 1]
        finders = ((visual3d,),) if is_visual3d(every) else (_STRICT, _LOOSE)
        for first, find in chain.from_iterable(product(starts, some) for some in finders):
            if (head := find(every[first : first + _TITLE_LINES])) is not None:
                head.delimiter, head.n_lines = delimiter, head.n_lines + first
                read_preamble(head, every[:first])
                for row in reversed(every[max(first - _LEVELS, 0) : first]):
                    _read_groups(head, row)
                _pass_further_titles(head, every)
                _read_names(head, every)
                _read_rows(head, every)
                if _stand_over_rows(head, every):
                    _drop_turns(head, every[head.n_lines :])
                    _drop_directions(head, every[head.n_lines :])
                    _drop_no_places(head)
                    _drop_images(head)
                    return head
    return None


def _stand_over_rows(head: Head, every: Sequence[Sequence[str]]) -> bool:
    """Whether what follows the titles may be a row of their table: with a number, or as many cells but no titles."""
    return all(
        any(map(is_number, row)) or (len(row) == head.n_cells and not in_one_line([row]) and not in_threes([row]))
        for row in every[head.n_lines : head.n_lines + 1]
    )


def _cells(line: str, delimiter: str | None) -> list[str]:
    text = line.lstrip(_COMMENT + " ") if line.startswith(tuple(_COMMENT)) else line
    return [cell.strip().strip('"') for cell in unquoted(text, delimiter).split(delimiter)] or [""]


def with_row_names(rows: list[list[str]]) -> list[list[str]]:
    """Return rows with an empty title before the others where each row begins with its number, as R writes them.

    Parameters
    ----------
    rows : list of list of str
        Cells of lines, those of titles first.
    """
    width = len(rows[-1]) if rows else 0
    first = next((at for at in range(len(rows), 0, -1) if len(rows[at - 1]) != width), 0)
    counted = [row[0] for row in rows[first:] if row and row[-1]]
    if first and len(rows[first - 1]) == width - 1 and counted == [f"{n}" for n in range(1, len(rows) - first + 1)]:
        return [*rows[: first - 1], ["", *rows[first - 1]], *rows[first:]]
    return rows


def read_preamble(head: Head, before: Sequence[Sequence[str]]) -> None:
    """Find unit and frame rate in the lines before the titles.

    Parameters
    ----------
    head : Head
        Of the table; gets what they say, where it has no unit or rate.
    before : sequence of sequences of str
        Cells of these lines, without what begins a comment.
    """
    texts = []
    for row in ([cell for cell in row if cell] for row in before):
        are_whole = sum(map(bool, map(_STATES.search, row))) > 1
        texts.append(row if are_whole else [":".join(row[at : at + 2]) for at in range(0, len(row), 2)])
    for text in (part for row in texts for cell in row for part in _APART.split(cell)):
        key, _, value = text.lstrip("/ ").replace("=", ":", 1).partition(":")
        if not value:  # FPS 200
            key, _, last = text.strip().rpartition(" ")
            value = last if is_number(last) or last.lower() in MM_PER_UNIT else ""
        value = value.strip(": ")
        key = CAMEL.sub(" ", key.strip())
        stated = _STATED.fullmatch(key)
        if stated and not stated[1] and not stated[2]:
            is_length = mm_of_unit(value) is not None
            head.notices += [] if is_length or not value else [f"the {key.lower()} {value[:20]} is none of length"]
            head.unit = head.unit or (value if is_length else "")
        elif stated and not _OF_OTHERS.search(key):
            head.rate = head.rate or (value.rstrip(" Hzfps") if stated[1] else _rate_of_step(value, stated[3] or "s"))


def _read_groups(head: Head, above: Sequence[str]) -> None:
    """Write the words of a line above the names before these where they tell columns apart: subjects, or velocities.

    Where names are numbers alone the words take their place.
    """
    row = [*above, *[""] * head.n_cells]
    starts = [body.place["x"] for body in head.bodies]
    words = [next(filter(None, reversed(row[: start + 1])), "") for start in starts]  # cells may be merged
    are_over = all({row[at] for at in body.place.values()} <= {row[body.place["x"]], ""} for body in head.bodies)
    pairs = {(word, body.name) for word, body in zip(words, head.bodies, strict=True)}
    are_people = len(pairs) == len(words) > len({name for _, name in pairs}) and all(map(str.isdecimal, words))
    if are_over and len({*words}) > 1 and "" not in words and (are_people or not any(map(is_number, words))):
        are_numbered = len({*words}) == len(words) and all(body.name.isdecimal() for body in head.bodies)
        for body, word in zip(head.bodies, words, strict=True):
            body.name = word if are_numbered else f"{word}:{body.name}"
        if are_numbered:
            head.notices = [notice for notice in head.notices if notice != NUMBERED]
            head.frames = (
                head.frames
                if head.counts is not None
                else next((at for at, cell in enumerate(above) if is_frame(cell)), None)
            )
            head.clock = head.clock or clock_of(above)


def _rate_of_step(value: str, unit: str) -> str:
    """Return the frame rate as text, of a time from frame to frame such as 5 ms, or in the unit of its title."""
    seconds = seconds_of(value if value[-1:].isalpha() else f"{value} {unit}")
    return f"{1.0 / float(seconds):.10g}" if is_number(seconds) and float(seconds) > 0.0 else ""


def _pass_further_titles(head: Head, every: list[list[str]]) -> None:
    """Pass over lines behind the titles that hold words alone: units, or the name of an index."""
    for row in every[head.n_lines :]:
        words = [word for cell in row if (word := cell.strip("[]()")) not in ("", "-")]
        if not words or any(is_number(word) or not word.replace("/", "").isalpha() for word in words):
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
    if NUMBERED in head.notices and len(owning) == len(head.bodies) and not any(is_number(cell) for _, cell in owning):
        head.notices.remove(NUMBERED)
        by_columns = sorted(head.bodies, key=lambda body: min(body.every_column))
        for body, (_, cell) in zip(by_columns, owning, strict=True):
            body.name = cell


def _read_rows(head: Head, every: list[list[str]]) -> None:
    """Find out whether rows of several take turns, and leave out flags that do not begin with one."""
    rows = every[head.n_lines :]
    cells = [row[column] for row in rows for body in head.bodies for column in body.place.values() if column < len(row)]
    head.unit_in_cells, head.mark = unit_behind(cells), mark_in(cells)
    head.unit = head.unit_in_cells or head.unit
    for body in head.bodies:
        for at, flag in [*body.flags.items()]:
            cells = [row[at] for row in rows if at < len(row) and not is_unseen(row[at])]
            if not all(is_of_flag(cell, flag) for cell in cells[:1]):
                del body.flags[at]
    if head.frames is not None and not all(is_number(row[head.frames]) for row in rows[:1] if head.frames < len(row)):
        head.frames = None  # ROS has frame_id, of coordinates
    titles = every[head.n_lines - 1]
    head.may_own = [at for at, title in enumerate(titles) if _OWNER.fullmatch(title)]
    head.owners = _owners(head, titles, rows)
    if head.clock is None and head.frames is None:
        taken = {column for body in head.bodies for column in body.every_column}
        free = (at for at in range(head.n_cells) if at not in taken)
        found = (at for at in free if _are_times([row[at] for row in rows if at < len(row)], first=at == 0))
        if (column := next(found, None)) is not None:
            head.clock = Clock(column, 0.0)
            head.notices.append(f"column {column + 1} is taken as times, as its cells say; its title does not")


def _are_times(cells: Sequence[str], *, first: bool) -> bool:
    """Whether cells are dates or times of day; in the first column also numbers that rise evenly by a fraction."""
    if len(cells) < _FEWEST or any(":" in cell for cell in cells):
        return len(cells) >= _FEWEST and all(is_number(seconds_of(cell)) and not is_unseen(cell) for cell in cells)
    with contextlib.suppress(ValueError):
        times = [float(cell.replace(",", ".")) for cell in cells]
        steps = [second - first for first, second in pairwise(times)]
        is_even = 0.0 < max(steps) < _EVEN * min(steps)
        return first and is_even and not all(step.is_integer() for step in steps)
    return False


def _owners(head: Head, titles: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the columns that say whose row it is; none if rows do not take turns."""
    columns = {at: [row[at] for row in rows if at < len(row)] for at in range(len(titles))}
    named = {*head.may_own, *(at for at, title in enumerate(titles) if _OWNING.fullmatch(title))}
    words = {at for at, cells in columns.items() if not any(map(is_number, map(seconds_of, cells)))}
    frames = columns.get(-1 if head.frames is None else head.frames, [])[:2]
    differing = {at for at in words if len({*frames}) < len(frames) and len({*columns[at][:2]}) > 1}
    recurring = {at for at in head.may_own if len({*columns[at]}) < len([*groupby(columns[at])])}
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


def _drop_images(head: Head) -> None:
    """Drop points beside which there are the same in the room: knee beside knee_world, as of landmarks in images."""
    by_name = {body.name.lower(): body for body in head.bodies}
    others = [match[1] for name in by_name if (match := _IN_ROOM.fullmatch(name))]
    beside = [by_name[name] for name in others if name in by_name]
    _leave_out(head, beside if 2 * len(beside) == len(head.bodies) else [], "points beside those called world")


def _drop_no_places(head: Head) -> None:
    """Drop what is no point: forces, accelerations, angles and the like."""
    points = [body for body in head.bodies if not body.is_turned and not body.has_angles]
    left_out = [body for body in points if _NO_PLACES.fullmatch(body.name) or _SENSED.fullmatch(body.name)]
    is_single = len(head.bodies) - len(left_out) < _FEWEST  # it has no skeleton
    _leave_out(head, points if left_out and is_single else left_out, "no points")
    angles = [body.name for body in head.bodies if body.turn and not body.is_turned]
    if angles:
        head.notices.append(f"rotations other than unit quaternions are left out: {', '.join(angles[:8])}")
