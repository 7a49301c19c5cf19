"""Final joint positions as a table: one row per frame, three columns per joint.

The header names every column with its unit: ``frame,time_s,limb0-limb1_x_mm,...``; a joint is called after its parent
and child limb. Frames count from 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from skelgen.files import replacing
from skelgen.model import Project, Skeleton, Take
from skelgen.progress import SILENT, Monitor, told
from skelgen_formats.finished import finished_project
from skelgen_formats.registry import Format

_TITLE = "Joint positions, CSV"


def joint_names(skeleton: Skeleton) -> tuple[str, ...]:
    """Return a name for each joint, such as ``limb0-limb1`` (parent, child)."""
    return tuple(f"limb{joint.parent}-limb{joint.child}" for joint in skeleton.joints)


def write_joints_csv(value: Project | Take, path: Path, monitor: Monitor = SILENT) -> list[Path]:
    """Write the joint positions of a finished project [mm], to a millionth of a millimetre.

    Raises
    ------
    WriteError
        If the value is no project, or the file cannot be written.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = finished_project(value, _TITLE)
    header = ["frame", "time_s", *(f"{name}_{axis}_mm" for name in joint_names(project.skeleton) for axis in "xyz")]
    rows = told(_rows(project), project.motion.n_frames, monitor)
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as stream:
        stream.write(",".join(header) + "\n")
        stream.writelines(rows)
    return [path]


def _rows(project: Project) -> Iterator[str]:
    motion = project.motion
    row = "%d,%r" + ",%.6f" * (3 * motion.joint_positions.shape[1]) + "\n"
    for frame, (time, positions) in enumerate(zip(motion.times.tolist(), motion.joint_positions, strict=True)):
        yield row % (frame, time, *positions.ravel().tolist())


FORMAT = Format(
    name="joints-csv",
    title=_TITLE,
    suffixes=(".joints.csv", ".csv"),
    holds="joints",
    write=write_joints_csv,
    check=lambda value, options: finished_project(value, _TITLE),
    keeps=("joints",),
    note="One row per frame, three columns per joint, in mm.",
)
