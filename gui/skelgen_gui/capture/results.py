"""What a capture tells in numbers: speed and losses, bodies, joint angles with their deviations, and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QListWidget,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from skelgen.model.rig import CaptureSettings
from skelgen_gui.capture.messages import Shot

MOST_SENTENCES = 200
"""Sentences that are kept: a loose plug must not fill the memory."""

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
        self.setWordWrap(True)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setAccessibleName(self.tr("Speed and losses of the capture"))
        self.setToolTip(
            self.tr(
                "Pairs a second, pairs that were lost because nobody took them in time, and the time from a pair "
                "of images to the joint angles"
            )
        )

    def show_shot(self, shot: Shot) -> None:
        """Show the numbers of a pair."""
        lines = [
            self.tr("{0:.1f} frames/s, {1} dropped, {2:.1f} ms latency").format(
                shot.rate, shot.n_dropped, 1000 * shot.latency
            ),
            self.tr("frame {3}: {0} and {1} balls, {2} points").format(
                len(shot.left.places), len(shot.right.places), len(shot.points), shot.index
            ),
        ]
        if shot.recorded is not None:
            lines.append(self.tr("recording {0}: {1} frames").format(shot.recorded.path.name, shot.recorded.n_frames))
        self.setText("\n".join(lines))


class ValueTable(QTableWidget):
    """Rows with a name and numbers; the rows stay while their numbers change.

    Parameters
    ----------
    name : str
        What it is, for readers of the screen.
    tip : str
        What its numbers are.
    columns : sequence of str
        Titles.
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, name: str, tip: str, columns: Sequence[str], parent: QWidget | None = None) -> None:
        super().__init__(0, len(columns), parent)
        self.setHorizontalHeaderLabels(list(columns))
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)

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
        """Show the numbers of a row."""
        for column, text in enumerate(texts, start=1):
            item = self.item(row, column)
            if item is not None and item.text() != text:
                item.setText(text)


class AngleTable(ValueTable):
    """Angles of joints, in degrees."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("", "", ("", "", "", ""), parent)
        self.setHorizontalHeaderLabels([self.tr("Joint"), self.tr("Angle [°]"), self.tr("± [°]"), self.tr("Gap [mm]")])
        self.setAccessibleName(self.tr("Joint angles"))
        self.setToolTip(
            self.tr(
                "Angles of joints, their standard deviations, and how far the joint's places in both bodies are "
                "apart; a ball joint has three, the parts of its rotation vector"
            )
        )
        self._settings: CaptureSettings | None = None

    def show_shot(self, shot: Shot) -> None:
        """Show the angles of a pair."""
        if shot.settings is not self._settings:
            self._settings = shot.settings
            self.show_names([name for joint in shot.settings.joints for name in _angle_names(joint.name, joint.kind)])
        row = 0
        for joint in shot.settings.joints:
            angle, n_angles = shot.angles.get(joint.name), len(_angle_names(joint.name, joint.kind))
            for part in range(n_angles):
                self.show_row(
                    row + part,
                    (_NOTHING,) * 3
                    if angle is None
                    else (
                        f"{math.degrees(angle.angles[part]):.2f}",
                        f"{math.degrees(angle.std[part]):.2f}",
                        f"{angle.residual:.2f}" if part == 0 else "",
                    ),
                )
            row += n_angles


class BodyTable(ValueTable):
    """Bodies and where they are."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("", "", ("", "", "", "", ""), parent)
        titles = [self.tr("Body"), self.tr("x [mm]"), self.tr("y [mm]"), self.tr("z [mm]"), self.tr("± [mm]")]
        self.setHorizontalHeaderLabels(titles)
        self.setAccessibleName(self.tr("Bodies"))
        self.setToolTip(
            self.tr(
                "Where bodies are in the rig's world, and the standard deviation of that in all; "
                "a dash stands for one that is not seen"
            )
        )
        self._settings: CaptureSettings | None = None

    def show_shot(self, shot: Shot) -> None:
        """Show the bodies of a pair."""
        if shot.settings is not self._settings:
            self._settings = shot.settings
            self.show_names([body.name for body in shot.settings.bodies])
        for row, body in enumerate(shot.settings.bodies):
            found = shot.bodies.get(body.name)
            if found is None:
                self.show_row(row, (_NOTHING,) * 4)
                continue
            spread = math.sqrt(float(np.trace(found.covariance[3:, 3:])))
            place = found.world_from_body[:3, 3].tolist()
            self.show_row(row, (*(f"{value:.1f}" for value in place), f"{spread:.2f}"))


class Sentences(QListWidget):
    """What the user should know, the newest first.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWordWrap(True)
        self.setAccessibleName(self.tr("What to know of the rig"))
        self.setToolTip(self.tr("Lost cameras, dark or glaring images, cameras that do not fit the settings"))

    def say(self, sentence: str) -> None:
        """Put a sentence at the top, unless it stands there."""
        top = self.item(0)
        if top is None or top.text() != sentence:
            self.insertItem(0, sentence)
            while self.count() > MOST_SENTENCES:
                self.takeItem(self.count() - 1)


def _angle_names(name: str, kind: str) -> tuple[str, ...]:
    return (name,) if kind == "hinge" else tuple(f"{name}.{axis}" for axis in "xyz")
