"""Joint angles as a table: one row per frame, two columns per angle.

The header names every column with its unit: ``frame,time_s,limb0-limb1_turn_deg,limb0-limb1_turn_std_deg,...``; a joint
is called after its parent and child limb. A hinge has ``turn``, a universal joint ``first`` and ``second`` (about the
axis in the parent, then in the child), other joints ``x``, ``y`` and ``z`` (rotation vector in the parent's axes),
rigid ones nothing. Angles are 0 in the reference pose. Frames count from 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from skelgen.model import Project, Take
from skelgen.progress import SILENT, Monitor, with_progress
from skelgen_formats.csv_rows import write_csv
from skelgen_formats.digits import fixed_rows
from skelgen_formats.finished import finished_project
from skelgen_formats.joints_csv import joint_names
from skelgen_formats.registry import Format
from skelgen_formats.world import RATE

_TITLE = "Joint angles, CSV"
_CHUNK_FRAMES = 2000
_DECIMALS = 6


def write_angles_csv(value: Project | Take, path: Path, monitor: Monitor = SILENT) -> list[Path]:
    """Write the joint angles of a finished project and their standard deviations [deg].

    Raises
    ------
    WriteError
        If the value is no project, or the file cannot be written.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = finished_project(value, _TITLE)
    from skelgen.kinematics.angles import angle_names  # noqa: PLC0415 - scipy is slow to load

    header = ["frame", "time_s"]
    for name, joint in zip(joint_names(project.skeleton), project.skeleton.joints, strict=True):
        header += [f"{name}_{angle}{what}_deg" for angle in angle_names(joint) for what in ("", "_std")]
    rows = with_progress(_rows(project), project.motion.n_frames, monitor)
    write_csv(path, header, rows)
    return [path]


def _rows(project: Project) -> Iterator[str]:
    from skelgen.kinematics.inverse import posture_of  # noqa: PLC0415 - scipy is slow to load

    motion, positions = project.motion, project.trajectories.positions
    for first in range(0, motion.n_frames, _CHUNK_FRAMES):
        frames = np.arange(first, min(first + _CHUNK_FRAMES, motion.n_frames))
        posture = posture_of(project.skeleton, motion, positions, frames)
        pairs = [np.stack(both, axis=2) for both in zip(posture.angles, posture.angle_std, strict=True)]
        numbers = [np.rad2deg(pair).reshape(len(frames), -1) for pair in pairs]
        table = np.concatenate([np.zeros((len(frames), 0)), *numbers], axis=1)
        rows = fixed_rows(table, _DECIMALS)
        for frame, time, row in zip(frames.tolist(), motion.times[frames].tolist(), rows, strict=True):
            yield f"{frame},{time!r}{row}\n"


FORMAT = Format(
    name="angles-csv",
    title=_TITLE,
    suffixes=(".angles.csv",),
    holds="joints",
    write=write_angles_csv,
    check=lambda value, options: finished_project(value, _TITLE),
    keeps=("angles",),
    options=(RATE,),
    note="One row per frame; every angle of every joint with its standard deviation, in degrees.",
)
