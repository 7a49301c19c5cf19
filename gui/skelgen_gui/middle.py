"""The middle of the window: the views of the take, or the one view that a page brings."""

from __future__ import annotations

from PySide6.QtCore import QByteArray
from PySide6.QtWidgets import QDockWidget, QMainWindow, QStackedWidget, QWidget


class Middle(QStackedWidget):
    """Shows the views of the take until a page brings another one, which also gets the room of the take's docks.

    Parameters
    ----------
    usual : QWidget
        The views of the take.
    window : QMainWindow
        Whose docks make room; that of the pages stays.
    """

    def __init__(self, usual: QWidget, window: QMainWindow) -> None:
        super().__init__(window)
        self._usual, self._window = usual, window
        self._layout: QByteArray | None = None
        self.addWidget(usual)

    def show_view(self, view: QWidget | None) -> None:
        """Show the view of a page; None shows those of the take."""
        if view is not None and self.indexOf(view) < 0:
            self.addWidget(view)
        self.setCurrentWidget(view or self._usual)
        if view is not None and self._layout is None:
            self._make_room()
        elif view is None and self._layout is not None:
            layout, self._layout = self._layout, None
            self._window.restoreState(layout)

    def layout_of_window(self) -> QByteArray:
        """Return the arrangement of the window's docks as it is while the views of the take are shown."""
        return self._window.saveState() if self._layout is None else self._layout

    def _make_room(self) -> None:
        """Hide the docks that have to do with a take only."""
        self._layout = self._window.saveState()
        for dock in self._window.findChildren(QDockWidget):
            if dock.objectName() != "steps":
                dock.hide()
