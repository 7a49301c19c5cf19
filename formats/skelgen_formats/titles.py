"""Titles of columns as scripts write them: whose coordinate along which axis, in which unit.

A title is a name and an axis, in any case and with a blank, a point, an underscore, a colon, a hyphen or nothing
between: ``knee_x``, ``kneeX``, ``knee (X)``, ``knee.position.x``, ``knee_tx``, ``knee_px``; or the axis first:
``x_knee``, ``X1``.
A unit of length may follow: ``knee_x_mm``, ``knee X [mm]``. The columns of a point may stand apart from each other.
MATLAB calls the columns of a matrix ``knee_1``, ``knee_2``, ``knee_3``, Python ``knee[0]`` and so on. Components of
unit quaternions are ``knee_qw``, ``knee.orientation.w``, ``knee_rot_w`` or ``qw_knee``; NDI calls them ``Q0``, ``Qx``,
``Qy``, ``Qz``. Angles of a body are ``knee_roll``, ``knee_pitch``, ``knee_yaw``, or ``knee_rx``, ``knee_rot_x``,
``knee_euler_x``; a unit may follow. Cells of a matrix are ``knee_r11``, ``knee_R[0][0]``, ``knee_rot_1_1``, or
numbered, ``knee_rot_0`` to ``knee_rot_8``. EuRoC names the frames: ``p_RS_R_x [m]``, ``q_RS_w []``.
"""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from skelgen_formats.body_columns import Body
from skelgen_formats.flags import FLAG_OF_ALL, FLAG_WORD, flag_of
from skelgen_formats.spelling import LENGTH, OF_VERSION, PLACE_WORD, spelt
from skelgen_formats.text import is_number, is_unseen
from skelgen_formats.turn_titles import (
    AXES,
    BETWEEN,
    angle_alone,
    angle_of,
    cell_of,
    component_alone,
    order_by_words,
    quaternion_of,
)

_UNIT = re.compile(rf"(.*?[xyz123][\])]?)(?: ?/ ?|[ _]in[ _]|[ _.,:-]{{0,2}}[\[(]?)({LENGTH})[\])]?", re.IGNORECASE)
_AXIS_LAST = re.compile(rf"(.{{1,200}}?){BETWEEN}{{0,2}}[\[(]?([xyz])[\])]?", re.IGNORECASE)
_TRANSLATED = re.compile(rf"(.{{1,200}}?){BETWEEN}[tp]([xyz])", re.IGNORECASE)
_AXIS_FIRST = re.compile(rf"([xyz]){BETWEEN}?(.{{1,200}}?)(?: ?/ ?(mm|cm|m)| ?[\[(](mm|cm|m)[\])])?", re.IGNORECASE)
_AXIS_AND_NUMBER = re.compile(rf"(?:(.{{1,200}}?){BETWEEN})??([xyz])_?(\d{{1,4}})", re.IGNORECASE)
_NUMBERED = re.compile(r"(.{1,200}?)(?:[_ .](?:dim|axis|coord|xyz|pos)?([0-4])|\[([0-3])\]|\(([1-4])\))")
_MANY = re.compile(r"(.{1,200}?)(?:[_ .]|(?=[\[(]))[\[(]?(\d{1,3})[\])]?")
_FOURTH = re.compile(rf"(.{{1,200}}?)(?:{BETWEEN}|(?=[\[(]))[\[(]?([w34])[\])]?", re.IGNORECASE)
_ALONE = re.compile(rf"(?:{PLACE_WORD})?([xyz])", re.IGNORECASE)
_TRANSLATED_ALONE = re.compile(r"[tp]([xyz])", re.IGNORECASE)
_NAMED_PLACE = re.compile(rf"(.{{1,200}}?)(?:{BETWEEN}(?i:{PLACE_WORD})|(?:Pos|Positions?|Translation){BETWEEN}?)")
UNIT_WORDS = {"unit", "units"}
"""Keys of what is no number but the unit of others."""

