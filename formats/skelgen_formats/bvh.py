"""BVH: a tree of bones with their angles in every frame, as Biovision wrote it and most programs read it.

Layout, text::

    HIERARCHY
    ROOT limb0                                    the root's position and rotation are its six channels
    {
      OFFSET 0 0 0
      CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
      JOINT limb1
      {
        OFFSET 0 0 350                            the joint in the parent's frame, which at rest has the world's axes
        CHANNELS 3 Zrotation Xrotation Yrotation  degrees; the rotation in the parent is Rz Rx Ry
        End Site                                  where a bone ends that carries no other
        {
          OFFSET 0 0 300
        }
      }
    }
    MOTION
    Frames: 2
    Frame Time: 0.01
    ...                                           one line per frame, the channels in the order of the hierarchy

Programs disagree on whether the position channels of a bone are added to its OFFSET or replace it: bones that have
them are written with an OFFSET of zero, where both are the same. Several roots hang on one that stays still, called
``world``, since many programs read the first root only.
"""

import math
from collections.abc import Container, Iterator
from pathlib import Path

import numpy as np

from skelgen.files import replacing
from skelgen.geometry.rotations import euler_angles
from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen.progress import Monitor, with_progress
from skelgen_formats.bones import COLON, bone_names, bone_tip, bone_transforms, free_limbs, lost_in_animations
from skelgen_formats.bvh_reader import read_bvh
from skelgen_formats.options import (
    AXES,
    BONE_NAMES,
    MM_PER_UNIT,
    RATE,
    REST,
    UNIT,
    Format,
    Options,
    Writable,
    moving_project,
    per_mm,
)

_TITLE = "BVH"
_WORLD = "world"
_WORLD_LIMB = -1
_TURNS = "Zrotation Xrotation Yrotation"
_PLACES = "Xposition Yposition Zposition"
_DECIMALS_OF_MM = 6
_DECIMALS_OF_DEGREES = 7  # 2e-9 rad: on a chain of a hundred metres less than a thousandth of a millimetre


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write skeleton and motion of a finished project, every root with its place, every joint with three angles."""
    project = moving_project(value, _TITLE)
    rows = with_progress(_rows(project, options.unit), project.motion.n_frames, monitor)
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as stream:
        stream.writelines(f"{line}\n" for line in _hierarchy(project, options.unit))
        stream.write(f"MOTION\nFrames: {project.motion.n_frames}\nFrame Time: {1 / project.motion.rate:.12g}\n")
        stream.writelines(rows)


def _hierarchy(project: Project, unit: str) -> Iterator[str]:
    yield "HIERARCHY"
    skeleton, free = project.skeleton, free_limbs(project.skeleton, project.motion.world_from_limb)
    # each joint in its parent's bone [mm], shape (n_limbs, 3), in the axes of the world at rest; zero of free limbs
    offsets = np.zeros((skeleton.n_limbs, 3))
    for joint in (one for one in skeleton.joints if one.child not in free):
        offsets[joint.child] = skeleton.reference_pose[joint.parent, :3, :3] @ joint.position_in_parent
    offsets = offsets * per_mm(unit)
    if len(skeleton.roots) > 1:
        yield from (f"ROOT {_WORLD}", "{", f"  OFFSET 0 0 0\n  CHANNELS 6 {_PLACES} {_TURNS}")
    for root in skeleton.roots.tolist():
        yield from _bone(skeleton, offsets, root, "" if len(skeleton.roots) == 1 else "  ", unit, free)
    if len(skeleton.roots) > 1:
        yield "}"


def _bone(
    skeleton: Skeleton, offsets: Floats, limb: int, margin: str, unit: str, free: Container[int]
) -> Iterator[str]:
    word = "JOINT" if margin else "ROOT"
    channels = f"6 {_PLACES} {_TURNS}" if limb in free else f"3 {_TURNS}"
    yield from (f"{margin}{word} {bone_names(skeleton, COLON)[limb]}", margin + "{")
    yield f"{margin}  OFFSET {_place(offsets[limb], unit)}"
    yield f"{margin}  CHANNELS {channels}"
    children = np.flatnonzero(skeleton.parents == limb).tolist()
    for child in children:
        yield from _bone(skeleton, offsets, child, margin + "  ", unit, free)
    if not children:
        tip = skeleton.reference_pose[limb, :3, :3] @ bone_tip(skeleton, limb) * per_mm(unit)
        yield from (f"{margin}  End Site", f"{margin}  {{", f"{margin}    OFFSET {_place(tip, unit)}", f"{margin}  }}")
    yield margin + "}"


def _rows(project: Project, unit: str) -> Iterator[str]:
    skeleton, motion = project.skeleton, project.motion
    world_from_bone = motion.world_from_limb.copy()
    world_from_bone[..., :3, :3] = motion.rotations @ skeleton.reference_pose[:, :3, :3].swapaxes(-1, -2)
    columns, template, free = [], [], free_limbs(skeleton, motion.world_from_limb)
    for limb in _downward(skeleton):
        if limb == _WORLD_LIMB:
            columns.append(np.zeros((motion.n_frames, 6)))
            template.append(" ".join(["%g"] * 6))
            continue
        place, turn = bone_transforms(world_from_bone, int(skeleton.parents[limb]), limb)
        if limb in free:
            columns.append(place * per_mm(unit))
            template.append(_template(unit))
        columns.append(np.rad2deg(euler_angles("ZXY", turn)))
        template.append(" ".join([f"%.{_DECIMALS_OF_DEGREES}f"] * 3))
    row = " ".join(template) + "\n"
    for numbers in np.concatenate(columns, axis=1):
        yield row % tuple(numbers.tolist())


def _downward(skeleton: Skeleton) -> Iterator[int]:
    """Limbs in the order of the hierarchy's lines; the world first where it is written."""
    if len(skeleton.roots) > 1:
        yield _WORLD_LIMB
    waiting = skeleton.roots.tolist()[::-1]
    while waiting:
        limb = waiting.pop()
        yield limb
        waiting.extend(np.flatnonzero(skeleton.parents == limb).tolist()[::-1])


def _place(place: Floats, unit: str) -> str:
    return _template(unit) % tuple(place.tolist())


def _template(unit: str) -> str:
    decimals = _DECIMALS_OF_MM + round(math.log10(MM_PER_UNIT[unit]))
    return " ".join([f"%.{decimals}f"] * 3)


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    unit = options.unit
    remarks = [f"BVH files name neither unit nor axes: lengths are in {unit}; most programs take y to be up."]
    if len(project.skeleton.roots) > 1:
        remarks.append(f"{len(project.skeleton.roots)} bodies hang on one root, {_WORLD!r}, that stays still.")
    return (*remarks, *lost_in_animations(project, _TITLE))


FORMAT = Format(
    name="bvh",
    title="BVH",
    suffixes=(".bvh",),
    holds="skeleton",
    read_motion=read_bvh,
    write=_write,
    check=lambda value, options: moving_project(value, _TITLE),
    keeps=("joints", "motion"),
    remarks=_remarks,
    options=(AXES, UNIT, RATE, BONE_NAMES, REST),
    note="One file; several roots hang on one that stays still. Read with channels in any order.",
)
