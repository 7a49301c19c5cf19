"""The Capture page: live on one tab, the assistant that calibrates cameras on the other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QTabWidget, QVBoxLayout, QWidget

from skelgen_gui.capture.assistant import Assistant
from skelgen_gui.capture.live_panel import LivePanel
from skelgen_gui.capture.view import CaptureView
from skelgen_gui.pages.context import Context

if TYPE_CHECKING:
    from skelgen.model.rig import StereoRig
    from skelgen_gui.capture.messages import BoardShot, Ended
    from skelgen_gui.capture.space import Found


class CapturePage(QWidget):
    """Captures with two cameras.

    Attributes
    ----------
    view : CaptureView
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
        self.view = CaptureView()
        self.live = LivePanel(context.jobs, context.tell_error, self)
        self.tabs = QTabWidget(self)
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName(self.tr("Capture or calibrate"))
        self.tabs.setToolTip(self.tr("Capture with cameras that are calibrated, or calibrate them"))
        self.tabs.setTabToolTip(self.tabs.addTab(self.live, self.tr("Live")), self.tr("Capture, see and record"))
        self.assistant = Assistant(context.jobs, context.tell_error, lambda: self.live.choice.settings.path, self)
        self.tabs.setTabToolTip(
            self.tabs.addTab(self.assistant, self.tr("Calibrate cameras")),
            self.tr("Measure the cameras with a chessboard"),
        )
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.tabs)
        self.live.shot.connect(self.view.show_shot)
        self.live.open_wanted.connect(context.files.open)
        self.live.ended.connect(self._remember)
        self.assistant.shot.connect(self._show_board)
        self.assistant.calibrated.connect(self._show_calibrated)
        self.assistant.saved.connect(self._use)

    def _remember(self, ended: Ended) -> None:
        """Let the 3-D view know which cameras took the recordings, for when they are opened."""
        for recorded in ended.recorded:
            if ended.settings is not None:
                self._cameras.remember(recorded.path, ended.settings.rig)

    def _show_board(self, shot: BoardShot) -> None:
        self.view.pictures.show_pair(shot.left, shot.right)

    def _show_calibrated(self, rig: StereoRig, boards: Found) -> None:
        self.view.space.show_rig(rig)
        self.view.space.show_found(boards)

    def _use(self, path: Path) -> None:
        """Capture with settings that were just saved."""
        self.live.choice.settings.show_path(str(path))
