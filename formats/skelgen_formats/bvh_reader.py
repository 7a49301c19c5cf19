"""BVH read as a motion of bones: any order of channels, three or six of them, positions that add to offsets or not.

The layout stands in `skelgen_formats.bvh`. Where a bone's position channels name its place in the parent, they replace
its OFFSET, as bvhio and Blender have it; in files where they stay nearer to zero than to the OFFSET, they add to it.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, ParameterError
from skelgen.geometry.rotations import matrix_from_euler
from skelgen.model.arrays import Floats
from skelgen.model.takes import BoneMotion
from skelgen.progress import counted
from skelgen_formats.bones import LARGEST_MM, bone_unit
from skelgen_formats.lines import Lines, read_lines
from skelgen_formats.markers import distinct_names
from skelgen_formats.options import AUTO
from skelgen_formats.text import count_in, number_in, parse_rows

_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "xyz")
_ROUNDED = 0.005  # of the rate: a frame time that is written with fewer digits could be that of many rates
_SLOWEST = 5.0  # s per frame, from which on a frame time is a rate, or is in ms
_CUT = "; the file may be cut off"


@dataclass
class _Bone:
    """What the hierarchy says of one bone."""

    name: str
    line: int
    parent: int
    offset: Floats | None = None
    channels: tuple[str, ...] | None = None
    tips: list[Floats] = field(default_factory=list)


def read_bvh(path: Path, skeleton: Path | None = None, unit: str = AUTO) -> BoneMotion:
    """Read skeleton and motion of a BVH file.

    Parameters
    ----------
    path : Path
        The file.
    skeleton : Path, optional
        Not allowed: the file holds its skeleton itself.
    unit : str
        Unit of its lengths, which it does not state; see `skelgen_formats.bones.bone_unit`.

    Raises
    ------
    FormatError
        If the file is not BVH, or is cut off, with the line where that shows.
    ParameterError
        If a skeleton is given, or there is no such unit.
    """
    if skeleton is not None:
        raise ParameterError(f"{path}: a BVH file holds its skeleton itself; leave {skeleton} out")
    lines = read_lines(path)
    hierarchy = _Hierarchy(path, lines)
    bones = hierarchy.bones
    notices: list[str] = []
    rows, rate = _motion(path, lines, hierarchy.end, sum(len(bone.channels or ()) for bone in bones), notices)
    offsets = np.array([bone.offset for bone in bones])
    tips = [np.array(bone.tips).reshape(-1, 3) for bone in bones]
    parents = np.array([bone.parent for bone in bones], dtype=np.intp)
    rotations, places = _posed(bones, offsets, rows)
    scale, assumed = bone_unit(path, unit, parents, offsets, tips)
    if max(np.abs(places).max(), np.abs(offsets).max()) * scale > LARGEST_MM:
        raise FormatError(path, "", f"a place is farther than {LARGEST_MM:g} mm; check the file and --motion-unit")
    return BoneMotion(
        names=distinct_names([bone.name for bone in bones], " "),
        parents=parents,
        rotations=rotations,
        places=places * scale,
        tips=tuple(tip * scale for tip in tips),
        rate=rate,
        name=path.name,
        notices=(*notices, *assumed),
    )


class _Hierarchy:
    """The part of a file above MOTION: its bones, and the index of the line after it."""

    def __init__(self, path: Path, lines: Lines) -> None:
        self.bones: list[_Bone] = []
        self.end = len(lines)
        self._path = path
        self._open: list[int | None] = []  # bones whose braces are open, None for an end site
        self._waits_for_brace = False
        number = 0
        for number, words in _statements(lines):
            if words[0].upper() == "MOTION":
                self.end = number
                break
            self._take(number, words)
        if self.end == len(lines):
            raise FormatError(path, number, f"the file ends without a MOTION line{_CUT}")
        self._check_end()

    def _take(self, number: int, words: list[str]) -> None:
        word = words[0].upper()
        if self._waits_for_brace != (word == "{"):
            wanted = "'{' belongs here" if self._waits_for_brace else "'{' follows no ROOT, JOINT or End Site"
            raise FormatError(self._path, number, f"{' '.join(words)[:40]!r}: {wanted}; the hierarchy is broken")
        if word == "{":
            self._waits_for_brace = False
        elif word == "HIERARCHY" and not self.bones:
            pass
        elif not self.bones and word != "ROOT":
            raise FormatError(self._path, number, "no HIERARCHY with a ROOT stands here; this is not BVH")
        elif word in {"ROOT", "JOINT"}:
            self._begin(number, word, words)
        elif word == "END":
            self._within(number, "End Site")
            self._open.append(None)
            self._waits_for_brace = True
        elif word == "}":
            if not self._open:
                raise FormatError(self._path, number, "'}' closes nothing; the braces of the hierarchy do not match")
            self._open.pop()
        elif word == "OFFSET":
            self._offset(number, words)
        elif word == "CHANNELS":
            self._channels(number, words)
        else:
            raise FormatError(self._path, number, f"{' '.join(words)[:40]!r} where a line of the hierarchy belongs")

    def _begin(self, number: int, word: str, words: list[str]) -> None:
        if (word == "ROOT") != (not self._open):
            place = "within another bone" if self._open else "outside of all bones"
            raise FormatError(self._path, number, f"{word} {place}; the braces of the hierarchy do not match")
        parent = -1 if word == "ROOT" else self._within(number, word)
        name = " ".join(words[1:])
        if not name:
            raise FormatError(self._path, number, f"{word} without a name")
        self._open.append(len(self.bones))
        self.bones.append(_Bone(name, number, parent))
        self._waits_for_brace = True

    def _within(self, number: int, what: str) -> int:
        bone = self._open[-1] if self._open else None
        if bone is None:
            raise FormatError(self._path, number, f"{what} outside of a bone; the braces of the hierarchy do not match")
        return bone

    def _offset(self, number: int, words: list[str]) -> None:
        if len(words) != 4:
            raise FormatError(self._path, number, f"{counted(len(words) - 1, 'number')} after OFFSET where 3 belong")
        place = np.array([number_in(self._path, number, word, "an OFFSET") for word in words[1:]])
        if self._open and self._open[-1] is None:
            owner = next(bone for bone in reversed(self._open) if bone is not None)
            self.bones[owner].tips.append(place)
            return
        bone = self.bones[self._within(number, "OFFSET")]
        if bone.offset is not None:
            raise FormatError(self._path, number, f"a second OFFSET of the bone {bone.name!r}")
        bone.offset = place

    def _channels(self, number: int, words: list[str]) -> None:
        bone = self.bones[self._within(number, "CHANNELS")]
        if bone.channels is not None:
            raise FormatError(self._path, number, f"second CHANNELS of the bone {bone.name!r}")
        count = count_in(self._path, number, words[1] if len(words) > 1 else "", "the number of channels")
        names = tuple(word.lower() for word in words[2:])
        if len(names) != count:
            raise FormatError(self._path, number, f"{len(names)} channels are named where {count} are announced")
        unknown = [word for word in words[2:] if word.lower() not in _CHANNELS]
        if unknown or len(set(names)) != count:
            what = f"there is no channel {unknown[0][:40]!r}" if unknown else "a channel is named twice"
            raise FormatError(self._path, number, f"{what}; a bone has some of {', '.join(_CHANNELS)}")
        bone.channels = names

    def _check_end(self) -> None:
        if self._open or self._waits_for_brace:
            raise FormatError(self._path, self.end, "MOTION begins where '}' is missing; the hierarchy is broken")
        if not self.bones:
            raise FormatError(self._path, self.end, "no bone stands before MOTION")
        for bone in self.bones:
            missing = "OFFSET" if bone.offset is None else "CHANNELS" if bone.channels is None else ""
            if missing:
                raise FormatError(self._path, bone.line, f"the bone {bone.name!r} has no {missing} line")


def _statements(lines: Lines) -> Iterator[tuple[int, list[str]]]:
    """Words of each line with its number; braces stand alone, wherever they are written."""
    for number, line in lines.numbered():
        for part in line.replace("{", "\n{\n").replace("}", "\n}\n").split("\n"):
            if part.split():
                yield number, part.split()


def _motion(path: Path, lines: Lines, at: int, n_channels: int, notices: list[str]) -> tuple[Floats, float]:
    """The channels of every frame, shape (n_frames, n_channels), and the frame rate [Hz]."""
    following = lines.numbered(at)
    announcement, step = next(following, None), next(following, None)
    if announcement is None or step is None:
        raise FormatError(path, len(lines), f"MOTION without Frames and Frame Time{_CUT}")
    n_frames = count_in(path, announcement[0], _after(path, announcement, "Frames:"), "the number of frames")
    rate = _rate(path, step, notices)
    if n_frames == 0 or n_channels == 0:
        raise FormatError(path, announcement[0], "nothing moves: there are no frames, or no bone has channels")
    numbers = array("q")  # of the frames' lines

    def frames() -> Iterator[tuple[int, str]]:
        for number, line in following:
            if len(numbers) == n_frames:
                raise FormatError(path, number, f"more frames than the {n_frames} announced")
            numbers.append(number)
            yield number, " ".join(line.split())

    rows = parse_rows(path, frames(), n_channels, " ")
    if len(rows) < n_frames:
        last = numbers[-1] if numbers else step[0]
        frame = "frame" if len(rows) == 1 else "frames"
        raise FormatError(path, last, f"{len(rows)} {frame} where {n_frames} are announced{_CUT}")
    broken = np.flatnonzero(~(np.abs(rows) < LARGEST_MM).all(axis=1))
    if len(broken):
        what = "a channel is not a number, or larger than anything that moves"
        raise FormatError(path, numbers[broken[0]], f"{what}; export the motion without gaps")
    return rows, rate


def _after(path: Path, numbered: tuple[int, str], head: str) -> str:
    number, line = numbered
    words = ":".join(part.strip() for part in " ".join(line.split()).split(":", 1))
    if not words.lower().startswith(head.lower()):
        raise FormatError(path, number, f"{words[:40]!r} where '{head}' belongs")
    return words[len(head) :].strip()


def _rate(path: Path, numbered: tuple[int, str], notices: list[str]) -> float:
    """The frame rate [Hz]; a whole number where the frame time is one's, cut or rounded to the digits written."""
    text = _after(path, numbered, "Frame Time:")
    seconds = number_in(path, numbered[0], text, "the frame time")
    if not 1 / LARGEST_MM < seconds < LARGEST_MM:
        raise FormatError(path, numbered[0], f"the frame time is {seconds:g} s; it must be above 0")
    decimals = len(text.replace(",", ".").partition(".")[2]) if "e" not in text.lower() else 0
    if seconds < _SLOWEST:
        return _whole_rate(seconds, decimals) or 1 / seconds
    in_ms = _whole_rate(seconds / 1000, decimals + 3) if seconds % 1 else None  # 33.333; 30 and 29.97 are rates
    meaning = "is taken as ms" if in_ms else "is taken as frames per second"
    notices.append(f"the frame time {seconds:g} {meaning}, for nothing moves so slowly; --motion-rate says otherwise")
    return in_ms or seconds


