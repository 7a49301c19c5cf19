"""The four stages as the application sees them: the ordered list `PIPELINE` is the pipeline.

A stage's module is imported when it first runs or is first asked for its parameters: scipy, scikit-learn and numba
take seconds to load. ``skelgen --help`` does without this module too: see `skelgen.app.stage_names`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from skelgen.app.corrections import corrected_labels, joint_wishes, known_kinds, limb_wishes, number_of
from skelgen.app.hierarchy import known_tree
from skelgen.app.inputs import check_trajectories, limbs_from_poses, limbs_with_parts, trajectories_from_poses
from skelgen.app.stage_names import JOINTS, LABELS, LIMBS, SKELETON
from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Poses, Project, StageReport, Trajectories
from skelgen.parameters import StageParameters
from skelgen.progress import Monitor

Results = tuple[Any, ...]
"""What a stage adds to a project, as its ``with_...`` method takes it."""


@dataclass(frozen=True)
class Wishes:
    """What the user knows or wants beside the parameters.

    Attributes
    ----------
    n_markers, n_limbs : int or None
        Known numbers; None lets the stages find them.
    n_jobs : int
        Processes for work that can be shared.
    hierarchy : mapping of str to str, or None
        Parent of every limb by name, empty for a root: names of bodies, or limb0, limb1, ...; None finds the tree.
    root : str or None
        Name of the limb that is the root of a tree that is found.
    """

    n_markers: int | None = None
    n_limbs: int | None = None
    n_jobs: int = 1
    hierarchy: Mapping[str, str] | None = None
    root: str | None = None

    def notices(self, stage: str) -> tuple[str, ...]:
        """Return what a stage's report says of what the user gave."""
        if stage == "joints":
            return self._notices_of_tree()
        known = {"labels": ("markers", self.n_markers), "limbs": ("limbs", self.n_limbs)}
        what, number = known.get(stage, ("", None))
        return () if number is None else (f"the number of {what} was given: {number}",)

    def _notices_of_tree(self) -> tuple[str, ...]:
        if self.hierarchy is not None:
            return ("the hierarchy was given",)
        return () if self.root is None else (f"the root was given: {self.root}",)


@dataclass(frozen=True)
class Stage:
    """One stage.

    Attributes
    ----------
    name, command, summary : str
        As in `skelgen.app.stage_names.StageName`.
    module, class_name : str
        Where the parameters are declared.
    given : callable (project) -> bool
        Whether the take already holds this stage's result.
    compute : callable (project, parameters, wishes, monitor) -> Results
        The work; `parameters` is None where the result is given.
    attach : callable ``(project, *results, report) -> Project``
        Puts the results into the project.
    """

    name: str
    command: str
    summary: str
    module: str
    class_name: str
    given: Callable[[Project], bool]
    compute: Callable[[Project, Any, Wishes, Monitor], Results]
    attach: Callable[..., Project]

    def parameters_class(self) -> type[StageParameters]:
        """Return the class that declares the parameters; loads the stage's module."""
        declared: type[StageParameters] = getattr(importlib.import_module(self.module), self.class_name)
        return declared


def stage_names() -> tuple[str, ...]:
    """Return the names of all stages in their order."""
    return tuple(stage.name for stage in PIPELINE)


def find_stage(name: str) -> Stage:
    """Return the stage called `name`, or raise `InputError` that lists the names."""
    for stage in PIPELINE:
        if stage.name == name:
            return stage
    raise InputError(f"there is no stage {name!r}; stages are {', '.join(stage_names())}")


def _label(project: Project, parameters: Any, wishes: Wishes, monitor: Monitor) -> Results:
    return corrected_labels(project, *_found_labels(project, parameters, wishes, monitor), monitor)


