"""Read the classic XML file as a stream: an element that has been understood is dropped, only its numbers stay."""

import re
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from lxml import etree

from skelgen.errors import FormatError
from skelgen.files import open_regular
from skelgen_formats.classic_xml.contents import (
    Bone,
    ClassicXml,
    Contents,
    JointFacts,
    JointStats,
    MarkerDistance,
    assemble,
)
from skelgen_formats.classic_xml.writer import ALL, BY_MARKER_SET, DEVIATIONS, JOINTS, MOTION, ROOT, VERSION
from skelgen_formats.xml_text import SAFE_XML

_UNITS = {"unit": "mm", "time_unit": "s", "quaternion": "x y z w"}
_JOINT_TAG = re.compile(r"joint(\d{1,9})-(\d{1,9})")
_NAN3 = [float("nan")] * 3
_MOST_WAITING = 1 << 24  # bytes: a frame of a hundred thousand markers
_LAST_CERTAIN_LINE = 65534  # libxml2 keeps line numbers of elements in 16 bits and stops counting there

_KEY_PLACES, _JOINT_PLACES = list("0120123"), list("012")
_IS_KEY = etree.XPath(
    "count(vector) = 2 and count(vector[1][@name='TRANSLATION']/vec_elem) = 3"
    " and count(vector[2][@name='ROTATION']/vec_elem) = 4"
)
_IS_JOINT = etree.XPath("count(vector) = 1 and count(vector/vec_elem) = 3")
_VALUES = etree.XPath("vector/vec_elem[@pos]/@val", smart_strings=False)
_PLACES = etree.XPath("vector/vec_elem/@pos", smart_strings=False)
_MARKER_VECTORS = etree.XPath("Bone/Marker/vector[count(vec_elem) = 3]")
_MARKER_VALUES = etree.XPath("Bone/Marker/vector/vec_elem[@pos]/@val", smart_strings=False)
_MARKER_PLACES = etree.XPath("Bone/Marker/vector/vec_elem/@pos", smart_strings=False)


def read(path: Path) -> ClassicXml:
    """Read a classic XML file; see `skelgen_formats.classic_xml.read_classic_xml`."""
    reader = _Reader(path)
    try:
        for element in _finished_elements(path, tuple(reader.handlers)):
            _spread(element)
            reader.handlers[element.tag](element)
            _drop(element)
    except etree.XMLSyntaxError as error:
        raise FormatError(path, error.lineno or "", f"broken XML: {error.msg}") from error
    return assemble(path, reader.contents)


def _finished_elements(path: Path, tags: tuple[str, ...]) -> Iterator[Any]:
    """Check the root, then yield each element of these tags as soon as it is complete."""
    with open_regular(path) as stream:
        for _, root in etree.iterparse(stream, events=("start",), **SAFE_XML):
            _check_root(path, root)
            break
    with open_regular(path) as stream:
        source = _Source(path, stream)
        for _, element in etree.iterparse(source, tag=tags, remove_comments=True, remove_pis=True, **SAFE_XML):
            source.n_waiting = 0
            yield element


class _Source:
    """A file that lxml reads; it ends the reading where elements pile up that nobody takes."""

    def __init__(self, path: Path, stream: BinaryIO) -> None:
        self._path, self._stream, self.n_waiting = path, stream, 0

    def read(self, size: int) -> bytes:
        """Return the next bytes; lxml asks for some thousand at a time."""
        self.n_waiting += size
        if self.n_waiting > _MOST_WAITING:
            what = f"holds {_MOST_WAITING} bytes without a bone, a key, a joint or a frame; none of these files does"
            raise FormatError(self._path, f"byte {self._stream.tell()}", what)
        return self._stream.read(size)


def _check_root(path: Path, root: Any) -> None:
    line = root.sourceline or 1
    if root.tag != ROOT:
        what = f"the root element is <{root.tag}> where <{ROOT}> belongs"
        raise FormatError(path, line, f"{what}; of XML of another program, export the markers as C3D or TRC")
    if root.getroottree().docinfo.internalDTD is not None:
        raise FormatError(path, line, "a document type is declared; these files have none")
    if root.get("version") != VERSION:
        raise FormatError(path, line, f"version {root.get('version')} is not known; {VERSION} can be read")
    for name, wanted in _UNITS.items():
        if root.get(name) != wanted:
            raise FormatError(path, line, f"{name} is {root.get(name)!r}; it must be {wanted!r}")


def _spread(element: Any) -> None:
    """Give the vectors of a compact file an element for each number, as others have."""
    for vector in element.iter("vector"):
        if vector.text and not len(vector):
            for place, number in enumerate(vector.text.split()):
                etree.SubElement(vector, "vec_elem", val=number, pos=str(place))


def _drop(element: Any) -> None:
    """Free an element and its elder siblings; itself it must stay in place while the parser goes on behind it."""
    element.clear(keep_tail=True)
    parent = element.getparent()
    while parent is not None and element.getprevious() is not None:
        del parent[0]


