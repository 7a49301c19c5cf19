"""What every page gets, with the runner of stages and the cameras, and the entry of a page in the table of pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget
from skelgen_formats.capture_settings import read_any_settings

from skelgen.app.configuration import Settings
from skelgen.app.pipeline import first_missing_stage, run_stages
from skelgen.errors import InputError, SkelgenError
from skelgen.model import PointCloud, Project
from skelgen.model.project import STAGES
from skelgen.model.rig import CameraRig, StereoRig
from skelgen.progress import Monitor
from skelgen_gui.model.viewpoint import ShownCamera, cameras_of
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.file_actions import FileActions
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.project.session import Document, Session
from skelgen_gui.widgets.preferences import Preferences

# How long stages take in proportion, in takes of points and in others
_OF_POINTS = {"labels": 8.0, "limbs": 1.0, "joints": 1.0, "skeleton": 4.0}
_OF_MARKERS = {"labels": 1.0, "limbs": 1.0, "joints": 1.0, "skeleton": 4.0}

_STEREO = "stereo"  # format of a take that was read from the settings of a capture and its images

HOME = "open"
"""Key of the page that is shown first; those before it lead to it."""


@dataclass(frozen=True, eq=False)
class Context:
    """The values that pages read and change.

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
    failed_changed()
        Another stage, or none, has failed.

    Attributes
    ----------
    failed : str
        The stage at which the last run ended with an error; empty if none did.
    entered : mapping of str to mapping
        Parameters that were entered in forms, by stage and name.
    """

    finished = Signal(str)
    values_changed = Signal()
    failed_changed = Signal()

    def __init__(
        self, document: Document, jobs: Jobs, report_error: Callable[[Exception], None], parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._document, self._jobs, self._report_error = document, jobs, report_error
        self.entered: dict[str, Mapping[str, object]] = {}
        self.computes_at_once = True
        self.failed, self._stage = "", ""
        self._running: tuple[Project, str] | None = None
        self._wanted: str | None = None
        jobs.progressed.connect(self._follow_stage)
        jobs.ended.connect(self._go_on)
        jobs.cancelled.connect(self._want_nothing)
        document.session.project_changed.connect(self._follow_project)

    def set_values(self, stage: str, values: Mapping[str, object]) -> None:
        """Note the parameters of a stage for its next run.

        Parameters
        ----------
        stage : str
            Name of the stage.
        values : mapping of str to value
            Its parameters.
        """
        self.entered[stage] = dict(values)

    def has_entered(self, stage: str) -> bool:
        """Return whether parameters of a stage were entered, other than those that it ran with."""
        return stage in self.entered

    def values(self, stage: str) -> Mapping[str, object]:
        """Return the parameters of a stage's next run: those of its form, or those that it ran with."""
        project = self._document.session.project
        if stage not in self.entered and project is not None and stage in project.reports:
            return project.reports[stage].parameters
        return self.entered.get(stage, {})

    @property
    def folder(self) -> str:
        """Where the project is, for dialogs; empty if that is not known."""
        return str(self._document.session.folder or "")

    def begin_with(self, values: Mapping[str, Mapping[str, object]]) -> None:
        """Forget what was entered, and take over the parameters that another project keeps, by stage and name."""
        self.failed = ""
        self.entered = dict(values)
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
        had = [stage for stage in STAGES if before.has(stage)]
        if had:
            self._want(had[-1])

    def take_back(self, index: int) -> None:
        """Take back a correction of a take that a calibrated skeleton labelled: it labels the take again."""
        project = self._document.session.project
        if project is None:
            return
        settings = self._settings()
        if settings is None:
            return

        def work(monitor: Monitor) -> Project:
            from skelgen.app.taking_back import taken_back  # noqa: PLC0415 - loads the stages

            return taken_back(project, index, settings, monitor)

        def done(result: Project) -> None:
            if self._document.session.project is project:  # else it was changed meanwhile
                self._document.take_back(index, result)

        if not self._jobs.start(self.tr("Taking a correction back"), work, done, self._report_error):
            self._report_error(InputError(self.tr("take the correction back when what is computed now is done")))

    def catch_up(self) -> None:
        """After undoing, run what was there in another state of the project and is not in this one."""
        stale = [stage for stage in STAGES if stage in self._document.session.stale]
        if stale:
            self._want(stale[-1])

    def _want(self, last: str) -> None:
        """Run up to a stage, if the user wants that at once and nothing else is waited for."""
        project = self._document.session.project
        if self._wanted is None and self.computes_at_once and project is not None and not project.has(last):
            self._wanted = last
        self._go_on()

    def _follow_project(self) -> None:
        """Drop a run whose project has changed meanwhile, and run that far with the new one: the newest wins."""
        project = self._document.session.project
        if self._running is None or project is self._running[0]:
            return
        begun_with, last = self._running
        self._running = None
        self._jobs.cancel()
        if project is not None and project.take is begun_with.take and not project.has(last):
            self._wanted = last

    def _want_nothing(self) -> None:
        self._wanted = None

    def _go_on(self) -> None:
        """Begin the run that is waited for, as soon as nothing else runs."""
        if self._jobs.is_busy:
            return
        project, last = self._document.session.project, self._wanted
        self._running = self._wanted = None
        if last is None:
            return
        if project is not None and not project.has(last):
            self._start(project, first_missing_stage(project), last, shows=False)

    def _start(self, project: Project, first: str, last: str, *, shows: bool = True) -> None:
        settings = self._settings()
        if settings is None:
            return

        def work(monitor: Monitor) -> Project:
            return run_stages(project, first, last, settings=settings, monitor=monitor)

        def done(result: Project) -> None:
            if self._document.session.project is project:  # else it was changed meanwhile
                self._document.computed(result)
                if shows:
                    self.finished.emit(last)

        def failed(error: Exception) -> None:
            if self._document.session.project is project:
                self.failed = self._stage
                self._report_error(error)
                self.failed_changed.emit()

        title = self.tr("Running {0}") if first == last else self.tr("Running {0} to {1}")
        stages = STAGES[STAGES.index(first) : STAGES.index(last) + 1]
        self.failed, self._stage = "", first
        self.failed_changed.emit()
        if self._jobs.start(title.format(first, last), work, done, failed, _plan(project, stages)):
            self._running = project, last

    def _settings(self) -> Settings | None:
        """The parameters of all stages; None if there are wrong ones, which is told."""
        try:
            return Settings({stage: self.values(stage) for stage in STAGES if self.values(stage)})
        except SkelgenError as error:
            self._report_error(error)
            return None

    def _follow_stage(self, name: str) -> None:
        self._stage = name if name in STAGES else self._stage


