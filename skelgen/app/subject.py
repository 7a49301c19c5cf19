"""One body, many takes: a skeleton that was calibrated on one take (the subject) is applied to others."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from skelgen.app.bodies import join_bodies
from skelgen.app.configuration import ParameterValues, Settings
from skelgen.app.corrections import OBEYED_BY_SUBJECT, with_stated_limb_names
from skelgen.app.inputs import body_of, check_take, poses_of_markers, trajectories_from_poses, with_checked_arguments
from skelgen.app.project_file.archive import find_result, open_project
from skelgen.errors import InputError
from skelgen.model import (
    Labelling,
    Limbs,
    Motion,
    PointCloud,
    Poses,
    Project,
    Skeleton,
    StageReport,
    Take,
    Trajectories,
)
from skelgen.model.arrays import Floats
from skelgen.model.joint_spans import JointSpan
from skelgen.progress import SILENT, Monitor
from skelgen.stages import labels
from skelgen.stages.joints import find_joint_spans
from skelgen.stages.subject import SensorShift, SubjectFit, find_moved_sensors, fit_subject, subject_motion


@with_checked_arguments
def apply_subject(
    take: Take | Project,
    subject: Project | Path | str | Sequence[Project | Path | str],
    parameters: ParameterValues = None,
    monitor: Monitor | None = None,
) -> Project:
    """Label and pose a take by skeletons that were calibrated on other takes of the same bodies.

    Parameters
    ----------
    take : PointCloud, Trajectories, Poses or Project
        The new take; corrections that a project holds are applied.
    subject : Project, Path or str, or a sequence of them
        The calibrated take with its skeleton, or the file that holds it; one for each body that the take shows.
    parameters : mapping, Path or str, optional
        As for `skelgen.reconstruct`: ``labels`` says how points are followed, ``skeleton`` which markers are outliers.
    monitor : Monitor, optional
        Receives progress and notices; may cancel.

    Returns
    -------
    Project
        Bone lengths, joints and places of markers are those of the subject; the report of the labels lists what is
        different in this take.

    Raises
    ------
    InputError
        If the take shows another body, or the subject has no skeleton.

    Examples
    --------
    >>> import skelgen
    >>> calibrated = skelgen.reconstruct(skelgen.simulate("rods", seed=1, n_frames=200).take)
    >>> walk = skelgen.simulate("rods", seed=1, n_frames=100).take
    >>> skelgen.apply_subject(walk, calibrated).skeleton.lengths == calibrated.skeleton.lengths
    True
    """
    subjects = [subject] if isinstance(subject, Project | Path | str) else list(subject)
    return run_with_subject(
        take if isinstance(take, Project) else Project(take),
        joined_subjects(subjects),
        settings=Settings(parameters),
        monitor=monitor or SILENT,
    )


def joined_subjects(subjects: Sequence[Project | Path | str]) -> Project:
    """Return what labels a take: the subject that is given, or the bodies of several as one.

    Parameters
    ----------
    subjects : sequence of Project, Path or str
        One or more calibrated takes, or the files that hold them.

    Raises
    ------
    InputError
        If there is none, one has no skeleton yet, or several are not all of markers.
    """
    found = [one if isinstance(one, Project) else open_subject(one) for one in subjects]
    if not found:
        raise InputError("no calibrated skeleton is given; name one for each body that the take shows")
    if len(found) == 1:
        return found[0]
    for one in found:
        check_subject(one, one.name or "the subject")
        if isinstance(one.take, Poses):
            raise InputError(
                f"{one.name}: several skeletons together label takes of markers, and this one is of sensors"
            )
    return join_bodies(found, [None if isinstance(one, Project) else Path(one) for one in subjects])


def open_subject(path: Path | str) -> Project:
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
    return check_subject(open_project(find_result(Path(path))), str(path))


def check_subject(subject: Project, where: str) -> Project:
    """Return a project that has a skeleton, or raise `InputError`.

    Parameters
    ----------
    subject : Project
        Perhaps without a skeleton.
    where : str
        What the error calls it, e.g. the path of its file.
    """
    if not subject.has("skeleton"):
        raise InputError(f"{where}: holds no skeleton yet; run all stages on its take first: skelgen run {where}")
    return subject


def run_with_subject(
    project: Project, subject: Project, *, settings: Settings | None = None, monitor: Monitor = SILENT
) -> Project:
    """Label and pose a take by the skeleton of another take of the same body.

    Parameters
    ----------
    project : Project
        The new take; results that it has are replaced.
    subject : Project
        The calibrated take, all stages done.
    settings : Settings, optional
        Parameters of the stages: `labels` says how points are followed, `skeleton` which markers are outliers.
    monitor : Monitor
        Receives progress and notices; may cancel.

    Returns
    -------
    Project
        Complete. Bone lengths, joints and places of markers are those of `subject`; the report of the labels lists
        what is different in this take.

    Raises
    ------
    InputError
        If the take shows another body, or one take is of markers and the other of bodies with orientation.
    """
    take, settings = project.take, settings or Settings()
    check_subject(subject, subject.name or "the subject")
    if isinstance(take, Poses) != isinstance(subject.take, Poses):
        what = ("markers", "bodies with orientation")
        of_take, of_subject = (what[isinstance(one, Poses)] for one in (take, subject.take))
        raise InputError(f"{project.name}: holds {of_take}, and the calibrated skeleton is of {of_subject}")
    check_take(take)
    if isinstance(take, Poses):
        return _run_with_sensors(project, take, subject, settings, monitor)
    started = time.perf_counter()
    with threadpool_limits(limits=1):
        fit = fit_subject(
            take,
            subject,
            labelling=settings.labels,
            posing=settings.skeleton,
            corrections=project.corrections,
            monitor=monitor,
        )
    seconds = time.perf_counter() - started
    for sentence in fit.notices:
        monitor.notice(sentence)
    notice = _notice_of(subject)
    report = StageReport(settings.labels.as_mapping(), seconds, (notice, *fit.notices))
    labelling = replace(_label_quality(take, fit), subject=_called(subject))
    done = project.with_trajectories(fit.trajectories, report, labelling)
    posing = StageReport(settings.skeleton.as_mapping(), 0.0, (notice,))
    return _as_stated(_with_skeleton(done, subject, fit.limbs, (fit.skeleton, fit.motion), posing), monitor)


def _run_with_sensors(project: Project, take: Poses, subject: Project, settings: Settings, monitor: Monitor) -> Project:
    """Pose a take of bodies with orientation; sensors that sit elsewhere on their limbs are placed anew."""
    started = time.perf_counter()
    monitor.begin("poses of the calibrated skeleton")
    names = subject.trajectories.names
    positions = _virtual_markers(take, subject)
    with threadpool_limits(limits=1):
        skeleton, seats, loose = find_moved_sensors(subject.skeleton, subject.trajectories.positions, positions)
        poses = labels.pose_skeleton(skeleton, positions, settings.skeleton, monitor)
        motion = subject_motion(skeleton, poses, positions, take.rate)
    sentences = _sentences_on_sensors(take, names, skeleton, seats, loose)
    for sentence in sentences:
        monitor.notice(sentence)
    notice = _notice_of(subject)
    trajectories = Trajectories(positions, names, take.rate, take.name, take.notices)
    done = project.with_trajectories(trajectories, StageReport({}, 0.0, (notice, *sentences)))
    limbs = Limbs(skeleton.limb_of_marker, np.full((len(names), len(names)), np.nan), skeleton.limb_names)
    posing = StageReport(settings.skeleton.as_mapping(), time.perf_counter() - started, (notice,))
    spans, _ = find_joint_spans(poses_of_markers(trajectories), subject.topology.parents, take.rate)
    for span in spans:
        monitor.notice(span.sentence(skeleton.limb_names))
    return _with_skeleton(done, subject, limbs, (skeleton, motion), posing, spans)


def _with_skeleton(
    project: Project,
    subject: Project,
    limbs: Limbs,
    found: tuple[Skeleton, Motion],
    report: StageReport,
    spans: tuple[JointSpan, ...] = (),
) -> Project:
    if np.array_equal(limbs.limb_of_marker, subject.limbs.limb_of_marker):
        limbs = replace(limbs, membership=subject.limbs.membership)
    if limbs.n_limbs == subject.limbs.n_limbs:
        bodies, sure = subject.limbs.body_of_limb, subject.limbs.body_probability
        limbs = replace(limbs, body_of_limb=bodies, body_probability=sure)
    done = project.with_limbs(limbs, StageReport({}, 0.0, report.notices))
    notices = tuple(span.sentence(found[0].limb_names) for span in spans)
    topology = replace(subject.topology.for_take(project.take.n_frames), spans=spans)
    done = done.with_topology(topology, StageReport({}, 0.0, (*report.notices, *notices)))
    return done.with_skeleton(*found, report)


def _as_stated(project: Project, monitor: Monitor) -> Project:
    """The project with the limbs' names that the user gave; notices say which corrections are not obeyed."""
    project = with_stated_limb_names(project)
    passed = [one.sentence for one in project.corrections if one.kind not in OBEYED_BY_SUBJECT]
    notices = tuple(f"not obeyed, as the skeleton of another take labels this one: {one}" for one in passed)
    for sentence in notices:
        monitor.notice(sentence)
    report = project.reports["labels"]
    reports = {**project.reports, "labels": replace(report, notices=(*report.notices, *notices))}
    return replace(project, reports=reports)


