"""ASF: the skeleton of an Acclaim motion, as CMU's motion capture database has them.

Layout, text; sections begin with a colon::

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

At rest all bones lie as `direction` says; the frames here are then those of the world. With the bone's axes C, its turn
against the parent is C Rz Ry Rx C^T where the AMC gives rx ry rz: the first one is applied first.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.geometry.euler import matrix_from_turns
from skelgen.model.arrays import Floats
from skelgen_formats.bone_units import LARGEST_MM
from skelgen_formats.text import number_in, read_lines

ROOT = "root"
MM_PER_INCH = 25.4
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


def read_asf(path: Path) -> Asf:
    """Read the bones of an ASF file.

    Raises
    ------
    FormatError
        If the file is not ASF, or its hierarchy is broken; with the line.
    """
    return _Reader(path).read()


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
        for number, line in enumerate(read_lines(self._path), start=1):
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
            raise FormatError(self._path, number, f"a second bone {name!r}")
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
        scale = MM_PER_INCH / self._length
        for name, (angles, order) in self._axes_of.items():
            # the first letter is applied first, so that it is the rightmost factor
            turns = np.array(angles)[["xyz".index(letter) for letter in order[::-1]]] * self._radians
            self._bones[name].axes = matrix_from_turns(order[::-1], turns)
        bones = tuple(self._bones[name] for name in (ROOT, *self._children))
        for bone in bones:
            bone.length *= scale
        return Asf(bones, self._position * scale, scale, self._radians)
