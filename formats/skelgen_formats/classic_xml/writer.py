"""Write the classic XML file as a stream, one frame in memory at a time.

The text is made from prepared rows rather than element by element: a 10,000-frame take has five million elements. The
tests parse every file with a strict XML parser.
"""

import functools
import itertools
import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen.progress import Monitor, with_progress
from skelgen_formats.bones import bone_transforms, xyzw_from_matrix
from skelgen_formats.classic_xml.contents import JointStats, MarkerDistance
from skelgen_formats.options import Options, Writable, finished_project
from skelgen_formats.xml_text import quoted

ROOT = "MotionCapture"
TITLE = "Skeleton and motion, XML"
VERSION = "1"
MOTION, JOINTS, ALL = "motion", "joints", "all"
"""How much is written of every frame: poses; joints as well; markers as well, and all digits of all numbers."""

_LEFT_OUT_BONE = -1
_EXACT, _SHORT = "%r", "%.9g"  # all digits of a double; a millionth of a millimetre within ten metres

BY_MARKER_SET = "marker set"
"""What the attribute ``PLACEDBY`` says of joints that the marker set places."""

DEVIATIONS = {
    "COVARIANCE": "covariance",
    "COVARIANCEINBONE": "covariance_in_child",
    "AXISSTANDARDDEVIATION": "axis_std",
    "SECONDAXISSTANDARDDEVIATION": "second_axis_std",
    "TURNCOVARIANCE": "turn_covariance",
}
"""Vectors of a ``JOINT`` beyond those of the thesis, and the fields of `skelgen.model.Joint`; only where estimated."""

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0, production 2 (Char)
_ELEMENT = re.compile('<vec_elem val="([^"]+)" pos="[0-9]+"/>')
_PROGRESS_EVERY = 1000  # texts, of which some thousands are written per second
_CHUNK_FRAMES = 500  # frames whose numbers are Python objects at one time: 500 x 40 x 3 of them are about 2 MB


