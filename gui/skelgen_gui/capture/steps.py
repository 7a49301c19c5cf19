"""The calibration steps share this: a job collects images until it is told to stop, then calibrates."""

from abc import abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QFileDialog, QLabel, QLayout, QPushButton, QScrollArea, QWidget

from skelgen.app.capture_jobs.messages import CaptureControl, Feed, TargetShot
from skelgen.errors import Cancelled, SkelgenError
from skelgen.model.rig import AnySettings
from skelgen.progress import Monitor
from skelgen_gui.capture.forms import SourceForm
from skelgen_gui.capture.measured import VerdictLabel
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.widgets.layouts import bare_column, describe, scrolled, wrap

if TYPE_CHECKING:
    from skelgen.app.capture_jobs.collecting import BodyCollector, JointCollector
    from skelgen.capture.calibration.body import BodyCalibration
    from skelgen.capture.calibration.joints import JointCalibration

_T = TypeVar("_T")
_Shot = TypeVar("_Shot")

_ProgressT = TypeVar("_ProgressT")


class JobPanel(QWidget, Generic[_Shot]):
    """A job that takes images until it is told to stop, with the button `go` that starts and stops it.

    Signals
    -------
    shot(object)
        The newest images, and what was found in them.

    Parameters
    ----------
    jobs : Jobs
        Where the work is done.
    report_error : callable (error)
        Shows faults that nobody foresaw.
    parent : QWidget, optional
        Parent widget.
    """

    shot = Signal(object)
    _arrived = Signal()
    go: QPushButton

    def __init__(self, jobs: Jobs, report_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._jobs, self._report_error = jobs, report_error
        self._control: CaptureControl | None = None
        self.feed: Feed[_Shot] = Feed(self._arrived.emit)
        self._arrived.connect(self.show_newest)

    def listen(self) -> None:
        """Follow the button, and all jobs."""
        self.go.clicked.connect(lambda: self.stop() if self.is_running else self.start())
        self._jobs.begun.connect(self.follow)
        self._jobs.ended.connect(self.follow)

    @property
    def is_running(self) -> bool:
        """Whether images are being taken."""
        return self._control is not None

    @abstractmethod
    def start(self) -> None:
        """Take images as the form says, unless something runs."""

    @abstractmethod
    def show_newest(self) -> None:
        """Show the newest images."""

    @abstractmethod
    def show_failure(self, error: Exception) -> None:
        """Show what broke the job off."""

    def follow(self) -> None:
        """Enable what can be done now."""
        if not self._jobs.is_busy:
            self._control = None  # a job that was cancelled before it began does not report its end
        self.go.setText(self.tr("Stop") if self.is_running else self.tr("Start"))
        self.go.setEnabled(self.is_running or not self._jobs.is_busy)

    def stop(self) -> None:
        """End after these images."""
        if self._control is not None:
            self._control.stop.set()
            self.go.setEnabled(False)

    def collect(
        self, title: str, control: CaptureControl, work: Callable[[Monitor], _T], done: Callable[[_T | None], None]
    ) -> None:
        """Collect images as a job, until the control stops it.

        Parameters
        ----------
        title : str
            Progress is reported under this name.
        control : CaptureControl
            Stops the job.
        work : callable (monitor) -> result
            Runs on another thread.
        done : callable (result or None)
            Is called in the window's thread; None if the job was cancelled.
        """

        def until_cancelled(monitor: Monitor) -> _T | None:
            try:
                return work(monitor)
            except Cancelled:  # as good an end as any: what was taken stays
                return None

        def finish(result: _T | None) -> None:
            self._control = None
            self.show_newest()
            done(result)
            self.follow()

        self._control = control
        if not self._jobs.start(title, until_cancelled, finish, self._fail):
            self._control = None
        self.follow()

    def _fail(self, error: Exception) -> None:
        self._control = None
        self.show_newest()
        self.show_failure(error)
        self.follow()


class Step(JobPanel[_Shot]):
    """One step of a calibration: a button that starts and stops, a sentence on how far it is, a verdict.

    Signals
    -------
    saved(object)
        Settings were written; their path.

    Attributes
    ----------
    go : QPushButton
        Starts and stops.
    state : QLabel
        How far it is.
    verdict : VerdictLabel
        What came out, or what is wrong.
    results : tuple of QWidget
        What shows the numbers of it.

    Parameters
    ----------
    jobs, report_error, parent
        As of `JobPanel`.
    """

    saved = Signal(object)

    def __init__(self, jobs: Jobs, report_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(jobs, report_error, parent)
        self.go, self.state, self.verdict = QPushButton(self), QLabel(self), VerdictLabel(self)
        wrap(self.state, self.tr("How far it is"))
        self.results: tuple[QWidget, ...] = ()
        self._area = QScrollArea(self)
        self.listen()

    def run(self, title: str, work: Callable[[Monitor], _T], done: Callable[[_T], None]) -> None:
        """Do some work as a job; an error is shown where the verdict stands.

        Parameters
        ----------
        title : str
            Progress is reported under this name.
        work : callable (monitor) -> result
            Runs on another thread.
        done : callable (result)
            Is called in the window's thread.
        """
        self._jobs.start(title, work, done, self._fail)

    def asked_settings(self, proposed: str) -> Path | None:
        """Ask where to save the settings, beginning with a proposed file; None if the user cancels."""
        title, kinds = self.tr("Save the settings of the capture"), self.tr("Settings (*.xml)")
        name, _ = QFileDialog.getSaveFileName(self, title, proposed, kinds)
        return Path(name if Path(name).suffix else f"{name}.xml") if name else None

    def show_end(self) -> None:
        """Scroll to what came out, the verdict before all, when the layout has made room."""

        def scroll() -> None:
            for widget in (*self.results, self.verdict):
                self._area.ensureWidgetVisible(widget)

        QTimer.singleShot(0, self, scroll)

    def lay_out(self, parts: Iterable[QWidget | QLayout]) -> None:
        """Put everything below each other, where it can be scrolled."""
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        bare_column(self, [scrolled(parts, self._area, has_margin=True)])

    def show_failure(self, error: Exception) -> None:
        """Say where the verdict stands what is wrong with images or forms; report what nobody foresaw."""
        if isinstance(error, SkelgenError):
            self.verdict.show_problem(str(error))
            self.show_end()
        else:
            self._report_error(error)


_CollectorT = TypeVar("_CollectorT", bound="BodyCollector | JointCollector")
_CalibrationT = TypeVar("_CalibrationT", bound="BodyCalibration | JointCalibration")


@dataclass(frozen=True)
class Plan(Generic[_CollectorT, _CalibrationT, _ProgressT]):
    """The work of a calibration step on another thread, made from the values of its form, without widgets.

    Attributes
    ----------
    collector : callable (control, feed) -> collector
        Makes the job that collects images.
    calibrate : callable (collector, monitor) -> calibration
        Calibrates from what was collected.
    """

    collector: Callable[[CaptureControl, Feed[TargetShot[_ProgressT]]], _CollectorT]
    calibrate: Callable[[_CollectorT, Monitor], _CalibrationT]


class AddingStep(Step[TargetShot[_ProgressT]], Generic[_CollectorT, _CalibrationT, _ProgressT]):
    """Collects images until it is told to stop, calibrates at once, and adds the result to the settings.

    Attributes
    ----------
    form : SourceForm
        Settings and source.
    calibrate, add : QPushButton
        Calibrate once more with the same images; write the result.
    found : calibration or None
        What came out.

    Parameters
    ----------
    form : SourceForm
        Settings and source.
    jobs, report_error, parent
        As of `Step`.
    """

    def __init__(
        self, form: SourceForm, jobs: Jobs, report_error: Callable[[Exception], None], parent: QWidget | None = None
    ) -> None:
        super().__init__(jobs, report_error, parent)
        self.form = form
        self.calibrate = QPushButton(self.tr("Calibrate"), self)
        self.add = QPushButton(self.tr("Add to settings"), self)
        self.calibrate.setToolTip(self.tr("Compute once more from the pairs of images that were taken last"))
        self.state.setText(self.invitation)
        self._collectors: list[_CollectorT] = []
        self.found: _CalibrationT | None = None
        self._notice = ""
        self.calibrate.clicked.connect(self.run_calibration)
        self.add.clicked.connect(self.add_to_settings)
        form.start_wanted.connect(self.start)

    @property
    @abstractmethod
    def invitation(self) -> str:
        """What the user is asked to do, before anything is seen."""

    @abstractmethod
    def plan(self) -> Plan[_CollectorT, _CalibrationT, _ProgressT]:
        """Return what is to be done as the form says now."""

    @abstractmethod
    def show_progress(self, progress: _ProgressT) -> None:
        """Show how far it is."""

    @abstractmethod
    def show_found(self, found: _CalibrationT | None) -> None:
        """Show what came out; None if nothing has yet."""

    @abstractmethod
    def adding(self, found: _CalibrationT) -> Callable[[Path, AnySettings], tuple[str, ...]]:
        """Return a function that adds a result to settings on another thread, and returns notices."""

    def start(self) -> None:
        """Collect images as the form says, from the beginning."""
        if self._jobs.is_busy:
            return
        plan, control, feed = self.plan(), CaptureControl(), self.feed
        collectors = self._collectors = []
        loading, title, computing = self.tr("Loading"), self.tr("Taking pairs of images"), self.tr("Calibrating")

        def work(monitor: Monitor) -> _CalibrationT:
            monitor.begin(loading)
            collector = plan.collector(control, feed)
            collectors.append(collector)  # at once: what it takes stays, whatever ends it
            collector.run(title, monitor)
            monitor.begin(computing)
            return plan.calibrate(collector, monitor)

        self._forget()
        self._notice = ""
        self.state.setText(self.invitation)
        self.collect(title, control, work, self._show)

    def run_calibration(self) -> None:
        """Calibrate with the images that were collected."""
        collector, plan, title = self._collector, self.plan(), self.tr("Calibrating")
        if self._jobs.is_busy or collector is None:
            return

        def work(monitor: Monitor) -> _CalibrationT:
            monitor.begin(title)
            return plan.calibrate(collector, monitor)

        self._forget()
        self.run(title, work, self._show)

    def add_to_settings(self) -> None:
        """Write what was found into the settings; ask for a file if none is in use."""
        path, collector = self.form.settings.path or self.asked_settings("rig.xml"), self._collector
        if not path or collector is None or collector.settings is None or self.found is None:
            return
        add, used = self.adding(self.found), collector.settings

        def work(_: Monitor) -> tuple[str, ...]:
            return add(Path(path), used)

        def done(notices: tuple[str, ...]) -> None:
            self.state.setText("\n".join([self.tr("Added to {0}.").format(path), *notices]))
            self.saved.emit(Path(path))

        self.run(self.tr("Saving"), work, done)

    def show_newest(self) -> None:
        """Show the newest pair, and how far it is."""
        newest, notices = self.feed.take()
        self._notice = notices[-1] if notices else self._notice
        if newest is not None:
            self.shot.emit(newest)
            self.show_progress(newest.progress)
            if self._notice:
                self.state.setText(f"{self.state.text()} {self._notice}")

    def follow(self) -> None:
        """Enable what can be done now."""
        super().follow()
        is_busy = self._jobs.is_busy
        describe(self.go, self.tr("Stop and calibrate") if self.is_running else self.tr("Take pairs of images"))
        self.form.setEnabled(not is_busy)
        collector = self._collector
        self.calibrate.setEnabled(collector is not None and collector.settings is not None and not is_busy)
        self.add.setEnabled(self.found is not None and not is_busy)

    @property
    def _collector(self) -> _CollectorT | None:
        """The job that collected images last; its images stay, whatever ended it."""
        return self._collectors[-1] if self._collectors else None

    def _show(self, found: _CalibrationT | None) -> None:
        """Show what came out; None if it was cancelled."""
        if found is None:
            return
        self.found = found
        self.verdict.show_verdict(found.verdict)
        self.show_found(found)
        self.show_end()
        self.follow()

    def _forget(self) -> None:
        self.found = None
        self.verdict.clear()
        self.show_found(None)
