"""Write markers with their gaps filled, and beside them a table of what is filled and how sure it is."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from skelgen_formats.registry import write_file

from skelgen.files import replacing
from skelgen.kinematics.filling import fill_gaps
from skelgen.model import Project
from skelgen.model.filled import Filled, Source

TABLE_SUFFIX = ".filled.csv"
"""What follows the stem in the name of the table."""


def fill_project(project: Project) -> Filled:
    """Fill the gaps of a project's markers.

    Raises
    ------
    MissingResultError
        If the project has no skeleton yet.
    """
    return fill_gaps(project.trajectories, project.skeleton, project.motion)


def write_filled(filled: Filled, path: Path) -> list[Path]:
    """Write complete markers in the format of the suffix, and a table with a row per filled position.

    Marker files cannot tell filled from measured positions: the table ``<stem>.filled.csv`` does, with frame (from 0),
    marker, source and standard deviation [mm].

    Raises
    ------
    WriteError
        If a file cannot be written, or no format for markers has the suffix.
    """
    table = path.with_name(path.stem + TABLE_SUFFIX)
    files = write_file(filled.trajectories, path)
    with replacing(table) as temporary, temporary.open("w", newline="", encoding="utf-8", errors="replace") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("frame", "marker", "source", "std_mm"))
        for frame, marker in np.argwhere(filled.filled).tolist():
            source = Source(int(filled.source[frame, marker]))
            rows.writerow((frame, filled.measured.names[marker], source.word, f"{filled.std[frame, marker]:.3f}"))
    return [*files, table]
