"""What every page is given, with the runner of stages, and the entry of a page in the table of pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from skelgen.app.configuration import Settings
from skelgen.app.pipeline import first_missing_stage, run_stages
from skelgen.errors import SkelgenError
from skelgen.model import Project
from skelgen.model.project import STAGES
from skelgen.progress import Monitor
from skelgen_gui.project.cameras import Cameras
from skelgen_gui.project.document import Document
from skelgen_gui.project.file_actions import FileActions
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.preferences import Preferences

HOME = "open"
"""Key of the page that is shown first; those before it lead to it."""


@dataclass(frozen=True, eq=False)
class Context:
    """What pages read and change.

    Attributes
    ----------
    session : Session
        The open project, frame and selection.
    document : Document
        Changes the project.
    jobs : Jobs
        Long work.
    runner : Runner
        Runs stages.
    preferences : Preferences
        What is kept between runs.
    report_error : callable (error)
        Shows what went wrong.
    files : FileActions
        Opens recordings and projects.
    cameras : Cameras
        Knows which cameras took recordings.
    """

    session: Session
    document: Document
    jobs: Jobs
    runner: Runner
    preferences: Preferences
    report_error: Callable[[Exception], None]
    files: FileActions
    cameras: Cameras


@dataclass(frozen=True)
class PageEntry:
    """One page of the window.

    Attributes
    ----------
    key : str
        Name in project files and tests.
    title : str
        What the user reads, in English.
    tip : str
        One sentence on what it is for.
    make : callable (context) -> QWidget
        Builds it when it is first shown.
    stage : str
        The stage whose result it shows, or empty.
    """

    key: str
    title: str
    tip: str
    make: Callable[[Context], QWidget]
    stage: str = ""


def view_of(page: QWidget) -> QWidget | None:
    """Return the view that a page brings as its attribute ``view``, to take the middle of the window; None if none."""
    view = getattr(page, "view", None)
    return view if isinstance(view, QWidget) else None


class Runner(QObject):
    """Holds the parameters of all forms, and runs the stages with them.

    Parameters
    ----------
    document : Document
        Whose project is computed.
    jobs : Jobs
        Where.
    report_error : callable (error)
        Shows what went wrong.
    parent : QObject, optional
        Owner.

    Signals
    -------
    finished(str)
        The last of the stages has run.
    values_changed()
        Forms have to show other values: another project is open.
    """

    finished = Signal(str)
    values_changed = Signal()

    def __init__(
        self, document: Document, jobs: Jobs, report_error: Callable[[Exception], None], parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._document, self._jobs, self._report_error = document, jobs, report_error
        self._values: dict[str, Mapping[str, Any]] = {}
        self.computes_at_once = True

    def set_values(self, stage: str, values: Mapping[str, Any]) -> None:
        """Note the parameters of a stage for its next run.

        Parameters
        ----------
        stage : str
            Name of the stage.
        values : mapping of str to value
            Its parameters.
        """
        self._values[stage] = dict(values)

    def has_entered(self, stage: str) -> bool:
        """Return whether parameters of a stage were entered, other than those that it ran with."""
        return stage in self._values

    def values(self, stage: str) -> Mapping[str, Any]:
        """Return the parameters of a stage's next run: those of its form, or those that it ran with."""
        project = self._document.session.project
        if stage not in self._values and project is not None and stage in project.reports:
            return project.reports[stage].parameters
        return self._values.get(stage, {})

    @property
    def entered(self) -> Mapping[str, Mapping[str, Any]]:
        """Parameters that were entered in forms, by stage and name."""
        return self._values

    def begin_with(self, values: Mapping[str, Mapping[str, Any]]) -> None:
        """Forget what was entered, and take over the parameters that another project keeps, by stage and name."""
        self._values = dict(values)
        self.values_changed.emit()

    def run(self, stage: str) -> None:
        """Run one stage, and those before it that are missing."""
        project = self._document.session.project
        if project is not None:
            missing = first_missing_stage(project)
            is_missing = not project.has(missing)
            first = missing if is_missing and STAGES.index(missing) < STAGES.index(stage) else stage
            self._start(project, first, stage)

    def run_all(self) -> None:
        """Run what is missing; all stages anew if nothing is."""
        project = self._document.session.project
        if project is not None:
            self._start(project, first_missing_stage(project), STAGES[-1])

    def run_again(self, before: Project) -> None:
        """After a correction, run again what the project had before it, if the user wants that at once."""
        project = self._document.session.project
        had = [stage for stage in STAGES if before.has(stage)]
        if self.computes_at_once and project is not None and had and not project.has(had[-1]):
            self._start(project, first_missing_stage(project), had[-1])

    def _start(self, project: Project, first: str, last: str) -> None:
        try:
            settings = Settings({stage: self.values(stage) for stage in STAGES if self.values(stage)})
        except SkelgenError as error:
            self._report_error(error)
            return

        def work(monitor: Monitor) -> Project:
            return run_stages(project, first, last, settings=settings, monitor=monitor)

        def done(result: Project) -> None:
            self._document.computed(result)
            self.finished.emit(last)

        title = self.tr("Running {0}") if first == last else self.tr("Running {0} to {1}")
        self._jobs.start(title.format(first, last), work, done, self._report_error)
