"""Texts without titles, as programs log and list points: each has its name before its coordinates, or each number has.

A line may hold a point, ``knee 1.5 2.5 3.5`` or ``12:00:01.5 marker knee x=1.5 y=2.5 z=3.5``, or all of a frame,
``0.02,knee,1.5,2.5,3.5,toe,4.5,5.5,6.5`` or ``t=0.02 knee_x=1.5 knee_y=2.5 ...``. A frame begins where a name comes
again, or one from before the last one, or where the number or time of day before the points, which may stand in a
line of its own, is another one. The numbers are written into a wide table, which `skelgen_formats.wide` reads. Tables
of a point each, below its name, become one with a column of names, which `skelgen_formats.tidy` reads.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.flags import flag_of
from skelgen_formats.foreign import is_foreign
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.options import POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.text import is_number
from skelgen_formats.tidy import read_tidy
from skelgen_formats.titles import axis_alone, bodies_of
from skelgen_formats.turn_titles import AXES
from skelgen_formats.wide import read_table

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|nan"
_COORDINATES = r"[\s,;]+".join(rf"(?:{axis}\s*[:=]\s*)?({_NUMBER})" for axis in AXES)
_POINT = re.compile(
    rf"(?<![\w.])([a-z_][\w.:-]{{0,60}})[\s,;:=(\[]+{_COORDINATES}(?![\w.])(?![\s,;]*[-+.]?\d)", re.IGNORECASE
)
_PAIR = re.compile(rf"(?<![\w.])([a-z_][\w.-]{{0,60}})\s*[:=]\s*({_NUMBER})(?![\w.])", re.IGNORECASE)
_MOMENT = re.compile(rf"\d{{1,2}}:\d\d:\d\d(?:[.,]\d+)?|{_NUMBER}", re.IGNORECASE)
_TOUCHING = re.compile(r"(?<![\w.:])\d+:$")  # a number and the name behind it
_CELLS = re.compile(r"[,;\t]")
_LOOKED_AT, _FEWEST = 256, 2  # lines; points of a frame
_BARE, _ABOVE = 2, 4  # lines without a point, of each frame and above the first
_MOST_PEOPLE = 16
_MOST_TIMES, _FREE = 16, 1 << 20  # points that frames may have beside those that are listed

_Point = tuple[str, str, list[str]]  # the last number or time before it, its name and coordinates
_Found = tuple[_Point, bool]  # and whether that number touches its name: 1:knee
_Frames = list[tuple[str, dict[str, list[str]]]]  # what stands before the points of each frame, and their numbers


def read_named_rows(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the points of a text.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `points`, `recorded_rate` and `recorded_unit` count.

    Raises
    ------
    FormatError
        If no names stand before numbers, or hardly any frame has most of them.
    """
    lines = [line for _, line in read_lines(path).numbered()]
    if blocks := _blocks(lines):
        if len({line.partition("\t")[0] for line in blocks[1:]}) < _FEWEST:
            raise FormatError(
                path, 1, "a table of a single point, which has no skeleton; write those of all points below it"
            )
        return read_tidy(path, Lines(path, "\n".join(blocks).encode(), "utf-8"), options)
    frames = _pairs(lines) or _frames(lines)
    names = {name: None for _, points in frames for name in points}
    n_listed = sum(len(points) for _, points in frames)
    if not frames:
        raise FormatError(path, 1, "no lines with names before three numbers each: knee 1.5 2.5 3.5")
    if len(names) * len(frames) > _MOST_TIMES * n_listed + _FREE:
        raise FormatError(path, "", f"{len(names)} names in {len(frames)} frames, but only {n_listed} points of them")
    table = Lines(path, "\n".join(_table(frames, names)).encode(), "utf-8")
    return read_table(path, table, options)


def _table(frames: _Frames, names: Mapping[str, None]) -> Iterator[str]:
    """Yield the lines of a wide table, with titles of axes where a name has three numbers."""
    widths = {name: len(numbers) for _, points in frames for name, numbers in points.items()}
    titles = [f"{name}_{axis}" if widths[name] > 1 else name for name in names for axis in AXES[: widths[name]]]
    is_told = any(moment for moment, _ in frames)
    counted = "frame" if all(moment.isdecimal() for moment, _ in frames) else "time"
    yield "\t".join([counted] * is_told + titles)
    for moment, points in frames:
        numbers = [number for name in names for number in points.get(name, [""] * widths[name])]
        yield "\t".join([moment] * is_told + numbers)


