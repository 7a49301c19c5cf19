"""One line of titles over a table of points, or two, or those of DeepLabCut or Visual3D: which columns are whose.

Titles are one line (see `skelgen_formats.titles`), or two, the name over the first or over each of the columns X, Y, Z
(Mokka has units between them); or those of DeepLabCut in 3D, ``scorer``, ``bodyparts`` and ``coords``; or the five of
an ASCII export of Visual3D: file, signal, type, folder, and ``ITEM  X  Y  Z``.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from skelgen_formats.body_columns import Body
from skelgen_formats.clock_titles import Clock, clock_of, is_frame
from skelgen_formats.flags import Flag, flag_of
from skelgen_formats.options import MM_PER_UNIT
from skelgen_formats.spelling import spelt, with_letters, with_lone_weight
from skelgen_formats.text import is_number, without_trailing_empty
from skelgen_formats.titles import axis_alone, bodies_of, not_taken, undoubled, with_axes
from skelgen_formats.turn_titles import AXES, COMPONENTS, angle_alone, component_alone, numbered_quaternions

_FEWEST = 2  # points of a table that no word says what it is
_LOCAL = re.compile(r"(?<![A-Za-z])[Ll]ocal(?![a-z])|(?<=[a-z])Local(?![a-z])")
UNREAD_QUATERNION = "quaternions are left out until titles say which number is w (qw, qx, qy, qz)"
"""A notice of quaternions whose components are numbered."""

NUMBERED = "X, Y and Z stand several times without names in their line: points are numbered"
"""A notice of points whose titles have no names."""

_IN_THREES = "three columns under one name are taken as x, y and z"
_QUANTITY = re.compile(
    r"(?:pos(?:itions?)?|trans(?:lations?)?|loc(?:ations?)?|(?P<turn>rot(?:ations?)?|ori(?:ent(?:ations?)?)?"
    r"|quat(?:ernions?)?|att(?:itude)?)(?:[_ ]?quat(?:ernions?)?)?)\W*?(?P<unit>[\[(].+[\])])?",
    re.IGNORECASE,
)  # not Origin, or Rotula, which are points
_LETTERS, _POSE = {*COMPONENTS}, "xyzxyzw"  # a place and a unit quaternion
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
    unit_in_cells, mark : str
        The unit that stands behind each number, and what parts thousands, if something does.
    n_cells, n_lines : int
        Cells of a row, and lines above the first.
    titles : sequence of str
        Of the columns, where they stand in one line.
    owners : list of int
        Columns that say whose row it is, where rows of several take turns.
    may_own : list of int
        Columns whose titles are those of owners, though the first rows do not take turns.
    notices : list of str
        What is left out.
    """

    bodies: list[Body]
    delimiter: str | None = None
    frames: int | None = None
    clock: Clock | None = None
    unit: str = ""
    rate: str = ""
    unit_in_cells: str = ""
    mark: str = ""
    n_cells: int = 0
    n_lines: int = 1
    titles: Sequence[str] = ()
    owners: list[int] = field(default_factory=list)
    may_own: list[int] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)

    @property
    def counts(self) -> int | None:
        """The column of frame numbers, else that of times."""
        return self.frames if self.frames is not None else self.clock.column if self.clock else None

    @property
    def flags(self) -> dict[int, Flag]:
        """The columns that say whether points are seen."""
        return {column: flag for body in self.bodies for column, flag in body.flags.items()}


