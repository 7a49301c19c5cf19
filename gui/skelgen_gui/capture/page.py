"""The Capture page: live on one tab, the assistant that calibrates cameras on the other."""

from __future__ import annotations

from PySide6.QtWidgets import QTabWidget, QVBoxLayout, QWidget

from skelgen_gui.capture.live_panel import LivePanel
from skelgen_gui.capture.view import CaptureView
from skelgen_gui.pages.context import Context


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
        self.view: QWidget = CaptureView()
        self.live = LivePanel(context.jobs, context.tell_error, self)
        self.tabs = QTabWidget(self)
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName(self.tr("Capture or calibrate"))
        self.tabs.setToolTip(self.tr("Capture with cameras that are calibrated, or calibrate them"))
        self.tabs.setTabToolTip(self.tabs.addTab(self.live, self.tr("Live")), self.tr("Capture, see and record"))
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.tabs)
        self.live.shot.connect(self.view.show_shot)
        self.live.open_wanted.connect(context.files.open)
