"""Fill the gaps of a project: by its skeleton, and otherwise where the user states it."""

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.gap_filling.single_gaps import fill_marker
from skelgen.model import Project, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.corrections import BY_SKELETON, Correction, named_marker
from skelgen.model.filled import Filled, PositionSource
from skelgen.progress import SILENT, Monitor

_SOURCES = {
    "rigid": PositionSource.LIMB,
    "spline": PositionSource.INTERPOLATED,
    "pattern": PositionSource.PATTERN,
}


def fill_project(project: Project, monitor: Monitor = SILENT) -> Filled:
    """Fill the gaps of all markers.

    Parameters
    ----------
    project : Project
        With a skeleton, or with corrections that state how gaps are filled: then these alone are.
    monitor : Monitor
        Receives progress, and a notice of each correction that is passed over; may cancel.

    Raises
    ------
    MissingResultError
        If the project has neither.
    """
    stated = [correction for correction in project.corrections if correction.kind == "fill"]
    if project.has("skeleton") or not stated:
        from skelgen.kinematics.gap_filling.filling import fill_gaps  # noqa: PLC0415 - loads scipy

        by_skeleton = fill_gaps(project.trajectories, project.skeleton, project.motion, monitor)
    else:
        by_skeleton = unfilled(project.trajectories)
    return with_stated(by_skeleton, stated, monitor)


def unfilled(trajectories: Trajectories) -> Filled:
    """Return markers of which no gap is filled."""
    seen = trajectories.seen
    source = np.where(seen, PositionSource.MEASURED, PositionSource.NONE).astype(np.intp)
    return Filled(trajectories, trajectories.positions, source, np.where(seen, 0.0, np.nan))


def with_stated(by_skeleton: Filled, stated: list[Correction], monitor: Monitor = SILENT) -> Filled:
    """Return filled markers with the gaps filled in other ways that the user states, the last statement first.

    Parameters
    ----------
    by_skeleton : Filled
        What the skeleton fills.
    stated : list of Correction
        Of the kind ``fill``; those whose markers are there no more are passed over.
    monitor : Monitor
        Receives a notice of each.
    """
    measured = by_skeleton.measured
    positions, source, std = by_skeleton.positions.copy(), by_skeleton.source.copy(), by_skeleton.std.copy()

    def row(frame: int) -> Floats:
        return measured.positions[frame] if frame < measured.n_frames else np.empty((0, 3))

    for correction in stated:
        try:
            marker, *donors = (
                named_marker(correction, which, measured.names, row) for which in range(len(correction.names))
            )
        except InputError as error:
            monitor.notice(str(error))
            continue
        first = correction.first_frame or 0
        last = measured.n_frames - 1 if correction.last_frame is None else correction.last_frame
        if correction.value == BY_SKELETON:
            frames = np.arange(first, last + 1)[~measured.seen[first : last + 1, marker]]
            found = (array[frames, marker] for array in (by_skeleton.positions, by_skeleton.source, by_skeleton.std))
            positions[frames, marker], source[frames, marker], std[frames, marker] = found
        else:
            fill = fill_marker(measured, marker, (first, last), correction.value, donors)
            positions[fill.frames, marker], std[fill.frames, marker] = fill.positions, fill.std
            source[fill.frames, marker] = _SOURCES[correction.value]
    return Filled(measured, positions, source, std)
