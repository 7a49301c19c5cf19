"""Names, tool tips, rows and scrolled columns, which every page needs."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QScrollArea, QWidget


def describe(widget: QWidget, name: str, tip: str = "") -> None:
    """Give a widget a name for screen readers, and a tool tip.

    Parameters
    ----------
    widget : QWidget
        What is described.
    name : str
        What it is.
    tip : str
        What it does; its name by default.
    """
    widget.setAccessibleName(name)
    widget.setToolTip(tip or name)


def row_of(*widgets: QWidget, is_filled: bool = True) -> QHBoxLayout:
    """Return widgets beside each other.

    Parameters
    ----------
    *widgets : QWidget
        From left to right.
    is_filled : bool
        Whether they share the whole width; otherwise room is left at the right.
    """
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    if not is_filled:
        row.addStretch(1)
    return row


def scroll(inner: QWidget, area: QScrollArea) -> QScrollArea:
    """Show a widget in a frameless area that scrolls; what is in it is reached by Tab.

    Parameters
    ----------
    inner : QWidget
        What is scrolled.
    area : QScrollArea
        Where.
    """
    area.setWidgetResizable(True)
    area.setFrameShape(QScrollArea.Shape.NoFrame)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    area.setWidget(inner)
    return area
