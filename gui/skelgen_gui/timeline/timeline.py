"""The timeline: transport, ruler, spare points, lanes."""

from collections.abc import Mapping
from functools import partial

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QWidget

from skelgen_gui.model.curves import Panel, count_panel
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.lane_view import LaneView, Legend
from skelgen_gui.timeline.player import PlayCommands, Player
from skelgen_gui.timeline.plot_view import PlotView
from skelgen_gui.timeline.ruler import Ruler
from skelgen_gui.timeline.span import VisibleSpan
from skelgen_gui.timeline.transport import Transport
from skelgen_gui.widgets.layouts import bare_column
from skelgen_gui.widgets.shortcuts import make_actions

_COUNTS_HEIGHT = 36


class Timeline(QWidget):
    """Plays the take, and shows what is known of every marker in every frame.

    Parameters
    ----------
    session : Session
        What is shown.
    actions : mapping of str to QAction, optional
        The window's, from `make_actions`; those of the menu Play are obeyed. Without them the timeline makes its own.

    Attributes
    ----------
    player : Player
        What plays.
    span : VisibleSpan
        Which frames are in sight; give it to `Curves` to keep both together.
    """

    def __init__(self, session: Session, actions: Mapping[str, QAction] | None = None) -> None:
        super().__init__()
        self._session = session
        if actions is None:
            actions = make_actions(self)
            self.addActions(list(actions.values()))
        self.player = Player(session, self)
        self.span = VisibleSpan(session, self)
        self.commands = PlayCommands(session, self.player, actions, self)
        self.transport = Transport(session, self.player, actions, self)
        self.ruler = Ruler(session, self.player, self.span, self)
        self.counts = PlotView(session, self.span, self)
        self.lane_view = LaneView(session, self.span, self)
        self.deriver = Deriver(self)
        self.setAccessibleName(self.tr("Timeline"))
        self.counts.setAccessibleName(self.tr("Points that belong to no marker"))
        self.counts.setToolTip(self.tr("How many points of each frame belong to no marker"))
        self.counts.setFixedHeight(_COUNTS_HEIGHT)
        column = bare_column(self, (self.transport, self.ruler, self.counts, self.lane_view, Legend(self)))
        column.setSpacing(0)
        column.setStretchFactor(self.lane_view, 1)
        session.project_changed.connect(self._follow_project)
        self._follow_project()

    def _follow_project(self) -> None:
        project = self._session.project
        if project is None:
            self.deriver.forget()
            self._take_counts(None)
        else:
            self.deriver.derive(partial(count_panel, project), self._take_counts)

    def _take_counts(self, panel: Panel | None) -> None:
        self.counts.setVisible(panel is not None)
        self.counts.show_panels((panel,) if panel is not None else ())
