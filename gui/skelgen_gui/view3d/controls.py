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
from PySide6.QtGui import QAction, QActionGroup, QKeySequence, QWheelEvent
from PySide6.QtWidgets import QApplication, QHBoxLayout, QMenu, QToolButton, QWidget

from skelgen_gui.model.view_state import MAGNIFICATIONS, TRAIL_SECONDS, Shown
from skelgen_gui.model.viewpoint import DOWN, Viewpoint

_Choice = tuple[str, float | None]  # text and value of something to choose

_KEYS = {"trails": "T", "names": "N", "four": "4"}  # of switches


class Commands(QObject):
    """The actions of the 3-D view.

    Signals
    -------
    shown_changed(Shown)
        The user switched something on or off.

    Attributes
    ----------
    fit, fit_take, front, side, top : QAction
        Move the camera of the view.
    hide, isolate, show_all : QAction
        Hide and show what is selected.
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
        tr = self.tr
        self.fit = self._action(tr("Fit"), "F", tr("Show all of this frame, or what is selected"))
        self.fit_take = self._action(tr("Fit take"), "Shift+F", tr("Show where all of the take happens"))
        self.front = self._action(tr("Front"), "1", tr("Look at the wider side"))
        self.side = self._action(tr("Side"), "3", tr("Look at the narrower side"))
        self.top = self._action(tr("Top"), "7", tr("Look from above"))
        self.hide = self._action(tr("Hide"), "H", tr("Hide what is selected"))
        self.isolate = self._action(tr("Isolate"), "Shift+H", tr("Show nothing but what is selected"))
        self.show_all = self._action(tr("Show all"), "Ctrl+H", tr("Show what was hidden"))
        self.rectangle = self._action(tr("Select"), "B", tr("Drag a rectangle around markers (also: Shift and drag)"))
        self.rectangle.setCheckable(True)
        self.switches = {name: self._switch(name, *words) for name, words in self._switch_words().items()}
        self.choices = {name: self._choice(name, values) for name, values in self._choice_words().items()}
        self.follow(shown)

    @property
    def with_keys(self) -> tuple[QAction, ...]:
        """The actions that have keys."""
        switches = (self.switches[name] for name in _KEYS)
        moves = (self.fit, self.fit_take, self.front, self.side, self.top)
        return (*moves, self.hide, self.isolate, self.show_all, self.rectangle, *switches)

    def fill(self, menu: QMenu) -> None:
        """Add all switches and choices to a menu."""
        menu.addActions(list(self.switches.values()))
        menu.addSeparator()
        titles = {"trail_seconds": self.tr("Length of trails"), "magnification": self.tr("Size of ellipsoids")}
        for name, actions in self.choices.items():
            submenu = menu.addMenu(titles.get(name, self.tr("Up axis")))
            submenu.setToolTipsVisible(True)
            submenu.addActions(actions)

    def _switch_words(self) -> dict[str, tuple[str, str]]:
        """Text and explanation of every switch."""
        tr = self.tr
        return {
            "markers": (tr("Markers"), tr("Measured markers; doubtful ones have a ring")),
            "filled": (tr("Filled markers"), tr("Unseen markers, hollow, where the skeleton places them")),
            "names": (tr("Names"), tr("Names of markers beside them")),
            "trails": (tr("Trails"), tr("Paths of the markers until this frame")),
            "bones": (tr("Bones"), tr("Lines between joints, and to the markers of end limbs")),
            "joints": (tr("Joints"), tr("Joints of the skeleton")),
            "uncertainty": (
                tr("Uncertainty of all joints"),
                tr("Ellipsoids, magnified; else of the selected joint"),
            ),
            "axes": (tr("Axes of joints"), tr("Axes of hinges and universal joints, and of bodies")),
            "floor": (tr("Floor"), tr("Floor grid and shadows")),
            "cameras": (tr("Cameras"), tr("What the cameras see, where they are known")),
            "follow": (tr("Follow"), tr("Go along with what moves")),
            "four": (tr("Four views"), tr("From the front, the side and above, beside the free view")),
            "other": (tr("Second result"), tr("The project that is compared, translucent")),
        }

    def _choice_words(self) -> dict[str, list[_Choice]]:
        """Text and value of everything that can be chosen."""
        seconds: list[_Choice] = [(self.tr("{value:g} s").format(value=value), value) for value in TRAIL_SECONDS]
        times: list[_Choice] = [(self.tr("As large as fits"), None)]
        times += [(self.tr("{value} × standard deviation").format(value=value), value) for value in MAGNIFICATIONS]
        ups: list[_Choice] = [(self.tr("As found from the data"), None)]
        ups += [(self.tr("X up"), 0), (self.tr("Y up"), 1), (self.tr("Z up"), 2)]
        ups += [(self.tr("X down"), DOWN), (self.tr("Y down"), DOWN + 1), (self.tr("Z down"), DOWN + 2)]
        return {"trail_seconds": seconds, "magnification": times, "up": ups}

    def _action(self, text: str, key: str, explanation: str) -> QAction:
        action = QAction(text, self)
        action.setStatusTip(explanation)
        action.setToolTip(f"{explanation} ({key})" if key else explanation)
        action.setShortcut(QKeySequence(key))
        return action

    def _switch(self, name: str, text: str, explanation: str) -> QAction:
        action = self._action(text, _KEYS.get(name, ""), explanation)
        action.setCheckable(True)
        action.toggled.connect(partial(self._set, name))
        return action

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
