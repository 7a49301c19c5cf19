"""Markers with their gaps filled, written in any format that holds markers."""

from __future__ import annotations

from pathlib import Path

from skelgen_formats.filled_markers import FILLED, marking_sentence
from skelgen_formats.registry import format_for_writing, write_file

from skelgen.errors import WriteError
from skelgen.kinematics.filling import fill_gaps
from skelgen.model import Project
from skelgen.model.filled import Filled
from skelgen.progress import SILENT, Monitor


def fill_project(project: Project, monitor: Monitor = SILENT) -> Filled:
    """Fill the gaps of a project's markers; the monitor is told of progress and may cancel.

    Raises
    ------
    MissingResultError
        If the project has no skeleton yet.
    """
    return fill_gaps(project.trajectories, project.skeleton, project.motion, monitor)


def write_filled(filled: Filled, path: Path) -> tuple[list[Path], str]:
    """Write complete markers in the format of the suffix, and a table with a row per filled position.

    Returns
    -------
    tuple of list of Path and str
        The files, and how filled positions are told from measured ones in them.

    Raises
    ------
    WriteError
        If a file cannot be written, or no format for markers has the suffix.
    """
    entry = format_for_writing(path)
    if FILLED not in entry.options:
        raise WriteError(f"{path}: {entry.name} holds the {entry.holds} and no markers; write c3d, trc or csm")
    return write_file(filled, path, filled=True), marking_sentence(entry, path)
