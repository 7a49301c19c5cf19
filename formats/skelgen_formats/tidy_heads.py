"""The line of titles of a tidy table: which column holds frames, times, names, groups and coordinates.

Coordinates are in three columns, or in one, with another that says along which axis they are.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from skelgen_formats.clock_titles import Clock, clock_of, is_frame
from skelgen_formats.table_heads import CAMEL
from skelgen_formats.text import is_number, unquoted
from skelgen_formats.titles import axis_alone, bodies_of, spelt, translation_alone
from skelgen_formats.turn_titles import AXES, angle_alone, cell_alone, component_alone

_THINGS = (
    *(
        "keypoint",
        "marker",
        "bodypart",
        "body_part",
        "landmark",
        "joint",
        "point",
        "name",
        "label",
        "body",
        "rigid_body",
    ),
    *("rigidbody", "object", "segment", "sensor", "station", "tool", "device", "tracker", "asset", "limb", "bone"),
    *("link", "rb", "tag", "agent", "part", "actor", "entity"),
)
_NAMES = (
    *(f"{thing}{end}" for thing in _THINGS for end in ("_name", "_label", "")),
    *(f"{thing}{end}" for end in ("_id", "_index", "id") for thing in _THINGS),
    *("id", "target", "track_id", "child_frame_id", "child", "variable", "key"),
)
_GROUPS = (
    *("model", "individual", "person", "subject", "subject_name", "track", "person_id", "skeleton_id", "subject_id"),
    *("user_id", "actor_id", "body_id", "id"),
)
_SIDES = ("handedness", "hand", "hand_index", "hand_id", "side", "type", "pose_index")
"""What parts points of one name where a frame has several."""

_FLAGS = tuple(
    f"{start}{word}" for start in ("", "is_", "tracking_") for word in ("valid", "visible", "tracked", "measured")
)
_HIDDEN = tuple(f"{start}{word}" for start in ("", "is_") for word in ("occluded", "hidden", "missing", "lost"))
_DELIMITERS = (",", ";", "\t", "|", None)
_COMMENTS = ("#", "%")
_AXIS_WORDS = ("axis", "coord", "coords", "coordinate", "dimension", "dim", "component")
_VALUE = re.compile(r"(?:value|position|pos|coordinate)s?(?:[ _]?[\[(]?(mm|cm|m)[\])]?)?", re.IGNORECASE)
AXIS_IN_NAME = re.compile(r"(?:[_ .:-][xyzXYZ]|(?<=[a-z0-9])[XYZ])$")
"""Where names of points end with the axis of a value."""

_FRAME_OF_ROS = "frame_id"  # a name, not a number


@dataclass
class TidyHead:
    """The line of titles: its index, what parts cells (None: blanks), titles, which column is what, times, and unit."""

    first: int
    delimiter: str | None
    titles: list[str]
    at: dict[str, int]
    clock: Clock | None
    unit: str


def find_tidy_head(lines: Sequence[str]) -> TidyHead | None:
    """Return what the line of titles says, which comments may precede; None if there is none.

    Parameters
    ----------
    lines : sequence of str
        Of the file.
    """
    for index, line in enumerate(lines):
        for delimiter in (one for one in _DELIMITERS if one or not any(filter(None, map(line.count, ",;\t")))):
            cells = unquoted(line.lstrip("#% "), delimiter).split(delimiter)
            titles = spelt([cell.strip().strip('"') for cell in cells])
            following = unquoted(lines[index + 1], delimiter).split(delimiter) if index + 1 < len(lines) else []
            clock = clock_of(titles)
            if at := _columns(titles, [cell.strip() for cell in following], clock):
                return TidyHead(index, delimiter, titles, at, clock, _unit_of(titles, at))
        if line.strip() and not line.startswith(_COMMENTS):
            break
    return None


def _unit_of(titles: Sequence[str], at: dict[str, int]) -> str:
    match = _VALUE.fullmatch(titles[at["value"]]) if "value" in at else None
    alone = axis_alone(titles[at["x"]]) if "x" in at else None
    named = [body.unit for body in bodies_of(titles)] if "x" in at and not alone else []
    return (match[1] or "").lower() if match else alone[1] if alone else "".join(named[:1])


def _columns(titles: Sequence[str], row: Sequence[str], clock: Clock | None) -> dict[str, int]:
    """Return the columns of frames, times, names, groups and coordinates; empty if one that is needed is missing."""
    plain = [CAMEL.sub("_", title).lower().replace(" ", "_") for title in titles]
    known = {"name": _NAMES, "group": _GROUPS, "side": _SIDES, "flag": _FLAGS, "hidden": _HIDDEN, "axis": _AXIS_WORDS}
    found = {what: [plain.index(title) for title in words if title in plain] for what, words in known.items()}
    found["value"] = [at for at, title in enumerate(titles) if _VALUE.fullmatch(title) and [at] != found["axis"][:1]]
    found["time"] = [max(clock.column, clock.fraction or 0)] if clock else []
    found["frame"] = [at for at, title in enumerate(titles) if is_frame(title)]
    if clock and _FRAME_OF_ROS in plain and not all(map(is_number, row[(at := plain.index(_FRAME_OF_ROS)) :][:1])):
        found["frame"].remove(at)
        found["name"].append(at)
    for at, title in enumerate(titles):
        if angle := angle_alone(title):
            found.setdefault(f"r{angle[0]}", []).append(at)
        if cell := cell_alone(title):
            found.setdefault(f"m{cell}", []).append(at)
        if component := component_alone(title):
            found.setdefault(f"q{component}", []).append(at)
        elif axis := axis_alone(title):
            found.setdefault(axis[0], []).append(at)
        elif letter := translation_alone(title):
            found.setdefault(letter, []).append(at)
    places = {what: columns[0] for what, columns in found.items() if columns}
    if {"name", "value"} <= places.keys() and AXIS_IN_NAME.search("".join(row[places["name"] :][:1])):
        places.setdefault("axis", places["name"])  # knee_x, as pandas melts tables
    if "name" in places and {"axis", "value"} <= places.keys() and not places.keys() & {*AXES}:
        return {what: at for what, at in places.items() if what != "side"} if clock or "frame" in places else {}
    if "name" in places and (clock or "frame" in places) and not places.keys() & {*AXES}:
        bodies = bodies_of(titles)  # one alone, whose name every row has: pos3d_x
        places |= bodies[0].place if len(bodies) == 1 else {}
    is_tidy = places.keys() >= {*AXES} and ("name" in places or not bodies_of(titles))
    is_tidy = is_tidy and titles.count(titles[places["x"]]) == 1
    return places if is_tidy and (clock or "frame" in places) else {}
