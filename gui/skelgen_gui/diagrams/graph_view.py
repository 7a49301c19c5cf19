"""The graph of joint costs, so that it can be seen why the tree is as it is."""

from functools import partial

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QContextMenuEvent, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import QComboBox, QWidget

from skelgen.app.drawing.graph import CostGraph, JointCost
from skelgen.app.drawing.wording import as_many_as_fit
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen_gui.diagrams.graph_painting import NODE, GraphPainting
from skelgen_gui.model import translate
from skelgen_gui.model.graph import find_graph, joint_sentences, nearest_line, nearest_point, pair_sentences
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.wording import limb_words
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import ZOOM, notches, paint_words, show_tip
from skelgen_gui.widgets.shortcuts import ARROW_KEYS

_MARGIN = 28.0  # px about the graph
_FOOT = 36.0  # px below it, for what the signs mean
_NEAR_JOINT, _NEAR_RIVAL, _NEAR_PAIR = 9.0, 6.0, 4.0  # px within which a line is caught
_ZOOMS = (0.5, 20.0)
_NAMES_ROOM = 60  # characters of markers' names
_KINDS = ("ball", "hinge", "universal", "rigid", "undetermined")  # of joints, in the legend
# Directions of the arrow keys: right, down
_STEPS = {Qt.Key.Key_Up: (0, -1), Qt.Key.Key_Down: (0, 1), Qt.Key.Key_Left: (-1, 0), Qt.Key.Key_Right: (1, 0)}