_FLAG = re.compile(rf"(?P<name>.{{1,200}}?){BETWEEN}(?P<word>{FLAG_WORD})", re.IGNORECASE)
_FLAG_FIRST = re.compile(
    rf"(?P<word>{FLAG_WORD})(?:{BETWEEN}(?P<name>.{{1,200}})|(?P<number>\d{{1,4}}))", re.IGNORECASE
)
_NAMED_ONLY = re.compile(r"(?:is_?)?tracking_?(?:valid|state)|cond|status|state|residuals?", re.IGNORECASE)
"""Flags that are not those of the point before them if they have another name."""

_IS_ANGLE = re.compile(r".*(?:euler|rotvec|rot|rotation|ori|orientation)[ _.:-]?[xyz]", re.IGNORECASE)
_BRACKETED = re.compile(r"^[\[(]([^\[\]()]+)[\])]$")
_SENSED = re.compile(r"[agmwfv][xyz]", re.IGNORECASE)  # of inertial sensors and force plates: ax, gy, Fz
_BESIDE = re.compile(rf"(.{{1,200}}?){BETWEEN}[vaws][xyz]", re.IGNORECASE)  # velocities and the like of a point
_DERIVED = re.compile(rf"(.{{1,200}}?{BETWEEN})[vaw]", re.IGNORECASE)  # knee-V beside knee-X
_PLATE = re.compile(rf"(.{{1,200}}?){BETWEEN}([FM])[xyzXYZ]")  # force and moment of a plate
_FEWEST = 2  # points of a table whose columns are numbered
_ANGLES = re.compile(rf"(?:(.*){BETWEEN})?r", re.IGNORECASE)  # Rx, Ry, Rz, knee_rx
_TRANSLATIONS = ("t", "p")  # Tx, Ty, Tz beside a quaternion without a name


def bodies_of(titles: Sequence[str]) -> list[Body]:
    """Return points and bodies with three coordinates, in the order of their titles.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    """
    titles = undoubled(spelt(titles))
    found = {parsed: _joined(_gathered(titles, parsed)) for parsed in (_axis_last, _axis_first, _axis_and_number)}
    best = max(found, key=lambda parsed: len(found[parsed]))
    if best is _axis_and_number:
        _drop_numbers(found[best])
    if found[best]:
        return _with_fourths(found[best], titles, "w")
    numbers = [match[2] or match[3] for title in titles if (match := _NUMBERED.fullmatch(title.strip()))]
    first = 0 if "0" in numbers else 1
    bodies = _joined(_gathered(titles, partial(_numbered, first=first)))
    longer = {match[1] for match in map(_MANY.fullmatch, titles) if match and int(match[2]) > first + len(AXES)}
    bodies = [body for body in bodies if body.name not in longer]
    return _with_fourths(bodies, titles, str(first + len(AXES))) if len(bodies) >= _FEWEST else []


def with_axes(titles: Sequence[str]) -> list[str]:
    """Return titles with axes for names that stand over three columns, or over the first of them; empty if none do.

    Parameters
    ----------
    titles : sequence of str
        Without quotes; pandas calls the second and third column ``knee.1`` and ``knee.2``.
    """
    found, at, n_points = [*titles, "", ""], 0, 0
    while at < len(titles):
        name, *others = found[at : at + 3]
        is_blank = is_number(name) or is_unseen(name.strip(",;[]")) or not any(map(str.isalpha, name))
        if name and others in (["", ""], [name] * 2, [f"{name}.1", f"{name}.2"]) and not is_blank:
            found[at : at + 3] = [f"{name}_{axis}" for axis in AXES]
            at, n_points = at + 2, n_points + 1
        at += 1
    return found[: max(at, len(titles))] if n_points >= _FEWEST else []


