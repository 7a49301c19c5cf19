"""Results of a capture: speed and losses, bodies, joint angles with their deviations, and notices."""

import math
from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QLabel, QListWidget, QTableWidget, QTableWidgetItem, QWidget

from skelgen.app.capture_jobs.messages import LiveShot
from skelgen.capture.target_joints import angle_names
from skelgen_gui.widgets.layouts import fit_columns, put_texts, wrap

MOST_NOTICES = 200
"""Notices that are kept: a loose plug must not fill the memory."""

_NOTHING = "–"


class Numbers(QLabel):
    """Frames per second, latency, losses, what is recorded.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        wrap(self, self.tr("Speed and losses of the capture"))
        put_texts(self)

    def show_shot(self, shot: LiveShot) -> None:
        """Show the numbers of a pair."""
        speed = self.tr("{0:.1f} frames/s, {1} dropped, {2:.1f} ms latency")
        counts = self.tr("frame {0}: {1} balls, {2} points")
        balls = " + ".join(str(len(image.places)) for image in shot.images)
        lines = [speed.format(shot.rate, shot.n_dropped, 1000 * shot.latency)]
        lines.append(counts.format(shot.index, balls, len(shot.found.points)))
        if shot.recorded is not None:
            lines.append(self.tr("recording {0}: {1} frames").format(shot.recorded.path.name, shot.recorded.n_frames))
        self.setText("\n".join(lines))


class ValueTable(QTableWidget):
    """Rows with a name and numbers; the rows stay while their numbers change.

    Signals
    -------
    removal_wanted()
        Delete was pressed.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    removal_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QTableWidget.SelectionBehavior.SelectRows)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        self._names: list[str] = []
        put_texts(self)

    def show_columns(self, titles: Sequence[str]) -> None:
        """Show columns of these titles."""
        self.setColumnCount(len(titles))
        self.setHorizontalHeaderLabels(list(titles))
        fit_columns(self.horizontalHeader(), 0)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Ask for the chosen rows to be taken away."""
        if event.matches(QKeySequence.StandardKey.Delete):
            self.removal_wanted.emit()
        else:
            super().keyPressEvent(event)

    def show_rows(self, rows: Sequence[Sequence[str]]) -> None:
        """Show rows, each a name and its numbers, or the name alone; while the names are the same, all rows stay."""
        names = [name for name, *_ in rows]
        if names != self._names:
            self._names = names
            self._make_rows()
        for row, (_, *texts) in enumerate(rows):
            for column in range(1, self.columnCount()):
                item, text = self.item(row, column), texts[column - 1] if texts else _NOTHING
                if item is not None and item.text() != text:
                    item.setText(text)

    def _make_rows(self) -> None:
        self.setRowCount(len(self._names))
        for row, name in enumerate(self._names):
            for column in range(self.columnCount()):
                item = QTableWidgetItem("" if column else name)
                if column:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                self.setItem(row, column, item)


class AngleTable(ValueTable):
    """Angles of joints, in degrees."""

    def show_shot(self, shot: LiveShot) -> None:
        """Show each angle of a pair with its deviation; the gap once for a joint."""
        rows: list[tuple[str, ...]] = []
        for joint in shot.settings.joints:
            angle = shot.angles.get(joint.name)
            for part, name in enumerate(angle_names(joint)):
                if angle is None:
                    rows.append((name,))
                    continue
                turn, std = math.degrees(angle.angles[part]), math.degrees(angle.std[part])
                rows.append((name, f"{turn:.2f}", f"{std:.2f}", f"{angle.residual:.2f}" if part == 0 else ""))
        self.show_rows(rows)


class BodyTable(ValueTable):
    """Bodies and where they are."""

    def show_shot(self, shot: LiveShot) -> None:
        """Show the place of each body of a pair, and its deviation."""
        rows: list[tuple[str, ...]] = []
        for body in shot.settings.bodies:
            found = shot.found.bodies.get(body.name)
            if found is None:
                rows.append((body.name,))
                continue
            spread = math.sqrt(float(np.trace(found.covariance[3:, 3:])))
            place = (f"{value:.1f}" for value in found.world_from_body[:3, 3].tolist())
            rows.append((body.name, *place, f"{spread:.2f}"))
        self.show_rows(rows)


class Notices(QListWidget):
    """Notices for the user, the newest first.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWordWrap(True)
        put_texts(self)

    def add(self, sentence: str) -> None:
        """Put a sentence at the top, unless it is there already."""
        top = self.item(0)
        if top is None or top.text() != sentence:
            self.insertItem(0, sentence)
            while self.count() > MOST_NOTICES:
                self.takeItem(self.count() - 1)
