"""Final joint positions as a table: one row per frame, three columns per joint.

The header names every column with its unit: ``frame,time_s,limb0-limb1_x_mm,...``; a joint is called after its parent
and child limb. Frames count from 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from skelgen.model import Project, Skeleton, Take
from skelgen.progress import SILENT, Monitor, with_progress
from skelgen_formats.csv_rows import write_csv
from skelgen_formats.digits import fixed_rows
from skelgen_formats.finished import finished_project
from skelgen_formats.markers import MM_PER_UNIT
from skelgen_formats.registry import Format
from skelgen_formats.world import AXES, RATE, UNIT, per_mm

_DECIMALS_OF_MM = 6
_CHUNK_FRAMES = 2000
_TITLE = "Joint positions, CSV"


def joint_names(skeleton: Skeleton) -> tuple[str, ...]:
    """Return a name for each joint, such as ``limb0-limb1`` (parent, child)."""
    return tuple(f"limb{joint.parent}-limb{joint.child}" for joint in skeleton.joints)


def write_joints_csv(value: Project | Take, path: Path, unit: str = "mm", monitor: Monitor = SILENT) -> list[Path]:
    """Write the joint positions of a finished project, to a millionth of a millimetre.

    Raises
    ------
    WriteError
        If the value is no project, or the file cannot be written.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = finished_project(value, _TITLE)
    header = ["frame", "time_s", *(f"{name}_{axis}_{unit}" for name in joint_names(project.skeleton) for axis in "xyz")]
    rows = with_progress(_rows(project, unit), project.motion.n_frames, monitor)
    write_csv(path, header, rows)
    return [path]


def _rows(project: Project, unit: str) -> Iterator[str]:
    motion = project.motion
    decimals = _DECIMALS_OF_MM + round(math.log10(MM_PER_UNIT[unit]))
    for first in range(0, motion.n_frames, _CHUNK_FRAMES):
        frames = slice(first, first + _CHUNK_FRAMES)
        joints = motion.joint_positions[frames] * per_mm(unit)
        rows = fixed_rows(joints.reshape(len(joints), -1), decimals)
        for frame, (time, row) in enumerate(zip(motion.times[frames].tolist(), rows, strict=True), first):
            yield f"{frame},{time!r}{row}\n"


FORMAT = Format(
    name="joints-csv",
    title=_TITLE,
    suffixes=(".joints.csv", ".csv"),
    holds="joints",
    write=write_joints_csv,
    check=lambda value, options: finished_project(value, _TITLE),
    keeps=("joints",),
    options=(AXES, UNIT, RATE),
    note="One row per frame, three columns per joint.",
)
