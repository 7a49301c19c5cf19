"""How the 3-D view is steered: by commands, and by mouse, wheel and keys.

Commands are actions for the view's buttons, its keys and the menus of the window. What a press of a button of the mouse
becomes, and what it does to the viewpoint, are plain functions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from enum import Enum
from functools import partial
from typing import Any

from PySide6.QtCore import QObject, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QAction, QActionGroup, QWheelEvent
from PySide6.QtWidgets import QApplication, QHBoxLayout, QMenu, QToolButton, QWidget

from skelgen.files import read_table
from skelgen_gui.model.view_state import MAGNIFICATIONS, TRAIL_SECONDS, Shown
from skelgen_gui.model.viewpoint import DOWN, Viewpoint
from skelgen_gui.widgets.shortcuts import Command, make_action

_Choice = tuple[str, float | None]  # text and value of something to choose


class Commands(QObject):
    """The actions of the 3-D view.

    Signals
    -------
    shown_changed(Shown)
        The user switched something on or off.

    Attributes
    ----------
    moves, hiding : dict of str to QAction
        What moves the camera of the view, and what hides and shows what is selected, by the names in their table.
    rectangle : QAction
        Checkable: dragging selects by a rectangle instead of turning the view.
    switches : dict of str to QAction
        Checkable, one for every switch of `Shown`, by its name.
    choices : dict of str to list of QAction
        Checkable, one for every value to choose of `Shown`'s other fields, by the field's name.

    Parameters
    ----------
    shown : Shown
        What is shown at first.
    parent : QWidget
        The view.
    """

    shown_changed = Signal(object)

    def __init__(self, shown: Shown, parent: QWidget) -> None:
        super().__init__(parent)
        self._shown = shown
        table = read_table(__file__, "commands")
        made = {
            part: {name: make_action(Command(name, **entry), self) for name, entry in table[part].items()}
            for part in table
        }
        self.moves, self.hiding, self.switches = made["moves"], made["hiding"], made["switches"]
        self.rectangle = made["selecting"]["rectangle"]
        self.rectangle.setCheckable(True)
        for name, action in self.switches.items():
            action.setCheckable(True)
            action.toggled.connect(partial(self._set, name))
        self.choices = {name: self._choice(name, values) for name, values in self._choice_words().items()}
        self.follow(shown)

    @property
    def with_keys(self) -> tuple[QAction, ...]:
        """The actions that have keys."""
        switches = (self.switches[name] for name in ("trails", "names", "four"))
        return (*self.moves.values(), *self.hiding.values(), self.rectangle, *switches)

    def fill(self, menu: QMenu) -> None:
        """Add all switches and choices to a menu."""
        menu.addActions(list(self.switches.values()))
        menu.addSeparator()
        titles = {"trail_seconds": self.tr("Length of trails"), "magnification": self.tr("Size of ellipsoids")}
        for name, actions in self.choices.items():
            submenu = menu.addMenu(titles.get(name, self.tr("Up axis")))
            submenu.setToolTipsVisible(True)
            submenu.addActions(actions)

    def _choice_words(self) -> dict[str, list[_Choice]]:
        """Text and value of everything that can be chosen."""
        seconds: list[_Choice] = [(self.tr("{value:g} s").format(value=value), value) for value in TRAIL_SECONDS]
        times: list[_Choice] = [(self.tr("As large as fits"), None)]
        times += [(self.tr("{value} × standard deviation").format(value=value), value) for value in MAGNIFICATIONS]
        ups: list[_Choice] = [(self.tr("As found from the data"), None)]
        ups += [(self.tr("X up"), 0), (self.tr("Y up"), 1), (self.tr("Z up"), 2)]
        ups += [(self.tr("X down"), DOWN), (self.tr("Y down"), DOWN + 1), (self.tr("Z down"), DOWN + 2)]
        return {"trail_seconds": seconds, "magnification": times, "up": ups}

    def _choice(self, name: str, values: Iterable[_Choice]) -> list[QAction]:
        group = QActionGroup(self)
        actions = []
        for text, value in values:
            action = group.addAction(text)
            action.setCheckable(True)
            action.setData(value)
            actions.append(action)
        group.triggered.connect(lambda action: self._set(name, action.data()))
        return actions

    def _set(self, name: str, value: float | None) -> None:
        changed: dict[str, Any] = {name: value}  # each field has a type of its own
        self.shown_changed.emit(replace(self._shown, **changed))

    def follow(self, shown: Shown) -> None:
        """Check what is shown by now."""
        self._shown = shown
        for name, action in self.switches.items():
            action.setChecked(getattr(shown, name))
        for name, actions in self.choices.items():
            for action in actions:
                action.setChecked(action.data() == getattr(shown, name))


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
        for action in (*(commands.moves[name] for name in ("fit", "front", "side", "top")), commands.rectangle):
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


ARROWS = {Qt.Key.Key_Left: (-1, 0), Qt.Key.Key_Right: (1, 0), Qt.Key.Key_Up: (0, -1), Qt.Key.Key_Down: (0, 1)}
"""Directions of the arrow keys: right, down."""

ZOOMS = {Qt.Key.Key_Plus: 1.2, Qt.Key.Key_Equal: 1.2, Qt.Key.Key_Minus: 1 / 1.2}
"""Factors of the keys that zoom."""

KEY_TURN = math.radians(6)
"""rad, for each press of an arrow key."""

KEY_SHIFT = 40.0
"""px, for each press of an arrow key."""

_TURN = math.radians(0.4)  # per pixel dragged
_WHEEL = 1.0012  # per eighth of a degree: a notch, 120, is 15 %


class DragKind(Enum):
    """The act of a drag while a button is down."""

    CLICK = "click"
    """The pointer has not moved yet, or only trembled."""
    TURN = "turn"
    SHIFT = "shift"
    BAND = "band"


class Drag:
    """A drag of the mouse: the button that is down, and what it moves.

    Attributes
    ----------
    button : Qt.MouseButton
        Which.
    kind : DragKind
        What it has become.

    Parameters
    ----------
    place : QPointF
        Where it was pressed.
    button : Qt.MouseButton
        Which.
    """

    def __init__(self, place: QPointF, button: Qt.MouseButton) -> None:
        self.button = button
        self.kind = DragKind.CLICK
        self._start = self._last = place

    @property
    def band(self) -> QRectF:
        """The rectangle between where it was pressed and where it is."""
        return QRectF(self._start, self._last).normalized()

    def moved_to(self, place: QPointF, wants_band: bool) -> QPointF:
        """Follow the pointer and return the step that it made.

        Parameters
        ----------
        place : QPointF
            Where it is.
        wants_band : bool
            Whether the left button draws a rectangle, should this become a drag now.
        """
        if self.kind is DragKind.CLICK:
            if (place - self._start).manhattanLength() < QApplication.startDragDistance():
                return QPointF()
            left = DragKind.BAND if wants_band else DragKind.TURN
            self.kind = left if self.button == Qt.MouseButton.LeftButton else DragKind.SHIFT
        step = place - self._last
        self._last = place
        return step


def dragged(viewpoint: Viewpoint, kind: DragKind, step: QPointF, height: float) -> Viewpoint:
    """Turn or shift the viewpoint by a step of the pointer.

    Parameters
    ----------
    viewpoint : Viewpoint
        Before the step.
    kind : DragKind
        What the drag does; others than turning and shifting leave the viewpoint.
    step : QPointF, px
        How far the pointer went.
    height : float, px
        Height of the picture.
    """
    if kind is DragKind.TURN:
        return viewpoint.orbited(-_TURN * step.x(), _TURN * step.y())
    return viewpoint.panned(step.x(), step.y(), height) if kind is DragKind.SHIFT else viewpoint


def wheeled(viewpoint: Viewpoint, event: QWheelEvent, widget: QWidget) -> Viewpoint:
    """Zoom the viewpoint at the pointer.

    Parameters
    ----------
    viewpoint : Viewpoint
        Before the wheel was turned.
    event : QWheelEvent
        How far it was turned.
    widget : QWidget
        Shows the picture.
    """
    place = event.position() - QPointF(widget.width() / 2, widget.height() / 2)
    return viewpoint.zoomed(_WHEEL ** event.angleDelta().y(), place.x(), place.y(), widget.height())
