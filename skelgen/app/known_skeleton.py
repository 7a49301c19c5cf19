"""One body, many takes: a skeleton that was calibrated on one take, applied to others."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from skelgen.app.configuration import Settings
from skelgen.app.inputs import check_take
from skelgen.app.known_sensors import apply_to_sensors
from skelgen.app.store import find_result, open_project
from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Poses, Project, StageReport
from skelgen.progress import SILENT, Monitor
from skelgen.stages.known import KnownFit, fit_known
from skelgen.stages.labels import labelling_of_markers
from skelgen.stages.labels.judged import Origin, history_of, labelling_of_cloud


def open_known(path: Path | str) -> Project:
    """Open a project whose skeleton is to be applied to other takes.

    Parameters
    ----------
    path : Path or str
        A project file, or the folder of a run.

    Raises
    ------
    InputError
        If it has no skeleton yet.
    """
    known = open_project(find_result(Path(path)))
    return check_known(known, str(path))


def check_known(known: Project, where: str) -> Project:
    """Return a project that has a skeleton with markers, or raise `InputError`."""
    if not known.has("skeleton"):
        raise InputError(f"{where}: holds no skeleton yet; run all stages on its take first: skelgen run {where}")
    return known


def apply_skeleton(
    project: Project, known: Project, *, settings: Settings | None = None, monitor: Monitor = SILENT
) -> Project:
    """Label and pose a take by the skeleton of another take of the same body.

    Parameters
    ----------
    project : Project
        The new take; results that it has are replaced.
    known : Project
        The calibrated take, all stages done.
    settings : Settings, optional
        Parameters of the stages: `labels` says how points are followed, `skeleton` what is an outlier.
    monitor : Monitor
        Told of progress and of what the user should know; may cancel.

    Returns
    -------
    Project
        Complete: bone lengths, joints and places of markers are those of `known`; what is otherwise in this take is
        told in the report of the labels.

    Raises
    ------
    InputError
        If the take shows another body, or one take is of markers and the other of bodies with orientation.

    Examples
    --------
    >>> walk = apply_skeleton(Project(skelgen.read("walk.c3d")), rom)  # doctest: +SKIP
    """
    take, settings = project.take, settings or Settings()
    check_known(known, known.name or "the known skeleton")
    if isinstance(take, Poses) != isinstance(known.take, Poses):
        what = ("markers", "bodies with orientation")
        of_take, of_known = (what[isinstance(one, Poses)] for one in (take, known.take))
        raise InputError(f"{project.name}: holds {of_take}, and the known skeleton is of {of_known}")
    if isinstance(take, Poses):
        return apply_to_sensors(project, known, settings, monitor)
    check_take(take)
    labelling, posing = settings.of("labels"), settings.of("skeleton")
    started = time.perf_counter()
    with threadpool_limits(limits=1):
        fit = fit_known(take, known, **stage_wishes(settings), monitor=monitor)
    seconds = time.perf_counter() - started
    for sentence in fit.sentences:
        monitor.notice(sentence)
    source = known.source.path if known.source is not None else known.name
    taken = (f"taken from the known skeleton of {source}",)
    done = project.with_trajectories(
        fit.trajectories, StageReport(labelling.as_mapping(), seconds, (*taken, *fit.sentences)), _account(project, fit)
    )
    done = done.with_limbs(fit.limbs, StageReport({}, 0.0, taken))
    done = done.with_topology(known.topology.for_take(take.n_frames), StageReport({}, 0.0, taken))
    return done.with_skeleton(fit.skeleton, fit.motion, StageReport(posing.as_mapping(), 0.0, taken))


def stage_wishes(settings: Settings) -> dict[str, Any]:
    """Return what `fit_known` takes of the parameters of the stages."""
    return {"labelling": settings.of("labels"), "posing": settings.of("skeleton")}


def _account(project: Project, fit: KnownFit) -> Labelling:
    """How sure the labels are."""
    take = project.take
    if isinstance(take, PointCloud):
        tracked = fit.labels.points
        origin = Origin(tracked.cloud, tracked.tracks, fit.labels.marker_of_point)
        return labelling_of_cloud(fit.trajectories, history_of(origin, fit.trajectories.n_markers))
    return labelling_of_markers(fit.trajectories, fit.trajectories)
