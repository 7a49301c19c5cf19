"""What the elements of a capture's settings may hold, and their numbers: each mistake is one sentence with its line."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from skelgen.errors import FormatError, InputError
from skelgen.model.arrays import Floats
from skelgen.model.rig import N_CAMERA_STD
from skelgen_formats.xml_text import closest_first

ROOT = "capture"
VERSION = "1"
UNIT = "mm"
FILE_NAME = "settings.xml"
LARGEST_FILE = 1 << 22
"""Bytes; a hundred bodies of ten points take 100 kB."""

LEFT, RIGHT, CAMERA = "left", "right", "camera"

_ONE = "exactly one"
_AT_MOST_ONE = "at most one"
_ANY = "any number"


@dataclass(frozen=True)
class Element:
    """What an element may hold.

    Attributes
    ----------
    required, optional : tuple of str
        Names of attributes.
    children : mapping of str to str
        Names of elements, and how many of them: `_ONE`, `_AT_MOST_ONE` or `_ANY`.
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
    children={"matrix": _ONE, "distortion": _ONE, "camera_from_world": _ONE},
)
_POSE = Element(numbers=16)
_PLACED = Element(optional=("std", "axis_std"), numbers=16)

OF_PAIR: Mapping[str, Element] = {
    ROOT: Element(
        required=("version", "unit"),
        children={"rig": _ONE}
        | dict.fromkeys(("source", "detection", "search"), _AT_MOST_ONE)
        | dict.fromkeys(("body", "joint"), _ANY),
    ),
    "source": Element(),
    "rig": Element(required=("noise",), children={LEFT: _ONE, RIGHT: _ONE, "covariance": _AT_MOST_ONE}),
    LEFT: _CAMERA,
    RIGHT: _CAMERA,
    "matrix": Element(numbers=9),
    "distortion": Element(numbers=5),
    "camera_from_world": _POSE,
    "covariance": Element(numbers=(2 * N_CAMERA_STD) ** 2),
    "detection": Element(children={"parameter": _ANY}),
    "search": Element(children={"parameter": _ANY}),
    "parameter": Element(required=("name", "value")),
    "body": Element(required=("name",), optional=("noise",), children={"point": _ANY}),
    "point": Element(optional=("std",), numbers=3),
    "joint": Element(
        required=("name", "kind", "parent", "child"), children={"parent_from_joint": _ONE, "child_from_joint": _ONE}
    ),
    "parent_from_joint": _PLACED,
    "child_from_joint": _PLACED,
}
"""Every element by its name."""

OF_ROOM: Mapping[str, Element] = {
    **OF_PAIR,
    "rig": Element(required=("noise",), children={CAMERA: _ANY}),
    CAMERA: Element(("width", "height", "name"), (), {**_CAMERA.children, "std": _AT_MOST_ONE}),
    "std": Element(numbers=N_CAMERA_STD),
}
"""The same for the cameras of a room."""

Layout = Mapping[str, Element]
"""What all elements of a file may hold."""

_Value = TypeVar("_Value")


def check_element(path: Path, element: Any, layout: Layout) -> None:
    """Refuse attributes, elements and text that the layout does not know, and miss those that it demands.

    Parameters
    ----------
    path : Path
        The file.
    element : Element
        Of its tree.
    layout : mapping of str to Element
        What may be there.
    """
    known = layout[element.tag]
    allowed = (*known.required, *known.optional)
    for name in element.attrib:
        if name not in allowed:
            raise error_at(path, element, f"<{element.tag}> has no attribute {name!r}; {_has(name, allowed)}")
    for name in known.required:
        if not element.get(name, "").strip():
            raise error_at(path, element, f"<{element.tag}> lacks the attribute {name!r}; {_has(name, allowed)}")
    for child in element:
        if child.tag not in known.children:
            raise error_at(path, child, f"<{child.tag}> is unknown in <{element.tag}>; {_holds(child.tag, known)}")
        check_element(path, child, layout)
    _check_counts(path, element, known)