def _whole_rate(seconds: float, decimals: int) -> float | None:
    """The whole frame rate [Hz] whose frame time is this one, written with so many decimals, if there is one."""
    whole = round(1 / seconds)
    is_whole = whole and abs(whole * seconds - 1) < _ROUNDED and abs(1 / whole - seconds) <= 10.0**-decimals
    return float(whole) if is_whole else None


def _posed(bones: list[_Bone], offsets: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Rotations parent from bone, shape (n_frames, n_bones, 3, 3), and places in the file's unit."""
    rotations = np.empty((len(rows), len(bones), 3, 3))
    places = np.repeat(offsets[np.newaxis], len(rows), axis=0)
    first = 0
    for index, bone in enumerate(bones):
        names = bone.channels or ()
        values = rows[:, first : first + len(names)]
        first += len(names)
        turned = [column for column, name in enumerate(names) if name.endswith("rotation")]
        moved = [column for column, name in enumerate(names) if name.endswith("position")]
        axes = "".join(names[column][0] for column in turned).upper()
        rotations[:, index] = matrix_from_euler(axes, np.deg2rad(values[:, turned]))
        coordinates = np.array(["xyz".index(names[column][0]) for column in moved], dtype=np.intp)
        adds = bone.parent >= 0 and _adds(values[:, moved], offsets[index, coordinates])
        places[:, index, coordinates] = values[:, moved] + (offsets[index, coordinates] if adds else 0.0)
    return rotations, places


def _adds(moved: Floats, offset: Floats) -> bool:
    """Whether position channels add to the offset: whether they stay nearer to zero than to it."""
    return bool(np.linalg.norm(moved, axis=1).sum() < np.linalg.norm(moved - offset, axis=1).sum())
