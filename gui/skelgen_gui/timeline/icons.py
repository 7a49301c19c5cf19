"""Signs of the transport buttons, drawn in the colour of the palette's texts."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPainterPath, QPalette, QPixmap, QPolygonF

_SIZE = 16.0
_RATIO = 3.0  # pixels per point: sharp on any screen

Shape = tuple[tuple[float, float], ...]

_BARS = {
    "pause": ((3.5, 2.5, 3.2, 11.0), (9.3, 2.5, 3.2, 11.0)),
    "first_frame": ((2.0, 2.5, 2.2, 11.0),),
    "last_frame": ((11.8, 2.5, 2.2, 11.0),),
    "previous_frame": ((10.6, 3.5, 2.2, 9.0),),
    "next_frame": ((3.2, 3.5, 2.2, 9.0),),
    "range_from": ((3.0, 2.0, 2.2, 12.0), (3.0, 2.0, 6.0, 2.0), (3.0, 12.0, 6.0, 2.0)),
    "range_to": ((10.8, 2.0, 2.2, 12.0), (7.0, 2.0, 6.0, 2.0), (7.0, 12.0, 6.0, 2.0)),
    "range_all": ((1.5, 2.5, 2.0, 11.0), (12.5, 2.5, 2.0, 11.0), (3.5, 7.2, 9.0, 1.6)),
}
_POLYGONS: dict[str, tuple[Shape, ...]] = {
    "play": (((3.5, 2.0), (13.5, 8.0), (3.5, 14.0)),),
    "first_frame": (((14.0, 2.5), (14.0, 13.5), (5.0, 8.0)),),
    "last_frame": (((2.0, 2.5), (2.0, 13.5), (11.0, 8.0)),),
    "previous_frame": (((9.0, 3.5), (9.0, 12.5), (2.5, 8.0)),),
    "next_frame": (((7.0, 3.5), (7.0, 12.5), (13.5, 8.0)),),
    "loop": (((9.0, 0.5), (13.0, 3.4), (9.0, 6.3)), ((7.0, 9.7), (3.0, 12.6), (7.0, 15.5))),
}


def transport_icon(name: str, palette: QPalette) -> QIcon:
    """Return the icon of a transport button: ``pause``, or a command of the menu Play."""
    icon = QIcon()
    for mode, group in (
        (QIcon.Mode.Normal, QPalette.ColorGroup.Active),
        (QIcon.Mode.Disabled, QPalette.ColorGroup.Disabled),
    ):
        icon.addPixmap(_drawn(name, palette.color(group, QPalette.ColorRole.ButtonText)), mode)
    return icon


def _drawn(name: str, colour: QColor) -> QPixmap:
    pixmap = QPixmap(round(_SIZE * _RATIO), round(_SIZE * _RATIO))
    pixmap.setDevicePixelRatio(_RATIO)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.fillPath(_path(name), colour)
    painter.end()
    return pixmap


def _path(name: str) -> QPainterPath:
    path = QPainterPath()
    path.setFillRule(Qt.FillRule.WindingFill)
    for bar in _BARS.get(name, ()):
        path.addRoundedRect(QRectF(*bar), 0.8, 0.8)
    for polygon in _POLYGONS.get(name, ()):
        path.addPolygon(QPolygonF([QPointF(*corner) for corner in polygon]))
        path.closeSubpath()
    if name == "loop":  # two arms of a ring, one to each arrow head
        for arm in ((2.0, 2.5, 7.5, 1.8), (2.0, 2.5, 1.8, 7.0), (6.5, 11.7, 7.5, 1.8), (12.2, 6.5, 1.8, 7.0)):
            path.addRoundedRect(QRectF(*arm), 0.8, 0.8)
    return path