def _called(subject: Project) -> str:
    return str(subject.source.path if subject.source else subject.name) or "another take"


def _notice_of(subject: Project) -> str:
    return f"taken from the calibrated skeleton of {_called(subject)}"


def _label_quality(take: PointCloud | Trajectories, fit: SubjectFit) -> Labelling:
    """How sure the labels are."""
    if isinstance(take, PointCloud):
        tracked = fit.labels.points
        points = labels.PointLabels(tracked.cloud, tracked.tracks, fit.labels.marker_of_point)
        found = labels.labelling_of_cloud(fit.found, labels.history_of(points, fit.found.n_markers))
    else:
        found = labels.labelling_of_markers(fit.found, fit.found)
    is_edited = fit.edits.touched.any() or fit.edits.deleted.any()
    return labels.corrected_quality(found, fit.edits, isinstance(take, PointCloud)) if is_edited else found


def _virtual_markers(take: Poses, subject: Project) -> Floats:
    """Virtual markers [mm] of the take's bodies in the order of the skeleton's; NaN for bodies that it lacks."""
    names = subject.trajectories.names
    bodies = list(dict.fromkeys(map(body_of, names)))
    if not set(bodies) & set(take.names):
        given, wanted = (", ".join(some) for some in (take.names, bodies))
        raise InputError(
            f"{take.name or 'the take'}: its bodies are called {given}, those of the calibrated skeleton {wanted}; "
            "name them alike"
        )
    virtual = trajectories_from_poses(take, length=_axis_length(subject.trajectories.positions, names))
    positions = np.full((take.n_frames, len(names), 3), np.nan)
    for column, name in enumerate(names):
        if name in virtual.names:
            positions[:, column] = virtual.positions[:, virtual.names.index(name)]
    return positions