def _plan(project: Project, stages: Sequence[str]) -> dict[str, float]:
    """How long each stage takes in proportion: as long as it took before, if all of them ran."""
    reports = [project.reports.get(stage) for stage in stages]
    if all(report is not None and report.seconds > 0 for report in reports):
        return {stage: report.seconds for stage, report in zip(stages, reports, strict=True) if report is not None}
    weights = _OF_POINTS if isinstance(project.take, PointCloud) else _OF_MARKERS
    return {stage: weights[stage] for stage in stages}


class Cameras(QObject):
    """The cameras of the recording that is open.

    Signals
    -------
    changed()
        Others, or none.

    Attributes
    ----------
    shown : tuple of ShownCamera
        The cameras that are shown.

    Parameters
    ----------
    report_error : callable (error)
        Shows what went wrong.
    window : QWidget
        Parent of the dialog.
    """

    changed = Signal()

    def __init__(self, report_error: Callable[[Exception], None], window: QWidget) -> None:
        super().__init__(window)
        self._report_error, self._window = report_error, window
        self.shown: tuple[ShownCamera, ...] = ()
        self._folder = ""
        self._known: dict[Path, StereoRig | CameraRig] = {}
        self._reader = Deriver(self)

    def remember(self, recording: Path, rig: StereoRig | CameraRig) -> None:
        """Note which rig a recording was made with, for when it is opened.

        Parameters
        ----------
        recording : Path
            The recorded file.
        rig : StereoRig or CameraRig
            The cameras that recorded it.
        """
        self._known[recording.absolute()] = rig

    def begin_with(self, project: Project, cameras: tuple[ShownCamera, ...]) -> None:
        """Show the cameras of another project.

        Parameters
        ----------
        project : Project
            If it keeps no cameras, those of its recording are shown, where they are known.
        cameras : tuple of ShownCamera
            The cameras that it keeps.
        """
        self._show(cameras)
        self._folder = "" if project.source is None else str(Path(project.source.path).parent)
        if self.shown or project.source is None:
            return
        path = Path(project.source.path)
        if path in self._known:
            self.show_rig(self._known[path])
        elif project.source.format == _STEREO:
            self._reader.derive(partial(_rig_in, path), self.show_rig, lambda _: None)  # the take is there all the same

    def show_rig(self, rig: StereoRig | CameraRig) -> None:
        """Show the cameras of a rig."""
        self._show(cameras_of(rig))

    def choose(self) -> None:
        """Ask for the settings of a capture, and show their cameras."""
        title, kinds = self.tr("Cameras of a capture"), self.tr("Settings (*.xml)")
        name, _ = QFileDialog.getOpenFileName(self._window, title, self._folder, kinds)
        if name:
            self._reader.derive(partial(_rig_in, Path(name)), self.show_rig, self._report_error)

    def _show(self, cameras: tuple[ShownCamera, ...]) -> None:
        self._reader.forget()  # what is still being read is of the cameras before
        self.shown = cameras
        self.changed.emit()


def _rig_in(path: Path) -> StereoRig | CameraRig:
    """The rig in the settings of a capture; on a thread, as lxml is loaded."""
    return read_any_settings(path).rig
