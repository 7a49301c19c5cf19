"""AMC: how the bones of an ASF moved.

Layout, text::

    :FULLY-SPECIFIED
    :DEGREES
    1                                 number of the frame
    root 9.37 17.87 -17.32 -2.02 -7.60 -3.23
    lfemur 4.00 1.20 -13.84           a line for every bone with freedoms, its values in the order of the ASF

The file states no frame rate; CMU's were recorded at 120 Hz.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, InputError, ParameterError
from skelgen.geometry.euler import matrix_from_turns
from skelgen.model.arrays import Floats
from skelgen.model.bones import BoneMotion
from skelgen_formats.asf import ROOT, Asf, AsfBone, read_asf
from skelgen_formats.bone_units import AUTO, LARGEST_MM
from skelgen_formats.registry import Format
from skelgen_formats.text import number_in, read_lines

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
    asf = read_asf(skeleton or _skeleton_of(path))
    values = _frames(path, asf)
    rotations = np.stack([_rotations(bone, values[bone.name], asf) for bone in asf.bones], axis=1)
    index_of = {bone.name: index for index, bone in enumerate(asf.bones)}
    places = np.stack([_places(bone, values[bone.name], asf, index_of) for bone in asf.bones], axis=1)
    stretched = [bone.name for bone in asf.bones if "l" in bone.freedoms]
    said = (f"lengths that change are taken as constant: {', '.join(stretched)}",) if stretched else ()
    return BoneMotion(
        names=tuple(bone.name for bone in asf.bones),
        parents=np.array([index_of.get(bone.parent, -1) for bone in asf.bones], dtype=np.intp),
        rotations=rotations,
        places=places,
        tips=tuple((bone.length * bone.direction)[np.newaxis] for bone in asf.bones),
        rate=RATE,
        name=path.name,
        notices=(*said, f"the file states no frame rate; taken as {RATE:g} Hz unless --motion-rate says otherwise"),
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
    values: dict[str, list[list[float]]] = {name: [] for name in wanted}
    n_frames, last, number = 0, 0.0, 0
    for number, line in enumerate(read_lines(path), start=1):
        words = line.partition("#")[0].split()
        if not words or words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].lstrip("+-").isdigit():
            _check_whole(path, number, values, wanted, n_frames)
            count = number_in(path, number, words[0], "the number of a frame")
            if n_frames and count != last + 1:
                raise FormatError(path, number, f"frame {count:g} follows frame {last:g}; frames are missing")
            n_frames, last = n_frames + 1, count
            continue
        if n_frames == 0:
            raise FormatError(path, number, f"{words[0][:40]!r} before the number of the first frame; this is not AMC")
        if words[0] not in wanted:
            raise FormatError(path, number, f"the skeleton has no bone {words[0][:40]!r}; is it of another ASF?")
        if len(values[words[0]]) == n_frames:
            raise FormatError(path, number, f"{words[0]!r} twice in one frame")
        if len(words) - 1 != wanted[words[0]]:
            count_here, count = len(words) - 1, wanted[words[0]]
            raise FormatError(path, number, f"{count_here} values of {words[0]!r} where the skeleton has {count}")
        row = [number_in(path, number, word, f"a value of {words[0]!r}") for word in words[1:]]
        if any(abs(value) > LARGEST_MM for value in row):
            raise FormatError(path, number, f"a value of {words[0]!r} is larger than anything that moves")
        values[words[0]].append(row)
    _check_whole(path, number, values, wanted, n_frames)
    if n_frames == 0:
        raise FormatError(path, number, "no frame; this is not AMC, or it is cut off")
    return {name: np.array(rows).reshape(n_frames, wanted[name]) for name, rows in values.items()}


def _check_whole(
    path: Path, number: int, values: dict[str, list[list[float]]], wanted: dict[str, int], n_frames: int
) -> None:
    missing = [name for name, count in wanted.items() if count and len(values[name]) < n_frames]
    if missing:
        what = f"the frame before has no line for {missing[0]!r}"
        raise FormatError(path, number, f"{what}; the file may be cut off, or be of another ASF")


def _rotations(bone: AsfBone, values: Floats, asf: Asf) -> Floats:
    """Parent from bone, shape (n_frames, 3, 3); the first turn is applied first."""
    turned = [column for column, freedom in enumerate(bone.freedoms) if freedom.startswith("r")][::-1]
    axes = "".join(bone.freedoms[column][1] for column in turned)
    turns = matrix_from_turns(axes, values[:, turned] * asf.radians)
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


FORMAT = Format(
    name="acclaim",
    title="Acclaim AMC with ASF",
    suffixes=(".amc", ".asf"),
    holds="skeleton",
    read_motion=read_acclaim,
    note="The ASF is looked for beside the AMC; CMU's motions.",
)
