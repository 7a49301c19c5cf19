"""A ring around what has the focus, once the keyboard goes from one thing to the next: also around painted views."""

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QApplication, QFocusFrame, QWidget

_WIDTH = 2.0  # px
_ROUND = 4.0  # px


class FocusRing(QFocusFrame):
    """Is where the focus is, while it is moved by keys.

    Parameters
    ----------
    window : QWidget
        In which the focus is followed; docks of it that float are followed, too.
    """

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self.hide()  # else it is shown with the window, around nothing
        QApplication.instance().focusChanged.connect(self._follow)  # type: ignore[union-attr]

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the ring in the colour of what is chosen: it stands out on any ground."""
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(self.palette().color(QPalette.ColorRole.Highlight), _WIDTH))
            half = _WIDTH / 2
            painter.drawRoundedRect(QRectF(self.rect()).adjusted(half, half, -half, -half), _ROUND, _ROUND)

    def _follow(self, _: QWidget | None, now: QWidget | None) -> None:
        """Go to where the focus is now, if keys brought it there."""
        is_here = now is not None and (now.window() is self._window or self._window.isAncestorOf(now.window()))
        by_keys = is_here and now is not None and now.window().testAttribute(Qt.WidgetAttribute.WA_KeyboardFocusChange)
        self.setWidget(now if by_keys else None)  # type: ignore[arg-type]
