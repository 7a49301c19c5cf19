"""Cal3D skeleton (.xsf) and animation (.xaf), as the XML loaders of Cal3D 0.9 to 1.3 read them.

One bone per limb, parents first; a bone begins at the joint to its parent, a root where its limb's frame has its
origin. Times are in seconds; Cal3D itself knows neither unit nor axis convention. The loaders take two
top-level elements, HEADER and the content, which makes the files no well-formed XML. Comments stand behind these.

Cal3D rotates a vector as v' = q* v q. The files therefore hold the conjugate of the usual quaternion.
"""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from skelgen.files import replacing
from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen.progress import Monitor, with_progress
from skelgen_formats import bones
from skelgen_formats.options import (
    AXES,
    BONE_NAMES,
    RATE,
    UNIT,
    Format,
    Options,
    Writable,
    files_beside,
    moving_project,
    per_mm,
)
from skelgen_formats.writing import choices_in
from skelgen_formats.xml_text import comment_text

_TITLE = "Cal3D"
SKELETON_SUFFIX, ANIMATION_SUFFIX = ".xsf", ".xaf"

_VERSION = 910  # of the 0.9 era: also the later forks accept it
_CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write skeleton and animation beside each other, whichever of the two `path` names."""
    project = moving_project(value, _TITLE)
    bones.check_single_precision(project, _TITLE)  # the loaders silently zero all that follows a number beyond
    skeleton_path, animation_path = files_beside(path, SKELETON_SUFFIX, ANIMATION_SUFFIX)
    comments = (f"<!--{comment_text(sentence)}-->\n" for sentence in choices_in(project))
    with replacing(skeleton_path) as skeleton_file, replacing(animation_path) as animation_file:
        _write_lines(skeleton_file, chain(_skeleton(project.skeleton, options.unit), comments))
        _write_lines(animation_file, _animation(project, options.unit, monitor))


def _write_lines(path: Path, lines: Iterator[str]) -> None:
    with path.open("w", encoding="ascii", errors="xmlcharrefreplace", newline="\n") as stream:
        stream.writelines(lines)


def _skeleton(skeleton: Skeleton, unit: str) -> Iterator[str]:
    reference_pose = bones.scaled_poses(skeleton.reference_pose, per_mm(unit))
    order, names = skeleton.outward.tolist(), bones.bone_names(skeleton, bones.COLON)
    bone_of_limb = {limb: bone for bone, limb in enumerate(order)} | {-1: -1}
    yield f'<HEADER MAGIC="XSF" VERSION="{_VERSION}"/>\n<SKELETON NUMBONES="{len(order)}">\n'
    for bone, limb in enumerate(order):
        parent = int(skeleton.parents[limb])
        children = [bone_of_limb[child] for child in order if skeleton.parents[child] == limb]
        yield f'<BONE ID="{bone}" NAME="{names[limb]}" NUMCHILDS="{len(children)}">\n'
        # text of the bind pose relative to the parent, and of its inverse in the world, which skinned vertices need
        translation, rotation = bones.bone_transforms(reference_pose, parent, limb)
        bone_from_world = reference_pose[limb, :3, :3].T
        yield _element("TRANSLATION", translation)
        yield _element("ROTATION", bones.xyzw_from_matrix(rotation) * _CONJUGATE)
        yield _element("LOCALTRANSLATION", -bone_from_world @ reference_pose[limb, :3, 3])
        yield _element("LOCALROTATION", bones.xyzw_from_matrix(bone_from_world) * _CONJUGATE)
        yield f"<PARENTID>{bone_of_limb[parent]}</PARENTID>\n"
        yield from (f"<CHILDID>{child}</CHILDID>\n" for child in children)
        yield "</BONE>\n"
    yield "</SKELETON>\n"


def _animation(project: Project, unit: str, monitor: Monitor) -> Iterator[str]:
    skeleton, motion = project.skeleton, project.motion
    world_from_limb = bones.scaled_poses(motion.world_from_limb, per_mm(unit))
    order = skeleton.outward.tolist()
    times = [f"{time:.9g}" for time in motion.times]
    duration = times[-1] if motion.n_frames > 1 else f"{1 / motion.rate:.9g}"  # zero is refused by the loaders
    key = f'<KEYFRAME TIME="%s">\n{_template("TRANSLATION", 3)}{_template("ROTATION", 4)}</KEYFRAME>\n'
    yield f'<HEADER MAGIC="XAF" VERSION="{_VERSION}"/>\n<ANIMATION NUMTRACKS="{len(order)}" DURATION="{duration}">\n'
    for bone, limb in enumerate(with_progress(order, len(order), monitor, every=1)):
        translations, rotations = bones.bone_transforms(world_from_limb, int(skeleton.parents[limb]), limb)
        numbers = np.concatenate([translations, bones.xyzw_from_matrix(rotations) * _CONJUGATE], axis=1)
        yield f'<TRACK BONEID="{bone}" NUMKEYFRAMES="{motion.n_frames}">\n'
        yield from (key % (time, *row) for time, row in zip(times, numbers.tolist(), strict=True))
        yield "</TRACK>\n"
    yield "</ANIMATION>\n"


def _element(name: str, numbers: Floats) -> str:
    return _template(name, len(numbers)) % tuple(numbers.tolist())


def _template(name: str, length: int) -> str:
    places = " ".join(["%.9g"] * length)  # nine digits determine every single-precision number
    return f"<{name}>{places}</{name}>\n"


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    return (f"Cal3D files name neither unit nor axes: remember that lengths are in {options.unit}.",)


FORMAT = Format(
    name="cal3d",
    title="Cal3D skeleton and animation",
    suffixes=(SKELETON_SUFFIX, ANIMATION_SUFFIX),
    holds="skeleton",
    write=_write,
    check=lambda value, options: moving_project(value, _TITLE),
    files=lambda path, options: files_beside(path, SKELETON_SUFFIX, ANIMATION_SUFFIX),
    keeps=("joints", "motion"),
    marks_open="comments at the end of the skeleton",
    remarks=_remarks,
    options=(AXES, UNIT, RATE, BONE_NAMES),
    note="Two files are written, .xsf and .xaf.",
)
