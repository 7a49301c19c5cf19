"""Run the stages of the pipeline on a project, from any stage to any other."""

import time
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from skelgen._kernels import announce_compiling
from skelgen.app.configuration import Settings
from skelgen.app.constraints import RunOptions, stated_number
from skelgen.app.corrections import is_by_subject
from skelgen.app.first_look import doubt_of_unit
from skelgen.app.inputs import check_take
from skelgen.app.stages import PIPELINE, Stage, with_result
from skelgen.errors import InputError
from skelgen.model import Limbs, Poses, Project, StageReport, Trajectories
from skelgen.model.limbs import with_names_of_limbs
from skelgen.model.project import STAGES
from skelgen.progress import SILENT, Monitor

_POSE_MARKERS = 3
"""Markers that give a limb a pose of its own."""


def run_stages(
    project: Project,
    from_stage: str | None = None,
    until_stage: str | None = None,
    *,
    settings: Settings | None = None,
    options: RunOptions | None = None,
    monitor: Monitor = SILENT,
) -> Project:
    """Run the stages from one to another, both included.

    Parameters
    ----------
    project : Project
        A take, perhaps with results of earlier stages.
    from_stage : str, optional
        First stage to run; by default the first one without a result, or the first of all if there is none.
    until_stage : str, optional
        Last stage to run; by default the last of all.
    settings : Settings, optional
        Parameters of the stages; defaults if left out.
    options : RunOptions, optional
        What the user asks of this run: known numbers, the tree, number of processes.
    monitor : Monitor
        Receives progress and notices; may cancel.

    Returns
    -------
    Project
        With the new results, and a report per stage that ran.

    Raises
    ------
    InputError
        If a stage is unknown or nothing can be found in the take.
    MissingResultError
        If a stage before `from_stage` has not run.
    """
    settings, options = settings or Settings(), options or RunOptions()
    stages = _stages_between(project, from_stage, until_stage)
    check_take(project.take)
    for stage in stages:
        if not stage.is_given(project):
            settings.of(stage.name)  # loads the stage here, so that the times below are those of the work alone
    with threadpool_limits(limits=1):  # batches of small matrices: more threads only wait for each other
        for stage in stages:
            project = _run(stage, project, settings, options, monitor)
    return project


def first_missing_stage(project: Project) -> str:
    """Return the first stage without a result, or the first of all if none is missing."""
    return next((name for name in STAGES if not project.has(name)), STAGES[0])


def check_stage(name: str) -> str:
    """Return the name of a stage, or raise `InputError` that lists the names if there is none."""
    if name not in STAGES:
        raise InputError(f"there is no stage {name!r}; stages are {', '.join(STAGES)}")
    return name


def _run(stage: Stage, project: Project, settings: Settings, options: RunOptions, monitor: Monitor) -> Project:
    collecting = CollectingMonitor(monitor, None if stage.name in STAGES[:2] else project.limbs)
    collecting.begin(stage.name)
    is_given = stage.is_given(project)
    if is_given and settings.is_changed(stage.name):
        collecting.notice(f"no parameter of {stage.name} has an effect: the take brings the result of this stage")
    for sentence in [] if is_given else settings.notices(stage.name, _facts(project, options)):
        collecting.notice(sentence)
    if is_by_subject(project):
        subject = f"the take was labelled by the skeleton of {project.labelling.subject}"
        collecting.notice(f"{subject}, which this run does without: apply that skeleton again (--skeleton) to keep it")
    if stage.name == STAGES[0] and (doubt := doubt_of_unit(project.take)):
        collecting.notice(doubt)
    started = time.perf_counter()
    with announce_compiling(_announcing(stage.name, monitor)):
        result = stage.run(project, settings, options, collecting)
    seconds = time.perf_counter() - started
    if is_given:
        report = StageReport({}, seconds, tuple(collecting.notices))
    else:
        notices = (*options.notices(stage.name), *collecting.notices)
        report = StageReport(settings.of(stage.name).as_mapping(), seconds, notices)
    return with_result(project, result, report)


def _facts(project: Project, options: RunOptions) -> dict[str, object]:
    """What decides, beside other parameters, whether a parameter has an effect."""
    n_limbs = options.n_limbs or stated_number(project, "n_limbs")
    facts: dict[str, object] = {"n_limbs": "given" if n_limbs else "found"}
    if isinstance(project.take, Poses):
        facts["take"] = "bodies"
    elif not isinstance(project.take, Trajectories):
        facts["take"] = "unlabelled"
    elif project.identities is None:  # markers that the user states are followed as points of an unlabelled take are
        facts["take"] = "labelled"
    if project.has("limbs"):
        sizes = np.bincount(project.limbs.limb_of_marker[project.limbs.limb_of_marker >= 0])
        facts["limbs"] = "small" if (sizes < _POSE_MARKERS).any() else "large"
    return facts


def _announcing(stage: str, monitor: Monitor) -> Callable[[str], None]:
    """Return what tells a monitor of the kernels that are compiled, one after the other."""
    compiled: list[str] = []

    def announce(kernel: str) -> None:
        if not compiled:
            monitor.begin(f"{stage}: compiling kernels, this once")
        compiled.append(kernel)
        monitor.advance(len(compiled) - 1, len(compiled))

    return announce


def _stages_between(project: Project, from_stage: str | None, until_stage: str | None) -> tuple[Stage, ...]:
    for name in (from_stage, until_stage):
        if name is not None:
            check_stage(name)
    last = STAGES.index(until_stage or STAGES[-1])
    if from_stage is None and project.has(STAGES[last]):
        from_stage = STAGES[0]  # nothing is missing: the user wants it all done again
    first = STAGES.index(from_stage or first_missing_stage(project))
    if first > last:
        raise InputError(f"the stage {STAGES[first]!r} comes after {STAGES[last]!r}; the order is {', '.join(STAGES)}")
    project.check_before(STAGES[first])
    return PIPELINE[first : last + 1]


class CollectingMonitor:
    """Keep every notice and pass everything on.

    Parameters
    ----------
    watcher : Monitor
        Receives all calls; its `Cancelled` goes through to the stage.
    limbs : Limbs, optional
        The limbs that notices speak of, which have names.

    Attributes
    ----------
    notices : list of str
        What was noticed so far, without repetitions.
    """

    def __init__(self, watcher: Monitor, limbs: Limbs | None = None) -> None:
        self._watcher, self._limbs = watcher, limbs
        self.notices: list[str] = []

    def begin(self, name: str) -> None:
        """Pass the start on."""
        self._watcher.begin(name)

    def advance(self, done: float, total: float) -> None:
        """Pass the progress on.

        Parameters
        ----------
        done, total : int
            Parts of the work that are done, and all of them.
        """
        self._watcher.advance(done, total)

    def notice(self, sentence: str) -> None:
        """Keep the notice and pass it on, once, with the names of limbs."""
        sentence = sentence if self._limbs is None else with_names_of_limbs(sentence, self._limbs)
        if sentence not in self.notices:
            self.notices.append(sentence)
            self._watcher.notice(sentence)
