"""Joint positions and joint angles as tables: one row per frame, columns with their units in the header.

Positions have three columns per joint: ``frame,time_s,limb0-limb1_x_mm,...``. Angles have two:
``frame,time_s,limb0-limb1_turn_deg,limb0-limb1_turn_std_deg,...``. A joint is called after its parent and child limb. A
hinge has ``turn``, a universal joint ``first`` and ``second`` (about the axis in the parent, then in the child), other
joints ``x``, ``y`` and ``z`` (rotation vector in the parent's axes), rigid ones nothing. Angles are 0 in the reference
pose. Frames count from 0.

If the motion leaves open where a joint is, columns ``limb0-limb1_determined`` stand last, one for each joint: 0 where
the motion does not determine its place, or 1.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from skelgen.files import replacing
from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen.progress import SILENT, Monitor, with_progress
from skelgen_formats.options import AXES, MM_PER_UNIT, RATE, UNIT, Format, Options, Writable, finished_project, per_mm

_JOINTS_TITLE, _ANGLES_TITLE = "Joint positions, CSV", "Joint angles, CSV"
_DECIMALS = 6  # of mm and of degrees
MARK = "_determined"
"""Ends the titles of columns that mark joints whose places the motion does not determine."""

MARKS_OPEN = f"columns `<joint>{MARK}`, 1 or 0, the last; left out if the motion determines all joints"
"""Where tables of motions say so."""
_CHUNK_FRAMES = 2000  # frames whose numbers are Python objects at one time


def _write_joints(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write the joint positions of a finished project and their standard deviations, to a millionth of a millimetre."""
    project = finished_project(value, _JOINTS_TITLE)
    motion = project.motion
    kinds = [("", motion.joint_positions)] + ([] if motion.joint_std is None else [("_std", motion.joint_std)])
    names = project.skeleton.joint_names
    header = [f"{name}_{axis}{kind}_{options.unit}" for kind, _ in kinds for name in names for axis in "xyz"]
    numbers = np.concatenate([values.reshape(motion.n_frames, 3 * len(names)) for _, values in kinds], axis=1)
    chunks = (numbers[frames] * per_mm(options.unit) for frames in _chunks(motion.n_frames))
    decimals = _DECIMALS + round(math.log10(MM_PER_UNIT[options.unit]))
    marked = with_marks(header, chunks, project.skeleton, names)
    write_motion(path, marked[0], motion.times, marked[1], decimals=decimals, monitor=monitor)


def _write_angles(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write the joint angles of a finished project and their standard deviations [deg]."""
    from skelgen.kinematics.joints.angles import angle_names  # noqa: PLC0415 - scipy is slow to load

    project = finished_project(value, _ANGLES_TITLE)
    header: list[str] = []
    for name, joint in zip(project.skeleton.joint_names, project.skeleton.joints, strict=True):
        header += [f"{name}_{angle}{what}_deg" for angle in angle_names(joint) for what in ("", "_std")]
    header, chunks = with_marks(header, _angles(project), project.skeleton, project.skeleton.joint_names)
    write_motion(path, header, project.motion.times, chunks, _DECIMALS, monitor)


def with_marks(
    header: Sequence[str], chunks: Iterable[Floats], skeleton: Skeleton, names: Sequence[str]
) -> tuple[list[str], Iterable[Floats]]:
    """Return a header and its numbers, with marks of the joints behind them if the motion does not determine all.

    Parameters
    ----------
    header : sequence of str, length n_columns
        Names of the numbers.
    chunks : iterable of ndarray, shape (n_rows, n_columns)
        The numbers of successive frames.
    skeleton : Skeleton
        With the joints.
    names : sequence of str, length n_joints
        What the joints are called in the file.
    """
    determined = [joint.is_determined for joint in skeleton.joints]
    if all(determined):
        return list(header), chunks
    marks = np.array(determined, dtype=np.float64)
    marked = (np.hstack([chunk, np.tile(marks, (len(chunk), 1))]) for chunk in chunks)
    return [*header, *(name + MARK for name in names)], marked


def write_motion(
    path: Path,
    header: Sequence[str],
    times: Floats,
    chunks: Iterable[Floats],
    decimals: int | None = None,
    monitor: Monitor = SILENT,
) -> None:
    """Write a row per frame: number of the frame from 0, time [s], and numbers.

    Parameters
    ----------
    path : Path
        The file, replaced as a whole.
    header : sequence of str, length n_columns
        Names of the numbers, with their units.
    times : ndarray, shape (n_frames,), s
        Time of each frame.
    chunks : iterable of ndarray, shape (n_rows, n_columns)
        The numbers of successive frames, together `n_frames` rows.
    decimals : int, optional
        Digits behind the point, but for marks; as many as give the same number back if left out.
    monitor : Monitor
        Shows progress; may cancel.

    Raises
    ------
    WriteError
        If the file cannot be written.
    """
    places = [0 if name.endswith(MARK) else decimals for name in header]
    row = "%d,%r" + "".join(",%r" if digits is None else f",%.{digits}f" for digits in places) + "\n"
    numbers = (values for chunk in chunks for values in chunk.tolist())
    frames = enumerate(zip(times.tolist(), numbers, strict=True))
    lines = (row % (frame, time, *values) for frame, (time, values) in frames)
    write_csv(path, ["frame", "time_s", *header], with_progress(lines, len(times), monitor))


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


def _angles(project: Project) -> Iterator[Floats]:
    """Yield the angles of successive frames [deg], each with its standard deviation, shape (n_rows, n_columns)."""
    from skelgen.kinematics.inverse.motion import successive_postures  # noqa: PLC0415 - scipy is slow to load

    motion = project.motion
    chunks = (np.arange(chosen.start, chosen.stop) for chosen in _chunks(motion.n_frames))
    for posture in successive_postures(project.skeleton, motion, project.trajectories.positions, chunks):
        n_rows = len(posture.limb_seen)
        pairs = [np.stack(both, axis=2) for both in zip(posture.angles, posture.angle_std, strict=True)]
        numbers = [np.rad2deg(pair).reshape(n_rows, -1) for pair in pairs]
        yield np.concatenate([np.zeros((n_rows, 0)), *numbers], axis=1)


def _chunks(n_frames: int) -> Iterator[slice]:
    for first in range(0, n_frames, _CHUNK_FRAMES):
        yield slice(first, min(first + _CHUNK_FRAMES, n_frames))


JOINTS_CSV = Format(
    name="joints-csv",
    title=_JOINTS_TITLE,
    suffixes=(".joints.csv", ".csv"),
    holds="joints",
    write=_write_joints,
    check=lambda value, options: finished_project(value, _JOINTS_TITLE),
    keeps=("joints",),
    marks_open=MARKS_OPEN,
    options=(AXES, UNIT, RATE),
    note="One row per frame; three columns per joint, then the three standard deviations of each.",
)
ANGLES_CSV = Format(
    name="angles-csv",
    title=_ANGLES_TITLE,
    suffixes=(".angles.csv",),
    holds="joints",
    write=_write_angles,
    check=lambda value, options: finished_project(value, _ANGLES_TITLE),
    keeps=("angles",),
    marks_open=MARKS_OPEN,
    options=(RATE,),
    note="One row per frame; every angle of every joint with its standard deviation, in degrees.",
)