def in_one_line(rows: Sequence[Sequence[str]]) -> Head | None:
    """Return what a single line of titles says, or None if they are not those of points.

    Parameters
    ----------
    rows : sequence of sequences of str
        Lines from that of the titles on, without quotes.
    """
    titles = with_lone_weight(without_trailing_empty(rows[0]), rows[1:])
    bodies = bodies_of(titles)
    if len(bodies) < _FEWEST and not any(body.is_turned or body.has_angles for body in bodies):
        return None
    unit = next((body.unit for body in bodies if body.unit), "")
    found = Head(bodies, n_cells=len(titles), titles=titles, unit=unit)
    _find_times(found, spelt(titles))
    if with_letters(titles) != titles:
        found.notices.append("directions in words, such as AP or forward, are taken as x, y and z")
    if undoubled(spelt(titles)) != spelt(titles):
        found.notices.append(NUMBERED)
    found.notices += not_taken(titles, bodies)
    if unread := numbered_quaternions(titles):
        found.notices.append(f"{UNREAD_QUATERNION}: {', '.join(unread[:8])}")
    if any(_LOCAL.search(titles[column]) for body in bodies for column in body.place.values()):
        found.notices.append("positions called local are taken as ones in the room; those of a child may not be")
    return found


def in_threes(rows: Sequence[Sequence[str]]) -> Head | None:
    """Return what names over three columns each, or over the first of them, say; None if there are none.

    Parameters
    ----------
    rows : sequence of sequences of str
        Lines from that of the names on, without quotes.
    """
    found = in_one_line([titled]) if (titled := with_axes(without_trailing_empty(rows[0]))) else None
    if found:
        found.notices.insert(0, _IN_THREES)
    return found


def names_of_threes(rows: Sequence[Sequence[str]]) -> Head | None:
    """Return whose numbers are in rows that have three for each name above them, behind frame or time.

    Parameters
    ----------
    rows : sequence of sequences of str
        Lines from that of the names on, without quotes.
    """
    titles = [cell for cell in without_trailing_empty(rows[0]) if cell and not cell.endswith(":")]
    numbers = without_trailing_empty(rows[1]) if len(rows) > 1 else []
    times = [title for title in titles if is_frame(title) or clock_of([title])]
    names = titles[len(times) :]
    if len({*names}) < max(_FEWEST, len(names)) or len(numbers) != len(times) + len(AXES) * len(names):
        return None
    if not all(map(is_number, numbers)) or any(is_number(name) or axis_alone(name) for name in names):
        return None
    found = in_one_line([[*times, *(f"{name}_{axis}" for name in names for axis in AXES)]])
    if found:
        found.notices.insert(0, "each name stands for three columns, x, y and z")
    return found


def _find_times(head: Head, titles: Sequence[str]) -> None:
    head.frames = next((at for at, title in enumerate(titles) if is_frame(title)), None)
    head.clock = clock_of(titles)


def under_names(rows: list[list[str]]) -> Head | None:
    """Names over the first of three columns X, Y, Z, or over each; frame and time may stand before."""
    if len(rows) < 3:
        return None
    upper, lower = ({*filter(None, row)} for row in rows[:2])
    if len(upper) == len(AXES) and all(map(axis_alone, upper)) and not any(map(is_number, lower)) and len(lower) > 1:
        rows = [rows[1], rows[0], *rows[2:]]  # pandas may write the level of axes first
    units = {word.lower() for word in rows[1] if word} - {"s"}
    has_units = len(units) == 1 and units <= {*MM_PER_UNIT}  # between names and axes, as Mokka has them
    titles = with_lone_weight(without_trailing_empty(rows[1 + has_units]), rows[2 + has_units :], rows[0])
    axes = [axis.strip("-.:") for axis in spelt(titles)]
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
    _find_times(
        found, [axis if clock_of([axis]) or is_frame(axis) else name for name, axis in zip(names, axes, strict=True)]
    )
    return found


def under_bodies(rows: list[list[str]]) -> Head | None:
    """Names over words for place and rotation, over axes in any order; or one name over X, Y, Z, X, Y, Z, W, or none.

    Without W rotations are angles.
    """
    for n_lines in (3, 2):
        if len(rows) <= n_lines:
            continue
        axes = without_trailing_empty(rows[n_lines - 1])
        names, words = (_carried_on(row, axes) for row in rows[:2])
        if n_lines == 2:
            names, words = _of_one_body(names, axes)
        titles = _of_quantities(names, words, axes)
        above = zip(*([*row, *[""] * len(axes)][: len(axes)] for row in rows[: n_lines - 1]), strict=True)
        titles = [title or next(filter(None, cells), "") for title, cells in zip(titles, above, strict=False)]
        found = in_one_line([titles]) if titles else None
        if found:
            found.n_lines = n_lines
            return found
    return None