def _blocks(lines: Iterable[str]) -> list[str]:
    """Return the lines of one table for those of a point each, with its name in a line above x, y and z; else none."""
    name, below, table = "", False, list[str]()
    for cells in (_CELLS.split(line) for line in lines):
        words = [cell.strip() for cell in cells if cell.strip()]
        if len(words) == 1 and not is_number(words[0]):
            name, below = words[0].rpartition(": ")[2].rstrip(":"), False
        elif name and {(axis_alone(word) or ("", ""))[0] for word in words} >= {*AXES}:
            below = True
            table = table or ["\t".join(["name", *cells])]
        elif below and words:
            table.append("\t".join([name, *cells]))
    return table


def _pairs(lines: Iterable[str]) -> _Frames:
    """Return the numbers of lines in which each has its name; empty if they name no points."""
    rows = [("", {name: [number] for name, number in _PAIR.findall(line)}) for line in lines]
    rows = [row for row in rows if row[1]]
    return rows if rows and len(bodies_of([*rows[0][1]])) >= _FEWEST else []


def _frames(lines: Iterable[str]) -> _Frames:
    """Return the points of each frame."""
    frames: _Frames = []
    every = _with_people(_points(lines))
    first: dict[str, str] = {}
    for moment, name, _ in every:
        if name in first:
            break
        first[name] = moment
    order = {} if len({*first.values()} - {""}) == 1 else {name: at for at, name in enumerate(first)}
    last = ""
    for before, name, place in every:
        moment = "" if order else before
        is_back = order.get(name, 0) < order.get(last, 0)
        if not frames or name in frames[-1][1] or is_back or moment != frames[-1][0]:
            frames.append((moment, {}))
        frames[-1][1][name], last = place, name
    return frames


def _with_people(found: Iterable[_Found]) -> list[_Point]:
    """Return points with the numbers that touch their names in these, if few recur by turns: 1:knee, 2:knee, 1:knee.

    Of frames or lines a number stands apart; numbers of points have names of their own.
    """
    pairs = [*found]
    every = [point for point, _ in pairs]
    numbers = [number for number, _ in groupby(moment for moment, _, _ in every)]
    few = len({*numbers})
    whose = Counter(name for _, name in {(moment, name) for moment, name, _ in every})
    recurring = sum(count > 1 for count in whose.values())
    are_turns = _FEWEST <= few <= _MOST_PEOPLE and len(numbers) > 2 * few and 2 * recurring > len(whose)
    if not are_turns or not all(touches for _, touches in pairs) or not all(map(str.isdecimal, numbers)):
        return every
    return [("", f"{moment}:{name}", place) for moment, name, place in every]


def _points(lines: Iterable[str]) -> Iterator[_Found]:
    """Yield the last number or time of day before each point, its name and coordinates, and whether the two touch."""
    moment = ""
    for line in lines:
        end = 0
        for match in _POINT.finditer(line):
            before = line[end : match.start()]
            moment = next(reversed(_MOMENT.findall(before)), moment)
            end = match.end()
            point = (moment, match[1].rstrip(":"), list(match.groups()[1:]))
            yield point, _TOUCHING.search(before) is not None
        moment = moment if end else next(reversed(_MOMENT.findall(line)), moment)


def _has_named_rows(head: bytes, path: Path) -> bool:
    lines = [line for line in decoded_head(head).splitlines()[:_LOOKED_AT] if line.strip()]
    if is_foreign(head, path) or any(line.startswith((":", "<", "{")) for line in lines):  # AMC, ASF, XML
        return False
    titles = [cell.strip() for line in lines[:_ABOVE] for cell in _CELLS.split(line)]
    axes = {axis for axis, _ in filter(None, map(axis_alone, titles))}
    if axes == {"x", "y"} and any(map(flag_of, titles)):  # points in images, each with a confidence
        return False
    if _blocks(lines) or len({tuple(row) for _, row in _pairs(lines[:_FEWEST])}) == 1:
        return True
    frames = _frames(lines)
    bare = sum(_POINT.search(line) is None for line in lines)
    return (
        len(frames) > 1
        and len(frames[0][1]) >= _FEWEST
        and frames[0][1].keys() == frames[1][1].keys()
        and bare <= _BARE * len(frames) + _ABOVE
    )


FORMAT = Format(
    name="named-rows",
    title="Names before coordinates",
    suffixes=(".xyz",),
    holds="markers",
    sniff=_has_named_rows,
    read=read_named_rows,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Logs and lists without titles: a name before three numbers each, knee 1.5 2.5 3.5, or knee_x=1.5.",
)
