"""The line of titles of a tidy table: which column holds frames, times, names, groups and coordinates.

Coordinates are in three columns, or in one, with another that says along which axis they are.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import groupby

from skelgen_formats.body_columns import Body
from skelgen_formats.cell_marks import mark_in, unit_behind
from skelgen_formats.clock_titles import clock_of, is_frame
from skelgen_formats.spelling import spelt, with_lone_weight
from skelgen_formats.table_heads import CAMEL, DELIMITERS, read_preamble, with_row_names
from skelgen_formats.text import is_number, unquoted, without_trailing_empty, words_of
from skelgen_formats.title_lines import Head
from skelgen_formats.titles import bodies_of, nameless_body
from skelgen_formats.turn_titles import AXES

_ENDS = (
    ("_name", "_label", "", "s"),
    ("_id", "_index", "id", "_idx", "_number", "_no"),
)  # of titles of names; those of the first stand for words
_COMMENTS = ("#", "%")
_VALUED = re.compile(r"[:=]\s*\S")
_VALUE = re.compile(r"(?:value|position|pos|coordinate)s?(?:[ _]?[\[(]?(mm|cm|m)[\])]?)?", re.IGNORECASE)
AXIS_IN_NAME = re.compile(r"(?:[_ .:-][xyzXYZ]|(?<=[a-z0-9])[XYZ])$")
"""Where names of points end with the axis of a value."""

_FRAME_OF_ROS = "frame_id"  # a name, not a number
_CHILD_OF_ROS = "child_frame_id"
_PATH_OF_ROS = re.compile(rf".*\.(?={_CHILD_OF_ROS}$|(?:translation|rotation)\.[wxyz]$)")  # of its message
_NUMBERED = 4  # lines of titles and rows that tell whether these begin with their number
_FEWEST_TITLES = 3  # frame, name and value
_PREAMBLE = 24  # lines before the titles, at most
_LOOKED_AT = 1024  # rows that tell whether numbers are names of points
_MOST_OTHERS = 24  # columns that are looked through for names


@dataclass
class TidyHead(Head):
    """The line of titles: its only body has the columns of coordinates, `at` says where names and the like stand."""

    at: dict[str, int] = field(default_factory=dict)

    @property
    def columns(self) -> list[int]:
        """Columns of the numbers of a row: a value along an axis, or a place, with its rotation if that is whole."""
        (body,) = self.bodies
        return [self.at["value"]] if "value" in self.at else body.columns(turned=body.is_turned or body.has_angles)


def find_tidy_head(lines: Sequence[str]) -> TidyHead | None:
    """Return what the line of titles says, which comments and words with values may precede; None if there is none.

    Parameters
    ----------
    lines : sequence of str
        Of the file.
    """
    for index, line in enumerate(lines):
        for delimiter in (one for one in DELIMITERS if one or not any(filter(None, map(line.count, ",;\t")))):
            rows = [unquoted(one.lstrip("#% "), delimiter).split(delimiter) for one in lines[index : index + _NUMBERED]]
            titles, *below = with_row_names([rows[0], *filter(any, rows[1:])])
            titles = spelt(with_lone_weight([cell.strip().strip('"') for cell in titles], below))
            cells_of = partial(_column, lines, index + 1, delimiter)
            if len(titles) >= _FEWEST_TITLES and (head := _head_of(titles, cells_of)):
                head.delimiter, head.n_lines = delimiter, index + 1
                read_preamble(head, [_stated(one) for one in lines[:index]])
                are_comments = all(one.startswith(_COMMENTS) or not one.strip() for one in lines[:index])
                return head if are_comments or "name" in head.at else None
        if index >= _PREAMBLE or "\0" in line or not _may_precede(line):
            break
    return None


def _stated(line: str) -> list[str]:
    """Return the cells of a line before the titles: a comment, or a word and a value, if these are no titles."""
    if line.startswith(_COMMENTS):
        return [line.lstrip("".join(_COMMENTS) + " ")]
    return without_trailing_empty([cell.strip().strip('"') for cell in re.split(r"[,;\t]", line)])


def _may_precede(line: str) -> bool:
    """Whether a line may stand before the titles: blank, a comment, or a word and its value, but no name alone."""
    cells = [] if line.startswith(_COMMENTS) else _stated(line)
    return not cells or 1 < len(cells) < _FEWEST_TITLES or (len(cells) == 1 and _VALUED.search(cells[0]) is not None)


@cache
def _known() -> dict[str, list[str]]:
    """Return the titles of what columns may hold, those that say most first."""
    table = words_of("tidy_titles")
    things, columns = table["things"], dict(table["columns"])
    words, numbers = _ENDS
    named = [f"{thing}{end}" for thing in things for end in words]
    columns["name"] = [*named, *(f"{thing}{end}" for end in numbers for thing in things), *columns["name"]]
    for what, starts in (("flag", ("", "is_", "tracking_")), ("hidden", ("", "is_"))):
        columns[what] = [f"{start}{word}" for start in starts for word in columns[what]] + table.get(what, [])
    return columns


def _column(lines: Sequence[str], first: int, delimiter: str | None, at: int) -> list[str]:
    """Return the cells of a column that hold something."""
    rows = (unquoted(line, delimiter).split(delimiter) for line in lines[first : first + _LOOKED_AT])
    return [cell for row in rows for cell in map(str.strip, row[at : at + 1]) if cell]


def _head_of(titles: Sequence[str], cells_of: Callable[[int], list[str]]) -> TidyHead | None:
    """Return which column holds what, by titles and the cells of columns; None if one that is needed is missing."""
    if sum(title.endswith(f".{_CHILD_OF_ROS}") for title in titles) == 1:  # rows of one transform each
        titles = [_PATH_OF_ROS.sub("", title) for title in titles]
    plain = [CAMEL.sub("_", title).lower().replace(" ", "_") for title in titles]
    found = {what: [plain.index(word) for word in words if word in plain] for what, words in _known().items()}
    at = {what: columns[0] for what, columns in found.items() if columns}
    clock, frames = clock_of(titles), [column for column, title in enumerate(titles) if is_frame(title)]
    if clock and _FRAME_OF_ROS in plain and not all(map(is_number, cells_of(ros := plain.index(_FRAME_OF_ROS))[:1])):
        frames.remove(ros)
        at.setdefault("name", ros)
    body, every = nameless_body(titles), bodies_of(titles)
    if not clock and not frames and not _tells_frames(cells_of(at["name"]) if "name" in at else [], body):
        return None
    at |= {"time": clock.last} if clock else {}
    moments = [*frames, *([clock.column] if clock else [])]
    if "name" not in at and body.is_placed and moments:
        others = {*range(len(titles))} - body.every_column - {*at.values(), *frames} | {
            *found.get("group", []),
            *found.get("side", []),
        }
        cells_in = cells_of(moments[0])
        at |= zip(
            ["name"],
            (one for one in sorted(others)[:_MOST_OTHERS] if _are_names(cells_of(one), cells_in)),
            strict=False,
        )
    values = [column for column, title in enumerate(titles) if _VALUE.fullmatch(title) and column != at.get("axis")]
    if values and "name" in at and AXIS_IN_NAME.search("".join(cells_of(at["name"])[:1])):
        at.setdefault("axis", at["name"])  # knee_x, as pandas melts tables
    elif values and "axis" not in at:
        of_axes = [column for column in range(len(titles)) if {*map(str.lower, cells_of(column))} == {*AXES}]
        at |= zip(["axis"], of_axes, strict=False)
    is_by_axis = bool(values and (clock or frames)) and at.keys() >= {"name", "axis"} and not body.place
    if is_by_axis:
        at["value"], value = values[0], _VALUE.fullmatch(titles[values[0]])
        body.unit = (value[1] or "").lower() if value else ""
    elif "name" in at and not body.place and len(every) == 1:  # one alone, whose name every row has: pos3d_x
        body.place, body.unit = every[0].place, every[0].unit
    is_tidy = body.is_placed and ("name" in at or not every) and titles.count(titles[body.place["x"]]) == 1
    head = TidyHead([body], frames=next(iter(frames), None), clock=clock, unit=body.unit, titles=titles, at=at)
    numbers = [cell for column in (*body.place.values(), *values) for cell in cells_of(column)]
    head.unit_in_cells, head.mark = unit_behind(numbers), mark_in(numbers)
    head.unit = head.unit_in_cells or head.unit
    return head if is_by_axis or is_tidy else None


def _are_names(cells: Sequence[str], moments: Sequence[str]) -> bool:
    """Whether cells are words or numbers of points: each once in a frame, and the same in the first and the next."""
    if len(cells) != len(moments) or len({*zip(moments, cells, strict=True)}) < len(cells):
        return False
    two = [*dict.fromkeys(moments), "", ""][:2]
    first, second = ({cell for cell, one in zip(cells, moments, strict=True) if one == moment} for moment in two)
    return len(first) > 1 and first == second and all(cell.isdecimal() or not is_number(cell) for cell in first)


def _tells_frames(names: Sequence[str], body: Body) -> bool:
    """Whether rows tell frames without their numbers: by names that follow each other again, or as those of one body.

    Numbers may be what rows are counted by, or classes that many rows in turn have.
    """
    is_body = body.is_turned or body.has_angles
    if not names or not all(map(is_number, names)):
        return is_body or bool(names)
    return 1 < len({*names}) < len(names if is_body else [*groupby(names)])
