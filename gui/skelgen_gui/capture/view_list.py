"""The views that a calibration rests on: which show the board, how well they fit, and which may go."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from PySide6.QtCore import Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QWidget

from skelgen_gui.capture.results import ValueTable
from skelgen_gui.capture.views import Side, View

Fit = tuple[float, float, bool]
"""Distance [px] of the corners from where they are expected, left and right, and whether the view was used."""

_HEIGHT = 130  # px: five views


class ViewList(ValueTable):
    """One row for each view; Delete takes the chosen ones away.

    Signals
    -------
    removal_wanted(object)
        These views, a list, shall go.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    removal_wanted = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        tip = self.tr(
            "Views that were taken; after the calibration, how far their corners are from where they are "
            "expected [px]. Delete takes the chosen ones away"
        )
        titles = self.tr("View"), self.tr("Left"), self.tr("Right"), self.tr("Used")
        self.describe(self.tr("Views of the board"), tip, titles)
        self.setFixedHeight(_HEIGHT)
        self._views: tuple[View, ...] = ()

    def show_views(self, views: Sequence[View], fits: Mapping[str, Fit]) -> None:
        """Show views, with how they fit where that is known."""
        views = tuple(views)
        if views != self._views:
            self._views = views
            self.show_names([view.name for view in views])
        for row, view in enumerate(views):
            left, right, is_used = fits.get(view.name, (math.nan, math.nan, None))
            used = "" if is_used is None else self.tr("yes") if is_used else self.tr("no")
            self.show_row(row, (self._told(view.left, left), self._told(view.right, right), used))
        if views:
            self.scrollToBottom()

    @property
    def selected_views(self) -> list[View]:
        """The chosen views."""
        rows = sorted({index.row() for index in self.selectedIndexes()})
        return [self._views[row] for row in rows if row < len(self._views)]

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Take the chosen views away."""
        if event.matches(QKeySequence.StandardKey.Delete) and self.selected_views:
            self.removal_wanted.emit(self.selected_views)
        else:
            super().keyPressEvent(event)

    def _told(self, side: Side, rms: float) -> str:
        if side is None:
            return self.tr("no board")
        return self.tr("board") if math.isnan(rms) else f"{rms:.2f}"