def _of_one_body(line: list[str], axes: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return names, and words for place and rotation, of one line over axes that has either; no words if it has others.

    Of a single name over X, Y, Z, X, Y, Z, W the axes tell the words.
    """
    told, lower = [*filter(None, line)], [axis.lower() for axis in axes]
    if len({*told}) > 1 and all(map(_QUANTITY.fullmatch, told)):
        return ["body" * bool(word) for word in line], line
    is_one = len({*told}) == 1 and "".join(axis for axis in lower if axis in _LETTERS) == _POSE
    words = iter(["position"] * len(AXES) + ["rotation"] * len(COMPONENTS) if is_one else [])
    return line, [next(words, "") if axis in _LETTERS else "" for axis in lower]


def _carried_on(row: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Return what stands over each column with an axis, there or over the ones before, where cells were merged."""
    carried: list[str] = []
    for cell, axis in zip([*row, *[""] * len(axes)], axes, strict=False):
        carried.append((cell or next(iter(carried[-1:]), "")) if axis.lower() in _LETTERS else "")
    return carried


def _of_quantities(names: Sequence[str], words: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Return titles of one line, knee_position_x, knee_quaternion_w, knee_euler_x; none if words or names lack."""
    matches = [_QUANTITY.fullmatch(word) for word in words]
    has_w = {name for name, axis in zip(names, axes, strict=True) if axis.lower() == "w"}
    titles = []
    for name, word, match, axis in zip(names, words, matches, axes, strict=True):
        if axis.lower() in _LETTERS and not name:
            return []
        kind = "position" if match and not match["turn"] else "quaternion" if name in has_w else "euler"
        unit = f" {match['unit']}" if match and match["unit"] and kind != "quaternion" else ""
        titles.append(f"{name}_{kind if match else word}_{axis}{unit}" if name else axis)
    return titles if any(matches) else []


def _triples(names: Sequence[str], axes: Sequence[str]) -> list[Body]:
    """Points whose columns stand side by side, behind the first column, with flags behind them."""
    lower = [axis.lower() for axis in axes]
    found = []
    for at in range(1, min(len(names), len(axes) - 2)):
        if lower[at : at + 3] == [*AXES]:
            behind = [*zip(names, axes, strict=False)][at + 3 : at + 4]
            flags = [flag for name, title in behind if name == names[at] and (flag := flag_of(title))]
            place = {axis: at + step for step, axis in enumerate(AXES)}
            found.append(Body(names[at], place=place, flags=dict(zip([at + 3], flags, strict=False))))
    return found


def deeplabcut(rows: list[list[str]]) -> Head | None:
    """Return what the three or four lines of DeepLabCut say; None if there are others."""
    titled = {row[0].lower(): row for row in rows if row[0].lower() in _DEEPLABCUT}
    if "bodyparts" not in titled or "coords" not in titled:
        return None
    parts, coords = titled["bodyparts"], titled["coords"]
    people = titled.get("individuals", [""] * len(parts))
    several = len(set(people[1:])) > 1
    names = [f"{person}:{part}" if several else part for person, part in zip(people, parts, strict=False)]
    return Head(_triples(names, coords), n_cells=len(coords), n_lines=len(titled))


def is_visual3d(rows: list[list[str]]) -> bool:
    """Whether lines are those of an ASCII export of Visual3D."""
    return len(rows) > 4 and rows[4][0].upper() == "ITEM"


def visual3d(rows: list[list[str]]) -> Head | None:
    """Targets and landmarks of an ASCII export of Visual3D: of the first trial, and of the first folder of a signal."""
    if not is_visual3d(rows):
        return None
    files, names, kinds, _, axes = rows[:5]
    found = Head([], n_cells=len(axes), n_lines=5)
    left_out = 0
    for body in _triples(names[: min(map(len, rows[:5]))], axes):
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
