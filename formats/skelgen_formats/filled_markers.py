"""What writers of markers do with filled positions: leave them out, or write them and say which they are."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import MissingResultError, WriteError
from skelgen.files import replacing
from skelgen.model import Project, Take, Trajectories
from skelgen.model.filled import Filled, Source
from skelgen.progress import SILENT, Monitor
from skelgen_formats.markers import trajectories_of
from skelgen_formats.registry import Format, Option

FILLED = Option(
    "filled",
    False,
    "Fill the gaps of a fitted project and write the filled positions as well, told apart by <stem>.filled.csv.",
    reading=False,
)
"""The option of every writer of markers."""

TABLE_SUFFIX = ".filled.csv"
"""What follows the stem in the name of the table."""

_MARKED = {"c3d": "filled positions have residual 0 and no camera, measured ones residual 1 and one camera"}


def check_markers(value: Project | Take | Filled, title: str, filled: bool) -> None:
    """Raise if a writer of markers cannot take a value; see `markers_to_write`."""
    if isinstance(value, Filled):
        return
    if not filled:
        trajectories_of(value, title)
    elif not isinstance(value, Project):
        raise WriteError(
            f"{title}: gaps are filled from a skeleton, and a take has none: give a project that is fitted"
        )
    elif not value.has("skeleton"):
        raise MissingResultError(f"{title}: gaps are filled from a skeleton: run the stage 'skeleton' first")


def markers_to_write(
    value: Project | Take | Filled, title: str, filled: bool, monitor: Monitor = SILENT
) -> Trajectories | Filled:
    """Return what a writer is to write: measured markers, or `Filled` if filled positions are wanted.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        Of `Filled` without the wish, the measured markers; of a project with it, its gaps are filled.
    title : str
        Of the format, for errors.
    filled : bool
        Whether filled positions are wanted.
    monitor : Monitor
        Told of the filling; may cancel.

    Raises
    ------
    WriteError
        If the value has no labelled markers, or nothing to fill them from.
    MissingResultError
        If filling is wanted and the project has no skeleton yet.
    """
    check_markers(value, title, filled)
    if isinstance(value, Filled):
        return value if filled else value.measured
    if filled and isinstance(value, Project):
        from skelgen.kinematics.filling import fill_gaps  # noqa: PLC0415 - numeric code that only this wish needs

        return fill_gaps(value.trajectories, value.skeleton, value.motion, monitor)
    return trajectories_of(value, title)


def positions_of(markers: Trajectories | Filled) -> Trajectories:
    """Return the markers with all positions that are to be written."""
    return markers.trajectories if isinstance(markers, Filled) else markers


def write_table(markers: Trajectories | Filled, path: Path) -> list[Path]:
    """Write the table of filled positions beside a file of markers; nothing if these are measured.

    The table has a row per filled position: frame (from 0), marker, source and standard deviation [mm].
    """
    if not isinstance(markers, Filled):
        return []
    table = table_of(path)
    with replacing(table) as temporary, temporary.open("w", newline="", encoding="utf-8", errors="replace") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("frame", "marker", "source", "std_mm"))
        for frame, marker in np.argwhere(markers.filled).tolist():
            source = Source(int(markers.source[frame, marker]))
            rows.writerow((frame, markers.measured.names[marker], source.word, f"{markers.std[frame, marker]:.3f}"))
    return [table]


def marker_files(path: Path, options: Mapping[str, Any]) -> tuple[Path, ...]:
    """Return the files that a writer of markers will make of a path."""
    return (path, table_of(path)) if options.get(FILLED.name) else (path,)


def table_of(path: Path) -> Path:
    """Return where the table of filled positions belongs to a file of markers."""
    return path.with_name(path.stem + TABLE_SUFFIX)


def marking_sentence(entry: Format, path: Path) -> str:
    """Say how filled positions are told from measured ones in a file, for the user who exports it."""
    marked = _MARKED.get(entry.name)
    if marked:
        return f"{path.name}: {marked}; {table_of(path).name} says from what they are filled and how surely"
    return (
        f"{path.name}: {entry.title} cannot mark filled positions; {table_of(path).name} beside it says which they are"
    )
