"""What a settings file of the stereo capture may hold: one table, which reader, writer and errors share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

ROOT = "capture"
VERSION = "1"
UNIT = "mm"
FILE_NAME = "settings.xml"
LARGEST_FILE = 1 << 22
"""Bytes; a hundred bodies of ten points take 100 kB."""

LEFT, RIGHT = "left", "right"

ONE = "exactly one"
AT_MOST_ONE = "at most one"
ANY = "any number"


@dataclass(frozen=True)
class Element:
    """What an element may hold.

    Attributes
    ----------
    required, optional : tuple of str
        Names of attributes.
    children : mapping of str to str
        Names of elements, and how many of them: `ONE`, `AT_MOST_ONE` or `ANY`.
    numbers : int
        Numbers that its text holds; 0 for elements whose text is not of numbers.
    """

    required: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    children: Mapping[str, str] = field(default_factory=dict)
    numbers: int = 0


_CAMERA = Element(
    required=("width", "height"),
    optional=("name",),
    children={"matrix": ONE, "distortion": ONE, "camera_from_world": ONE},
)
_POSE = Element(numbers=16)
_PLACED = Element(optional=("std", "axis_std"), numbers=16)

LAYOUT: Mapping[str, Element] = {
    ROOT: Element(
        required=("version", "unit"),
        children={"source": AT_MOST_ONE, "rig": ONE, "detection": AT_MOST_ONE, "body": ANY, "joint": ANY},
    ),
    "source": Element(),
    "rig": Element(required=("noise",), children={LEFT: ONE, RIGHT: ONE}),
    LEFT: _CAMERA,
    RIGHT: _CAMERA,
    "matrix": Element(numbers=9),
    "distortion": Element(numbers=5),
    "camera_from_world": _POSE,
    "detection": Element(children={"parameter": ANY}),
    "parameter": Element(required=("name", "value")),
    "body": Element(required=("name",), children={"point": ANY}),
    "point": Element(optional=("std",), numbers=3),
    "joint": Element(
        required=("name", "kind", "parent", "child"), children={"parent_from_joint": ONE, "child_from_joint": ONE}
    ),
    "parent_from_joint": _PLACED,
    "child_from_joint": _PLACED,
}
"""Every element by its name."""
