"""MVNX: segments of a body with their orientations, as Xsens MVN exports them.

Layout, XML with or without the namespace of Xsens, versions 2 to 4::

    <mvnx version="4">
      <subject label="Ann" frameRate="60" segmentCount="23" ...>
        <segments><segment label="Pelvis" id="1">...</segment>...</segments>
        <frames>
          <frame type="identity">...            (calibration poses: identity, tpose, tpose-isb, npose)
          <frame time="0" index="0" type="normal">
            <orientation>0.988107 0.008481 -0.146731 -0.045195 ...</orientation>   unit quaternion, scalar first, each
            <position>-0.000000 0.000000 -0.000657 ...</position>                  its origin in the world [m]

Segments are read as bodies: p_world = R(q) p_segment + position; z is up. Whatever else a frame holds is left out.
"""

from array import array
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import open_regular
from skelgen.model import Poses
from skelgen_formats.bodies import take_from_bodies
from skelgen_formats.lines import decoded_head
from skelgen_formats.options import Format
from skelgen_formats.text import rate_in
from skelgen_formats.xml_text import SAFE_XML

_MM_PER_M = 1000.0
_NORMAL = "normal"
_QUATERNION, _PLACE = ("orientation", 4), ("position", 3)


class _Frames(NamedTuple):
    """What a file holds: the names of the segments, the rate, and the numbers of all frames."""

    names: list[str]
    rate: float
    quaternions: "array[float]"
    places: "array[float]"


def read_mvnx(path: Path) -> Poses:
    """Read the segments of an MVNX file.

    Raises
    ------
    FormatError
        If it is no MVNX file, breaks off before the first frame, or a frame lacks the pose of a segment.
    """
    notices: list[str] = []
    frames = _read(path, notices)
    shape = (-1, len(frames.names))
    quaternions = np.frombuffer(frames.quaternions).reshape(*shape, _QUATERNION[1])
    places = np.frombuffer(frames.places).reshape(*shape, _PLACE[1])
    numbers = np.concatenate([places, quaternions], axis=2)
    return take_from_bodies(path, numbers, _MM_PER_M, frames.names, frames.rate, notices)


def _read(path: Path, notices: list[str]) -> _Frames:
    from lxml import etree  # noqa: PLC0415 - costs 50 ms, and most runs read no such file

    frames = _Frames([], 0.0, array("d"), array("d"))
    try:
        with open_regular(path) as stream:
            events = etree.iterparse(stream, events=("start", "end"), remove_comments=True, remove_pis=True, **SAFE_XML)
            for event, element in events:
                tag = element.tag.rpartition("}")[2]
                if event == "start":
                    frames = _started(path, frames, tag, element)
                elif tag == "segment":
                    if frames.places:
                        raise FormatError(path, element.sourceline or "", "a segment is named behind the first frame")
                    frames.names.append((element.get("label") or "").strip())
                elif tag == "frame":
                    _add(path, frames, element)
                    element.clear()
                    while element.getprevious() is not None:
                        del element.getparent()[0]
    except etree.XMLSyntaxError as error:
        if not frames.places:
            raise FormatError(path, error.lineno or "", f"broken XML: {error.msg}") from error
        where = f"in line {error.lineno or '?'} ({error.msg})"
        notices.append(f"the XML breaks off {where}; the frames before it are taken")
    if not frames.names or not frames.rate:
        raise FormatError(path, "", "no <subject> with its <segments>; export MVNX with segments from MVN")
    return frames


def _started(path: Path, frames: _Frames, tag: str, element: Any) -> _Frames:
    """Check the root and see the rate where the subject begins."""
    line = element.sourceline or ""
    if element.getparent() is None:
        if tag != "mvnx":
            raise FormatError(path, line, f"the root element is <{tag}> where <mvnx> belongs")
        if element.getroottree().docinfo.internalDTD is not None:
            raise FormatError(path, line, "a document type is declared; these files have none")
    if tag != "subject":
        return frames
    if frames.rate:
        raise FormatError(path, line, "a second subject; export one person per file")
    return frames._replace(rate=rate_in(path, line, element.get("frameRate") or "", "frameRate"))


def _add(path: Path, frames: _Frames, element: Any) -> None:
    if element.get("type", _NORMAL) != _NORMAL:
        return
    for numbers, (tag, size) in ((frames.quaternions, _QUATERNION), (frames.places, _PLACE)):
        text = element.findtext(f"{{*}}{tag}") or ""
        try:
            found = [float(word) for word in text.split()]
        except ValueError as error:
            raise FormatError(path, element.sourceline or "", f"<{tag}> holds a word that is no number") from error
        if len(found) != size * len(frames.names) or not found:
            what = f"<{tag}> has {len(found)} numbers where {size} belong to each of {len(frames.names)} segments"
            raise FormatError(path, element.sourceline or "", f"{what}; export MVNX with segment {tag}")
        numbers.extend(found)


FORMAT = Format(
    name="mvnx",
    title="Xsens MVNX",
    suffixes=(".mvnx",),
    holds="poses",
    sniff=lambda head, path: "<mvnx" in decoded_head(head),
    read=lambda path, options: read_mvnx(path),
    note="Segments of Xsens MVN as bodies, in metres with z up; sensors, joint angles and contacts are left out.",
)
