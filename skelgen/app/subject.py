"""One body, many takes: a skeleton that was calibrated on one take, applied to others."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, cast

import numpy as np
from threadpoolctl import threadpool_limits

from skelgen.app.configuration import Settings
from skelgen.app.inputs import body_of, check_take, trajectories_from_poses
from skelgen.app.project_file.archive import find_result, open_project
from skelgen.errors import InputError
from skelgen.model import Labelling, Limbs, PointCloud, Poses, Project, StageReport, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.skeleton import Skeleton
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import PointLabels, history_of, labelling_of_cloud, labelling_of_markers
from skelgen.stages.skeleton import SkeletonParameters
from skelgen.stages.subject import KnownFit, Seat, fit_known, known_motion, pose_known, reseated


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
        points = PointLabels(tracked.cloud, tracked.tracks, fit.labels.marker_of_point)
        return labelling_of_cloud(fit.trajectories, history_of(points, fit.trajectories.n_markers))
    return labelling_of_markers(fit.trajectories, fit.trajectories)


def apply_to_sensors(project: Project, known: Project, settings: Settings, monitor: Monitor) -> Project:
    """Pose a take of bodies with orientation by the skeleton of another one.

    Parameters
    ----------
    project : Project
        The new take.
    known : Project
        The calibrated take of sensors of the same names, all stages done.
    settings : Settings
        Of which `skeleton` says what is an outlier.
    monitor : Monitor
        Told of progress and of what the user should know.

    Returns
    -------
    Project
        Bone lengths and joints are those of `known`; sensors that sit elsewhere on their limbs are placed anew.

    Raises
    ------
    InputError
        If no body of the take is one of the skeleton's.
    """
    take, started = cast(Poses, project.take), time.perf_counter()
    check_take(take)
    posing = cast(SkeletonParameters, settings.of("skeleton"))
    monitor.begin("poses of the known skeleton")
    names = known.trajectories.names
    positions = _positions(take, known)
    with threadpool_limits(limits=1):
        skeleton, seats, loose = reseated(known.skeleton, known.trajectories.positions, positions)
        poses = pose_known(skeleton, positions, posing, monitor)
        motion = known_motion(skeleton, poses, positions, take.rate)
    sentences = _sentences(take, names, skeleton, seats, loose)
    for sentence in sentences:
        monitor.notice(sentence)
    source = known.source.path if known.source is not None else known.name
    taken = (f"taken from the known skeleton of {source}",)
    seconds = time.perf_counter() - started
    trajectories = Trajectories(positions, names, take.rate, take.name, take.notices)
    done = project.with_trajectories(trajectories, StageReport({}, 0.0, (*taken, *sentences)))
    nothing = np.full((len(names), len(names)), np.nan)
    done = done.with_limbs(Limbs(skeleton.limb_of_marker, nothing), StageReport({}, 0.0, taken))
    done = done.with_topology(known.topology.for_take(take.n_frames), StageReport({}, 0.0, taken))
    return done.with_skeleton(skeleton, motion, StageReport(posing.as_mapping(), seconds, taken))


def _positions(take: Poses, known: Project) -> Floats:
    """Virtual markers of the take's bodies in the skeleton's order [mm], NaN for bodies that it does not have."""
    names = known.trajectories.names
    bodies = list(dict.fromkeys(map(body_of, names)))
    if not set(bodies) & set(take.names):
        given, wanted = (", ".join(some) for some in (take.names, bodies))
        raise InputError(
            f"{take.name or 'the take'}: its bodies are called {given}, those of the known skeleton {wanted}; "
            "name them alike"
        )
    virtual = trajectories_from_poses(take, length=_axis_length(known.trajectories.positions, names))
    positions = np.full((take.n_frames, len(names), 3), np.nan)
    for column, name in enumerate(names):
        if name in virtual.names:
            positions[:, column] = virtual.positions[:, virtual.names.index(name)]
    return positions


def _axis_length(positions: Floats, names: tuple[str, ...]) -> float:
    """How far the virtual markers are from their bodies' origins [mm]: all alike, as far as they are seen."""
    from_origin = [
        np.nanmedian(np.linalg.norm(positions[:, column] - positions[:, names.index(f"{body_of(name)}:o")], axis=1))
        for column, name in enumerate(names)
        if name.endswith(":x") and not np.isnan(positions[:, column, 0]).all()
    ]
    return float(np.median(from_origin))


def _sentences(
    take: Poses, names: tuple[str, ...], skeleton: Skeleton, seats: tuple[Seat, ...], loose: tuple[int, ...]
) -> tuple[str, ...]:
    def body(limb: int) -> str:
        return body_of(names[int(skeleton.markers_of(limb)[0])])

    bodies = dict.fromkeys(map(body_of, names))
    said = ["posed by the known skeleton"]
    if seats:
        parts = ", ".join(f"{body(seat.limb)} by {seat.shift:.1f} mm and {seat.turn:.1f} degrees" for seat in seats)
        said.append(
            "sensors that sit elsewhere on their limbs than in the calibrated take, placed anew by their joints: "
            + parts
        )
    if loose:
        joints = [skeleton.joints[index] for index in loose]
        parts = ", ".join(f"{body(joint.parent)} - {body(joint.child)}" for joint in joints)
        said.append(f"joints that do not hold together: {parts}; a sensor slipped in the take, or this is another body")
    missing = [name for name in bodies if name not in take.names]
    if missing:
        said.append(f"bodies of the skeleton that the take does not have: {', '.join(missing)}")
    new = [name for name in take.names if name not in bodies]
    if new:
        said.append(f"bodies that the skeleton does not know, left out: {', '.join(new)}")
    return tuple(said)
