"""Long tables, one row per frame and item, as CSV or Parquet: markers, joints, angles and limbs, a file each.

Every column names its unit: ``frame,time_s,marker,limb,x_mm,...``. Frames count from 0. Numbers are written so that the
same float64 comes back. What is unseen is empty in CSV and null in Parquet.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import WriteError
from skelgen.files import arriving_together, replacing
from skelgen.geometry.rotations import quaternion_from_matrix
from skelgen.model import Project
from skelgen.model.arrays import Ints
from skelgen.model.tables import axis_columns, head_columns
from skelgen.progress import Monitor, with_progress
from skelgen_formats.motion_csv import write_csv
from skelgen_formats.options import AXES, RATE, UNIT, Format, Options, Writable, finished_project, per_mm
from skelgen_formats.text import defused

CSV_SUFFIX, PARQUET_SUFFIX = ".table.csv", ".parquet"

_CHUNK_FRAMES = 2000  # rows of so many frames are in memory at a time
_NEEDS_QUOTES = frozenset(',"\r\n')

Columns = dict[str, NDArray[Any]]
"""Some rows of a table: each column's name and values."""

Rows = Callable[[Project, Iterable[Ints], str], Iterator[Columns]]
"""Rows of a project for successive frames, in a unit of length."""


def _write_all_csv(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    _write(finished_project(value, "A table"), _files(path, CSV_SUFFIX), options.unit, monitor, _write_csv)


def _write_all_parquet(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    project = _check_parquet(value)
    _write(project, _files(path, PARQUET_SUFFIX), options.unit, monitor, _write_parquet)


def _write(
    project: Project,
    files: Sequence[Path],
    unit: str,
    monitor: Monitor,
    write: Callable[[Path, Iterator[Columns]], None],
) -> None:
    with arriving_together(files[0].parent) as folder:
        for rows_of, file in zip(TABLES.values(), files, strict=True):
            write(folder / file.name, _chunks(project, rows_of, unit, monitor))


def _files(path: Path, suffix: str) -> tuple[Path, ...]:
    stem = path.name.removesuffix(suffix) if path.name.endswith(suffix) else path.stem
    return tuple(path.with_name(f"{stem}.{name}{suffix}") for name in TABLES)


def _chunks(project: Project, rows_of: Rows, unit: str, monitor: Monitor) -> Iterator[Columns]:
    n_frames = project.motion.n_frames
    starts = range(0, max(n_frames, 1), _CHUNK_FRAMES)  # a table without rows has its columns all the same
    shown = with_progress(starts, len(starts), monitor, every=1)
    return rows_of(project, (np.arange(start, min(start + _CHUNK_FRAMES, n_frames)) for start in shown), unit)


def _by_frames(rows: Callable[[Project, Ints, str], Columns]) -> Rows:
    return lambda project, chunks, unit: (rows(project, frames, unit) for frames in chunks)


def _markers(project: Project, frames: Ints, unit: str) -> Columns:
    skeleton, motion, markers = project.skeleton, project.motion, project.trajectories
    limbs = [skeleton.limb_names[limb] if limb >= 0 else "" for limb in skeleton.limb_of_marker.tolist()]
    items = {"marker": markers.names, "limb": tuple(limbs)}
    scale = per_mm(unit)
    return {
        **head_columns(motion.times, frames, items),
        **axis_columns("{}_" + unit, markers.positions[frames] * scale),
        **axis_columns("model_{}_" + unit, motion.marker_positions[frames] * scale),
        f"residual_{unit}": motion.residuals[frames].ravel() * scale,
    }


def _joints(project: Project, frames: Ints, unit: str) -> Columns:
    motion = project.motion
    std = np.full(motion.joint_positions.shape, np.nan) if motion.joint_std is None else motion.joint_std
    determined = np.array([joint.is_determined for joint in project.skeleton.joints], dtype=np.intp)
    return {
        **head_columns(motion.times, frames, {"joint": project.skeleton.joint_names}),
        **axis_columns("{}_" + unit, motion.joint_positions[frames] * per_mm(unit)),
        **axis_columns("std_{}_" + unit, std[frames] * per_mm(unit)),
        "determined": np.tile(determined, len(frames)),
    }


def _angles(project: Project, chunks: Iterable[Ints], unit: str) -> Iterator[Columns]:
    from skelgen.kinematics.inverse.motion import successive_postures  # noqa: PLC0415 - scipy is slow to load
    from skelgen.kinematics.joints.angles import angle_names  # noqa: PLC0415 - scipy is slow to load

    skeleton, motion, first = project.skeleton, project.motion, 0
    named = zip(skeleton.joint_names, skeleton.joints, strict=True)
    pairs = [(name, angle) for name, joint in named for angle in angle_names(joint)]
    items = {"joint": tuple(name for name, _ in pairs), "angle": tuple(angle for _, angle in pairs)}
    for posture in successive_postures(skeleton, motion, project.trajectories.positions, chunks):
        frames = np.arange(first, first + len(posture.limb_seen))
        first, none = first + len(frames), np.zeros((len(frames), 0))
        yield {
            **head_columns(motion.times, frames, items),
            "value_deg": np.rad2deg(np.concatenate([none, *posture.angles], axis=1)).ravel(),
            "std_deg": np.rad2deg(np.concatenate([none, *posture.angle_std], axis=1)).ravel(),
        }


def _limbs(project: Project, frames: Ints, unit: str) -> Columns:
    motion = project.motion
    rotations = motion.rotations[frames]
    quaternions = quaternion_from_matrix(rotations)
    cells = [(row, column) for row in range(3) for column in range(3)]
    return {
        **head_columns(motion.times, frames, {"limb": project.skeleton.limb_names}),
        "seen": motion.limb_seen[frames].ravel().astype(np.intp),
        **axis_columns("{}_" + unit, motion.world_from_limb[frames][..., :3, 3] * per_mm(unit)),
        **{f"q{letter}": quaternions[..., index].ravel() for index, letter in enumerate("wxyz")},
        **{f"r{row + 1}{column + 1}": rotations[..., row, column].ravel() for row, column in cells},
    }


def _write_csv(path: Path, chunks: Iterator[Columns]) -> None:
    first = next(chunks)
    cells = (zip(*map(_cells, chunk.values()), strict=True) for chunk in chain([first], chunks))
    write_csv(path, list(first), (",".join(row) + "\n" for rows in cells for row in rows))


def _cells(values: NDArray[Any]) -> list[str]:
    if values.dtype.kind == "f":
        return ["" if number != number else repr(number) for number in values.tolist()]  # noqa: PLR0124 - NaN
    texts = [str(value) for value in values.tolist()]
    return [_quoted(defused(text)) for text in texts] if values.dtype.kind == "U" else texts


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if _NEEDS_QUOTES & set(text) else text


def _write_parquet(path: Path, chunks: Iterator[Columns]) -> None:
    import pyarrow  # noqa: PLC0415 - of the extra `tables`
    from pyarrow import parquet  # noqa: PLC0415

    def table_of(chunk: Columns) -> Any:
        return pyarrow.table({name: pyarrow.array(values, from_pandas=True) for name, values in chunk.items()})

    first = table_of(next(chunks))
    with replacing(path) as temporary, parquet.ParquetWriter(temporary, first.schema) as writer:
        writer.write_table(first)
        for chunk in chunks:
            writer.write_table(table_of(chunk))


def _check_parquet(value: Writable) -> Project:
    project = finished_project(value, "A table")
    try:
        import pyarrow  # noqa: F401, PLC0415 - whether it is there
    except ImportError as error:
        raise WriteError("Parquet needs pyarrow: pip install 'skelgen-mocap[tables]'") from error
    return project


TABLES: Mapping[str, Rows] = {
    "markers": _by_frames(_markers),
    "joints": _by_frames(_joints),
    "angles": _angles,
    "limbs": _by_frames(_limbs),
}
"""What each of the files holds."""

_KEPT = ("markers", "names", "limbs", "joints", "angles", "motion")
_NOTE = (
    "One row per frame and item, in four files: markers with their residuals, joints and angles [deg] with their"
    " deviations, and limbs with their rotations as quaternions and matrices."
)

CSV = Format(
    name="table-csv",
    title="Long tables, CSV",
    suffixes=(CSV_SUFFIX,),
    holds="skeleton",
    write=_write_all_csv,
    check=lambda value, options: finished_project(value, "A table"),
    files=lambda path, options: _files(path, CSV_SUFFIX),
    note=_NOTE,
    keeps=_KEPT,
    marks_open="column `determined` of the joints, 1 or 0",
    options=(AXES, RATE, UNIT),
)
PARQUET = replace(
    CSV,
    name="table-parquet",
    title="Long tables, Parquet",
    suffixes=(PARQUET_SUFFIX,),
    write=_write_all_parquet,
    check=lambda value, options: _check_parquet(value),
    files=lambda path, options: _files(path, PARQUET_SUFFIX),
    note=_NOTE + " Needs the extra `tables`.",
)
