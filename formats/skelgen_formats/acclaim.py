"""Acclaim: the bones of an ASF file, and how an AMC file moves them. CMU's motion capture database has both.

Layout of an ASF, text; sections begin with a colon::

    :units
      length 0.45                     a unit of the file is 1/0.45 inch
      angle deg
    :root
      order TX TY TZ RX RY RZ         what the AMC gives of the root, in this order
      axis XYZ
      position 0 0 0
      orientation 0 0 0               degrees, about the axes in turn
    :bonedata
      begin
        name lfemur
        direction 0.34 -0.94 0        in the world at rest
        length 7.16
        axis 0 0 20 XYZ               of the frame about whose axes the bone turns
        dof rx ry rz                  what the AMC gives of the bone
      end
    :hierarchy
      begin
        root lhipjoint rhipjoint
      end

At rest all bones lie as `direction` says; the frames here are then those of the world. With the bone's axes C, its
rotation relative to the parent is C Rz Ry Rx C^T where the AMC gives rx ry rz: the first one is applied first.

Layout of an AMC, text::

    :FULLY-SPECIFIED
    :DEGREES
    1                                 number of the frame
    root 9.37 17.87 -17.32 -2.02 -7.60 -3.23
    lfemur 4.00 1.20 -13.84           a line for every bone with freedoms, its values in the order of the ASF

The AMC states no frame rate; CMU's were recorded at 120 Hz.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, InputError, ParameterError
from skelgen.geometry.rotations import matrix_from_euler
from skelgen.model.arrays import Floats
from skelgen.model.takes import BoneMotion
from skelgen_formats.bones import LARGEST_MM
from skelgen_formats.lines import read_lines
from skelgen_formats.options import AUTO, Format
from skelgen_formats.text import number_in

RATE = 120.0
"""Frame rate [Hz] where nobody says otherwise."""


def read_acclaim(path: Path, skeleton: Path | None = None, unit: str = AUTO) -> BoneMotion:
    """Read the motion of an AMC file with the skeleton of its ASF.

    Parameters
    ----------
    path : Path
        The AMC.
    skeleton : Path, optional
        The ASF; by default that beside the AMC which its name begins with, or the only one.
    unit : str
        Must be ``auto``: the ASF states the unit.

    Raises
    ------
    FormatError
        If a file is not what it should be, or cut off; with the line.
    InputError
        If no ASF is found.
    ParameterError
        If a unit is given.
    """
    if path.suffix.lower() == ".asf":
        raise FormatError(path, "", "an ASF holds bones without motion; give the AMC, and this as --motion-skeleton")
    if unit != AUTO:
        raise ParameterError(f"{path}: its ASF states the unit; leave out --motion-unit")
    asf = _Reader(skeleton or _skeleton_of(path)).read()
    values = _frames(path, asf)
    rotations = np.stack([_rotations(bone, values[bone.name], asf) for bone in asf.bones], axis=1)
    index_of = {bone.name: index for index, bone in enumerate(asf.bones)}
    places = np.stack([_places(bone, values[bone.name], asf, index_of) for bone in asf.bones], axis=1)
    stretched = [bone.name for bone in asf.bones if "l" in bone.freedoms]
    notices = (f"lengths that change are taken as constant: {', '.join(stretched)}",) if stretched else ()
    return BoneMotion(
        names=tuple(bone.name for bone in asf.bones),
        parents=np.array([index_of.get(bone.parent, -1) for bone in asf.bones], dtype=np.intp),
        rotations=rotations,
        places=places,
        tips=tuple((bone.length * bone.direction)[np.newaxis] for bone in asf.bones),
        rate=RATE,
        name=path.name,
        notices=(*notices, f"the file states no frame rate; taken as {RATE:g} Hz unless --motion-rate says otherwise"),
    )


def _skeleton_of(path: Path) -> Path:
    try:
        there = sorted(entry for entry in path.parent.iterdir() if entry.suffix.lower() == ".asf")
    except OSError as error:
        raise InputError(f"{path}: its folder cannot be read: {error.strerror or error}") from error
    fitting = [entry for entry in there if path.stem.lower().startswith(entry.stem.lower())]
    if fitting:
        return max(fitting, key=lambda entry: len(entry.stem))
    if len(there) == 1:
        return there[0]
    found = f"; there are {', '.join(entry.name for entry in there)}" if there else ""
    raise InputError(f"{path}: no ASF beside it belongs to it{found}; name it: --motion-skeleton FILE.asf")


def _frames(path: Path, asf: Asf) -> dict[str, Floats]:
    """Values of each bone, shape (n_frames, n_freedoms)."""
    wanted = {bone.name: len(bone.freedoms) for bone in asf.bones}
    values, n_rows = {name: array("d") for name in wanted}, Counter[str]()
    n_frames, last, lines = 0, 0.0, read_lines(path)
    for number, line in lines.numbered():
        words = line.partition("#")[0].split()
        if not words or words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].lstrip("+-").isdigit():
            _check_whole(path, number, n_rows, wanted, n_frames)
            count = number_in(path, number, words[0], "the number of a frame")
            if n_frames and count != last + 1:
                raise FormatError(path, number, f"frame {count:g} follows frame {last:g}; frames are missing")
            n_frames, last = n_frames + 1, count
            continue
        if n_frames == 0:
            raise FormatError(path, number, f"{words[0][:40]!r} before the number of the first frame; this is not AMC")
        if words[0] not in wanted:
            raise FormatError(path, number, f"the skeleton has no bone {words[0][:40]!r}; is it of another ASF?")
        if n_rows[words[0]] == n_frames:
            raise FormatError(path, number, f"{words[0]!r} twice in one frame")
        if len(words) - 1 != wanted[words[0]]:
            count_here, count = len(words) - 1, wanted[words[0]]
            raise FormatError(path, number, f"{count_here} values of {words[0]!r} where the skeleton has {count}")
        row = [number_in(path, number, word, f"a value of {words[0]!r}") for word in words[1:]]
        if any(abs(value) > LARGEST_MM for value in row):
            raise FormatError(path, number, f"a value of {words[0]!r} is larger than anything that moves")
        values[words[0]].extend(row)
        n_rows[words[0]] += 1
    _check_whole(path, len(lines), n_rows, wanted, n_frames)
    if n_frames == 0:
        raise FormatError(path, len(lines), "no frame; this is not AMC, or it is cut off")
    return {name: np.frombuffer(numbers).reshape(n_frames, wanted[name]) for name, numbers in values.items()}


def _check_whole(path: Path, number: int, n_rows: Mapping[str, int], wanted: dict[str, int], n_frames: int) -> None:
    missing = [name for name, count in wanted.items() if count and n_rows[name] < n_frames]
    if missing:
        what = f"the frame before has no line for {missing[0]!r}"
        raise FormatError(path, number, f"{what}; the file may be cut off, or be of another ASF")


def _rotations(bone: AsfBone, values: Floats, asf: Asf) -> Floats:
    """Parent from bone, shape (n_frames, 3, 3); the first turn is applied first."""
    turned = [column for column, freedom in enumerate(bone.freedoms) if freedom.startswith("r")][::-1]
    axes = "".join(bone.freedoms[column][1] for column in turned)
    turns = matrix_from_euler(axes.upper(), values[:, turned] * asf.radians)
    if bone.name == ROOT:
        return np.asarray(bone.axes @ turns)
    return np.asarray(bone.axes @ turns @ bone.axes.T)


def _places(bone: AsfBone, values: Floats, asf: Asf, index_of: dict[str, int]) -> Floats:
    """Origin in the parent [mm], shape (n_frames, 3): where the parent ends, or the root's place in the world."""
    start = asf.position
    if bone.name != ROOT:
        parent = asf.bones[index_of[bone.parent]]
        start = parent.length * parent.direction
    moved = np.zeros((len(values), 3))
    for column, freedom in enumerate(bone.freedoms):
        if freedom.startswith("t"):
            moved[:, "xyz".index(freedom[1])] = values[:, column] * asf.mm_per_unit
    return np.asarray(start + moved)


