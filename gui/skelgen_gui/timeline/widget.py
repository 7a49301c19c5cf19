"""The timeline: transport, ruler, spare points, lanes."""

from __future__ import annotations

from functools import partial

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from skelgen_gui.derived import Deriver
from skelgen_gui.session import Session
from skelgen_gui.timeline.curve import Panel
from skelgen_gui.timeline.lane_view import LaneView
from skelgen_gui.timeline.legend import Legend
from skelgen_gui.timeline.panels import count_panel
from skelgen_gui.timeline.player import Player
from skelgen_gui.timeline.plot_view import PlotView
from skelgen_gui.timeline.ruler import Ruler
from skelgen_gui.timeline.span import VisibleSpan
from skelgen_gui.timeline.transport import Transport

_COUNTS_HEIGHT = 36


class Timeline(QWidget):
    """Plays the take, and shows what is known of every marker in every frame.

    Parameters
    ----------
    session : Session
        What is shown.
    player : Player, optional
        What plays it; one of its own if not given.
    """

    def __init__(self, session: Session, player: Player | None = None, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.player = player or Player(session, self)
        self.span = VisibleSpan(session, self)
        self.transport = Transport(session, self.player, self)
        self.ruler = Ruler(session, self.player, self.span, self)
        self.counts = PlotView(session, self.span, self)
        self.lane_view = LaneView(session, self.span, self)
        self.deriver = Deriver(self)
        self.counts.setAccessibleName(self.tr("Points that belong to no marker"))
        self.counts.setToolTip(self.tr("How many points of each frame belong to no marker"))
        self.counts.setFixedHeight(_COUNTS_HEIGHT)
        self.setAccessibleName(self.tr("Timeline"))
        self._arrange()
        self.add_keys_to(self.lane_view)
        self.add_keys_to(self.counts)
        session.project_changed.connect(self._follow_project)
        self._follow_project()

    @property
    def actions_of_keys(self) -> list[QAction]:
        """Actions with single keys, such as Space for play."""
        return self.transport.actions()

    def add_keys_to(self, view: QWidget) -> None:
        """Let the single keys work in another view as well while that has the focus."""
        view.addActions(self.actions_of_keys)

    def _arrange(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for part in (self.transport, self.ruler, self.counts):
            column.addWidget(part)
        column.addWidget(self.lane_view, 1)
        column.addWidget(Legend(self))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)

    def _follow_project(self) -> None:
        project = self._session.project
        if project is None:
            self._take_counts(None)
        else:
            self.deriver.derive(partial(count_panel, project), self._take_counts)

    def _take_counts(self, panel: Panel | None) -> None:
        self.counts.setVisible(panel is not None)
        self.counts.show_panels((panel,) if panel is not None else ())
