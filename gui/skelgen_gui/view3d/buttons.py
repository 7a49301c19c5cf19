"""The buttons in the upper right corner of the 3-D view."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QMenu, QToolButton, QWidget

from skelgen_gui.view3d.commands import Commands


class ViewButtons(QWidget):
    """A row of buttons: fit, front, side, top, select, and a menu of what is shown.

    Parameters
    ----------
    commands : Commands
        What they do.
    parent : QWidget
        The view.
    """

    def __init__(self, commands: Commands, parent: QWidget) -> None:
        super().__init__(parent)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(2)
        for action in (commands.fit, commands.front, commands.side, commands.top, commands.rectangle):
            button = self._button(action.toolTip())
            button.setDefaultAction(action)
            button.setAccessibleName(action.text())
            row.addWidget(button)
        self.menu = QMenu(self)
        self.menu.setToolTipsVisible(True)
        commands.fill(self.menu)
        show = self._button(self.tr("What is shown"))
        show.setText(self.tr("Show"))
        show.setAccessibleName(self.tr("Show"))
        show.setMenu(self.menu)
        show.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        row.addWidget(show)

    def _button(self, explanation: str) -> QToolButton:
        button = QToolButton(self)
        button.setAutoRaise(True)
        button.setToolTip(explanation)
        return button