def _place(element: Any) -> int | str:
    """Line of an element; far down in a long file, where lines are not counted, its frame."""
    line = int(element.sourceline or 0)
    if 0 < line < _LAST_CERTAIN_LINE:
        return line
    frames = (above.get("FrameIndex") or above.get("FRAMEID") for above in (element, *element.iterancestors()))
    return next((f"frame {frame}" for frame in frames if frame), "")


class _Reader:
    """Collects the numbers of the elements that it is handed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.contents = Contents()
        self.handlers: dict[str, Callable[[Any], None]] = {
            "MarkerNames": self._names,
            "StatsElements": self._stats,
            "BONE": self._bone,
            "KEYFRAME": self._key,
            "JointFrame": self._joint_frame,
            "MarkerOffsets": self._offsets,
            "Frame": self._frame,
            ROOT: self._root,
        }

    def _fail(self, element: Any, what: str) -> NoReturn:
        raise FormatError(self.path, _place(element), f"<{element.tag}> {what}")

    def _text(self, element: Any, name: str) -> str:
        text = element.get(name)
        if text is None:
            self._fail(element, f"lacks the attribute {name}")
        return str(text)

    def _float(self, element: Any, name: str) -> float:
        return self._floats(element, [self._text(element, name)])[0]

    def _floats(self, element: Any, texts: list[str]) -> list[float]:
        try:
            return list(map(float, texts))
        except ValueError:
            self._fail(element, f"holds what is no number: {', '.join(texts)[:80]}")

    def _int(self, element: Any, name: str) -> int:
        text = self._text(element, name)
        if not re.fullmatch(r"-?\d{1,9}", text):
            self._fail(element, f"has {name}={text[:40]!r} where a whole number belongs")
        return int(text)

    def _child(self, element: Any, tag: str) -> Any:
        child = element.find(tag)
        if child is None:
            self._fail(element, f"lacks the element <{tag}>")
        return child

    def _vector(self, element: Any, name: str, length: int) -> list[float]:
        found = [vector for vector in element.iterfind("vector") if vector.get("name") == name]
        if len(found) != 1:
            self._fail(element, f"has {len(found)} vectors {name} where one belongs")
        return self._numbers(found[0], length)

    def _numbers(self, vector: Any, length: int) -> list[float]:
        if [item.get("pos") for item in vector] != [str(place) for place in range(length)]:
            self._fail(vector, f"must hold {length} numbers at pos 0 to {length - 1}")
        return [self._float(item, "val") for item in vector]

    def _root(self, element: Any) -> None:
        self.contents.rate = self._float(element, "rate")
        self.contents.take = self._text(element, "take")
        detail = element.get("detail", ALL)
        if detail not in (MOTION, JOINTS, ALL):
            self._fail(element, f"has the detail {detail!r:.60}; it must be one of {MOTION}, {JOINTS}, {ALL}")
        self.contents.detail = detail

    def _names(self, element: Any) -> None:
        for index, marker in enumerate(element):
            if self._int(marker, "id") != index:
                self._fail(marker, f"has id {marker.get('id')} where {index} belongs")
            self.contents.names.append(self._text(marker, "name"))
            self.contents.bone_of_marker.append(self._int(marker, "bone"))

    def _stats(self, element: Any) -> None:
        self.contents.stats.extend(self._joint_stats(joint) for joint in element)

    def _joint_stats(self, joint: Any) -> JointStats:
        distances = self._child(joint, "DistanceStats")
        calculation = self._child(joint, "CalculationStats")
        return JointStats(
            first_bone=self._int(joint, "FirstBone"),
            second_bone=self._int(joint, "SecondBone"),
            alpha=self._float(joint, "Alpha"),
            first=self._distances(self._child(distances, "FirstBone")),
            second=self._distances(self._child(distances, "SecondBone")),
            n_iterations=self._int(calculation, "NumberOfIterations"),
            value=self._float(calculation, "FuncValueAtSolution"),
        )

    def _distances(self, bone: Any) -> tuple[MarkerDistance, ...]:
        return tuple(
            MarkerDistance(self._int(one, "MarkerId"), self._float(one, "AverageDist"), self._float(one, "Sigma"))
            for one in bone
        )

    def _bone(self, element: Any) -> None:
        limb = self._int(element, "BONEID")
        if limb in self.contents.bones:
            self._fail(element, f"has BONEID {limb}, which another bone has already")
        joint = element.find("JOINT")
        self.contents.bones[limb] = Bone(
            parent=self._int(element, "PARENT"),
            local_translation=self._vector(element, "LOCALTRANSLATION", 3),
            local_rotation=self._vector(element, "LOCALROTATION", 4),
            joint=None if joint is None else self._joint(joint),
            name=element.get("NAME", f"limb{limb}"),
        )

    def _joint(self, element: Any) -> JointFacts:
        names = {vector.get("name") for vector in element}
        return JointFacts(
            kind=self._text(element, "KIND"),
            open_directions=self._int(element, "OPENDIRECTIONS") if "OPENDIRECTIONS" in element.attrib else 0,
            usual_directions=self._int(element, "USUALDIRECTIONS") if "USUALDIRECTIONS" in element.attrib else 0,
            is_placed_by_marker_set=element.get("PLACEDBY") == BY_MARKER_SET,
            position_in_parent=self._vector(element, "POSITIONINPARENT", 3),
            position_in_child=self._vector(element, "POSITIONINBONE", 3),
            std=self._vector(element, "STANDARDDEVIATION", 3),
            axis=self._vector(element, "AXIS", 3) if "AXIS" in names else None,
            second_axis=self._vector(element, "SECONDAXIS", 3) if "SECONDAXIS" in names else None,
            deviations={
                name: self._vector(element, tag, 9 if "covariance" in name else 3)
                for tag, name in DEVIATIONS.items()
                if tag in names
            },
            name=element.get("NAME", ""),
        )

    def _key(self, element: Any) -> None:
        limb = self._int(element.getparent(), "BONEID")
        track = self.contents.tracks.setdefault(limb, array("d"))
        seen = self.contents.seen.setdefault(limb, bytearray())
        self._check_turn(element, "FRAMEID", len(seen))
        if not _IS_KEY(element) or _PLACES(element) != _KEY_PLACES:
            self._fail(element, "must hold the vectors TRANSLATION, with 3 numbers, and ROTATION, with 4")
        track.extend(self._exactly(element, _VALUES(element), len(_KEY_PLACES)))
        seen.append(element.get("SEEN") != "0")

    def _joint_frame(self, element: Any) -> None:
        joint = element.getparent()
        name = _JOINT_TAG.fullmatch(joint.tag)
        if name is None:
            self._fail(joint, "is no name of a joint, such as joint0-1")
        is_raw = joint.getparent() is not None and joint.getparent().tag == "RawJointPositions"
        joints = self.contents.raw_joints if is_raw else self.contents.final_joints
        positions = joints.setdefault((int(name[1]), int(name[2])), array("d"))
        self._check_turn(element, "FrameIndex", len(positions) // 3)
        if len(element) == 0:
            positions.extend(_NAN3)
        elif not _IS_JOINT(element) or _PLACES(element) != _JOINT_PLACES:
            self._fail(element, "must hold one vector with 3 numbers, or nothing")
        else:
            positions.extend(self._exactly(element, _VALUES(element), 3))

    def _offsets(self, element: Any) -> None:
        for bone in element:
            limb = self._int(bone, "id")
            for vector in bone:
                if vector.get("name") == "CenterOfMass":
                    self.contents.centers[limb] = self._numbers(vector, 3)
                else:
                    marker = self._marker(vector)
                    self.contents.offsets[marker] = self._numbers(vector, 3)
                    self.contents.sigmas[marker] = self._float(vector, "Sigma")
                    if vector.get("StandardDeviation") is not None:
                        texts = vector.get("StandardDeviation").split()
                        self.contents.offset_stds[marker] = self._exactly(vector, texts, 3)
                        self.contents.noises[marker] = self._float(vector, "Noise")

    def _frame(self, element: Any) -> None:
        self._check_turn(element, "FrameIndex", self.contents.n_marker_frames)
        vectors = _MARKER_VECTORS(element)
        if _MARKER_PLACES(element) != _JOINT_PLACES * len(vectors):
            self._fail(element, "holds a marker with a vector that has not 3 numbers at pos 0 to 2")
        numbers = self._exactly(element, _MARKER_VALUES(element), 3 * len(vectors))
        rows = {name: _NAN3 * len(self.contents.names) for name in ("FinalMarkerPosition", "OrgMarkerPosition")}
        for index, vector in enumerate(vectors):
            row = rows.get(vector.get("name"))
            if row is None:
                self._fail(vector, f"is called {vector.get('name')!r}; it must be one of {', '.join(rows)}")
            start = 3 * self._marker(vector.getparent())
            row[start : start + 3] = numbers[3 * index : 3 * index + 3]
        self.contents.final_markers.extend(rows["FinalMarkerPosition"])
        self.contents.tracked_markers.extend(rows["OrgMarkerPosition"])
        self.contents.n_marker_frames += 1

    def _marker(self, element: Any) -> int:
        marker = self._int(element, "id")
        if not 0 <= marker < len(self.contents.names):
            self._fail(element, f"has id {marker}; there are {len(self.contents.names)} names of markers")
        return marker

    def _check_turn(self, element: Any, name: str, wanted: int) -> None:
        if self._int(element, name) != wanted:
            self._fail(element, f"has {name} {element.get(name)} where {wanted} belongs")

    def _exactly(self, element: Any, texts: list[str], count: int) -> list[float]:
        if len(texts) != count:
            self._fail(element, f"holds {len(texts)} numbers where {count} belong")
        return self._floats(element, texts)
