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

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import FormatError, ParameterError
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
from skelgen_formats.capture_elements import (
    CAMERA,
    FILE_NAME,
    LARGEST_FILE,
    LEFT,
    OF_PAIR,
    OF_ROOM,
    RIGHT,
    ROOT,
    UNIT,
    VERSION,
    built,
    check_element,
    distinct,
    error_at,
    number_of,
    numbers_of,
    numbers_of_attribute,
    whole_of,
)
from skelgen_formats.xml_text import closest_first, number_text, quoted, read_root, write_lines

__all__ = ["read_any_settings", "read_settings", "write_settings"]


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
        what = f"holds {len(settings.rig.cameras)} cameras of a room; this needs a <left> and a <right> one"
        raise FormatError(Path(path), "", what)
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
    root = read_root(path, ROOT, FILE_NAME, LARGEST_FILE)
    is_room = root.find(f"rig/{CAMERA}") is not None
    check_element(path, root, OF_ROOM if is_room else OF_PAIR)
    for name, wanted in (("version", VERSION), ("unit", UNIT)):
        if root.get(name) != wanted:
            raise error_at(path, root, f"{name} is {root.get(name)!r}; only {wanted!r} can be read")
    rig_element = root.find("rig")
    noise = number_of(path, rig_element, "noise")
    elements = list(rig_element.iterfind(CAMERA)) if is_room else [rig_element.find(side) for side in (LEFT, RIGHT)]
    cameras = [_camera(path, element) for element in elements]
    bodies = [_body(path, element) for element in distinct(path, root.iterfind("body"))]
    names = [body.name for body in bodies]
    joints = [_joint(path, element, names) for element in distinct(path, root.iterfind("joint"))]
    source = (root.findtext("source") or "").strip()
    found = [_parameters(path, root, *of) for of in (("detection", detection), ("search", search))]
    if is_room:
        found_std = (element.find("std") for element in elements)
        std = [numbers_of(path, one) if one is not None else _EXACT for one in found_std]
        room = built(path, rig_element, lambda: CameraRig(cameras, noise, np.array(std)))
        return RoomSettings(room, bodies, joints, source, *found)
    spread = rig_element.find("covariance")
    covariance = None if spread is None else numbers_of(path, spread).reshape(2 * N_CAMERA_STD, -1)
    rig = built(path, rig_element, lambda: StereoRig(cameras[0], cameras[1], noise, covariance))
    return CaptureSettings(rig, bodies, joints, source, *found)


_EXACT = np.zeros(N_CAMERA_STD)


def _camera(path: Path, element: Any) -> Camera:
    values = (whole_of(path, element, "width"), whole_of(path, element, "height"))
    matrix = numbers_of(path, element.find("matrix")).reshape(3, 3)
    distortion = numbers_of(path, element.find("distortion"))
    pose = numbers_of(path, element.find("camera_from_world")).reshape(4, 4)
    return built(path, element, lambda: Camera(*values, matrix, distortion, pose, element.get("name", "")))


def _body(path: Path, element: Any) -> BodyTarget:
    points = [numbers_of(path, point) for point in element]
    std = [numbers_of_attribute(path, point, "std", 3) for point in element]
    if not points:
        raise error_at(path, element, f"body {element.get('name')!r} has no <point>; a body has some, 4 or more")
    noise = 0.0 if element.get("noise") is None else number_of(path, element, "noise")
    return built(path, element, lambda: BodyTarget(element.get("name"), np.array(points), np.array(std), noise))


def _joint(path: Path, element: Any, bodies: list[str]) -> TargetJoint:
    name, kind, parent, child = (element.get(key) for key in OF_PAIR["joint"].required)
    for role, body in (("parent", parent), ("child", child)):
        if body not in bodies:
            known = ", ".join(closest_first(body, bodies)) or "none"
            raise error_at(path, element, f"the {role} of joint {name!r} is body {body!r}, which is not there: {known}")
    places = [element.find(tag) for tag in ("parent_from_joint", "child_from_joint")]
    poses = [numbers_of(path, place).reshape(4, 4) for place in places]
    std = np.array([numbers_of_attribute(path, place, "std", 3) for place in places])
    axis_std = np.array([numbers_of_attribute(path, place, "axis_std", 1)[0] for place in places])
    return built(path, element, lambda: TargetJoint(name, kind, parent, child, poses[0], poses[1], std, axis_std))


def _parameters(path: Path, root: Any, of: str, declared: type[StageParameters] | None) -> dict[str, ParameterValue]:
    element = root.find(of)
    if element is None:
        return {}
    known = None if declared is None else {entry.name: entry for entry in declared.declarations()}
    return {child.get("name"): _value_of(path, child, known) for child in distinct(path, element.iterfind("*"))}


def _value_of(path: Path, element: Any, known: dict[str, Declaration] | None) -> ParameterValue:
    name, text = element.get("name"), element.get("value")
    if known is None:
        try:
            return float(text)
        except ValueError:
            return str(text)
    if name not in known:
        names = ", ".join(closest_first(name, list(known)))
        raise error_at(path, element, f"the {element.getparent().tag} has no parameter {name!r}; it has {names}")
    try:
        value: ParameterValue = known[name].check(text)
    except ParameterError as error:
        raise error_at(path, element, str(error)) from error
    return value


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
        yield f"  <source>{escape(settings.source, quote=False)}</source>"
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
                yield f"    <parameter name={quoted(name)} value={quoted(_parameter(value))}/>"
            yield f"  </{tag}>"
    for body in settings.bodies:
        noise = f' noise="{float(body.noise)!r}"' if body.noise else ""
        yield f"  <body name={quoted(body.name)}{noise}>"
        for point, std in zip(body.points, np.asarray(body.std), strict=True):
            yield f'    <point std="{number_text(std)}">{number_text(point)}</point>'
        yield "  </body>"
    for joint in settings.joints:
        ends = f"parent={quoted(joint.parent)} child={quoted(joint.child)}"
        yield f'  <joint name={quoted(joint.name)} kind="{joint.kind}" {ends}>'
        for side, tag in enumerate(("parent_from_joint", "child_from_joint")):
            std = f' std="{number_text(joint.std[side])}" axis_std="{float(joint.axis_std[side])!r}"'
            yield from _matrix("    ", tag, std, getattr(joint, tag))
        yield "  </joint>"


def _parameter(value: ParameterValue) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return repr(float(value))  # NumPy's call themselves by their type
    return str(value)


def _camera_lines(side: str, camera: Camera, std: Floats | None = None) -> Iterator[str]:
    yield f'    <{side} name={quoted(camera.name)} width="{camera.width}" height="{camera.height}">'
    yield from _matrix("      ", "matrix", "", camera.matrix)
    yield f"      <distortion>{number_text(camera.distortion)}</distortion>"
    yield from _matrix("      ", "camera_from_world", "", camera.camera_from_world)
    if std is not None and std.any():
        yield f"      <std>{number_text(std)}</std>"
    yield f"    </{side}>"


def _matrix(indent: str, tag: str, attributes: str, matrix: Floats) -> Iterator[str]:
    yield f"{indent}<{tag}{attributes}>"
    for row in matrix:
        yield f"{indent}  {number_text(row)}"
    yield f"{indent}</{tag}>"
