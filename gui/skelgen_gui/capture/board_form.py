"""What the assistant is told: which board, and where its images come from."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSpinBox,
    QWidget,
)

from skelgen.capture.calibration.board import Board
from skelgen_gui.capture.choice import FolderButton, SourceField

SIMULATED_BOARD = "simulated:board?paced=yes&rate=30&frames=1800"
"""A simulated chessboard as cameras would deliver it, for a minute."""

_MOST_CORNERS, _LARGEST_SQUARE = 40, 1000.0


class BoardForm(QWidget):
    """Board, size of a square, and source.

    Signals
    -------
    changed()
        Another board: views of the one before say nothing of it.
    size_changed()
        Another size of its squares.
    start_wanted()
        What the form says shall be looked at.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    changed = Signal()
    size_changed = Signal()
    start_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.columns, self.rows, self.square = QSpinBox(self), QSpinBox(self), QDoubleSpinBox(self)
        self.source = SourceField(self)
        self.folder, self.simulated = FolderButton(self), QPushButton(self)
        self._describe()
        self._lay_out()
        for box in (self.columns, self.rows):
            box.valueChanged.connect(self.changed)
        self.square.valueChanged.connect(self.size_changed)
        self.folder.chosen.connect(self._take_folder)
        self.simulated.clicked.connect(self._choose_simulation)

    @property
    def board(self) -> Board:
        """The board."""
        return Board(self.columns.value(), self.rows.value(), self.square.value())

    def _describe(self) -> None:
        tip = self.tr("Corners where four squares meet, not squares: a chessboard of 10 x 7 squares has 9 x 6")
        for box, value, name in (
            (self.columns, 9, self.tr("Corners along the longer side")),
            (self.rows, 6, self.tr("Corners along the shorter side")),
        ):
            box.setRange(3, _MOST_CORNERS)
            box.setValue(value)
            box.setAccessibleName(name)
            box.setToolTip(tip)
        self.square.setRange(0.1, _LARGEST_SQUARE)
        self.square.setDecimals(3)
        self.square.setValue(25.0)
        self.square.setSuffix(self.tr(" mm"))
        self.square.setAccessibleName(self.tr("Side of a square"))
        self.square.setToolTip(self.tr("Measure over several squares: all lengths in later captures rest on it"))
        self.source.show_hint(self.tr("cameras, a folder, a list or videos"))
        self.simulated.setText(self.tr("Simulated board"))
        self.simulated.setAccessibleName(self.tr("Look at a simulated board"))
        self.simulated.setToolTip(self.tr("Try the assistant without cameras: a board moves before the simulated rig"))

    def _lay_out(self) -> None:
        corners, sources = QHBoxLayout(), QHBoxLayout()
        for widget in (self.columns, QLabel("×", self), self.rows, QLabel(self.tr("corners"), self)):
            corners.addWidget(widget)
        corners.addStretch(1)
        for button in (self.folder, self.simulated):
            sources.addWidget(button)
        sources.addStretch(1)
        layout = QFormLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addRow(self.tr("Board"), corners)
        layout.addRow(self.tr("Square"), self.square)
        layout.addRow(self.tr("Source"), self.source)
        layout.addRow("", sources)

    def _take_folder(self, source: str) -> None:
        self.source.show_source(source)
        self.start_wanted.emit()

    def _choose_simulation(self) -> None:
        self.columns.setValue(9)
        self.rows.setValue(6)
        self.square.setValue(25.0)
        self.source.show_source(SIMULATED_BOARD)
        self.start_wanted.emit()
