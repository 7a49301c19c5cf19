"""C3D with the joints' centres as virtual points behind the markers, as programs for gait have theirs.

Joints have residual 0 and no camera, as c3d.org has it for points that are computed; measured markers have residual 1
and camera 1, unseen ones residual -1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.model import Project, Take
from skelgen.model.filled import Source
from skelgen.progress import SILENT, Monitor
from skelgen_formats.c3d import FORMAT as C3D
from skelgen_formats.c3d import write_points
from skelgen_formats.finished import finished_project
from skelgen_formats.joints_csv import joint_names
from skelgen_formats.registry import Format
from skelgen_formats.world import AXES, RATE, UNIT

_TITLE = "C3D with joints"


def write_c3d_joints(value: Project | Take, path: Path, unit: str = "mm", monitor: Monitor = SILENT) -> list[Path]:
    """Write measured markers and joints as the points of a C3D file.

    Raises
    ------
    WriteError
        If the value is no project, a marker is called like a joint, or as for C3D.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = finished_project(value, _TITLE)
    markers, joints = project.trajectories, project.motion.joint_positions
    points = replace(
        markers,
        positions=np.concatenate([markers.positions, joints], axis=1),
        names=(*markers.names, *joint_names(project.skeleton)),
    )
    measured = np.where(markers.seen, Source.MEASURED, Source.NONE)
    computed = np.full(joints.shape[:2], Source.JOINT)
    write_points(points, path, unit, np.concatenate([measured, computed], axis=1))
    return [path]


def _remarks(project: Project, options: Mapping[str, Any]) -> tuple[str, ...]:
    told_apart = "Joints have residual 0 and no camera, measured markers residual 1 and one camera."
    return (told_apart, *C3D.remarks(project, options))


FORMAT = Format(
    name="c3d-joints",
    title=_TITLE,
    suffixes=(".joints.c3d",),
    holds="joints",
    write=write_c3d_joints,
    check=lambda value, options: finished_project(value, _TITLE),
    keeps=("markers", "names", "joints"),
    remarks=_remarks,
    options=(AXES, RATE, UNIT),
    note="Markers as measured, and the joints' centres as virtual points named after parent and child limb.",
)