def undoubled(titles: Sequence[str]) -> list[str]:
    """Return titles with numbers before those without a name that stand several times: ``0 X``, ``1 X``.

    Parameters
    ----------
    titles : sequence of str
        Without quotes; pandas numbers all but the first, ``X``, ``X.1``.
    """
    every, count, numbered = Counter(titles), Counter[str](), []
    doubled = {title for title, n in every.items() if n > 1 or f"{title}.1" in every}
    if not any(map(axis_alone, doubled)):
        return [*titles]
    for title in titles:
        base, _, number = title.rpartition(".")
        plain = base if number.isdecimal() and base in doubled else title
        is_nameless = axis_alone(plain) or component_alone(plain) or angle_alone(plain)
        numbered.append(f"{count[plain]} {plain}" if is_nameless and plain in doubled else title)
        count[plain] += 1
    return numbered


def _drop_numbers(bodies: Sequence[Body]) -> None:
    """Take the numbers off names that differ without them, too: columns of TRC are knee_X1, toe_X2."""
    plain = [body.name.rpartition(" ")[0] for body in bodies]
    if len(set(plain)) == len(plain):
        for body, name in zip(bodies, plain, strict=True):
            body.name = name


def _with_fourths(bodies: list[Body], titles: Sequence[str], word: str) -> list[Body]:
    """Return the same bodies with their fourth columns, ``knee.w`` beside ``knee.x``, or ``knee_4``, and flags."""
    found = [_FOURTH.fullmatch(title.strip()) for title in titles]
    fourths = {match[1]: column for column, match in enumerate(found) if match and match[2].lower() == word}
    last = {at: match for at, title in enumerate(titles) if (match := _FLAG.fullmatch(title.strip()))}
    first = {at: match for at, title in enumerate(titles) if (match := _FLAG_FIRST.fullmatch(title.strip()))}
    names = {at: (match["name"] or match["number"]).lower() for at, match in first.items()}
    names |= {at: match["name"].lower() for at, match in last.items()}
    flags = {at: flag for at, match in (first | last).items() if (flag := flag_of(match["word"]))}
    nearby = {at for at, match in last.items() if not _NAMED_ONLY.fullmatch(match["word"])}
    alone = {at: flag_of(title) for at, title in enumerate(titles) if re.fullmatch(FLAG_OF_ALL, title, re.IGNORECASE)}
    of_all = {at: flag for at, flag in alone.items() if flag and len(alone) == 1}
    for body in bodies:
        body.fourth = None if body.is_turned else fourths.get(body.name)
        behind = max(body.place.values()) + 1
        own = {at for at, name in names.items() if name == body.name.lower()} or {behind} & nearby
        body.flags = of_all | {at: flags[at] for at in sorted(own)}
    return bodies


def turned_without_place(titles: Sequence[str]) -> list[str]:
    """Return names of bodies that have a quaternion or three angles, and no coordinate.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    """
    turned = [body for body in _gathered(titles, _axis_last) if (body.is_turned or body.has_angles) and not body.place]
    return [body.name or "body" for body in turned if body.name or not nameless_body(titles).is_placed]


def not_taken(titles: Sequence[str], bodies: Sequence[Body]) -> list[str]:
    """Return sentences on columns of places and rotations that belong to none of the bodies found.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    bodies : sequence of Body
        From `bodies_of`.
    """
    taken = {column for body in bodies for column in body.every_column}
    second = [title for title in spelt(titles) if OF_VERSION.fullmatch(title)]
    titles = undoubled(spelt(titles))
    every = [body for parsed in (_axis_last, _axis_first, _axis_and_number) for body in _gathered(titles, parsed)]
    others = [body for body in every if body.name and not body.every_column & taken]
    turned = [body.name for body in others if not body.place and (body.is_turned or body.has_angles)]
    placed = [body.name for body in others if body.is_placed]
    kinds = (
        ("rotations without positions", turned),
        ("points whose titles are of another form", placed),
        ("second versions of coordinates", second),
    )
    return [f"{kind} are left out: {', '.join([*dict.fromkeys(names)][:8])}" for kind, names in kinds if names]


