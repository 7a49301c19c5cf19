"""What the bars of lanes mean."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QSize
from PySide6.QtGui import QFontMetricsF, QPainter, QPaintEvent, QPalette
from PySide6.QtWidgets import QSizePolicy, QWidget

from skelgen_gui.palette import colour_of_limb, doubt_colour, rgb_of
from skelgen_gui.pixels import pixmap_of
from skelgen_gui.timeline.lane_picture import lane_picture
from skelgen_gui.timeline.lanes import State
from skelgen_gui.timeline.scale import GUTTER

_SAMPLE = 26  # px, width of a bar
_BAR = 14  # px, its height
_GAP = 18.0
_LEAST = 6.0  # px from the left border


class Legend(QWidget):
    """A sample of each bar with its meaning."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._words = {
            State.SEEN: self.tr("seen"),
            State.FILLED: self.tr("filled by the skeleton"),
            State.DOUBTFUL: self.tr("doubtful"),
            State.LEFT_OUT: self.tr("on no limb"),
        }
        self.setAccessibleName(self.tr("Meaning of the bars"))
        self.setAccessibleDescription(", ".join(self._words.values()))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        """Return one low line."""
        return QSize(400, _BAR + 8)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the samples as lanes are painted."""
        painter = QPainter(self)
        metrics = QFontMetricsF(self.font())
        widths = [_SAMPLE + 5 + metrics.horizontalAdvance(words) + _GAP for words in self._words.values()]
        x = min(float(GUTTER), max(self.width() - sum(widths), _LEAST))  # below the lanes, if there is room
        ratio = self.devicePixelRatioF()
        doubt = rgb_of(doubt_colour(self.palette()))
        for (state, words), width in zip(self._words.items(), widths, strict=True):
            shares = np.zeros((1, round(_SAMPLE * ratio), len(State)))
            shares[..., state] = 1.0
            colour = colour_of_limb(-1 if state == State.LEFT_OUT else 0, self.palette())
            colours = rgb_of(colour)[np.newaxis]
            bar = lane_picture(shares, colours, doubt, round(_BAR * ratio))
            painter.drawPixmap(QPointF(x, 4), pixmap_of(bar, ratio))
            painter.setPen(self.palette().color(QPalette.ColorRole.WindowText))
            painter.drawText(QPointF(x + _SAMPLE + 5, 4 + (_BAR + metrics.ascent() - metrics.descent()) / 2), words)
            x += width
        painter.end()
