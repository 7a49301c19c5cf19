"""The Capture page: live on one tab, calibration steps on the others; pictures and space in the middle."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QFileDialog,
    QGridLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QSplitter,
    QTabWidget,
    QWidget,
)

from skelgen.app.capture_jobs.images import CameraImage
from skelgen.app.capture_jobs.messages import CaptureControl, CaptureEnd, FoundInSpace, LiveShot, TargetShot, WandShot
from skelgen.capture.calibration.chessboard import LEAST_CORNERS
from skelgen.model.rig import CameraRig, StereoRig
from skelgen.progress import Monitor
from skelgen_gui.capture.camera_step import CameraStep
from skelgen_gui.capture.forms import FileField, LiveChoice
from skelgen_gui.capture.pictures import Pictures
from skelgen_gui.capture.results import AngleTable, BodyTable, Notices, Numbers
from skelgen_gui.capture.room_step import RoomStep
from skelgen_gui.capture.space import Space
from skelgen_gui.capture.steps import JobPanel
from skelgen_gui.capture.target_steps import JointStep, TargetStep
from skelgen_gui.project.context import Context
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.widgets.layouts import bare_column, column, describe, put_texts, scrolling

if TYPE_CHECKING:
    from skelgen.capture.calibration.taking import BodyProgress, JointProgress

_LEAST_HEIGHT = 48  # px, of the notices: two lines

_NUMBERED = re.compile(r"(.*)-(\d+)")
_SUFFIX = ".mfml"


class LivePanel(JobPanel[LiveShot]):
    """Runs a capture as a job, and shows its numbers.

    Signals
    -------
    ended(CaptureEnd)
        A capture ended.
    open_wanted(Path)
        A recording shall be opened.

    Parameters
    ----------
    jobs, report_error, parent
        As of `JobPanel`.
    """

    ended = Signal(object)
    open_wanted = Signal(object)

    def __init__(self, jobs: Jobs, report_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(jobs, report_error, parent)
        self.choice, self.go = LiveChoice(self), QPushButton(self)
        self.recorder = _RecordRow(self)
        self.numbers, self.angles, self.bodies = Numbers(self), AngleTable(self), BodyTable(self)
        self.notices = Notices(self)
        self._lay_out()
        self.choice.start_wanted.connect(self.start)
        self.recorder.changed.connect(self._set_recording)
        self.recorder.open_wanted.connect(self.open_wanted)
        self.listen()
        self.follow()

    def start(self) -> None:
        """Start a capture as the form says, unless something runs."""
        if self._jobs.is_busy:
            return
        options, control, feed = self.choice.options, CaptureControl(), self.feed
        loading = self.tr("Loading; the first time this takes a minute")
        running = self.tr("Capturing")

        def work(monitor: Monitor) -> CaptureEnd:
            monitor.begin(loading)
            from skelgen.app.capture_jobs.live import LiveCapture  # noqa: PLC0415 - a second; not on the window's thread

            return LiveCapture(options, control, feed, running).run(monitor)

        self.notices.clear()
        self.numbers.setText(loading)
        self.collect(running, control, work, self._finish)

    def stop(self) -> None:
        """Let the capture end after these images."""
        super().stop()
        if self.is_running:
            self.go.setText(self.tr("Stopping…"))

    def _lay_out(self) -> None:
        self.notices.setMinimumHeight(_LEAST_HEIGHT)
        known = QLabel(self.tr("What to know"), self), self.notices
        parts = (self.choice, self.go, self.recorder, self.numbers, self.angles, self.bodies, *known)
        inner = QWidget(self)
        layout = column(inner, parts)
        bare_column(self, [scrolling(inner, QScrollArea(self))])  # on low screens
        for widget, share in ((self.angles, 4), (self.bodies, 3), (self.notices, 1)):
            layout.setStretchFactor(widget, share)

    def _set_recording(self, target: Path | None) -> None:
        if self._control is not None:
            self._control.record = target

    def show_newest(self) -> None:
        """Show the newest images and numbers, and what is to be known."""
        newest, notices = self.feed.take()
        for sentence in notices:
            self.notices.add(sentence)
        if newest is not None:
            self.numbers.show_shot(newest)
            self.angles.show_shot(newest)
            self.bodies.show_shot(newest)
            self.shot.emit(newest)

    def _finish(self, ended: CaptureEnd | None) -> None:
        self.recorder.record.setChecked(False)
        if ended is None:  # cancelled before it began
            self.numbers.clear()
            return
        if ended.recorded:
            self.recorder.recorded = ended.recorded[-1].path
        for recorded in ended.recorded:
            self.notices.add(self.tr("Recorded: {0}, {1} frames.").format(recorded.path, recorded.n_frames))
        if ended.error is not None:
            self.notices.add(str(ended.error))
        counts = self.tr("{0} frames captured, {1} dropped.").format(ended.n_frames, ended.n_dropped)
        self.numbers.setText(self.tr("The capture broke off. {0}").format(counts) if ended.error else counts)
        self.ended.emit(ended)

    def show_failure(self, error: Exception) -> None:
        """Report an error that nobody foresaw; what was recorded stays whole."""
        self.recorder.record.setChecked(False)
        self.numbers.clear()
        self._report_error(error)

    def follow(self) -> None:
        """Enable what can be done now."""
        super().follow()
        describe(self.go, self.tr("Stop the capture") if self.is_running else self.tr("Start the capture"))
        self.choice.setEnabled(not self._jobs.is_busy)
        self.recorder.set_running(self.is_running)


class _RecordRow(QWidget):
    """The file that is recorded, and the button that begins and ends recording.

    Signals
    -------
    changed(object)
        Another file shall be recorded, a path; or none, None.
    open_wanted(object)
        The recording at this path shall be opened.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    changed = Signal(object)
    open_wanted = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.line = QLineEdit(str(Path.home() / f"capture{_SUFFIX}"), self)
        self.browse, self.record, self.open = QPushButton(self), QPushButton(self), QPushButton(self)
        self.recorded: Path | None = None
        put_texts(self)
        self.record.setCheckable(True)
        self.set_running(False)
        layout = QGridLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.line, 0, 0)
        layout.addWidget(self.browse, 0, 1)
        layout.addWidget(self.open, 1, 0)
        layout.addWidget(self.record, 1, 1)
        self.browse.clicked.connect(self._choose)
        self.record.toggled.connect(self._switch)
        self.open.clicked.connect(lambda: self.open_wanted.emit(self.recorded))

    def set_running(self, is_running: bool) -> None:
        """Enable recording while something is captured, and opening what was recorded afterwards."""
        self.record.setEnabled(is_running)
        self.open.setEnabled(not is_running and self.recorded is not None)

    def _choose(self) -> None:
        title, kinds = self.tr("Record into"), self.tr("Recordings (*.mfml *.c3d)")
        name, _ = QFileDialog.getSaveFileName(self, title, self.line.text(), kinds)
        if name:
            path = Path(name)
            self.line.setText(str(path if path.suffix else path.with_suffix(_SUFFIX)))

    def _switch(self, is_on: bool) -> None:
        if is_on:
            self.line.setText(str(free_path(Path(self.line.text()))))
        self.line.setEnabled(not is_on)
        self.browse.setEnabled(not is_on)
        self.record.setText(self.tr("■ End recording") if is_on else self.tr("● Record"))
        self.changed.emit(Path(self.line.text()) if is_on else None)


