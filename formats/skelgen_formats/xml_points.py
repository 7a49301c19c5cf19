"""XML of points, as KIT's motion database and scripts write it: elements for frames, in these for points.

Coordinates are attributes, ``<knee x="1" y="2" z="3"/>``, or a text, ``<MarkerPosition name="knee">1 2 3</...>``. What
elements hold is read as `skelgen_formats.json_points` does: those of one name that follow each other are a list.
"""

import contextlib
import re
from pathlib import Path
from typing import Any

from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.foreign import is_foreign
from skelgen_formats.json_points import take_from_value
from skelgen_formats.options import POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.xml_text import read_root

_NUMBER = rb"[-+.\de]+"
_COORDINATES = re.compile(
    rb"<[\w:]+(?=[^<>]*\sx\s*=)(?=[^<>]*\sy\s*=)(?=[^<>]*\sz\s*=)|<\w*(?:Marker|Joint|Point)\w*(?: [^<>]*)?>\s*"
    + rb"\s+".join([_NUMBER] * 3)
    + rb"\s*<",
    re.IGNORECASE,
)
_DECLARED = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<\?xml[^<>]*\?>\s*)?")
_KIND, _POSITION = "type", "position"


def read_xml(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the points of a file.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `points`, `recorded_rate`, `recorded_unit` and `sample` count.

    Raises
    ------
    FormatError
        If it is damaged, or holds no positions.
    """
    root = read_root(path, "", "XML of points", -1)
    several = {(one.getparent().tag, one.tag) for one in root.iter() if one.getnext() is not None}
    several = {(parent, tag) for parent, tag in several if any(len(one.findall(tag)) > 1 for one in root.iter(parent))}
    return take_from_value(path, _value(root, several), options, "XML")


def _value(element: Any, several: set[tuple[str, str]]) -> Any:
    """Return what an element holds: numbers of its text, or an object of attributes and elements in it."""
    value: dict[str, Any] = {key: _number(text) for key, text in element.attrib.items()}
    words = [_number(word) for word in (element.text or "").split()]
    if words and all(isinstance(word, float) for word in words):
        numbers = words if len(words) > 1 else words[0]
        if not value and not len(element):
            return numbers
        value[_POSITION] = numbers
    for tag in dict.fromkeys(one.tag for one in element):
        held = [(one.get(_KIND), _value(one, several)) for one in element.findall(tag)]
        kinds = {kind for kind, _ in held}
        if len(kinds) == len(held) > 1:  # sensors of different kinds
            value |= {str(kind): one for kind, one in held}
        else:
            value[tag] = [one for _, one in held] if (element.tag, tag) in several else held[0][1]
    return value


def _number(text: str) -> float | str:
    with contextlib.suppress(ValueError):
        return float(text)
    return text


def _has_points(head: bytes, path: Path) -> bool:
    plain = _DECLARED.sub(b"", head, count=1)
    return plain.startswith(b"<") and not is_foreign(plain, path) and _COORDINATES.search(plain) is not None


FORMAT = Format(
    name="xml",
    title="XML of points",
    suffixes=(".mmm.xml",),
    holds="markers",
    sniff=_has_points,
    read=read_xml,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Elements with x, y, z or three numbers in elements of frames, as of KIT's motion database, by their names.",
)
