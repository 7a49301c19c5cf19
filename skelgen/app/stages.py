"""The four stages as steps on a project: what each takes from it, calls, and adds to it.

`PIPELINE` lists them in their order; `skelgen.app.pipeline` runs them. A stage is imported when it runs: scipy, numba
and scikit-learn take seconds to load.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

from skelgen.app import constraints, inputs
from skelgen.app.configuration import Settings
from skelgen.app.constraints import RunOptions
from skelgen.app.corrections import corrected_labels
from skelgen.app.limb_names import marker_set_of, named_limbs, names_in_motion, names_of_shape, with_joint_names
from skelgen.app.set_prior import HeldNotices, bodies_by_joints, near_limbs, with_segments, with_tree
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
    Topology,
    Trajectories,
)
from skelgen.progress import Monitor, counted


@dataclass(frozen=True, eq=False)
class LabelResult:
    """Labelled markers, and how sure their labels are; the latter is None for bodies with orientation."""

    trajectories: Trajectories
    labelling: Labelling | None


@dataclass(frozen=True, eq=False)
class SkeletonResult:
    """The rigid skeleton and its motion."""

    skeleton: Skeleton
    motion: Motion


StageResult = LabelResult | Limbs | Topology | SkeletonResult


def with_result(project: Project, result: StageResult, report: StageReport) -> Project:
    """Return a project with the result of a stage, without what later stages have computed from another one.

    Parameters
    ----------
    project : Project
        With the results of all stages before.
    result : StageResult
        What the stage has found.
    report : StageReport
        How it went.
    """
    match result:
        case LabelResult():
            return project.with_trajectories(result.trajectories, report, result.labelling)
        case Limbs():
            return project.with_limbs(result, report)
        case Topology():
            return project.with_topology(result, report)
        case SkeletonResult():
            names = result.skeleton.limb_names
            named = project if names == project.limbs.names else project.before("skeleton").with_limb_names(names)
            return named.with_skeleton(result.skeleton, result.motion, report)


@dataclass(frozen=True)
class Stage:
    """One stage of the pipeline.

    Attributes
    ----------
    name : str
        Also the name of its command, of its parameters and of its report.
    run : callable (project, settings, options, monitor) -> StageResult
        The work on a project that has the results of all stages before.
    """

    name: str
    run: Callable[[Project, Settings, RunOptions, Monitor], StageResult]

    def is_given(self, project: Project) -> bool:
        """Whether the take holds the result of this stage already: bodies with orientation are labelled limbs."""
        return isinstance(project.take, Poses) and self.name in {"labels", "limbs"}


def run_labels(project: Project, settings: Settings, options: RunOptions, monitor: Monitor) -> LabelResult:
    """Label the markers of a take: follow points, repair labelled markers, or put virtual markers on bodies.

    Parameters
    ----------
    project : Project
        With a take; corrections and stated identities are obeyed.
    settings : Settings
        Parameters of the stages.
    options : RunOptions
        Perhaps the number of markers.
    monitor : Monitor
        Receives progress and notices; may cancel.

    Raises
    ------
    InputError
        If nothing can be labelled, or a statement of the user names what does not exist.
    """
    take = project.take
    if isinstance(take, Trajectories) and options.n_markers not in (None, take.n_markers):
        raise InputError(
            f"{project.name}: {counted(options.n_markers or 0, 'marker is', 'markers are')} asked for, but the take "
            f"has {take.n_markers} with names; the number of markers is for takes without names"
        )
    if isinstance(take, PointCloud):
        found = _labels_of_points(project, take, settings, options, monitor)
    elif isinstance(take, Poses):
        found = _labels_of_bodies(project, take, monitor)
    elif take.are_keypoints:
        if project.identities is not None:
            raise InputError(f"{project.name}: keypoints are named by what estimates them; none is to be stated")
        found = LabelResult(take, None)
    else:
        from skelgen.stages.labels import check_labels  # noqa: PLC0415 - see the module's docstring

        identities, seed = project.identities, project.seed
        found = LabelResult(*check_labels(take, settings.labels, identities=identities, seed=seed, monitor=monitor))
    return LabelResult(*corrected_labels(project, found.trajectories, found.labelling, monitor))


def run_limbs(project: Project, settings: Settings, options: RunOptions, monitor: Monitor) -> Limbs:
    """Group the labelled markers of a project into limbs.

    Parameters
    ----------
    project : Project
        With labels.
    settings : Settings
        Parameters of the stages.
    options : RunOptions
        Perhaps the number of limbs.
    monitor : Monitor
        Receives progress and notices; may cancel.

    Raises
    ------
    InputError
        If no limbs can be found, or a statement of the user names what does not exist.
    """
    if isinstance(project.take, Poses):
        return _limbs_of_bodies(project, project.take, options, monitor)
    inputs.check_trajectories(project.trajectories)
    if project.trajectories.are_keypoints:
        return _limbs_of_keypoints(project, options, monitor)
    from skelgen.stages.limbs import doubt_notices, find_limbs  # noqa: PLC0415 - see the module's docstring

    n_limbs = options.n_limbs or constraints.stated_number(project, "n_limbs")
    stated = constraints.limb_constraints(project, settings.limbs.marker_set, monitor)
    is_open = settings.limbs.method == "rigidity" and settings.limbs.n_bodies < 2
    first = None if is_open else n_limbs
    find = partial(find_limbs, parameters=settings.limbs, n_limbs=first, seed=project.seed, monitor=monitor)
    split = project.labelling.split if project.has_labelling else ()
    held = HeldNotices(monitor)
    limbs = inputs.limbs_with_parts(project.trajectories, split, partial(find, constraints=stated, monitor=held))
    parted = bodies_by_joints(project, settings, limbs, stated, monitor)
    if parted is not None:
        stated, held = parted, HeldNotices(monitor)
        limbs = inputs.limbs_with_parts(project.trajectories, split, partial(find, constraints=stated, monitor=held))
    if settings.limbs.marker_set == "auto" and first is None:
        prior = with_segments(project, limbs, stated.with_parameters(settings.limbs), monitor)
        if prior is not None:
            held = HeldNotices(monitor)
            limbs = inputs.limbs_with_parts(project.trajectories, split, partial(find, constraints=prior, monitor=held))
    if n_limbs not in {None, limbs.n_limbs}:
        held, near = HeldNotices(monitor), near_limbs(project.trajectories.names, limbs, split, stated, n_limbs)
        find = partial(find, n_limbs=n_limbs, monitor=held)
        try:
            limbs = inputs.limbs_with_parts(project.trajectories, split, partial(find, constraints=near))
        except InputError:  # the limbs that are found cannot be parted into so few
            limbs = inputs.limbs_with_parts(project.trajectories, split, partial(find, constraints=stated))
    limbs = named_limbs(project, limbs, settings.limbs.marker_set, monitor)
    held.release(limbs)
    if limbs.n_limbs == 1 and n_limbs is None:
        monitor.notice("only one limb is found: all markers move as one, or each by itself; there is no joint")
    for notice in doubt_notices(limbs, project.trajectories.names):
        monitor.notice(notice)
    return limbs


def run_joints(project: Project, settings: Settings, options: RunOptions, monitor: Monitor) -> Topology:
    """Find the joints between the limbs of a project and the tree that they form.

    Parameters
    ----------
    project : Project
        With limbs.
    settings : Settings
        Parameters of the stages.
    options : RunOptions
        Perhaps the tree, its root, or joints that are known.
    monitor : Monitor
        Receives progress and notices; may cancel.

    Raises
    ------
    InputError
        If there is no limb, or a statement of the user cannot be obeyed.
    """
    if project.trajectories.are_keypoints:
        from skelgen.stages.keypoints import find_keypoint_joints  # noqa: PLC0415 - see the module's docstring

        if options.root is not None:
            _limbs_of_keypoints(project, options, monitor)  # says if there is no such point
            if project.limbs.limb_of_marker[project.trajectories.names.index(options.root)] != 0:
                what = "the root of keypoints is chosen with their limbs; run that stage with it"
                raise InputError(f"{project.name}: {what}")
        return find_keypoint_joints(project.trajectories, project.limbs)
    from skelgen.stages.joints import JointSearch  # noqa: PLC0415 - see the module's docstring

    stated = constraints.joint_constraints(project, options, monitor, settings.limbs.marker_set)
    parameters = settings.joints
    if settings.limbs.marker_set == "none":
        parameters = replace(parameters, known_neighbours=False)
    search = JointSearch(project.trajectories, project.limbs, parameters, project.seed)
    find = partial(search.find, monitor=monitor)
    held, prior = HeldNotices(monitor), None
    with _processes(options.n_jobs):
        if isinstance(project.take, Poses):
            return inputs.joints_of_bodies(project, find, stated, monitor)
        topology = find(constraints=stated, monitor=held)
        if settings.limbs.marker_set == "auto":
            names = constraints.names_by_markers(project) if _wears_set(project) else names_of_shape(project)
            prior = with_tree(project, topology, stated, names, monitor)
        if prior is None:
            held.release()
        else:
            topology = find(constraints=prior)
    return topology


def run_skeleton(project: Project, settings: Settings, options: RunOptions, monitor: Monitor) -> SkeletonResult:
    """Fit a skeleton of rigid limbs and its motion to every frame of a project.

    Parameters
    ----------
    project : Project
        With limbs and a tree.
    settings : Settings
        Parameters of the stages.
    options : RunOptions
        None concerns this stage.
    monitor : Monitor
        Receives progress and notices; may cancel.

    Raises
    ------
    InputError
        If no marker of a tree is ever seen, or a correction cannot be obeyed.
    """
    if project.trajectories.are_keypoints:
        from skelgen.stages.keypoints import fit_keypoint_skeleton  # noqa: PLC0415 - see the module's docstring

        skeleton, motion = fit_keypoint_skeleton(project.trajectories, project.limbs)
        return SkeletonResult(replace(skeleton, limb_names=project.limbs.names), motion)
    from skelgen.stages.skeleton import fit_skeleton  # noqa: PLC0415 - see the module's docstring

    held = HeldNotices(monitor)  # limbs get their names at the end
    types, parameters = constraints.joint_types(project, held), settings.skeleton
    if settings.limbs.marker_set == "none":
        parameters = replace(parameters, known_build=False)
    skeleton, motion = fit_skeleton(
        project.trajectories,
        project.limbs,
        project.topology,
        parameters.with_joint_types(types) if types else parameters,
        monitor=held,
        are_poses=isinstance(project.take, Poses),
    )
    names = names_in_motion(project, skeleton, motion, marker_set_of(project), monitor)
    held.release(replace(project.limbs, names=names))
    return SkeletonResult(with_joint_names(project, replace(skeleton, limb_names=names)), motion)


PIPELINE = (
    Stage("labels", run_labels),
    Stage("limbs", run_limbs),
    Stage("joints", run_joints),
    Stage("skeleton", run_skeleton),
)
"""The stages in the order in which they run."""


def _processes(n_jobs: int) -> AbstractContextManager[object]:
    """Share work that can be shared among processes."""
    if n_jobs == 1:
        return nullcontext()
    from joblib import parallel_config  # noqa: PLC0415 - several processes are rare

    return cast(AbstractContextManager[object], parallel_config("loky", n_jobs=n_jobs, inner_max_num_threads=1))


def _wears_set(project: Project) -> bool:
    from skelgen.stages.names import recognised_set  # noqa: PLC0415 - reads tables

    return not isinstance(project.take, Poses) and recognised_set(project.trajectories.names) is not None


def _labels_of_points(
    project: Project, cloud: PointCloud, settings: Settings, options: RunOptions, monitor: Monitor
) -> LabelResult:
    from skelgen.stages.labels import label_markers  # noqa: PLC0415 - see the module's docstring

    trajectories, labelling = label_markers(
        cloud,
        settings.labels,
        n_markers=options.n_markers or constraints.stated_number(project, "n_markers"),
        identities=project.identities,
        seed=project.seed,
        monitor=monitor,
    )
    return LabelResult(trajectories, labelling)


def _labels_of_bodies(project: Project, poses: Poses, monitor: Monitor) -> LabelResult:
    if project.identities is not None:
        raise InputError(f"{project.name}: the take holds bodies with orientation; no point of it needs a name")
    monitor.notice(
        "the take holds bodies with orientation: each becomes seven virtual markers (its origin and both ends of "
        "its axes), named body:o, body:x, body:-x and so on"
    )
    return LabelResult(inputs.trajectories_from_poses(inputs.repaired_sensors(poses, monitor)), None)


def _limbs_of_bodies(project: Project, poses: Poses, options: RunOptions, monitor: Monitor) -> Limbs:
    if options.n_limbs not in (None, poses.n_bodies):
        raise InputError(
            f"{project.name}: the take holds {counted(poses.n_bodies, 'body', 'bodies')}, each of which is a limb; "
            f"{counted(options.n_limbs or 0, 'limb')} cannot be made of them"
        )
    monitor.notice("each body of the take is a limb: this stage is skipped")
    return named_limbs(project, inputs.limbs_from_poses(poses, project.trajectories), "none")


def _limbs_of_keypoints(project: Project, options: RunOptions, monitor: Monitor) -> Limbs:
    if options.n_limbs or options.hierarchy or options.joined or options.parted:
        what = "limbs and tree of keypoints are the bones between them; only their root can be stated"
        raise InputError(f"{project.name}: {what} (`--points markers` reads the points as markers)")
    from skelgen.stages.keypoints import find_keypoint_limbs  # noqa: PLC0415 - see the module's docstring

    limbs = find_keypoint_limbs(project.trajectories, options.root, monitor)
    return named_limbs(project, limbs, "none")
