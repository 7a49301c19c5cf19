"""Run the stages of the pipeline on a project, from any stage to any other."""

import time
from collections.abc import Callable

from threadpoolctl import threadpool_limits

from skelgen._kernels import announce_compiling
from skelgen.app.configuration import Settings
from skelgen.app.constraints import RunOptions
from skelgen.app.inputs import check_take
from skelgen.app.stages import PIPELINE, Stage, with_result
from skelgen.errors import InputError, MissingResultError
from skelgen.model import Project, StageReport
from skelgen.model.project import STAGES
from skelgen.progress import SILENT, Monitor


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
    collecting = CollectingMonitor(monitor)
    collecting.begin(stage.name)
    started = time.perf_counter()
    with announce_compiling(_announcing(stage.name, monitor)):
        result = stage.run(project, settings, options, collecting)
    seconds = time.perf_counter() - started
    if stage.is_given(project):
        report = StageReport({}, seconds, tuple(collecting.notices))
    else:
        notices = (*options.notices(stage.name), *collecting.notices)
        report = StageReport(settings.of(stage.name).as_mapping(), seconds, notices)
    return with_result(project, result, report)


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
    for name in STAGES[:first]:
        if not project.has(name):
            raise MissingResultError(f"the stage {STAGES[first]!r} needs the result of {name!r}; run that first")
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
        """Pass the progress on.

        Parameters
        ----------
        done, total : int
            Parts of the work that are done, and all of them.
        """
        self._watcher.advance(done, total)

    def notice(self, sentence: str) -> None:
        """Keep the notice and pass it on, once."""
        if sentence not in self.notices:
            self.notices.append(sentence)
            self._watcher.notice(sentence)