class GraphView(QWidget):
    """Shows limbs, every joint that was tried between them, and the tree that was found.

    Hover tells cost, margin, best rival, probability, kind and range of motion; click or arrow keys select a limb (Ctrl
    and click: this as well), a click on a line or J the joint, a click on another line both of its limbs; the wheel
    zooms, dragging pans, a double click or 0 shows all.

    Attributes
    ----------
    graph : CostGraph or None
        What is shown; None while it is derived, or before there are joints.

    Parameters
    ----------
    session : Session
        What is shown.
    """

    own_keys = ARROW_KEYS | {Qt.Key.Key_J, Qt.Key.Key_0}

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.graph: CostGraph | None = None
        self._graph_of: Project | None = None
        self._layouts: tuple[Floats, Floats] = (np.zeros((0, 2)), np.zeros((0, 2)))
        self._zoom, self._shift = 1.0, QPointF(0, 0)
        self._pressed: QPointF | None = None
        self._pointed_limb: int | None = None
        self._pointed_joint: int | None = None
        self.deriver = Deriver(self)
        self.layout_box = QComboBox(self)
        self.layout_box.addItems([self.tr("As in the take"), self.tr("As a tree")])
        self.layout_box.move(6, 6)
        self.layout_box.currentIndexChanged.connect(self.show_all)
        put_texts(self)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        session.project_changed.connect(self._follow_project)
        session.selection_changed.connect(self.update)
        self._follow_project()

    @property
    def places(self) -> Floats:
        """Middle of each limb in this widget [px], shape (n_limbs, 2)."""
        unit = self._layouts[self.layout_box.currentIndex()]
        room = np.array([self.width() - 2 * _MARGIN, self.height() - _FOOT - 2 * _MARGIN])
        size = np.maximum(room if self.layout_box.currentIndex() else np.full(2, room.min()), 1.0)
        middle = np.array([self.width() / 2 + self._shift.x(), (self.height() - _FOOT) / 2 + self._shift.y()])
        return np.asarray(middle + (unit - 0.5) * size * self._zoom)

    def sizeHint(self) -> QSize:
        """Return room for some limbs."""
        return QSize(560, 480)

    def show_all(self) -> None:
        """Show the whole graph."""
        self._zoom, self._shift = 1.0, QPointF(0, 0)
        self.update()

    def tip_at(self, place: QPointF) -> str:
        """Describe the limb, the joint or the pair of limbs at a place."""
        limb, joint, pair = self._found_at(place)
        project = self._graph_of
        if limb is not None and project is not None:
            markers = project.limbs.markers_of(limb).tolist()
            count = self.tr("{0}: {1} markers") if len(markers) != 1 else self.tr("{0}: 1 marker")
            names = as_many_as_fit([project.trajectories.names[marker] for marker in markers], _NAMES_ROOM)
            return count.format(limb_words(project, limb), len(markers)) + f"\n{names}"
        if joint is not None and self.graph is not None:
            return joint_sentences(self.graph.joints[joint], self._called)
        if pair is not None and self.graph is not None:
            return pair_sentences(self.graph, *pair, self._called)
        return self.tr(
            "Strong lines: the tree · faint lines: joints that were tried · % : how likely the joint is there"
        )

    def event(self, event: QEvent) -> bool:
        """Describe what lies under the pointer."""
        return show_tip(self, event, self.tip_at) or super().event(event)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Select a limb or a joint, or begin to pan."""
        if event.button() != Qt.MouseButton.LeftButton:
            return
        self._pressed = event.position()
        adds = bool(event.modifiers() & Qt.KeyboardModifier.ControlModifier)
        found = self._selection_at(event.position(), adds)
        if found is not None:
            self._pressed = None
            self._session.select(found)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Ask for a menu for what is selected; what is under the pointer is selected first."""
        found = self._selection_at(QPointF(event.pos()), adds=False)
        if event.reason() is QContextMenuEvent.Reason.Mouse and found is not None:
            before = self._session.selection
            if found.joint != before.joint or not found.limbs <= before.limbs:
                self._session.select(found)
        self._session.menu_requested.emit(event.globalPos())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Pan, or mark what lies under the pointer."""
        if self._pressed is not None and event.buttons() & Qt.MouseButton.LeftButton:
            self._shift += event.position() - self._pressed
            self._pressed = event.position()
            self.update()
            return
        limb, joint, _ = self._found_at(event.position())
        if (limb, joint) != (self._pointed_limb, self._pointed_joint):
            self._pointed_limb, self._pointed_joint = limb, joint
            self.update()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Show all."""
        self.show_all()

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom about the pointer."""
        before = self._zoom
        self._zoom = min(max(before * ZOOM ** notches(event)[1], _ZOOMS[0]), _ZOOMS[1])
        from_middle = event.position() - QPointF(self.width() / 2, (self.height() - _FOOT) / 2)
        self._shift = from_middle - (from_middle - self._shift) * (self._zoom / before)
        self.update()
        event.accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Go from limb to limb, or to the joint above one."""
        key = Qt.Key(event.key())
        if key in _STEPS and self.graph is not None:
            self._step(np.array(_STEPS[key], dtype=np.float64))
        elif key == Qt.Key.Key_J and self.graph is not None:
            above = np.flatnonzero(self.graph.topology.children == self._session.selection.limb)
            if len(above):
                self._session.select(Selection(joint=int(above[0])))
        elif key == Qt.Key.Key_0:
            self.show_all()
        elif key == Qt.Key.Key_Escape:
            self._session.select(Selection())
        else:
            super().keyPressEvent(event)

    @property
    def _called(self) -> list[str]:
        """What the limbs are called."""
        project = self._graph_of
        return [] if project is None else [limb_words(project, limb) for limb in range(project.limbs.n_limbs)]

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the graph, and what is selected."""
        with QPainter(self) as painter:
            if self.graph is None:
                words = self.tr("Run the step Joints to see what the tree was chosen from")
                paint_words(painter, QRectF(self.rect()), words, self.palette())
            else:
                painting = GraphPainting(painter, self.graph, self.places, self.palette())
                painting.pairs()
                painting.tree(self._session.selection.joint)
                painting.rival(self._marked_joint(self.graph))
                painting.signs()
                painting.limbs(self._selected_limbs(), self._pointed_limb)
                painting.words(() if self._graph_of is None else self._graph_of.limbs.names)
                words = self.tr("% : how likely the joint is there; dashed: doubtful")
                painting.legend([(kind, translate("Graph", kind)) for kind in _KINDS], words, QRectF(self.rect()))

    def _follow_project(self) -> None:
        """Derive the graph; until it is there, that of an earlier result stays."""
        project = self._session.project
        self.deriver.forget()
        if project is None or not project.has("joints"):
            self.graph = None
            self.update()
        else:
            self.deriver.derive(partial(find_graph, project), partial(self._take, project))

    def _take(self, project: Project, found: tuple[CostGraph, tuple[Floats, Floats]]) -> None:
        is_same_take = self._graph_of is not None and self._graph_of.take is project.take
        self._graph_of, (self.graph, self._layouts) = project, found
        self._pointed_limb = self._pointed_joint = None
        if is_same_take:
            self.update()
        else:
            self.show_all()

    def _found_at(self, place: QPointF) -> tuple[int | None, int | None, tuple[int, int] | None]:
        """The limb, the joint, or the pair of limbs at a place."""
        if self.graph is None:
            return None, None, None
        places, at = self.places, np.array([place.x(), place.y()])
        limb = nearest_point(places, at, NODE)
        if limb is not None:
            return limb, None, None
        joint = nearest_line(places[self.graph.topology.edges], at, _NEAR_JOINT)
        if joint is not None:
            return None, joint, None
        pair = nearest_line(places[self.graph.pairs], at, _NEAR_PAIR)
        if pair is None:
            return None, None, None
        first, second = self.graph.pairs[pair].tolist()
        return None, None, (first, second)

    def _selection_at(self, place: QPointF, adds: bool) -> Selection | None:
        """What a click selects: a limb, with Control one more; a joint; or both limbs of another joint that was tried.

        With the limbs of the dashed line the joint stays selected that it would replace.
        """
        if self.graph is None:
            return None
        marked = self._marked_joint(self.graph)
        if marked is not None and marked.rival is not None:
            line = self.places[np.array([marked.rival])]
            is_other = nearest_point(self.places, np.array([place.x(), place.y()]), NODE) is None
            if is_other and nearest_line(line, np.array([place.x(), place.y()]), _NEAR_RIVAL) is not None:
                return Selection(joint=self.graph.joints.index(marked)).with_limbs(frozenset(marked.rival))
        limb, joint, pair = self._found_at(place)
        if limb is not None:
            return self._session.selection.with_limb(limb) if adds else Selection(limb=limb)
        if joint is not None:
            return Selection(joint=joint)
        return None if pair is None else Selection().with_limbs(frozenset(pair))

    def _marked_joint(self, graph: CostGraph) -> JointCost | None:
        """The joint under the pointer, otherwise the selected one."""
        number = self._session.selection.joint if self._pointed_joint is None else self._pointed_joint
        return None if number is None or number >= len(graph.joints) else graph.joints[number]

    def _selected_limbs(self) -> set[int]:
        """The selected limb, and those of selected markers."""
        selection, project = self._session.selection, self._graph_of
        limbs = set(selection.limbs)
        if project is not None:
            markers = [marker for marker in selection.markers if marker < project.limbs.n_markers]
            limbs |= set(project.limbs.limb_of_marker[markers].tolist())
        return limbs

    def _step(self, direction: Floats) -> None:
        """Select the nearest limb in a direction, at first the first root."""
        if self.graph is None or not self.graph.topology.n_limbs:
            return
        limb = self._session.selection.limb
        if limb is None or limb >= self.graph.topology.n_limbs:
            self._session.select(Selection(limb=int(self.graph.topology.roots[0])))
            return
        between = self.places - self.places[limb]
        along = between @ direction
        aside = np.linalg.norm(between - along[:, np.newaxis] * direction, axis=1)
        effort = np.where(along > aside / 2, along + 2 * aside, np.inf)
        effort[limb] = np.inf
        if np.isfinite(effort).any():
            self._session.select(Selection(limb=int(effort.argmin())))
