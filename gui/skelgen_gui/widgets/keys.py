"""Where keys go, and a ring around what has the focus: lists and buttons keep the keys that they need themselves."""

from PySide6.QtCore import QEvent, QObject, QRectF, Qt
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QApplication,
    QComboBox,
    QFocusFrame,
    QTabBar,
    QWidget,
)

_Key = Qt.Key

ARROW_KEYS = frozenset({_Key.Key_Left, _Key.Key_Right, _Key.Key_Up, _Key.Key_Down})
"""Keys that go about."""

_MOVES = ARROW_KEYS | {_Key.Key_Home, _Key.Key_End, _Key.Key_PageUp, _Key.Key_PageDown}
_MOVED = (QAbstractItemView, QComboBox, QAbstractSlider, QTabBar)
_PRESSED = (QAbstractButton, QComboBox, QAbstractItemView)
_COMMANDS = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier


class KeyKeeper(QObject):
    """Leaves keys to the widget with the focus that would otherwise go to the window's commands.

    Lists and the like keep the keys that go about; Space presses a button that was reached by the keyboard, while after
    a click it is the window's; any widget keeps the keys of its attribute ``own_keys``. Fields for text see to theirs.
    """

    def watch(self, window: QWidget) -> None:
        """Follow the keys of a window, or of a dock that may float."""
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Accept what the widget with the focus needs: Qt then sends it the key."""
        if event.type() != QEvent.Type.ShortcutOverride or not isinstance(event, QKeyEvent):
            return False
        focus = QApplication.focusWidget()
        if focus is None or event.modifiers() & _COMMANDS or not _needs(focus, _Key(event.key())):
            return False
        event.accept()
        return True


def _needs(widget: QWidget, key: Qt.Key) -> bool:
    own: frozenset[Qt.Key] = getattr(widget, "own_keys", frozenset())
    if key in own or (key in _MOVES and isinstance(widget, _MOVED)):
        return True
    by_keyboard = widget.window().testAttribute(Qt.WidgetAttribute.WA_KeyboardFocusChange)
    return key == _Key.Key_Space and by_keyboard and isinstance(widget, _PRESSED)


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
