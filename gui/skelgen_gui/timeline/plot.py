"""Paints a panel of curves: grid, bands, lines, and a legend with the values of the frame that is shown."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPalette, QPen

from skelgen.app.drawing.scales import ticks
from skelgen.app.drawing.wording import digits, plain
from skelgen.model.arrays import Floats
from skelgen_gui.model.curves import Curve, Panel
from skelgen_gui.timeline.span import VisibleSpan
from skelgen_gui.widgets.painting import draw_lines
from skelgen_gui.widgets.theme import blended, colour_of_limb, component_colour, is_dark

_TICK_ROOM = 24.0  # px between lines of the grid
_BAND = 0.25  # opacity
_AIR = 0.06  # of the height, free above and below the curves
_LINE = 1.3
_VEIL = 0.75  # opacity of the ground behind values of the scale
_CHIP = 8.0
_SHADE = 35  # percent by which a further curve of the same limb stands out more from the ground
_Role = QPalette.ColorRole


def _colour_of(curve: Curve, palette: QPalette) -> QColor:
    """Return the colour of a curve.

    Parameters
    ----------
    curve : Curve
        The curve.
    palette : QPalette
        Light or dark.
    """
    if curve.limb is not None:
        colour, change = colour_of_limb(curve.limb, palette), 100 + _SHADE * curve.shade
        return colour.lighter(change) if is_dark(palette) else colour.darker(change)
    return palette.color(_Role.Text) if curve.component is None else component_colour(curve.component, palette)


def paint_plot(painter: QPainter, panel: Panel, span: VisibleSpan, place: QRectF, palette: QPalette) -> None:
    """Paint grid and curves.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    panel : Panel
        What is drawn.
    span : VisibleSpan
        Which frames.
    place : QRectF, px
        Where; the legend lies at the left of it.
    palette : QPalette
        Colours of texts and ground.
    """
    n_columns = max(round(place.width()), 1)
    columns = panel.columns(span.first, span.end, n_columns)
    low, high = panel.scale(columns)
    air = _AIR * (high - low)
    high += air
    low -= 0.0 if panel.from_zero and low == 0 else air
    painter.save()
    painter.setClipRect(place)
    painter.fillRect(place, palette.color(_Role.Base))
    lines = _grid(low, high, place)
    for value, y in lines:
        painter.setPen(blended(palette.color(_Role.Text), palette.color(_Role.Base), 0.3 if value == 0 else 0.12))
        painter.drawLine(QPointF(place.left(), y), QPointF(place.right(), y))

    def heights(values: Floats) -> Floats:
        return np.asarray(place.bottom() - (values - low) / (high - low) * place.height())

    xs = np.arange(n_columns, dtype=np.float64) + (place.left() + 0.5)
    for curve, found in zip(panel.curves, columns, strict=True):
        colour = _colour_of(curve, palette)
        if found.band is not None:
            _paint_band(painter, colour, _upright(xs, *map(heights, found.band)))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(colour, _LINE, Qt.PenStyle.SolidLine, Qt.PenCapStyle.SquareCap))  # round: 10 times slower
        draw_lines(painter, _joined(xs, *map(heights, found.line)))
    _paint_scale(painter, lines, place, palette)
    painter.restore()


def paint_legend(painter: QPainter, panel: Panel, frame: int, place: QRectF, palette: QPalette) -> None:
    """Paint the title, and a line for each curve with its value in a frame.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    panel : Panel
        What is drawn.
    frame : int
        The frame whose values are written.
    place : QRectF, px
        Where the curves are; the legend lies at the left of it.
    palette : QPalette
        Colours of texts.
    """
    font, bold = painter.font(), QFont(painter.font())
    bold.setBold(True)
    metrics = QFontMetricsF(font)
    step = metrics.height()
    left, room = 6.0, place.left() - 14.0
    rows = [QRectF(left, place.top() + 2 + step * index, room, step) for index in range(len(panel.curves) + 2)]
    title = f"{panel.title} [{panel.unit}]" if panel.unit else panel.title
    elide = Qt.TextElideMode.ElideRight
    painter.setPen(palette.color(_Role.WindowText))
    painter.setFont(bold)
    painter.drawText(rows[0], Qt.AlignmentFlag.AlignLeft, QFontMetricsF(bold).elidedText(title, elide, room))
    painter.setFont(font)
    for row, curve in zip(rows[1:], panel.curves, strict=False):
        if row.bottom() > place.bottom():
            return
        values = curve.line.low
        value = digits(float(values[frame])) if frame < len(values) else ""
        chip = QRectF(row.left(), row.center().y() - 1.5, _CHIP, 3.0)
        painter.fillRect(chip, _colour_of(curve, palette))
        name_room = room - _CHIP - 6 - metrics.horizontalAdvance(value) - 4
        name = metrics.elidedText(curve.name, Qt.TextElideMode.ElideMiddle, name_room)
        painter.drawText(row.adjusted(_CHIP + 5, 0, 0, 0), Qt.AlignmentFlag.AlignLeft, name)
        painter.drawText(row, Qt.AlignmentFlag.AlignRight, value)
    last = rows[len(panel.curves) + 1]
    if panel.note and last.bottom() <= place.bottom():
        painter.setPen(palette.color(_Role.PlaceholderText))
        painter.drawText(last, Qt.AlignmentFlag.AlignLeft, metrics.elidedText(panel.note, elide, room))


def _grid(low: float, high: float, place: QRectF) -> list[tuple[float, float]]:
    """Round values, and the height of each [px]."""
    wanted = max(int(place.height() / _TICK_ROOM), 1)
    scale = place.height() / (high - low)
    return [(value, round(place.bottom() - (value - low) * scale) + 0.5) for value in ticks(low, high, wanted)]


def _paint_scale(painter: QPainter, lines: list[tuple[float, float]], place: QRectF, palette: QPalette) -> None:
    """Values of the grid, above the curves on a ground that lets these through."""
    text, ground = palette.color(_Role.Text), palette.color(_Role.Base)
    metrics = QFontMetricsF(painter.font())
    veil = QColor(ground)
    veil.setAlphaF(_VEIL)
    painter.setPen(blended(text, ground, 0.65))
    for value, y in lines:
        shown = plain(value)
        room = QRectF(
            place.left() + 2, y - metrics.height(), metrics.horizontalAdvance(shown) + 6, metrics.height() - 1
        )
        if room.top() >= place.top():
            painter.fillRect(room, veil)
            painter.drawText(room, Qt.AlignmentFlag.AlignCenter, shown)


def _paint_band(painter: QPainter, colour: QColor, lines: Floats) -> None:
    veil = QColor(colour)
    veil.setAlphaF(_BAND)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    painter.setPen(QPen(veil, 1.0))
    draw_lines(painter, lines)


def _upright(xs: Floats, starts: Floats, stops: Floats) -> Floats:
    """Upright lines, shape (n, 2, 2), without those that are unknown."""
    known = ~np.isnan(starts) & ~np.isnan(stops)
    return np.stack([np.stack([xs, starts], axis=1), np.stack([xs, stops], axis=1)], axis=1)[known]


def _joined(xs: Floats, starts: Floats, stops: Floats) -> Floats:
    """Lines that join the columns of a curve, each a pixel apart, without bridging what is unknown."""
    upright = _upright(xs, starts, stops)
    across = np.stack([np.stack([xs[:-1], stops[:-1]], axis=1), np.stack([xs[1:], starts[1:]], axis=1)], axis=1)
    return np.concatenate([upright, across[~np.isnan(across).any(axis=(1, 2))]])
