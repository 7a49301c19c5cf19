"""The 3-D view: orbit, pan, zoom; hover, click and rubber band. It paints what the session shows."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from PySide6.QtCore import QEvent, QPoint, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QContextMenuEvent,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from skelgen.model.arrays import Floats
from skelgen_gui.model.picture import Canvas, FrameView, Picture
from skelgen_gui.model.scene import Scene, Snapshot
from skelgen_gui.model.selection import Marked, Pick, Selection, is_drawn, is_selected, markers_within, pick, with_pick
from skelgen_gui.model.view_camera import Floor, ViewCamera
from skelgen_gui.model.view_state import Shown
from skelgen_gui.model.viewpoint import Viewpoint
from skelgen_gui.model.wording import about
from skelgen_gui.project.session import Session
from skelgen_gui.view3d import controls
from skelgen_gui.view3d.renderer import NO_FRUSTUMS, Renderer
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import paint_words

_MARGIN = 8  # px, of the buttons from the border
_Modifier = Qt.KeyboardModifier


class View3D(QWidget):
    """The 3-D view of a session.

    Dragging turns the view (right or middle button: shifts it), the wheel zooms at the pointer. A click selects what is
    under it, with control it is added or taken away; shift and drag selects the markers in a rectangle.

    Signals
    -------
    shown_changed(Shown)
        Other things are shown.
    clicked()
        Something was clicked and is selected now.
    context_requested(QPoint, Selection)
        The user wants a menu for what is selected, at a place on the screen.

    Attributes
    ----------
    shown : Shown
        What is shown.

    Parameters
    ----------
    session : Session
        What is open, which frame, and what is selected.
    parent : QWidget, optional
        Parent widget.
    is_main : bool
        Whether it has buttons and keys; those of the main view hold for all.
    """

    shown_changed = Signal(object)
    clicked = Signal()
    context_requested = Signal(QPoint, object)

    def __init__(self, session: Session, parent: QWidget | None = None, *, is_main: bool = True) -> None:
        super().__init__(parent)
        self._session = session
        self.shown = Shown()
        self._camera = ViewCamera()
        self._other: Scene | None = None
        self._frustums = NO_FRUSTUMS
        self._renderer: Renderer | None = None
        self._painted: tuple[Snapshot, Picture] | None = None
        self._hovered: Pick | None = None
        self._drag: controls.Drag | None = None
        self._pointer = QPointF()
        self._set_up_widget()
        self.commands = controls.Commands(self.shown, self)
        self._connect_commands()
        self._buttons = controls.ViewButtons(self.commands, self)
        self._buttons.setVisible(is_main)
        if is_main:
            self.addActions(self.commands.with_keys)
        session.project_changed.connect(self._take_project)
        session.other_changed.connect(self._take_other)
        session.frame_changed.connect(self.update)
        session.selection_changed.connect(self.update)
        self._take_project()
        self._take_other()

    @property
    def viewpoint(self) -> Viewpoint:
        """Where the viewer stands."""
        return self._camera.canvas.viewpoint

    @property
    def up(self) -> int:
        """The coordinate axis that points up."""
        return self._camera.up

    def set_shown(self, shown: Shown) -> None:
        """Show other parts."""
        if shown == self.shown:
            return
        if shown.up != self.shown.up:
            self._camera.point_up(shown.up)
        if shown.follow != self.shown.follow:
            self._camera.follow(self._session.frame if shown.follow else None)
        self.shown = shown
        self.shown_changed.emit(shown)
        self.update()

    def show_cameras(self, frustums: Sequence[Floats], up: int | None = None) -> None:
        """Show cameras, and look at them and the take anew.

        Parameters
        ----------
        frustums : sequence of ndarray, shape (n, 2, 3), mm
            Each camera as lines, as `frustum` gives them.
        up : int, optional
            The coordinate axis that points up, or with `DOWN` added down, if the cameras determine it.
        """
        self._frustums = np.concatenate([NO_FRUSTUMS, *frustums])
        self._camera.show_cameras(self._frustums.reshape(-1, 3), up)
        self.update()

    def hide_markers(self, names: Iterable[str]) -> None:
        """Hide some markers, by their names, and show all others; limbs without any shown marker are hidden, too."""
        self.set_shown(replace(self.shown, hidden=tuple(sorted(names))))

    def hide_selected(self) -> None:
        """Hide the selected markers and limbs."""
        self.hide_markers({*self.shown.hidden, *self._selected_names()})

    def isolate_selected(self) -> None:
        """Show nothing but the selected markers and limbs."""
        names = self._selected_names()
        if names and self._camera.scene is not None:
            self.hide_markers(set(self._camera.scene.names) - names)

    def _selected_names(self) -> set[str]:
        scene = self._camera.scene
        markers = set() if scene is None else Marked(self._session.selection).markers(scene)
        return set() if scene is None else {scene.names[marker] for marker in markers}

    def look_home(self) -> None:
        """Look at the whole take as at first, and do so again when the view gets another size."""
        self._camera.look_home()
        self.update()

    def stand_at(self, viewpoint: Viewpoint) -> None:
        """Put the viewer elsewhere."""
        self._camera.move(viewpoint)
        self.update()

    def fit(self) -> None:
        """Fit the markers that are selected or on the selected limb, otherwise all of this frame."""
        scene = self._camera.scene
        chosen = set() if scene is None else Marked(self._session.selection).markers(scene)
        self._camera.fit_frame(self._session.frame, chosen)
        self.update()

    def fit_take(self) -> None:
        """Fit the whole take."""
        self._camera.fit_take()
        self.update()

    def look_from_front(self) -> None:
        """Look at the wider side."""
        self._look(0.0, 0.0)

    def look_from_side(self) -> None:
        """Look at the narrower side."""
        self._look(math.pi / 2, 0.0)

    def look_from_top(self) -> None:
        """Look down."""
        self._look(0.0, math.pi / 2)

    def place_of_marker(self, marker: int) -> QPointF | None:
        """Where a marker was last painted [px]; None if it is hidden or unknown."""
        if self._painted is None or marker >= len(self._painted[1].markers):
            return None
        x, y = self._painted[1].markers[marker].tolist()
        return None if math.isnan(x) else QPointF(x, y)

    def note(self) -> str:
        """Description of what lies under the pointer; empty if nothing does."""
        hovered, painted, scene = self._hovered, self._painted, self._camera.scene
        if hovered is None or painted is None or scene is None or not is_drawn(painted[1], hovered):
            return ""
        return about(hovered, scene, painted[0])

    def sizeHint(self) -> QSize:
        """Return a comfortable size."""
        return QSize(900, 700)

    def minimumSizeHint(self) -> QSize:
        """Return the least useful size."""
        return QSize(240, 180)

    def event(self, event: QEvent) -> bool:
        """Hold back the tool tip where something is explained already."""
        return (event.type() == QEvent.Type.ToolTip and bool(self.note())) or super().event(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the frame."""
        canvas = self._camera.canvas_at(self._session.frame)
        floor = self._camera.floor if self.shown.floor else None
        frustums = self._frustums if self.shown.cameras else NO_FRUSTUMS
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            if self._renderer is None or self._renderer.ratio != self.devicePixelRatioF():
                self._renderer = Renderer(self.palette(), self.devicePixelRatioF())
            renderer = self._renderer
            renderer.paint_backdrop(painter, canvas, floor, frustums, self._legend())
            self._painted = self._paint_scenes(painter, renderer, canvas, floor)
            if self._drag is not None and self._drag.kind is controls.DragKind.BAND:
                renderer.paint_band(painter, self._drag.band)
            elif self._session.project is None:
                words = self.tr("Drop a recording or a project here, or choose File, Open")
                paint_words(painter, QRectF(self.rect()), words, self.palette())
            elif self._drag is None and (text := self.note()):
                renderer.paint_note(painter, text, self._pointer.x(), self._pointer.y(), canvas)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the buttons in their corner, and an untouched view fitted."""
        self._buttons.adjustSize()
        self._buttons.move(self.width() - self._buttons.width() - _MARGIN, _MARGIN)
        self._camera.resize(self.width(), self.height())

    def changeEvent(self, event: QEvent) -> None:
        """Follow the colours of the desktop."""
        if event.type() in (QEvent.Type.PaletteChange, QEvent.Type.StyleChange):
            self._renderer = None
            self.update()
        super().changeEvent(event)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Begin a click or a drag."""
        self._drag = controls.Drag(event.position(), event.button())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Drag, or see what is under the pointer."""
        self._pointer = event.position()
        if self._drag is None:
            before, self._hovered = self._hovered, self._pick(event.position())
            if self._hovered is not None or before is not None:
                self.update()
            return
        wants_band = self.commands.rectangle.isChecked() != bool(event.modifiers() & _Modifier.ShiftModifier)
        step = self._drag.moved_to(event.position(), wants_band)
        if self._drag.kind in (controls.DragKind.TURN, controls.DragKind.SHIFT):
            self.stand_at(controls.dragged(self.viewpoint, self._drag.kind, step, self.height()))
        self.update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Select what was clicked or is in the rectangle, or ask for a menu."""
        drag, self._drag = self._drag, None
        if drag is None:
            return
        adds = bool(event.modifiers() & _Modifier.ControlModifier)
        if drag.kind is controls.DragKind.BAND:
            self._select_within(drag.band, adds)
        elif drag.kind is controls.DragKind.CLICK and drag.button == Qt.MouseButton.LeftButton:
            self._select(self._pick(event.position()), adds)
            self.clicked.emit()
        elif drag.kind is controls.DragKind.CLICK and drag.button == Qt.MouseButton.RightButton:
            self._ask_for_menu(event)
        self.update()

    def leaveEvent(self, event: QEvent) -> None:
        """Nothing is under the pointer any more."""
        self._hovered = None
        self.update()

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom at the pointer."""
        self.stand_at(controls.wheeled(self.viewpoint, event, self))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Ask for a menu from the keyboard; that of the mouse follows its release, since dragging shifts the view."""
        if event.reason() is QContextMenuEvent.Reason.Keyboard:
            self.context_requested.emit(self.mapToGlobal(self.rect().center()), self._session.selection)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Turn (ctrl and arrows), shift (alt and arrows), zoom (ctrl, plus and minus), select all or (esc) nothing."""
        modifiers = event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier
        if event.key() in controls.ARROWS and modifiers in (_Modifier.ControlModifier, _Modifier.AltModifier):
            right, down = controls.ARROWS[Qt.Key(event.key())]
            if modifiers == _Modifier.ControlModifier:
                self.stand_at(self.viewpoint.orbited(controls.KEY_TURN * right, -controls.KEY_TURN * down))
            else:
                self.stand_at(
                    self.viewpoint.panned(-controls.KEY_SHIFT * right, -controls.KEY_SHIFT * down, self.height())
                )
        elif event.key() in controls.ZOOMS and modifiers & _Modifier.ControlModifier:
            self.stand_at(self.viewpoint.zoomed(controls.ZOOMS[Qt.Key(event.key())]))
        elif event.matches(QKeySequence.StandardKey.SelectAll) and self._camera.scene is not None:
            self._session.select(Selection(frozenset(range(self._camera.scene.n_markers))))
        elif event.key() == Qt.Key.Key_Escape:
            self._session.select(Selection())
        else:
            super().keyPressEvent(event)

    def _connect_commands(self) -> None:
        commands = self.commands
        moves = self.fit, self.fit_take, self.look_from_front, self.look_from_side, self.look_from_top
        hiding = self.hide_selected, self.isolate_selected, lambda: self.hide_markers(())
        actions = *commands.moves.values(), *commands.hiding.values()
        for action, act in zip(actions, (*moves, *hiding), strict=True):
            action.triggered.connect(act)
        commands.shown_changed.connect(self.set_shown)
        self.shown_changed.connect(commands.follow)

    def _set_up_widget(self) -> None:
        put_texts(self)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def _take_project(self) -> None:
        self._camera.open(self._session.project)
        self._hovered, self._painted = None, None
        self.update()

    def _take_other(self) -> None:
        self._other = None if self._session.other is None else Scene(self._session.other)
        self.update()

    def _look(self, right_of_front: float, elevation: float) -> None:
        self._camera.look(right_of_front, elevation)
        self.update()

    def _paint_scenes(
        self, painter: QPainter, renderer: Renderer, canvas: Canvas, floor: Floor | None
    ) -> tuple[Snapshot, Picture] | None:
        view, scene, other = FrameView(self._session.frame, canvas, self.shown), self._camera.scene, self._other
        if other is not None and self.shown.other and view.frame < other.n_frames:
            renderer.paint_other(painter, other, view)
        if scene is None or view.frame >= scene.n_frames:
            return None
        return renderer.paint_scene(painter, scene, view, Marked(self._session.selection, self._hovered), floor)

    def _legend(self) -> str:
        """Say how large the grid's cells and the ellipsoids are."""
        scene, floor, parts = self._camera.scene, self._camera.floor, []
        if floor is not None and self.shown.floor:
            parts.append(self.tr("grid {spacing:g} mm").format(spacing=floor.spacing))
        has_ellipsoids = self.shown.uncertainty or self._session.selection.joint is not None
        if has_ellipsoids and scene is not None and scene.project.has("skeleton"):
            times = self.shown.magnification or scene.magnification
            parts.append(self.tr("ellipsoids {times} × std").format(times=times))
        return "   ".join(parts)

    def _pick(self, place: QPointF) -> Pick | None:
        return None if self._painted is None else pick(self._painted[1], place.x(), place.y())

    def _select(self, picked: Pick | None, adds: bool) -> None:
        """Select one thing, or nothing, besides what is selected or instead of it."""
        before, scene = self._session.selection if adds else Selection(), self._camera.scene
        self._session.select(before if picked is None or scene is None else with_pick(before, picked, scene))

    def _select_within(self, band: QRectF, adds: bool) -> None:
        if self._painted is None:
            return
        markers = markers_within(self._painted[1], band.left(), band.top(), band.right(), band.bottom())
        before = self._session.selection if adds else Selection()
        self._session.select(replace(before, markers=before.markers | markers))

    def _ask_for_menu(self, event: QMouseEvent) -> None:
        """Ask for a menu for what is selected; what is clicked and not selected is selected first."""
        picked, scene = self._pick(event.position()), self._camera.scene
        if picked is not None and scene is not None and not is_selected(picked, self._session.selection, scene):
            self._select(picked, adds=False)
        self.context_requested.emit(event.globalPosition().toPoint(), self._session.selection)
