"""Joint positions and joint angles as tables: one row per frame, columns with their units in the header.

Positions: ``frame,time_s,limb0-limb1_x_mm,...``, three columns per joint. Angles:
``frame,time_s,limb0-limb1_turn_deg,limb0-limb1_turn_std_deg,...``, two columns per angle; a
joint is called after its parent and child limb. A hinge has ``turn``, a universal joint ``first`` and ``second`` (about
the axis in the parent, then in the child), other joints ``x``, ``y`` and ``z`` (rotation vector in the parent's axes),
rigid ones nothing. Angles are 0 in the reference pose. Frames count from 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from skelgen.files import replacing
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen.progress import SILENT, Monitor, with_progress
from skelgen_formats.bones import joint_names
from skelgen_formats.digits import fixed_rows
from skelgen_formats.options import AXES, MM_PER_UNIT, RATE, UNIT, Writable, per_mm
from skelgen_formats.parts import finished_project
from skelgen_formats.registry import Format

_DECIMALS_OF_MM = 6
_JOINT_CHUNK = 2000
_JOINTS_TITLE = "Joint positions, CSV"


def write_joints_csv(value: Writable, path: Path, unit: str = "mm", monitor: Monitor = SILENT) -> list[Path]:
    """Write the joint positions of a finished project, to a millionth of a millimetre.

    Raises
    ------
    WriteError
        If the value is no project, or the file cannot be written.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = finished_project(value, _JOINTS_TITLE)
    header = ["frame", "time_s", *(f"{name}_{axis}_{unit}" for name in joint_names(project.skeleton) for axis in "xyz")]
    rows = with_progress(_joint_rows(project, unit), project.motion.n_frames, monitor)
    write_csv(path, header, rows)
    return [path]


def _joint_rows(project: Project, unit: str) -> Iterator[str]:
    motion = project.motion
    decimals = _DECIMALS_OF_MM + round(math.log10(MM_PER_UNIT[unit]))
    for first in range(0, motion.n_frames, _JOINT_CHUNK):
        frames = slice(first, first + _JOINT_CHUNK)
        joints = motion.joint_positions[frames] * per_mm(unit)
        rows = fixed_rows(joints.reshape(len(joints), -1), decimals)
        for frame, (time, row) in enumerate(zip(motion.times[frames].tolist(), rows, strict=True), first):
            yield f"{frame},{time!r}{row}\n"


JOINTS_CSV = Format(
    name="joints-csv",
    title=_JOINTS_TITLE,
    suffixes=(".joints.csv", ".csv"),
    holds="joints",
    write=lambda value, path, options, monitor: write_joints_csv(value, path, options.unit, monitor),
    check=lambda value, options: finished_project(value, _JOINTS_TITLE),
    keeps=("joints",),
    options=(AXES, UNIT, RATE),
    note="One row per frame, three columns per joint.",
)


_ANGLES_TITLE = "Joint angles, CSV"
_ANGLE_CHUNK = 2000
_DECIMALS = 6


def write_angles_csv(value: Writable, path: Path, monitor: Monitor = SILENT) -> list[Path]:
    """Write the joint angles of a finished project and their standard deviations [deg].

    Raises
    ------
    WriteError
        If the value is no project, or the file cannot be written.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = finished_project(value, _ANGLES_TITLE)
    from skelgen.kinematics.joints.angles import angle_names  # noqa: PLC0415 - scipy is slow to load

    header = ["frame", "time_s"]
    for name, joint in zip(joint_names(project.skeleton), project.skeleton.joints, strict=True):
        header += [f"{name}_{angle}{what}_deg" for angle in angle_names(joint) for what in ("", "_std")]
    rows = with_progress(_angle_rows(project), project.motion.n_frames, monitor)
    write_csv(path, header, rows)
    return [path]


def _angle_rows(project: Project) -> Iterator[str]:
    from skelgen.kinematics.inverse.inverse_kinematics import posture_of  # noqa: PLC0415 - scipy is slow to load

    motion, positions = project.motion, project.trajectories.positions
    for first in range(0, motion.n_frames, _ANGLE_CHUNK):
        frames = np.arange(first, min(first + _ANGLE_CHUNK, motion.n_frames))
        posture = posture_of(project.skeleton, motion, positions, frames)
        pairs = [np.stack(both, axis=2) for both in zip(posture.angles, posture.angle_std, strict=True)]
        numbers = [np.rad2deg(pair).reshape(len(frames), -1) for pair in pairs]
        table = np.concatenate([np.zeros((len(frames), 0)), *numbers], axis=1)
        rows = fixed_rows(table, _DECIMALS)
        for frame, time, row in zip(frames.tolist(), motion.times[frames].tolist(), rows, strict=True):
            yield f"{frame},{time!r}{row}\n"


ANGLES_CSV = Format(
    name="angles-csv",
    title=_ANGLES_TITLE,
    suffixes=(".angles.csv",),
    holds="joints",
    write=lambda value, path, options, monitor: write_angles_csv(value, path, monitor),
    check=lambda value, options: finished_project(value, _ANGLES_TITLE),
    keeps=("angles",),
    options=(RATE,),
    note="One row per frame; every angle of every joint with its standard deviation, in degrees.",
)


def write_csv(path: Path, header: Sequence[str], rows: Iterable[str]) -> None:
    """Write a table.

    Parameters
    ----------
    path : Path
        The file, replaced as a whole.
    header : sequence of str
        Names of the columns, free of commas.
    rows : iterable of str
        Each with its line end.

    Raises
    ------
    WriteError
        If the file cannot be written.
    """
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(",".join(header) + "\n")
        stream.writelines(rows)


def write_motion(path: Path, header: Sequence[str], times: Floats, numbers: Floats) -> None:
    """Write a row per frame: number of the frame from 0, time [s], and numbers to the last digit.

    Parameters
    ----------
    path : Path
        The file.
    header : sequence of str, length n_columns
        Names of the numbers, with their units.
    times : ndarray, shape (n_frames,), s
        Time of each frame.
    numbers : ndarray, shape (n_frames, n_columns)
        The numbers.
    """
    row = "%d,%r" + ",%r" * numbers.shape[1] + "\n"
    frames = enumerate(zip(times.tolist(), numbers.tolist(), strict=True))
    write_csv(path, ["frame", "time_s", *header], (row % (frame, time, *values) for frame, (time, values) in frames))
