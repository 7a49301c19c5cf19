"""What writers of markers share: which value they can take, filled positions, and the table of these."""

import csv
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import MissingResultError, WriteError
from skelgen.files import replacing
from skelgen.model import PointCloud, Project, Trajectories
from skelgen.model.filled import Filled, PositionSource
from skelgen.progress import SILENT, Monitor
from skelgen_formats.options import Writable
from skelgen_formats.text import defused


def trajectories_of(value: Writable, title: str) -> Trajectories:
    """Return the measured markers of a value, or raise `WriteError` that says what would work.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        With labelled markers.
    title : str
        Of the format, for the error.
    """
    if isinstance(value, Filled):
        return value.measured
    if isinstance(value, Project):
        value = value.trajectories if value.has("labels") else value.take
    if isinstance(value, Trajectories):
        return value
    has = "bodies with orientation: poses can be written as poses-csv"
    if isinstance(value, PointCloud):
        has = "points without labels: run the stage 'labels' first, or use mfml"
    raise WriteError(f"{title} holds labelled markers and this value has {has}")


def check_writable_names(
    path: Path, names: Sequence[str], forbidden: str, clean: Callable[[str], str] = str
) -> list[str]:
    """Return the names as `clean` makes them; refuse those that the format cannot hold or that become equal.

    Parameters
    ----------
    path : Path
        The file, for errors.
    names : sequence of str
        Of the markers.
    forbidden : str
        Characters that no name may hold, beside ends of lines.
    clean : callable (name) -> str
        Makes a name as it is written.
    """
    cleaned = [clean(name) for name in names]
    for name in cleaned:
        if not name or any(character in name for character in forbidden + "\r\n\0"):
            what = "is empty or holds a character that this format cannot hold; rename it"
            raise WriteError(f"{path}: the name {name!r} {what}")
    twice = [name for name, count in Counter(cleaned).items() if count > 1]
    if twice:
        raise WriteError(f"{path}: two names would both be written as {twice[0]!r}; rename one")
    return cleaned


TABLE_SUFFIX = ".filled.csv"
"""What follows the stem in the name of the table."""


def check_markers(value: Writable, title: str, filled: bool) -> None:
    """Raise if a writer of markers cannot take a value; errors as `markers_to_write`.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    title : str
        Of the format, for errors.
    filled : bool
        Whether filled positions are wanted.
    """
    if not filled or isinstance(value, Filled):
        trajectories_of(value, title)
    elif not isinstance(value, Project):
        what = "gaps are filled from a skeleton, and a take has none: give a project that is fitted"
        raise WriteError(f"{title}: {what}")
    elif not value.has("skeleton"):
        raise MissingResultError(f"{title}: gaps are filled from a skeleton: run the stage 'skeleton' first")


def markers_to_write(value: Writable, title: str, filled: bool, monitor: Monitor = SILENT) -> Trajectories | Filled:
    """Return what a writer is to write: measured markers, or `Filled` if filled positions are wanted.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        Of `Filled` without `filled`, the measured markers are written; the gaps of a project are filled with it.
    title : str
        Of the format, for errors.
    filled : bool
        Whether filled positions are wanted.
    monitor : Monitor
        Shows the progress of filling; may cancel.

    Raises
    ------
    WriteError
        If the value has no labelled markers, or nothing to fill them from.
    MissingResultError
        If filling is wanted and the project has no skeleton yet.
    """
    check_markers(value, title, filled)
    if filled and isinstance(value, Filled):
        return value
    if filled and isinstance(value, Project):
        from skelgen.kinematics.gap_filling.stated import fill_project  # noqa: PLC0415 - numeric code of filling alone

        return fill_project(value, monitor)
    return trajectories_of(value, title)


def positions_of(markers: Trajectories | Filled) -> Trajectories:
    """Return the markers with all positions that are to be written."""
    return markers.trajectories if isinstance(markers, Filled) else markers


def write_table(markers: Trajectories | Filled, path: Path) -> list[Path]:
    """Write the table of filled positions beside a file of markers; nothing if these are measured.

    The table has a row per filled position: frame (from 0), marker, source and standard deviation [mm].

    Parameters
    ----------
    markers : Trajectories or Filled
        What was written.
    path : Path
        The file of markers.
    """
    if not isinstance(markers, Filled):
        return []
    table = table_of(path)
    with replacing(table) as temporary, temporary.open("w", newline="", encoding="utf-8", errors="replace") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("frame", "marker", "source", "std_mm"))
        for frame, marker in np.argwhere(markers.filled).tolist():
            source = PositionSource(int(markers.source[frame, marker]))
            name, std = defused(markers.measured.names[marker]), f"{markers.std[frame, marker]:.3f}"
            rows.writerow((frame, name, source.word, std))
    return [table]


def marker_files(path: Path, filled: bool) -> tuple[Path, ...]:
    """Return the files that a writer of markers will make of a path.

    Parameters
    ----------
    path : Path
        The file of markers.
    filled : bool
        Whether filled positions are written.
    """
    return (path, table_of(path)) if filled else (path,)


def table_of(path: Path) -> Path:
    """Return where the table of filled positions belongs to a file of markers."""
    return path.with_name(path.stem + TABLE_SUFFIX)
