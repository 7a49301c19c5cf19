"""Write settings so that reading gives the same numbers, bit for bit, and people can edit them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera, CaptureSettings, ParameterValue
from skelgen_formats.capture_settings.reader import LEFT, RIGHT, ROOT, UNIT, VERSION
from skelgen_formats.xml_files import write_lines

_COMMENT = (
    "lengths in mm, images in px, angles in rad; a_from_b turns coordinates of b into those of a; std as measured"
)


def write_settings(settings: CaptureSettings, path: Path | str) -> None:
    """Write the settings of a stereo capture; the file appears whole or not at all.

    Parameters
    ----------
    settings : CaptureSettings
        What to write.
    path : Path or str
        The file.

    Raises
    ------
    WriteError
        If a name holds a character that XML forbids, or the file cannot be written.
    """
    write_lines(Path(path), [f'<{ROOT} version="{VERSION}" unit="{UNIT}">', *_inside(settings), f"</{ROOT}>"])


def _inside(settings: CaptureSettings) -> Iterator[str]:
    yield f"  <!-- {_COMMENT} -->"
    if settings.source:
        yield f"  <source>{escape(settings.source)}</source>"
    yield f'  <rig noise="{float(settings.rig.noise)!r}">'
    yield from _camera(LEFT, settings.rig.left)
    yield from _camera(RIGHT, settings.rig.right)
    yield "  </rig>"
    if settings.detection:
        yield "  <detection>"
        for name, value in settings.detection.items():
            yield f"    <parameter name={quoteattr(name)} value={quoteattr(_parameter(value))}/>"
        yield "  </detection>"
    for body in settings.bodies:
        yield f"  <body name={quoteattr(body.name)}>"
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


def _camera(side: str, camera: Camera) -> Iterator[str]:
    yield f'    <{side} name={quoteattr(camera.name)} width="{camera.width}" height="{camera.height}">'
    yield from _matrix("      ", "matrix", "", camera.matrix)
    yield f"      <distortion>{_text(camera.distortion)}</distortion>"
    yield from _matrix("      ", "camera_from_world", "", camera.camera_from_world)
    yield f"    </{side}>"


def _matrix(indent: str, tag: str, attributes: str, matrix: Floats) -> Iterator[str]:
    yield f"{indent}<{tag}{attributes}>"
    for row in matrix:
        yield f"{indent}  {_text(row)}"
    yield f"{indent}</{tag}>"


def _text(numbers: Floats) -> str:
    return " ".join(repr(float(number)) for number in numbers)
