"""Settings of the stereo capture in one XML file: cameras, noise, bodies, joints, source and detection.

The calibrations write it and ``skelgen motion-capture`` reads it. Lengths are in mm, pixels count from the centre of
the first one, matrices are written row by row; ``a_from_b`` turns coordinates of b into those of a. The left camera's
frame is the world unless its ``camera_from_world`` says otherwise::

    <capture version="1" unit="mm">
      <source>recording/</source>
      <rig noise="0.1">
        <left name="left" width="640" height="480">
          <matrix>...9 numbers...</matrix>
          <distortion>k1 k2 p1 p2 k3</distortion>
          <camera_from_world>...16 numbers...</camera_from_world>
        </left>
        <right ...>...</right>
        <covariance>...900 numbers, of the calibrated cameras; may be left out...</covariance>
      </rig>
      <detection><parameter name="..." value="..."/></detection>
      <search><parameter name="max_distance" value="5.0"/></search>
      <body name="upper"><point std="0.1 0.1 0.1">0 0 0</point>...</body>
      <joint name="elbow" kind="hinge" parent="upper" child="lower">
        <parent_from_joint>...16 numbers...</parent_from_joint>
        <child_from_joint>...16 numbers...</child_from_joint>
      </joint>
    </capture>

The cameras of a room, two to sixteen, are ``<camera name="...">`` elements in place of ``<left>`` and ``<right>``; each
may hold a ``<std>`` of 15 numbers: deviations of fx, fy, cx, cy, k1 k2 p1 p2 k3, its turn [rad] and its place.

Every name is checked: what is unknown, missing or twice there is refused with file, line and what is allowed.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from skelgen.errors import FormatError, InputError, ParameterError
from skelgen.model.arrays import Floats
from skelgen.model.rig import (
    N_CAMERA_STD,
    BodyTarget,
    Camera,
    CameraRig,
    CaptureSettings,
    ParameterValue,
    RoomSettings,
    StereoRig,
    TargetJoint,
)
from skelgen.parameters import Declaration, StageParameters
from skelgen_formats.xml_text import closest_first, read_root, write_lines

__all__ = [
    "read_any_settings",
    "read_settings",
    "write_settings",
]

ROOT = "capture"
VERSION = "1"
UNIT = "mm"
FILE_NAME = "settings.xml"
_LARGEST_FILE = 1 << 22
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

_LAYOUT: Mapping[str, Element] = {
    ROOT: Element(
        required=("version", "unit"),
        children={
            "source": _AT_MOST_ONE,
            "rig": _ONE,
            "detection": _AT_MOST_ONE,
            "search": _AT_MOST_ONE,
            "body": _ANY,
            "joint": _ANY,
        },
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

_OF_ROOM: Mapping[str, Element] = {
    **_LAYOUT,
    "rig": Element(required=("noise",), children={CAMERA: _ANY}),
    CAMERA: Element(("width", "height", "name"), (), {**_CAMERA.children, "std": _AT_MOST_ONE}),
    "std": Element(numbers=N_CAMERA_STD),
}
"""The same for the cameras of a room."""

_Layout = Mapping[str, Element]


_Value = TypeVar("_Value")


def read_settings(
    path: Path | str, detection: type[StageParameters] | None = None, search: type[StageParameters] | None = None
) -> CaptureSettings:
    """Read the settings of a stereo capture.

    Parameters
    ----------
    path : Path or str
        The file.
    detection, search : StageParameters class, optional
        What the detection of balls and the search for bodies declare; their parameters are then checked with their
        lines. Without it any name and value is taken.

    Returns
    -------
    CaptureSettings

    Raises
    ------
    FormatError
        If the file cannot be read, is no well-formed XML, holds an unknown name, lacks one that must be there, or a
        value is not what it must be; the sentence says file, line and what is allowed.
    """
    settings = read_any_settings(path, detection, search)
    if isinstance(settings, RoomSettings):
        raise FormatError(
            Path(path),
            "",
            f"holds {len(settings.rig.cameras)} cameras of a room; this needs a <left> and a <right> one",
        )
    return settings


def read_any_settings(
    path: Path | str, detection: type[StageParameters] | None = None, search: type[StageParameters] | None = None
) -> CaptureSettings | RoomSettings:
    """Read the settings of a capture by two cameras, or by those of a room; errors as of `read_settings`.

    Parameters
    ----------
    path, detection, search
        As of `read_settings`.
    """
    path = Path(path)
    root = read_root(path, ROOT, FILE_NAME, _LARGEST_FILE)
    is_room = root.find(f"rig/{CAMERA}") is not None
    _check_names(path, root, _OF_ROOM if is_room else _LAYOUT)
    for name, wanted in (("version", VERSION), ("unit", UNIT)):
        if root.get(name) != wanted:
            raise _error(path, root, f"{name} is {root.get(name)!r}; only {wanted!r} can be read")
    cameras = root.find("rig")
    noise = _number(path, cameras, "noise")
    elements = list(cameras.iterfind(CAMERA)) if is_room else [cameras.find(side) for side in (LEFT, RIGHT)]
    eyes = [_camera(path, element) for element in elements]
    bodies = [_body(path, element) for element in _distinct(path, root.iterfind("body"))]
    names = [body.name for body in bodies]
    joints = [_joint(path, element, names) for element in _distinct(path, root.iterfind("joint"))]
    source = (root.findtext("source") or "").strip()
    found = [_parameters(path, root, *of) for of in (("detection", detection), ("search", search))]
    if is_room:
        std = [_numbers(path, one) if one is not None else _EXACT for one in (eye.find("std") for eye in elements)]
        room = _built(path, cameras, lambda: CameraRig(eyes, noise, np.array(std)))
        return RoomSettings(room, bodies, joints, source, *found)
    spread = cameras.find("covariance")
    covariance = None if spread is None else _numbers(path, spread).reshape(2 * N_CAMERA_STD, -1)
    rig = _built(path, cameras, lambda: StereoRig(eyes[0], eyes[1], noise, covariance))
    return CaptureSettings(rig, bodies, joints, source, *found)


_EXACT = np.zeros(N_CAMERA_STD)


def _check_names(path: Path, element: Any, layout: _Layout) -> None:
    """Refuse attributes, elements and text that the layout does not know, and miss those that it demands."""
    known = layout[element.tag]
    allowed = (*known.required, *known.optional)
    for name in element.attrib:
        if name not in allowed:
            raise _error(path, element, f"<{element.tag}> has no attribute {name!r}; {_has(name, allowed)}")
    for name in known.required:
        if not element.get(name, "").strip():
            raise _error(path, element, f"<{element.tag}> lacks the attribute {name!r}; {_has(name, allowed)}")
    for child in element:
        if child.tag not in known.children:
            raise _error(path, child, f"<{child.tag}> is unknown in <{element.tag}>; {_holds(child.tag, known)}")
        _check_names(path, child, layout)
    _check_counts(path, element, known)


def _check_counts(path: Path, element: Any, known: Element) -> None:
    texts = [element.text, *(child.tail for child in element)]
    if known.children and any(text and text.strip() for text in texts):
        raise _error(path, element, f"<{element.tag}> holds text between its elements; {_holds('', known)}")
    for name, count in known.children.items():
        found = element.findall(name)
        if count == _ONE and not found:
            raise _error(path, element, f"<{element.tag}> lacks <{name}>; {_holds(name, known)}")
        if count != _ANY and len(found) > 1:
            line = found[0].sourceline
            raise _error(path, found[1], f"a second <{name}> in <{element.tag}>, the first is in line {line}; keep one")


def _camera(path: Path, element: Any) -> Camera:
    values = (_whole(path, element, "width"), _whole(path, element, "height"))
    matrix = _numbers(path, element.find("matrix")).reshape(3, 3)
    distortion = _numbers(path, element.find("distortion"))
    pose = _numbers(path, element.find("camera_from_world")).reshape(4, 4)
    return _built(path, element, lambda: Camera(*values, matrix, distortion, pose, element.get("name", "")))


def _body(path: Path, element: Any) -> BodyTarget:
    points = [_numbers(path, point) for point in element]
    std = [_attribute_numbers(path, point, "std", 3) for point in element]
    if not points:
        raise _error(path, element, f"body {element.get('name')!r} has no <point>; a body has some, 4 or more")
    noise = 0.0 if element.get("noise") is None else _number(path, element, "noise")
    return _built(path, element, lambda: BodyTarget(element.get("name"), np.array(points), np.array(std), noise))


def _joint(path: Path, element: Any, bodies: list[str]) -> TargetJoint:
    name, kind, parent, child = (element.get(key) for key in _LAYOUT["joint"].required)
    for role, body in (("parent", parent), ("child", child)):
        if body not in bodies:
            known = ", ".join(closest_first(body, bodies)) or "none"
            raise _error(path, element, f"the {role} of joint {name!r} is body {body!r}, which is not there: {known}")
    places = [element.find(tag) for tag in ("parent_from_joint", "child_from_joint")]
    poses = [_numbers(path, place).reshape(4, 4) for place in places]
    std = np.array([_attribute_numbers(path, place, "std", 3) for place in places])
    axis_std = np.array([_attribute_numbers(path, place, "axis_std", 1)[0] for place in places])
    return _built(path, element, lambda: TargetJoint(name, kind, parent, child, poses[0], poses[1], std, axis_std))


def _parameters(path: Path, root: Any, of: str, declared: type[StageParameters] | None) -> dict[str, ParameterValue]:
    element = root.find(of)
    if element is None:
        return {}
    known = None if declared is None else {entry.name: entry for entry in declared.declarations()}
    return {child.get("name"): _value_of(path, child, known) for child in _distinct(path, element.iterfind("*"))}


def _value_of(path: Path, element: Any, known: dict[str, Declaration] | None) -> ParameterValue:
    name, text = element.get("name"), element.get("value")
    if known is None:
        try:
            return float(text)
        except ValueError:
            return str(text)
    if name not in known:
        names = ", ".join(closest_first(name, list(known)))
        raise _error(path, element, f"the {element.getparent().tag} has no parameter {name!r}; it has {names}")
    try:
        value: ParameterValue = known[name].check(text)
    except ParameterError as error:
        raise _error(path, element, str(error)) from error
    return value


def _distinct(path: Path, elements: Iterable[Any]) -> list[Any]:
    """The elements, unless two bear one name."""
    seen: dict[str, Any] = {}
    for element in elements:
        name = element.get("name")
        if name in seen:
            line = seen[name].sourceline
            raise _error(path, element, f"a second {element.tag} is called {name!r}, the first is in line {line}")
        seen[name] = element
    return list(seen.values())


def _numbers(path: Path, element: Any) -> Floats:
    return _parsed(path, element, f"<{element.tag}>", element.text or "", _OF_ROOM[element.tag].numbers)


def _attribute_numbers(path: Path, element: Any, name: str, count: int) -> Floats:
    """Numbers of an attribute, not below 0; zeros where it is not given."""
    if element.get(name) is None:
        return np.zeros(count)
    values = _parsed(path, element, f"{name} of <{element.tag}>", element.get(name), count)
    if (values < 0).any():
        raise _error(path, element, f"{name} of <{element.tag}> is below 0; a standard deviation is 0 or more")
    return values


def _number(path: Path, element: Any, name: str) -> float:
    return float(_parsed(path, element, f"{name} of <{element.tag}>", element.get(name), 1)[0])


def _whole(path: Path, element: Any, name: str) -> int:
    value = _number(path, element, name)
    if value != int(value):
        raise _error(path, element, f"{name} of <{element.tag}> is {value:g}; a whole number belongs there")
    return int(value)


def _parsed(path: Path, element: Any, what: str, text: str, count: int) -> Floats:
    words = text.split()
    if len(words) != count:
        wanted = "a number belongs" if count == 1 else f"{count} numbers belong"
        raise _error(path, element, f"{what} holds {len(words)} where {wanted}")
    values = np.empty(count)
    for place, word in enumerate(words):
        try:
            values[place] = float(word)
        except ValueError as error:
            raise _error(path, element, f"{what} holds {word[:40]!r} where a number belongs") from error
        if not math.isfinite(values[place]):
            raise _error(path, element, f"{what} holds {word[:40]!r}; numbers must be finite")
    return values


def _built(path: Path, element: Any, build: Callable[[], _Value]) -> _Value:
    """Construct a value; what it refuses gets file and line."""
    try:
        return build()
    except InputError as error:
        raise _error(path, element, str(error)) from error


def _has(name: str, allowed: Iterable[str]) -> str:
    names = closest_first(name, list(allowed))
    return f"it has {', '.join(names)}" if names else "it has none"


def _holds(name: str, known: Element) -> str:
    names = [f"<{child}>" for child in closest_first(name, list(known.children))]
    return f"it holds {', '.join(names)}" if names else "it holds no elements"


def _error(path: Path, element: Any, what: str) -> FormatError:
    return FormatError(path, element.sourceline or "", what)


_COMMENT = (
    "lengths in mm, images in px, angles in rad; a_from_b turns coordinates of b into those of a; std as measured"
)


def write_settings(settings: CaptureSettings | RoomSettings, path: Path | str) -> None:
    """Write the settings of a capture; the file appears whole or not at all.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        What to write.
    path : Path or str
        The file.

    Raises
    ------
    WriteError
        If a name holds a character that XML forbids, or the file cannot be written.
    """
    write_lines(Path(path), [f'<{ROOT} version="{VERSION}" unit="{UNIT}">', *_inside(settings), f"</{ROOT}>"])


def _inside(settings: CaptureSettings | RoomSettings) -> Iterator[str]:
    yield f"  <!-- {_COMMENT} -->"
    if settings.source:
        yield f"  <source>{escape(settings.source)}</source>"
    yield f'  <rig noise="{float(settings.rig.noise)!r}">'
    if isinstance(settings, CaptureSettings):
        yield from _camera_lines(LEFT, settings.rig.left)
        yield from _camera_lines(RIGHT, settings.rig.right)
        if settings.rig.covariance is not None:
            yield from _matrix("    ", "covariance", "", settings.rig.covariance)
    else:
        for camera, std in zip(settings.rig.cameras, np.asarray(settings.rig.std), strict=True):
            yield from _camera_lines(CAMERA, camera, std)
    yield "  </rig>"
    for tag, parameters in (("detection", settings.detection), ("search", settings.search)):
        if parameters:
            yield f"  <{tag}>"
            for name, value in parameters.items():
                yield f"    <parameter name={quoteattr(name)} value={quoteattr(_parameter(value))}/>"
            yield f"  </{tag}>"
    for body in settings.bodies:
        noise = f' noise="{float(body.noise)!r}"' if body.noise else ""
        yield f"  <body name={quoteattr(body.name)}{noise}>"
        for point, std in zip(body.points, np.asarray(body.std), strict=True):
            yield f'    <point std="{_text(std)}">{_text(point)}</point>'
        yield "  </body>"
    for joint in settings.joints:
        ends = f"parent={quoteattr(joint.parent)} child={quoteattr(joint.child)}"
        yield f'  <joint name={quoteattr(joint.name)} kind="{joint.kind}" {ends}>'
        for side, tag in enumerate(("parent_from_joint", "child_from_joint")):
            std = f' std="{_text(joint.std[side])}" axis_std="{float(joint.axis_std[side])!r}"'
            yield from _matrix("    ", tag, std, getattr(joint, tag))
        yield "  </joint>"


def _parameter(value: ParameterValue) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return repr(float(value))  # NumPy's call themselves by their type
    return str(value)


def _camera_lines(side: str, camera: Camera, std: Floats | None = None) -> Iterator[str]:
    yield f'    <{side} name={quoteattr(camera.name)} width="{camera.width}" height="{camera.height}">'
    yield from _matrix("      ", "matrix", "", camera.matrix)
    yield f"      <distortion>{_text(camera.distortion)}</distortion>"
    yield from _matrix("      ", "camera_from_world", "", camera.camera_from_world)
    if std is not None and std.any():
        yield f"      <std>{_text(std)}</std>"
    yield f"    </{side}>"


def _matrix(indent: str, tag: str, attributes: str, matrix: Floats) -> Iterator[str]:
    yield f"{indent}<{tag}{attributes}>"
    for row in matrix:
        yield f"{indent}  {_text(row)}"
    yield f"{indent}</{tag}>"


def _text(numbers: Floats) -> str:
    return " ".join(repr(float(number)) for number in numbers)