def axis_alone(title: str) -> tuple[str, str] | None:
    """Return axis and unit of a title without a name, such as ``x``, ``pos_x`` or ``X (mm)``; None of any other.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    text, unit = _without_unit(title)
    match = _ALONE.fullmatch(text)
    return (match[1].lower(), unit) if match else None


def nameless_body(titles: Sequence[str]) -> Body:
    """Return the columns of a body whose titles have no name, ``x`` or ``tx``, ``qw``, ``roll``, ``r11``.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    """
    body = Body("")
    for column, title in enumerate(titles):
        if angle := angle_alone(title):
            body.angles.setdefault(angle[0], column)
            body.stated_order, body.angle_unit = body.stated_order or angle[1], body.angle_unit or angle[2]
        if (cell := cell_of(title)) and not cell[0]:
            body.matrix.setdefault(cell[1], column)
        text, unit = _without_unit(title)
        if component := component_alone(title):
            body.turn.setdefault(component, column)
        elif place := _ALONE.fullmatch(text) or _TRANSLATED_ALONE.fullmatch(text):
            body.place.setdefault(place[1].lower(), column)
            body.unit = body.unit or unit
    return body


_Parsed = Callable[[str], tuple[str, str, str] | None]  # name, axis and unit of a title


def _gathered(titles: Sequence[str], parsed: _Parsed) -> list[Body]:
    """Return what has columns; where an axis of a name stands again, another one of this name begins."""
    bodies: list[Body] = []
    latest: dict[str, Body] = {}
    for column, title in enumerate(titles):
        what, (name, key, unit) = _column_of(title, parsed)
        name = _BRACKETED.sub(r"\1", name.strip(" =;,~\\'\""))
        if not what:
            continue
        body = latest.get(name.lower())
        if body is None or key in getattr(body, what):
            body = latest[name.lower()] = Body(name)
            bodies.append(body)
        getattr(body, what)[key] = column
        body.name = body.name or name
        if what == "place":
            body.unit = body.unit or unit
        elif what == "angles":
            body.angle_unit, body.stated_order = body.angle_unit or unit, order_by_words(title)
    beside = _beside_points(bodies, titles)
    bodies = [body for body in bodies if body not in beside]
    for body in bodies:
        if not body.place and body.cells:  # of four rows and columns, the last of which is the place
            first = 0 if "00" in body.matrix else 1
            columns = [body.matrix.get(f"{first + row}{first + 3}") for row in range(3)]
            body.place = {axis: column for axis, column in zip(AXES, columns, strict=True) if column is not None}
        if body.turn.keys() == {*AXES} and _IS_ANGLE.fullmatch(titles[body.turn["x"]]):
            body.angles, body.turn = body.turn, {}
    return bodies


def _beside_points(bodies: Sequence[Body], titles: Sequence[str]) -> list[Body]:
    """Return velocities and the like of other bodies, ``knee_vx`` beside ``knee_x``, and force plates."""
    placed = [body for body in bodies if body.is_placed]
    names = {body.name.lower() for body in placed}
    rates = [(body, _BESIDE.fullmatch(titles[body.place["x"]].strip())) for body in placed]
    plates = [(body, match) for body in placed if (match := _PLATE.fullmatch(titles[body.place["x"]].strip()))]
    kinds = {(match[1], match[2]) for _, match in plates}
    beside = [body for body, match in rates if match and match[1].lower() in names]
    derived = [(body, _DERIVED.fullmatch(body.name.lower())) for body in placed]
    beside += [body for body, match in derived if match and match[1] + "x" in names]
    return beside + [body for body, match in plates if {(match[1], "F"), (match[1], "M")} <= kinds]


def _column_of(title: str, parsed: _Parsed) -> tuple[str, tuple[str, str, str]]:
    """Return to which part of a body a column belongs, if to any, and its name, key and unit."""
    if angle := angle_of(title):
        return "angles", angle
    if turn := quaternion_of(title):
        return "turn", (*turn, "")
    if place := parsed(title):
        return "place", place
    cell = cell_of(title)
    return ("matrix", (*cell, "")) if cell else ("", ("", "", ""))


def _joined(bodies: list[Body]) -> list[Body]:
    """Return places, all with a name, without those that are angles of another one, such as ``Rx`` beside ``Tx``.

    A quaternion without a name belongs to the next place behind it that has none but T or P.
    """
    for body in bodies:
        if not body.name and body.is_turned and not body.place:
            first = min([*body.turn.values(), *body.matrix.values()])
            behind = [one for one in bodies if one.is_placed and min(one.place.values()) > first]
            near = [one for one in [*behind, *bodies] if one.is_placed and not one.turn and not one.matrix]
            other = next((one for one in near if one.name.lower() in _TRANSLATIONS), body)
            other.turn, other.matrix, other.name = body.turn, body.matrix, ""
    places = _with_angles(bodies)
    for body in bodies:
        body.name = body.name or "body"
    return places


def _with_angles(bodies: list[Body]) -> list[Body]:
    """Return places with the angles that stand in columns of other names: `R` beside `T`, or `knee_r` beside `knee`."""
    placed = {body.name: body for body in bodies if body.is_placed}
    angles = [body for body in bodies if _are_angles(body, placed)]
    places = [body for body in bodies if body.is_placed and body not in angles]
    for body in angles:
        match = _ANGLES.fullmatch(body.name)
        name = (match[1] or "") if match else ""
        columns = body.angles or body.place
        free = [one for one in places if one.name.lower() in _TRANSLATIONS and not one.angles]
        nearest = min(free, key=partial(_columns_between, columns), default=None)
        other = placed[name] if name else nearest
        if other is not None:
            other.angles, other.stated_order = columns, body.stated_order
            other.angle_unit, other.name = body.angle_unit, name
    return places


def _columns_between(angles: Mapping[str, int], place: Body) -> int:
    """Return how far the columns of a place are from those of angles."""
    return min(abs(column - angle) for column in place.place.values() for angle in angles.values())


def _are_angles(body: Body, places: Mapping[str, Body]) -> bool:
    """Whether a body is nothing but angles of another: without a name, or x, y and z of R alone or of another's R."""
    match = _ANGLES.fullmatch(body.name) if body.is_placed else None
    return (match is not None and (not match[1] or match[1] in places)) or (
        not body.name and not body.place and body.has_angles
    )