def write_classic_xml(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write a finished project; the file is described in `skelgen_formats.classic_xml`.

    Parameters
    ----------
    value : Project
        Finished.
    path : Path
        The file.
    options : Options
        Of the format.
    monitor : Monitor
        Shows progress; may cancel.

    Raises
    ------
    WriteError
        If the value is another one, a name cannot be written, or the file.
    MissingResultError
        If a stage has not run whose result is written.
    """
    project, detail = finished_project(value, TITLE), options.xml_detail
    counts = project.trajectories.n_frames, len(project.topology.raw_joint_positions), project.motion.n_frames
    if len(set(counts)) > 1:
        raise WriteError(f"{path}: markers, raw joints and motion have {counts} frames; they must have the same number")
    header = _header(project, path, detail)
    skeleton, motion, number = project.skeleton, project.motion, _EXACT if detail == ALL else _SHORT
    raw, final = (
        _joints(skeleton, at, number) for at in (project.topology.raw_joint_positions, motion.joint_positions)
    )
    joints: tuple[Iterable[str], ...] = (
        *(["<RawJointPositions>\n"], raw, ["</RawJointPositions>\n"]),
        *(["<FinalJointPositions>\n<JointPositions>\n"], final, ["</JointPositions>\n</FinalJointPositions>\n"]),
    )
    parts: tuple[Iterable[str], ...] = (
        *(_stats(project), _skeleton(project, path), _animation(project, number)),
        *(() if detail == MOTION else joints),
        *(["<MarkerPositions>\n"], _offsets(skeleton), _frames(project) if detail == ALL else ()),
        [f"</MarkerPositions>\n</{ROOT}>\n"],
    )
    # texts of a frame: a key per limb, raw and final joints, markers limb by limb
    n_joint_rows = 0 if detail == MOTION else 2 * skeleton.n_joints
    n_marker_rows = len(_bones(skeleton)) + 1 if detail == ALL else 0
    n_rows = motion.n_frames * (skeleton.n_limbs + n_joint_rows + n_marker_rows)
    texts = with_progress(itertools.chain.from_iterable(parts), n_rows, monitor, _PROGRESS_EVERY)
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(header)
        stream.writelines(map(_compacted, texts) if options.compact else texts)


def _compacted(text: str) -> str:
    """Text with the numbers of each vector side by side; a nanometre is the tenth digit of a take within ten metres."""
    numbers = _ELEMENT.sub(lambda found: f"{float(found[1]):.10g} ", text)
    return numbers.replace(" </vector>", "</vector>")


def _header(project: Project, path: Path, detail: str) -> str:
    limb_of_marker = project.skeleton.limb_of_marker.tolist()
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<{ROOT} version="{VERSION}" unit="mm" time_unit="s" quaternion="x y z w" root_track="world"'
        f' detail="{detail}" rate="{project.motion.rate!r}" take={_quoted(project.name, path)}>',
        "<MarkerNames>",
        *(
            f'<MarkerName id="{index}" name={_quoted(name, path)} bone="{bone}"/>'
            for index, (name, bone) in enumerate(zip(project.trajectories.names, limb_of_marker, strict=True))
        ),
        "</MarkerNames>",
    ]
    return "\n".join(lines) + "\n"


def _quoted(text: str, path: Path) -> str:
    if _NOT_XML.search(text):
        raise WriteError(f"{path}: the name {text!r} holds a character that XML forbids; rename it first")
    return quoted(text)


def _stats(project: Project) -> Iterator[str]:
    yield "<StatsElements>\n"
    for stats in joint_stats(project):
        bones = f'SecondBone="{stats.second_bone}" FirstBone="{stats.first_bone}"'
        yield f'<Joint {bones} Alpha="{_number(stats.alpha)}">\n'
        yield f"<DistanceStats>\n{_distances('FirstBone', stats.first)}{_distances('SecondBone', stats.second)}"
        numbers = f'NumberOfIterations="{stats.n_iterations}" FuncValueAtSolution="{_number(stats.value)}"'
        yield f"</DistanceStats>\n<CalculationStats {numbers}/>\n</Joint>\n"
    yield "</StatsElements>\n"


def _distances(tag: str, distances: tuple[MarkerDistance, ...]) -> str:
    rows = (
        f'<MarkerDistToJoint MarkerId="{one.marker}" AverageDist="{one.mean!r}" Sigma="{one.sigma!r}"/>\n'
        for one in distances
    )
    return f"<{tag}>\n{''.join(rows)}</{tag}>\n"


def _skeleton(project: Project, path: Path) -> Iterator[str]:
    skeleton = project.skeleton
    joint_of_child = {joint.child: joint for joint in skeleton.joints}
    yield f'<SkeletonAndAnimation>\n<SKELETON NUMBONES="{skeleton.n_limbs}">\n'
    for limb in skeleton.outward.tolist():
        name = _quoted(skeleton.limb_names[limb], path)
        yield f'<BONE PARENT="{skeleton.parents[limb]}" BONEID="{limb}" NAME={name}>\n'
        yield _bind_pose(skeleton, limb)
        if limb in joint_of_child:
            joint = joint_of_child[limb]
            name = _quoted(skeleton.joint_name(joint), path)
            placed = f' PLACEDBY="{BY_MARKER_SET}"' if joint.is_placed_by_marker_set else ""
            known = f'OPENDIRECTIONS="{joint.open_directions}" USUALDIRECTIONS="{joint.usual_directions}"'
            yield f'<JOINT KIND="{joint.kind}" {known}{placed} NAME={name}>\n'
            yield _row("POSITIONINPARENT", joint.position_in_parent)
            yield _row("POSITIONINBONE", joint.position_in_child)
            yield _row("STANDARDDEVIATION", joint.std)
            yield "" if joint.axis is None else _row("AXIS", joint.axis)
            yield "" if joint.second_axis is None else _row("SECONDAXIS", joint.second_axis)
            for tag, name in DEVIATIONS.items():
                value = getattr(joint, name)
                yield "" if value is None else _row(tag, value.ravel())
            yield "</JOINT>\n"
        yield "</BONE>\n"
    yield "</SKELETON>\n"


def _bind_pose(skeleton: Skeleton, limb: int) -> str:
    parent, pose = int(skeleton.parents[limb]), skeleton.reference_pose[limb]
    translation, rotation = bone_transforms(skeleton.reference_pose, parent, limb)
    if parent < 0:
        translation = np.zeros(3)  # as in the thesis; where the root stands is in LOCALTRANSLATION
    bone_from_world = pose[:3, :3].T
    return (
        _row("TRANSLATION", translation)
        + _row("ROTATION", xyzw_from_matrix(rotation))
        + _row("LOCALTRANSLATION", -bone_from_world @ pose[:3, 3])
        + _row("LOCALROTATION", xyzw_from_matrix(bone_from_world))
    )


def _animation(project: Project, number: str) -> Iterator[str]:
    skeleton, motion = project.skeleton, project.motion
    times = motion.times.tolist()
    vectors = f"{_template('TRANSLATION', 3, number)}{_template('ROTATION', 4, number)}"
    key = f'<KEYFRAME FRAMEID="%d" TIME="{number}"%s>\n{vectors}</KEYFRAME>\n'
    yield "<ANIMATION>\n"
    for limb in skeleton.outward.tolist():
        translations, rotations = bone_transforms(motion.world_from_limb, int(skeleton.parents[limb]), limb)
        numbers = np.concatenate([translations, xyzw_from_matrix(rotations)], axis=1)
        yield f'<TRACK NUMKEYFRAMES="{motion.n_frames}" BONEID="{limb}">\n'
        for frame, row in _rows(numbers):
            mark = "" if motion.limb_seen[frame, limb] else ' SEEN="0"'
            yield key % (frame, times[frame], mark, *row)
        yield "</TRACK>\n"
    yield "</ANIMATION>\n</SkeletonAndAnimation>\n"


def _joints(skeleton: Skeleton, positions: Floats, number: str) -> Iterator[str]:
    vector = _template("%d", 3, number)
    known = f'<JointFrame FrameIndex="%d">\n{vector}</JointFrame>\n'
    for index, joint in enumerate(skeleton.joints):
        tag = f"joint{joint.parent}-{joint.child}"
        yield f"<{tag}>\n"
        for frame, row in _rows(positions[:, index]):
            yield f'<JointFrame FrameIndex="{frame}"/>\n' if math.isnan(row[0]) else known % (frame, frame, *row)
        yield f"</{tag}>\n"


def _offsets(skeleton: Skeleton) -> Iterator[str]:
    centers = centers_of_mass(skeleton)
    yield "<MarkerOffsets>\n"
    for limb, markers in _bones(skeleton):
        if limb == _LEFT_OUT_BONE:
            continue
        yield f'<Bone id="{limb}">\n'
        yield "" if np.isnan(centers[limb]).any() else _row("CenterOfMass", centers[limb])
        for marker in markers:
            offset = skeleton.marker_offsets[marker] - centers[limb]
            mark = f'id="{marker}" Sigma="{_number(skeleton.marker_std[marker])}"{_sureness(skeleton, marker)}'
            mark += ' name="Offset"'
            yield "" if np.isnan(offset).any() else _vector(mark, 3) % tuple(offset.tolist())
        yield "</Bone>\n"
    yield "</MarkerOffsets>\n"


def _sureness(skeleton: Skeleton, marker: int) -> str:
    """Attributes with the noise of a marker and the standard deviation of its place, where they were estimated."""
    if skeleton.offset_std is None or skeleton.marker_noise is None:
        return ""
    stds = " ".join(_number(value) for value in skeleton.offset_std[marker].tolist())
    return f' Noise="{_number(skeleton.marker_noise[marker])}" StandardDeviation="{stds}"'


def _frames(project: Project) -> Iterator[str]:
    bones = _bones(project.skeleton)
    reconstructed, tracked = _rows(project.motion.marker_positions), _rows(project.trajectories.positions)
    for (frame, finals), (_, originals) in zip(reconstructed, tracked, strict=True):
        yield f'<Frame FrameIndex="{frame}">\n'
        for limb, markers in bones:
            rows = "".join(_marker(marker, finals[marker], originals[marker]) for marker in markers)
            yield f'<Bone id="{limb}">\n{rows}</Bone>\n'
        yield "</Frame>\n"


def _marker(marker: int, final: list[float], original: list[float]) -> str:
    """Text of one marker in one frame; NaN is unseen, or not reconstructed, and carries no vector."""
    first = "" if math.isnan(final[0]) else _template("FinalMarkerPosition", 3) % tuple(final)
    second = "" if math.isnan(original[0]) else _template("OrgMarkerPosition", 3) % tuple(original)
    return f'<Marker id="{marker}">\n{first}{second}</Marker>\n'


def _bones(skeleton: Skeleton) -> list[tuple[int, list[int]]]:
    """Limbs with their markers, and those that are left out under bone -1, if there are any."""
    bones = [(limb, skeleton.markers_of(limb).tolist()) for limb in skeleton.outward.tolist()]
    left_out = skeleton.markers_of(_LEFT_OUT_BONE).tolist()
    return [(limb, markers) for limb, markers in [*bones, (_LEFT_OUT_BONE, left_out)] if markers]


def _rows(numbers: Floats) -> Iterator[tuple[int, Any]]:
    """Frame index and numbers of each frame as plain floats, which Python writes faster than NumPy's."""
    for start in range(0, len(numbers), _CHUNK_FRAMES):
        yield from enumerate(numbers[start : start + _CHUNK_FRAMES].tolist(), start)


def _number(value: float) -> str:
    return "NaN" if math.isnan(value) else repr(float(value))


def _row(name: str, numbers: Floats) -> str:
    return _template(name, len(numbers)) % tuple(numbers.tolist())


@functools.cache
def _template(name: str, length: int, number: str = _EXACT) -> str:
    return _vector(f'name="{name}"', length, number)


def _vector(marks: str, length: int, number: str = _EXACT) -> str:
    """Text of a vector element with a place for each number."""
    elements = "".join(f'<vec_elem val="{number}" pos="{pos}"/>' for pos in range(length))
    return f'<vector length="{length}" {marks}>{elements}</vector>\n'


def joint_stats(project: Project) -> tuple[JointStats, ...]:
    """Return the statistics of every joint, in the order of the topology's children."""
    topology = project.topology
    return tuple(
        JointStats(
            first_bone=int(parent),
            second_bone=int(child),
            alpha=topology.final_alpha,
            first=_marker_distances(project, int(parent), joint),
            second=_marker_distances(project, int(child), joint),
            n_iterations=int(topology.n_iterations[joint]),
            value=float(topology.values[joint]),
        )
        for joint, (parent, child) in enumerate(topology.edges)
    )


def centers_of_mass(skeleton: Skeleton) -> Floats:
    """Return the mean of each limb's marker offsets [mm] in the limb's frame, NaN without markers, (n_limbs, 3)."""
    centers = np.full((skeleton.n_limbs, 3), np.nan)
    for limb in range(skeleton.n_limbs):
        offsets = skeleton.marker_offsets[skeleton.markers_of(limb)]
        known = offsets[~np.isnan(offsets).any(axis=1)]
        if len(known):
            centers[limb] = known.mean(axis=0)
    return centers


def _marker_distances(project: Project, limb: int, joint: int) -> tuple[MarkerDistance, ...]:
    """Mean and deviation of the distance to the raw joint [mm] of each marker on a limb, frames with both known."""
    found = []
    for marker in project.skeleton.markers_of(limb).tolist():
        apart = project.trajectories.positions[:, marker] - project.topology.raw_joint_positions[:, joint]
        distances = np.linalg.norm(apart, axis=1)
        known = distances[~np.isnan(distances)]
        if len(known):
            found.append(MarkerDistance(marker, float(known.mean()), float(known.std())))
    return tuple(found)
