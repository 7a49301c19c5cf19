"""Tool tips that follow the pointer in a picture."""

from __future__ import annotations

import html
from collections.abc import Callable

from PySide6.QtCore import QEvent, QPointF
from PySide6.QtGui import QHelpEvent
from PySide6.QtWidgets import QToolTip, QWidget


def tell(widget: QWidget, event: QEvent, told_at: Callable[[QPointF], str]) -> bool:
    """Show what is told of the place under the pointer, if that is what an event asks for.

    Parameters
    ----------
    widget : QWidget
        Whose event it is.
    event : QEvent
        Any.
    told_at : callable
        Gives lines of plain text for a place in the widget.

    Returns
    -------
    bool
        Whether the event asked for it.
    """
    if event.type() != QEvent.Type.ToolTip or not isinstance(event, QHelpEvent):
        return False
    QToolTip.showText(event.globalPos(), rich(told_at(QPointF(event.pos()))), widget)
    return True


def rich(text: str) -> str:
    """Return plain text as rich text, which Qt wraps, and in which names of markers cannot be taken for tags."""
    return "<qt>" + "<br>".join(html.escape(line) for line in text.split("\n")) + "</qt>"