ROOT = "root"
_MM_PER_INCH = 25.4
_DEGREES_OF_FREEDOM = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
_ANGLES = {"deg": np.pi / 180, "rad": 1.0}
_MOST_BONES = 1000


@dataclass
class AsfBone:
    """One bone.

    Attributes
    ----------
    name : str
        Its name.
    line : int
        Where it begins in the file.
    direction : ndarray, shape (3,)
        Unit vector in the world at rest; 0 for the root.
    length : float, mm
        Length.
    axes : ndarray, shape (3, 3)
        World from the frame whose axes the bone turns about.
    freedoms : tuple of str
        What a frame of the AMC gives: ``rx``, ``ty``, ``l`` ...
    parent : str
        Name of the parent, empty before the hierarchy is read.
    """

    name: str
    line: int
    direction: Floats = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axes: Floats = field(default_factory=lambda: np.eye(3))
    freedoms: tuple[str, ...] = ()
    parent: str = ""


@dataclass(frozen=True, eq=False)
class Asf:
    """A skeleton: the root, then bones after their parents; mm, and the radians of a unit of angle."""

    bones: tuple[AsfBone, ...]
    position: Floats
    mm_per_unit: float
    radians: float


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._bones = {ROOT: AsfBone(ROOT, 0)}
        self._children: list[str] = []
        self._length, self._radians = 1.0, _ANGLES["deg"]
        self._position, self._axes_of = np.zeros(3), dict[str, tuple[list[float], str]]()
        self._bone: AsfBone | None = None

    def read(self) -> Asf:
        section, number = "", 0
        for number, line in read_lines(self._path).numbered():
            words = line.partition("#")[0].split()
            if not words:
                continue
            if words[0].startswith(":"):
                section = words[0][1:].lower()
                self._bone = self._bones[ROOT] if section == "root" else None
                continue
            take = {"units": self._units, "root": self._root, "bonedata": self._bonedata, "hierarchy": self._hierarchy}
            if not section:
                raise FormatError(self._path, number, "a section such as :root belongs here; this is not ASF")
            if section in take:
                take[section](number, words)
        if section != "hierarchy" and not self._children:
            raise FormatError(self._path, number, "no :hierarchy with bones; the file may be cut off")
        return self._finished()

    def _numbers(self, number: int, words: list[str], count: int) -> list[float]:
        if len(words) != count + 1:
            raise FormatError(self._path, number, f"{len(words) - 1} values after {words[0]} where {count} belong")
        values = [number_in(self._path, number, word, words[0]) for word in words[1:]]
        if max(map(abs, values)) > LARGEST_MM:
            raise FormatError(self._path, number, f"{words[0]} is larger than anything that moves")
        return values

    def _units(self, number: int, words: list[str]) -> None:
        if words[0] == "length":
            (self._length,) = self._numbers(number, words, 1)
            if not self._length > 1 / LARGEST_MM:
                raise FormatError(self._path, number, f"the unit of length is {self._length:g}; it must be above 0")
        elif words[0] == "angle":
            if len(words) != 2 or words[1] not in _ANGLES:
                raise FormatError(self._path, number, "the unit of angles must be deg or rad")
            self._radians = _ANGLES[words[1]]

    def _root(self, number: int, words: list[str]) -> None:
        root = self._bones[ROOT]
        root.line = root.line or number
        if words[0] == "order":
            root.freedoms = self._freedoms(number, words)
        elif words[0] == "position":
            self._position = np.array(self._numbers(number, words, 3))
        elif words[0] == "orientation":
            self._axes_of[ROOT] = (self._numbers(number, words, 3), "xyz")

    def _bonedata(self, number: int, words: list[str]) -> None:
        if words[0] == "begin":
            self._bone = AsfBone("", number)
        elif self._bone is None:
            raise FormatError(self._path, number, f"{words[0][:40]!r} outside of begin and end")
        elif words[0] == "name" and len(words) == 2:
            self._named(number, words[1])
        elif words[0] == "direction":
            direction = np.array(self._numbers(number, words, 3))
            if not np.linalg.norm(direction) > 0:
                raise FormatError(self._path, number, "a bone without direction")
            self._bone.direction = direction / np.linalg.norm(direction)
        elif words[0] == "length":
            (self._bone.length,) = self._numbers(number, words, 1)
        elif words[0] == "axis":
            self._axis(number, words)
        elif words[0] == "dof":
            self._bone.freedoms = self._freedoms(number, words)
        elif words[0] == "end":
            if not self._bone.name:
                raise FormatError(self._path, self._bone.line, "a bone without a name")
            self._bone = None

    def _named(self, number: int, name: str) -> None:
        if name in self._bones or self._bone is None:
            raise FormatError(self._path, number, f"a second bone {name[:40]!r}")
        if self._bone.name:
            raise FormatError(self._path, number, f"a second name of the bone {self._bone.name[:40]!r}")
        if len(self._bones) > _MOST_BONES:
            raise FormatError(self._path, number, f"more than {_MOST_BONES} bones")
        self._bone.name = name
        self._bones[name] = self._bone

    def _axis(self, number: int, words: list[str]) -> None:
        order = words[-1].lower()
        if self._bone is None or sorted(order) != ["x", "y", "z"]:
            raise FormatError(self._path, number, "an axis ends with the order of its turns, such as XYZ")
        if not self._bone.name:
            raise FormatError(self._path, number, "an axis before the name of its bone")
        self._axes_of[self._bone.name] = (self._numbers(number, words[:-1], 3), order)

    def _freedoms(self, number: int, words: list[str]) -> tuple[str, ...]:
        freedoms = tuple(word.lower() for word in words[1:])
        unknown = [word for word in freedoms if word not in _DEGREES_OF_FREEDOM]
        if unknown or len(set(freedoms)) != len(freedoms):
            what = f"{unknown[0][:40]!r} is no freedom" if unknown else "a freedom is named twice"
            raise FormatError(self._path, number, f"{what}; there are {', '.join(_DEGREES_OF_FREEDOM)}")
        return freedoms

    def _hierarchy(self, number: int, words: list[str]) -> None:
        if words[0] in {"begin", "end"}:
            return
        for name in words:
            if name not in self._bones:
                raise FormatError(self._path, number, f"there is no bone {name[:40]!r} in :bonedata")
        if words[0] != ROOT and words[0] not in self._children:
            raise FormatError(self._path, number, f"{words[0]!r} carries bones before any bone carries it")
        for name in words[1:]:
            if name in self._children or name == ROOT:
                raise FormatError(self._path, number, f"two bones carry {name!r}, or it carries itself")
            self._bones[name].parent = words[0]
            self._children.append(name)

    def _finished(self) -> Asf:
        scale = _MM_PER_INCH / self._length
        for name, (angles, order) in self._axes_of.items():
            # the first letter is applied first, so that it is the rightmost factor
            turns = np.array(angles)[["xyz".index(letter) for letter in order[::-1]]] * self._radians
            self._bones[name].axes = matrix_from_euler(order[::-1].upper(), turns[np.newaxis])[0]
        bones = tuple(self._bones[name] for name in (ROOT, *self._children))
        for bone in bones:
            bone.length *= scale
        return Asf(bones, self._position * scale, scale, self._radians)


FORMAT = Format(
    name="acclaim",
    title="Acclaim AMC with ASF",
    suffixes=(".amc", ".asf"),
    holds="skeleton",
    read_motion=read_acclaim,
    note="The ASF is looked for beside the AMC; CMU's motions.",
)
