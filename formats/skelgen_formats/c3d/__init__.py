"""C3D, the exchange format of motion capture: read and written as takes, and written with joints as virtual points.

`layout` is what a file states of itself, `reader` reads its points, `writer` writes them as a stream. ezc3d is not used
because it trusts headers: a single damaged byte can end the whole process or fill the memory, which no caller can
catch, it stops after 65535 frames, and it keeps every array that it is given. The tests compare with it, and with the
package `c3d`.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from skelgen.model import Project
from skelgen.model.filled import Filled, PositionSource
from skelgen.model.placed_joints import place_of
from skelgen.progress import Monitor
from skelgen_formats.c3d.companions import companions_of
from skelgen_formats.c3d.layout import MAGIC, MOST_HEADER_FRAMES
from skelgen_formats.c3d.reader import read_c3d
from skelgen_formats.c3d.writer import write_points
from skelgen_formats.options import (
    AXES,
    BODIES,
    FILLED,
    POINTS,
    RATE,
    RECORDED_UNIT,
    UNIT,
    Format,
    Options,
    Writable,
    finished_project,
)
from skelgen_formats.writing import (
    check_markers,
    marker_files,
    markers_to_write,
    positions_of,
    trajectories_of,
    write_table,
)

__all__ = ["C3D", "C3D_JOINTS", "read_c3d"]

_TITLE, _JOINTS_TITLE = "C3D", "C3D with joints"
_FIRST_PRINTABLE = 0x20  # block numbers lie below; above, "P" as second byte is text


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write labelled markers as C3D: f32, unseen markers with residual -1.

    What else the C3D file held that they were read from, events, analogue values and force plates, is written with them
    as long as the frames are the same. Filled positions have residual 0 and no camera, as c3d.org has it for points
    that are not measured; measured ones then have residual 1 and camera 1: nobody knows which cameras saw them.
    """
    markers = markers_to_write(value, _TITLE, options.filled, monitor)
    take = positions_of(markers)
    origin = take.origin
    if isinstance(value, Project):
        origin = value.source.path if value.source is not None else getattr(value.take, "origin", "")
    companions = companions_of(replace(take, origin=origin), options.axes, options.unit)
    write_points(take, path, options.unit, markers.source if isinstance(markers, Filled) else None, companions)
    write_table(markers, path)


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    take = trajectories_of(project, _TITLE)
    ends = (extreme.reduce(take.positions, axis=None, initial=0.0) for extreme in (np.fmin, np.fmax))
    far = max(map(abs, ends))
    rounded = f"Positions are rounded to single precision, to {np.spacing(np.float32(far)):.1g} mm."
    cut = f"Some programs show only the first {MOST_HEADER_FRAMES} of the {take.n_frames} frames of a C3D file."
    return (rounded, cut) if take.n_frames > MOST_HEADER_FRAMES else (rounded,)


C3D = Format(
    name="c3d",
    title=_TITLE,
    suffixes=(".c3d",),
    holds="markers",
    sniff=lambda head, path: len(head) > 1 and head[1] == MAGIC and 0 < head[0] < _FIRST_PRINTABLE,
    read=lambda path, options: read_c3d(path, options.points, options.bodies, options.sample, options.recorded_unit),
    write=_write,
    check=lambda value, options: check_markers(value, _TITLE, options.filled),
    files=lambda path, options: marker_files(path, options.filled),
    keeps=("markers", "names"),
    remarks=_remarks,
    filled_mark="filled positions have residual 0 and no camera, measured ones residual 1 and one camera",
    options=(POINTS, BODIES, RECORDED_UNIT, AXES, UNIT, RATE, FILLED),
    note="A point is unseen where its residual is below 0 or it lies at 0, 0, 0. When read, units are those of the "
    "file, outputs of models are left out, and rotations, as Theia writes them, are bodies.",
)


def _write_joints(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write measured markers and joints as the points of a C3D file.

    Joints have residual 0 and no camera, as c3d.org has it for points that are computed; measured markers have residual
    1 and camera 1, unseen ones residual -1. Joints whose place the motion does not determine say so in their
    descriptions, POINT:DESCRIPTIONS.
    """
    project = finished_project(value, _JOINTS_TITLE)
    markers, joints = project.trajectories, project.motion.joint_positions
    points = replace(
        markers,
        positions=np.concatenate([markers.positions, joints], axis=1),
        names=(*markers.names, *project.skeleton.joint_names),
    )
    measured = np.where(markers.seen, PositionSource.MEASURED, PositionSource.NONE)
    computed = np.full(joints.shape[:2], PositionSource.JOINT)
    marks = [place_of(joint).remark for joint in project.skeleton.joints]
    descriptions = [""] * markers.n_markers + marks
    write_points(points, path, options.unit, np.concatenate([measured, computed], axis=1), descriptions=descriptions)


def _remarks_on_joints(project: Project, options: Options) -> tuple[str, ...]:
    kinds_of_points = "Joints have residual 0 and no camera, measured markers residual 1 and one camera."
    return (kinds_of_points, *C3D.remarks(project, options))


C3D_JOINTS = Format(
    name="c3d-joints",
    title=_JOINTS_TITLE,
    suffixes=(".joints.c3d",),
    holds="joints",
    write=_write_joints,
    check=lambda value, options: finished_project(value, _JOINTS_TITLE),
    keeps=("markers", "names", "joints"),
    marks_open="description of the point, in `POINT:DESCRIPTIONS`",
    remarks=_remarks_on_joints,
    options=(AXES, RATE, UNIT),
    note="Markers as measured, and the joints' centres as virtual points named after parent and child limb.",
)
