"""What a calibration found: the verdict in sentences, and the numbers with their standard deviations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QLabel, QWidget

from skelgen.capture.calibration.verdict import REPEAT, Verdict
from skelgen_gui.capture.results import ValueTable
from skelgen_gui.theme import PROBLEM_ROLE

if TYPE_CHECKING:
    from skelgen.capture.calibration.stereo import StereoCalibration

_HEIGHT = 290  # px, of the table: all its rows


class VerdictLabel(QLabel):
    """What a calibration is worth, or why there is none.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWordWrap(True)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setAccessibleName(self.tr("Verdict on the calibration"))

    def show_verdict(self, verdict: Verdict) -> None:
        """Show a verdict."""
        role = PROBLEM_ROLE if verdict.grade == REPEAT else QPalette.ColorRole.WindowText
        self.setForegroundRole(role)
        self.setText("\n".join(verdict.sentences))

    def show_problem(self, sentence: str) -> None:
        """Say why there is no calibration."""
        self.setForegroundRole(PROBLEM_ROLE)
        self.setText(sentence)


class CameraTable(ValueTable):
    """The numbers of both cameras; hidden while there are none.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        tip = self.tr("What was measured, with standard deviations; what has none was held")
        self.describe(self.tr("Numbers of both cameras"), tip, ("", self.tr("left"), self.tr("right")))
        self.setFixedHeight(_HEIGHT)
        self.hide()

    def show_calibration(self, found: StereoCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.table import camera_rows  # noqa: PLC0415 - only where there is a result

        self.show_rows(camera_rows(found))
        self.show()