def free_path(path: Path) -> Path:
    """Return a path; if it exists, the next one with a number behind its name that does not."""
    while path.exists():
        match = _NUMBERED.fullmatch(path.stem)
        stem, number = (match[1], int(match[2])) if match is not None else (path.stem, 1)
        path = path.with_stem(f"{stem}-{number + 1}")
    return path


class CapturePage(QWidget):
    """Captures with two cameras or those of a room, and calibrates them.

    Attributes
    ----------
    view : _CaptureView
        What takes the middle of the window while this page is shown.

    Parameters
    ----------
    context : Context
        What pages are given.
    """

    def __init__(self, context: Context) -> None:
        super().__init__()
        self.setObjectName("page-capture")
        self._cameras = context.cameras
        self.view = _CaptureView()
        self.tabs = QTabWidget(self)
        self.tabs.setDocumentMode(True)
        self.tabs.setUsesScrollButtons(False)
        put_texts(self)
        self.live = LivePanel(context.jobs, context.report_error, self)  # behind the heads of tabs, as Tab goes
        self.camera_step = CameraStep(context.jobs, context.report_error, lambda: self.live.choice.settings.path, self)
        self.room = RoomStep(context.jobs, context.report_error, self)
        self.target = TargetStep(context.jobs, context.report_error, self)
        self.joints = JointStep(context.jobs, context.report_error, self)
        for panel, title, tip in (
            (self.live, self.tr("Live"), self.tr("Capture, see and record")),
            (self.camera_step, self.tr("Cameras"), self.tr("Measure the cameras with a chessboard")),
            (self.room, self.tr("Room"), self.tr("Measure many cameras around a room with a wand")),
            (self.target, self.tr("Rigid body"), self.tr("Measure the balls of a target")),
            (self.joints, self.tr("Joints"), self.tr("Measure the joints between targets")),
        ):
            self.tabs.setTabToolTip(self.tabs.addTab(panel, title), tip)
        bare_column(self, [self.tabs])
        self.live.shot.connect(self.view.show_shot)
        self.live.open_wanted.connect(context.files.open)
        self.live.ended.connect(self._remember)
        self.camera_step.shot.connect(self.view.pictures.show_images)
        self.camera_step.calibrated.connect(self._show_calibrated)
        self.room.shot.connect(self._show_waved)
        self.room.calibrated.connect(self._show_calibrated)
        self.camera_step.forgotten.connect(self.view.pictures.clear)
        self.camera_step.forgotten.connect(self.view.space.clear)
        self._fields = [one.settings for one in (self.live.choice, self.target.form, self.joints.form)]
        for field in self._fields:
            field.changed.connect(partial(self._share, field))
        for step in (self.target, self.joints):
            step.shot.connect(self._show_target)
        for saving in (self.camera_step, self.room, self.target, self.joints):
            saving.saved.connect(self._use)

    def _remember(self, ended: CaptureEnd) -> None:
        """Let the 3-D view know which cameras took the recordings, for when they are opened."""
        for recorded in ended.recorded:
            if ended.settings is not None:
                self._cameras.remember(recorded.path, ended.settings.rig)

    def _show_calibrated(self, rig: StereoRig | CameraRig, found: FoundInSpace) -> None:
        self.view.space.show_rig(rig)
        self.view.space.show_found(found)

    def _show_waved(self, shot: WandShot) -> None:
        progress = shot.progress
        covered = progress.covered >= LEAST_CORNERS
        titles = [f"{name}: {views}" for name, views in zip(progress.names, progress.n_views.tolist(), strict=True)]
        self.view.pictures.show_images(shot.images, titles, tuple(covered))

    def _show_target(self, shot: TargetShot[BodyProgress] | TargetShot[JointProgress]) -> None:
        self.view.show_seen(shot.images, shot.rig, shot.found)

    def _use(self, path: Path) -> None:
        """Go on with settings that were just saved."""
        self.live.choice.settings.show_path(str(path))
        self.joints.read_targets()

    def _share(self, field: FileField) -> None:
        """All steps use one file; the simulated rig, which needs none, leaves those of the others as they are."""
        if field.path:
            for other in self._fields:
                other.show_path(field.path)


class _CaptureView(QSplitter):
    """Pictures above, space below.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(Qt.Orientation.Vertical, parent)
        self.pictures, self.space = Pictures(self), Space(self)
        self.addWidget(self.pictures)
        self.addWidget(self.space)
        self.setStretchFactor(0, 1)
        self.setStretchFactor(1, 1)
        put_texts(self)

    def show_shot(self, shot: LiveShot) -> None:
        """Show the images of one moment of a live capture and what was found in them."""
        self.show_seen(shot.images, shot.settings.rig, shot.found)

    def show_seen(self, images: Sequence[CameraImage], rig: StereoRig | CameraRig, found: FoundInSpace) -> None:
        """Show images and what was found in them.

        Parameters
        ----------
        images : sequence of CameraImage
            Those of all cameras.
        rig : StereoRig or CameraRig
            The cameras.
        found : FoundInSpace
            Points and bodies.
        """
        self.pictures.show_images(images, rig.names if isinstance(rig, CameraRig) else ())
        self.space.show_rig(rig)
        self.space.show_found(found)