def _check_counts(path: Path, element: Any, known: Element) -> None:
    texts = [element.text, *(child.tail for child in element)]
    if known.children and any(text and text.strip() for text in texts):
        raise error_at(path, element, f"<{element.tag}> holds text between its elements; {_holds('', known)}")
    for name, count in known.children.items():
        found = element.findall(name)
        if count == _ONE and not found:
            raise error_at(path, element, f"<{element.tag}> lacks <{name}>; {_holds(name, known)}")
        if count != _ANY and len(found) > 1:
            line = found[0].sourceline
            what = f"a second <{name}> in <{element.tag}>, the first is in line {line}; keep one"
            raise error_at(path, found[1], what)


def distinct(path: Path, elements: Iterable[Any]) -> list[Any]:
    """Return the elements, unless two bear one name.

    Parameters
    ----------
    path : Path
        The file.
    elements : iterable of Element
        Those that bear names.
    """
    seen: dict[str, Any] = {}
    for element in elements:
        name = element.get("name")
        if name in seen:
            line = seen[name].sourceline
            raise error_at(path, element, f"a second {element.tag} is called {name!r}, the first is in line {line}")
        seen[name] = element
    return list(seen.values())


def numbers_of(path: Path, element: Any) -> Floats:
    """Return the numbers that an element holds.

    Parameters
    ----------
    path : Path
        The file.
    element : Element
        Of its tree.
    """
    return _parsed(path, element, f"<{element.tag}>", element.text or "", OF_ROOM[element.tag].numbers)


def numbers_of_attribute(path: Path, element: Any, name: str, count: int) -> Floats:
    """Return numbers of an attribute, not below 0; zeros where it is not given.

    Parameters
    ----------
    path : Path
        The file.
    element : Element
        Of its tree.
    name : str
        Of the attribute.
    count : int
        How many belong there.
    """
    if element.get(name) is None:
        return np.zeros(count)
    values = _parsed(path, element, f"{name} of <{element.tag}>", element.get(name), count)
    if (values < 0).any():
        raise error_at(path, element, f"{name} of <{element.tag}> is below 0; a standard deviation is 0 or more")
    return values


def number_of(path: Path, element: Any, name: str) -> float:
    """Return the number that an attribute holds.

    Parameters
    ----------
    path : Path
        The file.
    element : Element
        Of its tree.
    name : str
        Of the attribute.
    """
    return float(_parsed(path, element, f"{name} of <{element.tag}>", element.get(name), 1)[0])


def whole_of(path: Path, element: Any, name: str) -> int:
    """Return the whole number that an attribute holds.

    Parameters
    ----------
    path : Path
        The file.
    element : Element
        Of its tree.
    name : str
        Of the attribute.
    """
    value = number_of(path, element, name)
    if value != int(value):
        raise error_at(path, element, f"{name} of <{element.tag}> is {value:g}; a whole number belongs there")
    return int(value)


def _parsed(path: Path, element: Any, what: str, text: str, count: int) -> Floats:
    words = text.split()
    if len(words) != count:
        wanted = "a number belongs" if count == 1 else f"{count} numbers belong"
        raise error_at(path, element, f"{what} holds {len(words)} where {wanted}")
    values = np.empty(count)
    for place, word in enumerate(words):
        try:
            values[place] = float(word)
        except ValueError as error:
            raise error_at(path, element, f"{what} holds {word[:40]!r} where a number belongs") from error
        if not math.isfinite(values[place]):
            raise error_at(path, element, f"{what} holds {word[:40]!r}; numbers must be finite")
    return values


def built(path: Path, element: Any, build: Callable[[], _Value]) -> _Value:
    """Construct a value; what it refuses gets file and line.

    Parameters
    ----------
    path : Path
        The file.
    element : Element
        Of its tree.
    build : callable
        Constructs it.
    """
    try:
        return build()
    except InputError as error:
        raise error_at(path, element, str(error)) from error


def _has(name: str, allowed: Iterable[str]) -> str:
    names = closest_first(name, list(allowed))
    return f"it has {', '.join(names)}" if names else "it has none"


def _holds(name: str, known: Element) -> str:
    names = [f"<{child}>" for child in closest_first(name, list(known.children))]
    return f"it holds {', '.join(names)}" if names else "it holds no elements"


def error_at(path: Path, element: Any, what: str) -> FormatError:
    """Return an error with file and line.

    Parameters
    ----------
    path : Path
        The file.
    element : Element
        Of its tree.
    what : str
        What is wrong.
    """
    return FormatError(path, element.sourceline or "", what)