def _found_labels(
    project: Project, parameters: Any, wishes: Wishes, monitor: Monitor
) -> tuple[Trajectories, Labelling | None]:
    take = project.take
    if isinstance(take, PointCloud):
        from skelgen.stages.labels import label_with_quality  # noqa: PLC0415 - see the module's docstring

        return label_with_quality(
            take,
            parameters,
            n_markers=wishes.n_markers or number_of(project, "n_markers"),
            identities=project.identities,
            seed=project.seed,
            monitor=monitor,
        )
    if isinstance(take, Poses):
        if project.identities is not None:
            raise InputError(f"{project.name}: the take holds bodies with orientation; no point of it needs a name")
        monitor.notice(
            "the take holds bodies with orientation: each becomes seven virtual markers (its origin and both ends of "
            "its axes), named body:o, body:x, body:-x and so on"
        )
        return trajectories_from_poses(take), None
    from skelgen.stages.labels import check_labels  # noqa: PLC0415 - see the module's docstring

    return check_labels(take, parameters, identities=project.identities, monitor=monitor)


def _attach_labels(
    project: Project, trajectories: Trajectories, labelling: Labelling | None, report: StageReport
) -> Project:
    return project.with_trajectories(trajectories, report, labelling)


def _cluster(project: Project, parameters: Any, wishes: Wishes, monitor: Monitor) -> Results:
    if isinstance(project.take, Poses):
        if wishes.n_limbs not in (None, project.take.n_bodies):
            raise InputError(
                f"{project.name}: the take holds {project.take.n_bodies} bodies, each of which is a limb; "
                f"{wishes.n_limbs} limbs cannot be made of them"
            )
        monitor.notice("each body of the take is a limb: this stage is skipped")
        return (limbs_from_poses(project.take, project.trajectories),)
    check_trajectories(project.trajectories)
    from skelgen.stages.limbs import find_limbs  # noqa: PLC0415 - see the module's docstring

    n_limbs = wishes.n_limbs or number_of(project, "n_limbs")
    told = limb_wishes(project, monitor)
    find = partial(find_limbs, parameters=parameters, n_limbs=n_limbs, seed=project.seed, monitor=monitor, **told)
    limbs = limbs_with_parts(project.trajectories, project.labelling.split if project.has_labelling else (), find)
    if limbs.n_limbs == 1 and n_limbs is None:
        monitor.notice("only one limb is found: all markers move as one, or each by itself; there is no joint")
    return (limbs,)


def _join(project: Project, parameters: Any, wishes: Wishes, monitor: Monitor) -> Results:
    from skelgen.stages.joints import find_joints  # noqa: PLC0415 - see the module's docstring

    topology = find_joints(
        project.trajectories,
        project.limbs,
        parameters,
        seed=project.seed,
        n_jobs=wishes.n_jobs,
        monitor=monitor,
        **(joint_wishes(project, monitor) | known_tree(project, wishes.hierarchy, wishes.root)),
    )
    return (topology,)


def _fit(project: Project, parameters: Any, wishes: Wishes, monitor: Monitor) -> Results:
    from skelgen.stages.skeleton import fit_skeleton  # noqa: PLC0415 - see the module's docstring

    kinds = known_kinds(project, monitor)
    told = parameters.knowing(kinds) if kinds else parameters
    known = {"are_poses": True} if isinstance(project.take, Poses) else {}
    return fit_skeleton(project.trajectories, project.limbs, project.topology, told, monitor=monitor, **known)


PIPELINE = (
    Stage(
        *LABELS,
        module="skelgen.stages.labels",
        class_name="LabelParameters",
        given=lambda project: isinstance(project.take, Poses),
        compute=_label,
        attach=_attach_labels,
    ),
    Stage(
        *LIMBS,
        module="skelgen.stages.limbs",
        class_name="LimbParameters",
        given=lambda project: isinstance(project.take, Poses),
        compute=_cluster,
        attach=Project.with_limbs,
    ),
    Stage(
        *JOINTS,
        module="skelgen.stages.joints",
        class_name="JointParameters",
        given=lambda project: False,
        compute=_join,
        attach=Project.with_topology,
    ),
    Stage(
        *SKELETON,
        module="skelgen.stages.skeleton",
        class_name="SkeletonParameters",
        given=lambda project: False,
        compute=_fit,
        attach=Project.with_skeleton,
    ),
)
"""The stages in the order in which they run."""
