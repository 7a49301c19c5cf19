"""What takes the middle of the window while the Capture page is shown: both pictures, and space below them."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter, QWidget

from skelgen_gui.capture.messages import Shot
from skelgen_gui.capture.pictures import PicturePair
from skelgen_gui.capture.space import Found, Space


class CaptureView(QSplitter):
    """Pictures above, space below.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(Qt.Orientation.Vertical, parent)
        self.pictures, self.space = PicturePair(self), Space(self)
        self.addWidget(self.pictures)
        self.addWidget(self.space)
        self.setStretchFactor(0, 1)
        self.setStretchFactor(1, 1)
        self.setAccessibleName(self.tr("Capture"))

    def show_shot(self, shot: Shot) -> None:
        """Show a pair of images and what was found in it."""
        self.pictures.show_pair(shot.left, shot.right)
        self.space.show_rig(shot.settings.rig)
        self.space.show_found(Found(shot.points, shot.groups, shot.bodies))
