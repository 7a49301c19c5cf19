"""The Capture page: live on one tab, calibration steps on the others; pictures and space in the middle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter, QTabWidget, QWidget

from skelgen.app.capture_jobs.camera_images import CameraImage
from skelgen.app.capture_jobs.messages import CaptureEnd, FoundInSpace, LiveShot, TargetShot, WandShot
from skelgen.capture.calibration.chessboard import LEAST_CORNERS
from skelgen.model.rig import CameraRig, StereoRig
from skelgen_gui.capture.camera_step import CameraStep
from skelgen_gui.capture.forms import FileField
from skelgen_gui.capture.live import LivePanel
from skelgen_gui.capture.pictures import Pictures
from skelgen_gui.capture.room_step import RoomStep
from skelgen_gui.capture.space import Space
from skelgen_gui.capture.target_steps import JointStep, TargetStep
from skelgen_gui.project.context import Context
from skelgen_gui.widgets.layouts import bare_column, put_texts

if TYPE_CHECKING:
    from skelgen.capture.calibration.taking import BodyProgress, JointProgress


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
        self.camera_step.shot.connect(lambda shot: self.view.pictures.show_pair(shot.left, shot.right))
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
        self.view.pictures.show_all(shot.images, titles, tuple(covered))

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
        if isinstance(rig, CameraRig):
            self.pictures.show_all(images, rig.names)
        else:
            self.pictures.show_pair(*images)
        self.space.show_rig(rig)
        self.space.show_found(found)