def _axis_length(positions: Floats, names: tuple[str, ...]) -> float:
    """Distance [mm] of the virtual markers from the origins of their bodies; it is the same for all."""
    from_origin = [
        np.nanmedian(np.linalg.norm(positions[:, column] - positions[:, names.index(f"{body_of(name)}:o")], axis=1))
        for column, name in enumerate(names)
        if name.endswith(":x") and not np.isnan(positions[:, column, 0]).all()
    ]
    return float(np.median(from_origin))


def _sentences_on_sensors(
    take: Poses, names: tuple[str, ...], skeleton: Skeleton, seats: Sequence[SensorShift], loose: Sequence[int]
) -> tuple[str, ...]:
    def body(limb: int) -> str:
        return body_of(names[int(skeleton.markers_of(limb)[0])])

    bodies = dict.fromkeys(map(body_of, names))
    notices = ["posed by the calibrated skeleton"]
    if seats:
        parts = ", ".join(f"{body(seat.limb)} by {seat.shift:.1f} mm and {seat.turn:.1f} degrees" for seat in seats)
        where = "elsewhere on their limbs than in the calibrated take"
        notices.append(f"sensors that sit {where}, placed anew by their joints: {parts}")
    if loose:
        joints = [skeleton.joints[index] for index in loose]
        parts = ", ".join(f"{body(joint.parent)} - {body(joint.child)}" for joint in joints)
        notices.append(
            f"joints that do not hold together: {parts}; a sensor slipped in the take, or this is another body"
        )
    missing = [name for name in bodies if name not in take.names]
    if missing:
        notices.append(f"bodies of the skeleton that the take does not have: {', '.join(missing)}")
    new = [name for name in take.names if name not in bodies]
    if new:
        notices.append(f"bodies that the skeleton does not have, left out: {', '.join(new)}")
    return tuple(notices)
