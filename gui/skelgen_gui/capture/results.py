"""Results of a capture: speed and losses, bodies, joint angles with their deviations, and notices."""

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QLabel, QListWidget, QTableWidget, QTableWidgetItem, QWidget

from skelgen.app.capture_jobs.messages import LiveShot
from skelgen.capture.target_joints import angle_names
from skelgen.model.rig import CaptureSettings, RoomSettings
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

    def show_names(self, names: Sequence[str]) -> None:
        """Show rows of these names, without numbers."""
        self.setRowCount(len(names))
        for row, name in enumerate(names):
            for column in range(self.columnCount()):
                item = QTableWidgetItem(name if column == 0 else _NOTHING)
                if column:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                self.setItem(row, column, item)

    def show_row(self, row: int, texts: Iterable[str]) -> None:
        """Show the numbers of a row.

        Parameters
        ----------
        row : int
            Which row.
        texts : iterable of str
            Its numbers, behind the name.
        """
        for column, text in enumerate(texts, start=1):
            item = self.item(row, column)
            if item is not None and item.text() != text:
                item.setText(text)

    def show_rows(self, rows: Sequence[Sequence[str]]) -> None:
        """Show other rows, each a name and its numbers."""
        self.show_names([name for name, *_ in rows])
        for row, (_, *texts) in enumerate(rows):
            self.show_row(row, texts)


class _ShotTable(ValueTable):
    """Numbers of each pair of images; the rows follow from the settings."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._settings: CaptureSettings | RoomSettings | None = None

    def show_shot(self, shot: LiveShot) -> None:
        """Show the numbers of a pair."""
        if shot.settings is not self._settings:
            self._settings = shot.settings
            self.show_names(self.names_of(shot.settings))
        for row, texts in enumerate(self.texts_of(shot)):
            self.show_row(row, texts or (_NOTHING,) * (self.columnCount() - 1))

    @abstractmethod
    def names_of(self, settings: CaptureSettings | RoomSettings) -> list[str]:
        """Return the names of the rows."""

    @abstractmethod
    def texts_of(self, shot: LiveShot) -> Iterator[tuple[str, ...]]:
        """Yield the numbers of each row; none for what is not seen."""


class AngleTable(_ShotTable):
    """Angles of joints, in degrees."""

    def names_of(self, settings: CaptureSettings | RoomSettings) -> list[str]:
        """Return a name for each angle."""
        return [name for joint in settings.joints for name in angle_names(joint)]

    def texts_of(self, shot: LiveShot) -> Iterator[tuple[str, ...]]:
        """Yield each angle with its deviation; the gap once for a joint."""
        for joint in shot.settings.joints:
            angle = shot.angles.get(joint.name)
            for part in range(len(angle_names(joint))):
                if angle is None:
                    yield ()
                    continue
                turn, std = math.degrees(angle.angles[part]), math.degrees(angle.std[part])
                yield f"{turn:.2f}", f"{std:.2f}", f"{angle.residual:.2f}" if part == 0 else ""


class BodyTable(_ShotTable):
    """Bodies and where they are."""

    def names_of(self, settings: CaptureSettings | RoomSettings) -> list[str]:
        """Return the names of the bodies."""
        return [body.name for body in settings.bodies]

    def texts_of(self, shot: LiveShot) -> Iterator[tuple[str, ...]]:
        """Yield the place of each body, and its deviation."""
        for body in shot.settings.bodies:
            found = shot.found.bodies.get(body.name)
            if found is None:
                yield ()
                continue
            spread = math.sqrt(float(np.trace(found.covariance[3:, 3:])))
            yield *(f"{value:.1f}" for value in found.world_from_body[:3, 3].tolist()), f"{spread:.2f}"


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
