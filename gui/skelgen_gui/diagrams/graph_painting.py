"""Paints the graph: every joint that was tried as a faint line, the tree as strong ones, limbs as discs."""

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPainterPath, QPalette, QPen

from skelgen.app.drawing.graph import CostGraph, Disc, JointCost, joint_sign
from skelgen.model.arrays import Floats
from skelgen_gui.model.graph import GAP, margin_label, place_words
from skelgen_gui.widgets.painting import colour_of_limb, doubt_colour, draw_lines, is_dark

NODE = 14.0
"""px, radius of a limb."""

_FAINTEST, _STRONGEST = 0.03, 0.5  # opacity of the dearest and of the cheapest joint that was not taken
_SHADES = 12  # opacities that are drawn: lines of one opacity take one call
_TREE, _THIN = 4.0, 1.2
_SIGN = 6.0
_HALO = 5.0
_WORDS_PAD = 4.0
_SPACE = 2.0  # px, between a limb and its name
_Role = QPalette.ColorRole


class GraphPainting:
    """One painting of a graph.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    graph : CostGraph
        What is painted.
    places : ndarray, shape (n_limbs, 2), px
        Middle of each limb.
    palette : QPalette
        Colours of texts and ground.
    """

    def __init__(self, painter: QPainter, graph: CostGraph, places: Floats, palette: QPalette) -> None:
        self._painter, self._graph, self._places, self._palette = painter, graph, places, palette
        self._metrics = QFontMetricsF(painter.font())
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)

    def pairs(self) -> None:
        """Paint joints that were tried and not taken: the cheaper, the stronger; kinematic loops dotted."""
        colour = QColor(self._palette.color(_Role.Text))
        shades = np.round(self._graph.strengths**2 * (_SHADES - 1)).astype(int)
        for shade in range(_SHADES):
            chosen = self._graph.pairs[shades == shade]
            colour.setAlphaF(_FAINTEST + (_STRONGEST - _FAINTEST) * shade / (_SHADES - 1))
            self._painter.setPen(QPen(colour, _THIN))
            draw_lines(self._painter, self._places[chosen])
        for pair in self._graph.topology.loops:
            self.line(pair, self._palette.color(_Role.Link), Qt.PenStyle.DotLine)

    def tree(self, selected: int | None) -> None:
        """Paint the joints of the tree, doubtful ones dashed, the selected one on a halo."""
        for number, joint in enumerate(self._graph.joints):
            if number == selected:
                pen = QPen(self._palette.color(_Role.Highlight), _TREE + 2 * _HALO)
                pen.setCapStyle(Qt.PenCapStyle.RoundCap)
                self._painter.setPen(pen)
                self._painter.drawLine(*self._ends((joint.parent, joint.child)))
            colour = doubt_colour(self._palette) if joint.is_doubtful else self._palette.color(_Role.Text)
            style = Qt.PenStyle.DashLine if joint.is_doubtful else Qt.PenStyle.SolidLine
            self._painter.setPen(QPen(colour, _TREE, style, Qt.PenCapStyle.FlatCap))
            self._painter.drawLine(*self._ends((joint.parent, joint.child)))

    def rival(self, joint: JointCost | None) -> None:
        """Paint the joint that would be used without this one."""
        if joint is not None and joint.rival is not None:
            self.line(joint.rival, doubt_colour(self._palette), Qt.PenStyle.DashDotLine)

    def line(self, pair: tuple[int, int], colour: QColor, style: Qt.PenStyle) -> None:
        """Paint a line between two limbs that stands out.

        Parameters
        ----------
        pair : tuple of int
            The limbs.
        colour : QColor
            Colour of the line.
        style : Qt.PenStyle
            Its dashes.
        """
        self._painter.setPen(QPen(colour, 2.0, style))
        self._painter.drawLine(*self._ends(pair))

    def signs(self) -> None:
        """Paint the type of each joint in its middle."""
        ground, text = self._palette.color(_Role.Window), self._palette.color(_Role.Text)
        for joint in self._graph.joints:
            start, end = self._ends((joint.parent, joint.child))
            middle = (start + end) / 2
            self._painter.setPen(QPen(ground, 3.0))
            self._painter.setBrush(text)
            self._painter.drawPath(_sign_path(joint.kind, middle, _SIGN))
            self._painter.setPen(Qt.PenStyle.NoPen)
            self._painter.drawPath(_sign_path(joint.kind, middle, _SIGN))

    def words(self, names: Sequence[str]) -> None:
        """Write beside each joint how sure it is, and beside each limb its name, where there is one."""
        joints = self._graph.joints
        edges = np.array([(joint.parent, joint.child) for joint in joints], dtype=np.intp).reshape(-1, 2)
        lines, height = self._places[edges], self._metrics.height()
        named = [(limb, name) for limb, name in enumerate(names) if name != f"limb{limb}"]
        text = self._palette.color(_Role.Text)
        colours = [doubt_colour(self._palette) if joint.is_doubtful else text for joint in joints]
        labels = [*map(margin_label, joints), *(name for _, name in named)]
        widths = [self._metrics.horizontalAdvance(label) + _WORDS_PAD if label else 0.0 for label in labels]
        sizes = np.array([(width, height if width else 0.0) for width in widths]).reshape(-1, 2)
        middles = np.concatenate([lines.mean(axis=1), self._places[[limb for limb, _ in named]]])
        gaps = np.repeat([GAP, NODE + _SPACE], [len(joints), len(named)])
        placed = place_words(middles, sizes, self._places, NODE, lines, gaps)
        ground = QColor(self._palette.color(_Role.Window))
        ground.setAlphaF(0.8)
        colours += [self._palette.color(_Role.PlaceholderText)] * len(named)
        taken: list[QRectF] = []
        circles = [QRectF(x - NODE, y - NODE, 2 * NODE, 2 * NODE) for x, y in self._places.tolist()]
        width_of_view = self._painter.window().width()
        for colour, label, (x, y), (width, _) in zip(colours, labels, placed.tolist(), sizes.tolist(), strict=True):
            left = max(0.0, min(x - width / 2, width_of_view - width))
            room = QRectF(left, y - height / 2, width, height)
            if len(taken) >= len(joints) and any(room.intersects(other) for other in (*taken, *circles)):
                continue  # names that would cover other words or limbs are left out
            taken.append(room)
            self._painter.fillRect(room, ground)
            self._painter.setPen(colour)
            self._painter.drawText(room, Qt.AlignmentFlag.AlignCenter, label)

    def limbs(self, selected: set[int], pointed: int | None) -> None:
        """Paint the limbs with their numbers.

        Parameters
        ----------
        selected : set of int
            Limbs that are selected.
        pointed : int or None
            The limb under the pointer.
        """
        on_limb = QColor("#101214" if is_dark(self._palette) else "#ffffff")
        for limb, (x, y) in enumerate(self._places.tolist()):
            at = QPointF(x, y)
            if limb in selected or limb == pointed:
                colour = QColor(self._palette.color(_Role.Highlight))
                colour.setAlphaF(1.0 if limb in selected else 0.4)
                self._painter.setPen(Qt.PenStyle.NoPen)
                self._painter.setBrush(colour)
                self._painter.drawEllipse(at, NODE + _HALO, NODE + _HALO)
            is_root = self._graph.topology.parents[limb] < 0
            self._painter.setPen(QPen(self._palette.color(_Role.Text if is_root else _Role.Window), 2.0))
            self._painter.setBrush(colour_of_limb(limb, self._palette))
            self._painter.drawEllipse(at, NODE, NODE)
            self._painter.setPen(on_limb)
            room = QRectF(x - NODE, y - NODE, 2 * NODE, 2 * NODE)
            self._painter.drawText(room, Qt.AlignmentFlag.AlignCenter, str(limb))

    def legend(self, kinds: list[tuple[str, str]], words: str, place: QRectF) -> None:
        """Explain the signs at the foot of a place.

        Parameters
        ----------
        kinds : list of (str, str)
            Type of a joint, and its name.
        words : str
            Further explanation.
        place : QRectF, px
            Above its lower edge.
        """
        text = self._palette.color(_Role.PlaceholderText)
        x, y = place.left() + 12, place.bottom() - 12
        for kind, name in kinds:
            self._painter.setPen(Qt.PenStyle.NoPen)
            self._painter.setBrush(text)
            self._painter.drawPath(_sign_path(kind, QPointF(x, y), _SIGN - 1))
            self._painter.setPen(text)
            self._painter.drawText(QPointF(x + _SIGN + 5, y + self._metrics.ascent() / 2 - 1), name)
            x += _SIGN + 5 + self._metrics.horizontalAdvance(name) + 18
        if x + self._metrics.horizontalAdvance(words) > place.right():  # then in a line of its own
            x, y = place.left() + 12 - _SIGN, y - 1.3 * self._metrics.height()
        self._painter.drawText(QPointF(x, y + self._metrics.ascent() / 2 - 1), words)

    def _ends(self, pair: tuple[int, int]) -> tuple[QPointF, QPointF]:
        first, second = pair
        return QPointF(*self._places[first].tolist()), QPointF(*self._places[second].tolist())


def _sign_path(kind: str, at: QPointF, size: float) -> QPainterPath:
    """The sign of a type of joint about a place; `size` [px] is half its height."""
    path = QPainterPath()
    for part in joint_sign(kind):
        outline = QPainterPath()
        if isinstance(part, Disc):
            outline.addEllipse(at, size * part.radius, size * part.radius)
            outline.addEllipse(at, size * part.hole, size * part.hole)
        else:
            half = QPointF(size * part.half_width, size * part.half_height)
            outline.addRoundedRect(QRectF(at - half, at + half), size * part.corner, size * part.corner)
        path = path.united(outline) if not path.isEmpty() else outline
    return path