def _without_unit(title: str) -> tuple[str, str]:
    match = _UNIT.fullmatch(title.strip())
    return (match[1], match[2].lower()) if match else (title.strip(), "")


def _axis_last(title: str) -> tuple[str, str, str] | None:
    text, unit = _without_unit(title)
    if (alone := _ALONE.fullmatch(text)) and len(text) > 1:
        return "", alone[1].lower(), unit
    match = _TRANSLATED.fullmatch(text) or _AXIS_LAST.fullmatch(text)
    if match is None or _SENSED.fullmatch(text):
        return None
    named = _NAMED_PLACE.fullmatch(match[1])
    return (named or match)[1], match[2].lower(), unit


def _axis_first(title: str) -> tuple[str, str, str] | None:
    match = _AXIS_FIRST.fullmatch(title.strip())
    return (match[2], match[1].lower(), (match[3] or match[4] or "").lower()) if match else None


def _axis_and_number(title: str) -> tuple[str, str, str] | None:
    match = _AXIS_AND_NUMBER.fullmatch(title.strip())
    return (f"{match[1] or ''} {match[3]}".strip(), match[2].lower(), "") if match else None


def _numbered(title: str, first: int) -> tuple[str, str, str] | None:
    text, unit = _without_unit(title)
    match = _NUMBERED.fullmatch(text)
    place = int(match[2] or match[3] or match[4]) - first if match else -1
    return (match[1], AXES[place], unit) if match and 0 <= place < len(AXES) else None
