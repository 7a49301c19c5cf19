"""Run the stages of the pipeline on a project, from any stage to any other."""

from __future__ import annotations

import time

from threadpoolctl import threadpool_limits

from skelgen._kernels import announce_compiling
from skelgen.app.configuration import Settings
from skelgen.app.inputs import check_take
from skelgen.app.stages import PIPELINE, Stage, Wishes, stage_names
from skelgen.errors import InputError, MissingResultError
from skelgen.model import Project, StageReport
from skelgen.progress import SILENT, Monitor


def run_stages(
    project: Project,
    from_stage: str | None = None,
    until_stage: str | None = None,
    *,
    settings: Settings | None = None,
    wishes: Wishes | None = None,
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
    wishes : Wishes, optional
        Known numbers of markers and limbs, number of processes.
    monitor : Monitor
        Told of progress and notices; may cancel.

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
    settings, wishes = settings or Settings(), wishes or Wishes()
    stages = _stages_between(project, from_stage, until_stage)
    check_take(project.take)
    for stage in stages:
        if not stage.given(project):
            settings.of(stage.name)  # loads the module here, so that the times below are those of the work alone
    with threadpool_limits(limits=1):  # batches of small matrices: more threads only wait for each other
        for stage in stages:
            project = _run(stage, project, settings, wishes, monitor)
    return project


def first_missing_stage(project: Project) -> str:
    """Return the first stage without a result, or the first of all if none is missing."""
    names = stage_names()
    return next((name for name in names if not project.has(name)), names[0])


def _run(stage: Stage, project: Project, settings: Settings, wishes: Wishes, monitor: Monitor) -> Project:
    collecting = CollectingMonitor(monitor)
    collecting.begin(stage.name)
    parameters = None if stage.given(project) else settings.of(stage.name)
    started = time.perf_counter()
    with announce_compiling(lambda kernel: monitor.begin(f"{stage.name}: compiling {kernel}, this once")):
        results = stage.compute(project, parameters, wishes, collecting)
    seconds = time.perf_counter() - started
    if parameters is None:
        report = StageReport({}, seconds, tuple(collecting.notices))
    else:
        report = StageReport(parameters.as_mapping(), seconds, (*wishes.notices(stage.name), *collecting.notices))
    return stage.attach(project, *results, report)


def _stages_between(project: Project, from_stage: str | None, until_stage: str | None) -> tuple[Stage, ...]:
    names = stage_names()
    for name in (from_stage, until_stage):
        if name is not None and name not in names:
            raise InputError(f"there is no stage {name!r}; stages are {', '.join(names)}")
    last = names.index(until_stage or names[-1])
    if from_stage is None and project.has(names[last]):
        from_stage = names[0]  # nothing is missing: the user wants it all done again
    first = names.index(from_stage or first_missing_stage(project))
    if first > last:
        raise InputError(f"the stage {names[first]!r} comes after {names[last]!r}; the order is {', '.join(names)}")
    for name in names[:first]:
        if not project.has(name):
            raise MissingResultError(f"the stage {names[first]!r} needs the result of {name!r}; run that first")
    return PIPELINE[first : last + 1]


class CollectingMonitor:
    """Keep every notice and pass everything on.

    Parameters
    ----------
    watcher : Monitor
        Receives all calls; its `Cancelled` goes through to the stage.

    Attributes
    ----------
    notices : list of str
        What was noticed so far, without repetitions.
    """

    def __init__(self, watcher: Monitor) -> None:
        self._watcher = watcher
        self.notices: list[str] = []

    def begin(self, name: str) -> None:
        """Pass the start on."""
        self._watcher.begin(name)

    def advance(self, done: float, total: float) -> None:
        """Pass the progress on."""
        self._watcher.advance(done, total)

    def notice(self, sentence: str) -> None:
        """Keep the notice and pass it on, once."""
        if sentence not in self.notices:
            self.notices.append(sentence)
            self._watcher.notice(sentence)
