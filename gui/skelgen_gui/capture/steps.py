"""What the calibration steps have in common: a job takes frames until it is told to stop, then calibrates."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QFileDialog,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from skelgen.errors import Cancelled, SkelgenError
from skelgen_gui.capture.camera_views import VerdictLabel
from skelgen_gui.capture.feed import Feed
from skelgen_gui.capture.forms import SourceForm
from skelgen_gui.project.jobs import Jobs

if TYPE_CHECKING:
    from skelgen.model.rig import CaptureSettings
    from skelgen_gui.capture.messages import TakenShot
    from skelgen_gui.capture.taking import Taking


class Step(QWidget):
    """One step: a button that starts and stops, a sentence on how far it is, a verdict.

    Signals
    -------
    shot(object)
        The newest pair of images, and what was found in it.
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
    jobs : Jobs
        Where the work is done.
    tell_error : callable (error)
        Shows faults that nobody foresaw.
    parent : QWidget, optional
        Parent widget.
    """

    shot = Signal(object)
    saved = Signal(object)

    def __init__(self, jobs: Jobs, tell_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._jobs, self._tell_error = jobs, tell_error
        self._stop: Event | None = None
        self.feed: Feed[Any] = Feed(self)
        self.go, self.state, self.verdict = QPushButton(self), QLabel(self), VerdictLabel(self)
        self.state.setWordWrap(True)
        self.state.setTextFormat(Qt.TextFormat.PlainText)
        self.results: tuple[QWidget, ...] = ()
        self._area = QScrollArea(self)
        self.feed.arrived.connect(self.hear)
        self.go.clicked.connect(self._start_or_stop)
        jobs.begun.connect(self.follow)
        jobs.ended.connect(self.follow)

    @property
    def is_gathering(self) -> bool:
        """Whether frames are being taken."""
        return self._stop is not None

    def start(self) -> None:
        """Take frames as the form says, unless something runs."""
        raise NotImplementedError

    def hear(self) -> None:
        """Show what came newest."""
        raise NotImplementedError

    def follow(self) -> None:
        """What can be done depends on what runs and what is there."""
        if not self._jobs.is_busy:
            self._stop = None  # one that was cancelled before it began says nothing
        self.go.setText(self.tr("Stop") if self.is_gathering else self.tr("Start"))
        self.go.setEnabled(self.is_gathering or not self._jobs.is_busy)

    def stop(self) -> None:
        """End after this pair."""
        if self._stop is not None:
            self._stop.set()
            self.go.setEnabled(False)

    def run(self, title: str, work: Callable[[Any], Any], done: Callable[[Any], None]) -> None:
        """Do some work as a job; what it cannot do is told where the verdict stands."""
        self._jobs.start(title, work, done, self._fail)

    def gather(self, title: str, stop: Event, work: Callable[[Any], Any], done: Callable[[Any], None]) -> None:
        """Take frames as a job, until `stop` is set."""

        def until_cancelled(monitor: Any) -> Any:
            try:
                return work(monitor)
            except Cancelled:  # as good an end as any: what was taken stays
                return None

        def finish(result: Any) -> None:
            self._stop = None
            self.hear()
            done(result)
            self.follow()

        self._stop = stop
        if not self._jobs.start(title, until_cancelled, finish, self._fail):
            self._stop = None
        self.follow()

    def show_end(self) -> None:
        """Scroll to what came out, the verdict before all, when the layout has made room."""

        def scroll() -> None:
            for widget in (*self.results, self.verdict):
                self._area.ensureWidgetVisible(widget)

        QTimer.singleShot(0, self, scroll)

    def lay_out(self, parts: Iterable[QWidget | QLayout]) -> None:
        """Put everything below each other, where it can be scrolled."""
        inner = QWidget(self)
        column = QVBoxLayout(inner)
        for part in parts:
            if isinstance(part, QWidget):
                column.addWidget(part)
            else:
                column.addLayout(part)
        column.addStretch(1)
        area = self._area
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # what is in it is reached by Tab, and scrolled to
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setWidget(inner)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(area)

    def _start_or_stop(self) -> None:
        if self.is_gathering:
            self.stop()
        else:
            self.start()

    def _fail(self, error: Exception) -> None:
        self._stop = None
        self.hear()
        if isinstance(error, SkelgenError):
            self.verdict.show_problem(str(error))
            self.show_end()
        else:
            self._tell_error(error)
        self.follow()


def row_of(*widgets: QWidget) -> QHBoxLayout:
    """Return widgets beside each other."""
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    return row


@dataclass(frozen=True)
class Plan:
    """What a step does on another thread; made of what its form says, without widgets.

    Attributes
    ----------
    take : callable (stop, feed) -> Taking
        Begins to take frames.
    calibrate : callable (taking, monitor) -> calibration
        Computes what they tell.
    """

    take: Callable[[Event, Any], Taking]
    calibrate: Callable[[Any, Any], Any]


@dataclass(eq=False)
class _Kept:
    """What was taken, whatever ended it."""

    taking: Taking | None = None


class AddingStep(Step):
    """Takes frames until it is told to stop, calibrates at once, and adds the result to the settings.

    Attributes
    ----------
    form : SourceForm
        Settings and source.
    calibrate, add : QPushButton
        Calibrate once more with the same frames; write the result.
    found : calibration or None
        What came out.

    Parameters
    ----------
    form : SourceForm
        What the step is told.
    jobs, tell_error, parent
        As of `Step`.
    """

    def __init__(
        self,
        form: SourceForm,
        jobs: Jobs,
        tell_error: Callable[[Exception], None],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(jobs, tell_error, parent)
        self.form: Any = form
        self.calibrate, self.add = QPushButton(self.tr("Calibrate"), self), QPushButton(self)
        self.add.setText(self.tr("Add to settings"))
        self.add.setAccessibleName(self.add.text())
        self.calibrate.setAccessibleName(self.calibrate.text())
        self.calibrate.setToolTip(self.tr("Compute once more from the pairs of images that were taken last"))
        self.state.setAccessibleName(self.tr("How far it is"))
        self.state.setText(self.invitation)
        self._kept = _Kept()
        self.found: Any = None
        self._said = ""
        self.calibrate.clicked.connect(self.run_calibration)
        self.add.clicked.connect(self.add_to_settings)
        form.start_wanted.connect(self.start)

    @property
    def invitation(self) -> str:
        """What to do, before anything is seen."""
        raise NotImplementedError

    def plan(self) -> Plan:
        """Return what is to be done as the form says now."""
        raise NotImplementedError

    def show_progress(self, progress: Any) -> None:
        """Show how far it is."""
        raise NotImplementedError

    def show_found(self, found: Any) -> None:
        """Show what came out; None if nothing has yet."""
        raise NotImplementedError

    def change(self, told: list[str]) -> Callable[[CaptureSettings], CaptureSettings]:
        """Return what adds the result to settings, on another thread; what the user should know goes to `told`."""
        raise NotImplementedError

    def start(self) -> None:
        """Take frames as the form says, from the beginning."""
        if self._jobs.is_busy:
            return
        plan, stop, feed, kept = self.plan(), Event(), self.feed, _Kept()
        loading, title, computing = self.tr("Loading"), self.tr("Taking pairs of images"), self.tr("Calibrating")

        def work(monitor: Any) -> Any:
            monitor.begin(loading)
            kept.taking = plan.take(stop, feed)
            kept.taking.run(title, monitor)
            monitor.begin(computing)
            return plan.calibrate(kept.taking, monitor)

        self._forget()
        self._kept, self._said = kept, ""
        self.state.setText(self.invitation)
        self.gather(title, stop, work, self._show)

    def run_calibration(self) -> None:
        """Calibrate with the frames that were taken."""
        taking, plan, title = self._kept.taking, self.plan(), self.tr("Calibrating")
        if self._jobs.is_busy or taking is None:
            return

        def work(monitor: Any) -> Any:
            monitor.begin(title)
            return plan.calibrate(taking, monitor)

        self._forget()
        self.run(title, work, self._show)

    def add_to_settings(self) -> None:
        """Write what was found into the settings; ask for a file if none is in use."""
        path = self.form.settings.path or self._asked()
        taking = self._kept.taking
        if not path or taking is None or taking.settings is None or self.found is None:
            return
        told: list[str] = []
        change, seen_with = self.change(told), taking.settings

        def work(_: Any) -> None:
            from skelgen_gui.capture.saving import add_to_settings  # noqa: PLC0415 - lxml costs 50 ms

            add_to_settings(Path(path), seen_with, change)

        def done(_: None) -> None:
            self.state.setText("\n".join([self.tr("Added to {0}.").format(path), *told]))
            self.saved.emit(Path(path))

        self.run(self.tr("Saving"), work, done)

    def hear(self) -> None:
        """Show the newest pair, and how far it is."""
        newest, said = self.feed.take()
        self._said = said[-1] if said else self._said
        if newest is not None:
            self._show_shot(newest)

    def follow(self) -> None:
        """What can be done depends on what runs and what is there."""
        super().follow()
        is_busy = self._jobs.is_busy
        self.go.setAccessibleName(
            self.tr("Stop and calibrate") if self.is_gathering else self.tr("Take pairs of images")
        )
        self.go.setToolTip(self.go.accessibleName())
        self.form.setEnabled(not is_busy)
        taking = self._kept.taking
        self.calibrate.setEnabled(taking is not None and taking.settings is not None and not is_busy)
        self.add.setEnabled(self.found is not None and not is_busy)

    def _show_shot(self, shot: TakenShot) -> None:
        self.shot.emit(shot)
        self.show_progress(shot.progress)
        if self._said:
            self.state.setText(f"{self.state.text()} {self._said}")

    def _show(self, found: Any) -> None:
        """Show what came out; nothing does of what was cancelled."""
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

    def _asked(self) -> str:
        title, kinds = self.tr("Save the settings of the capture"), self.tr("Settings (*.xml)")
        name, _ = QFileDialog.getSaveFileName(self, title, "rig.xml", kinds)
        return name if not name or Path(name).suffix else f"{name}.xml"
