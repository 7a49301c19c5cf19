"""Timeline, curves, matrix and graph can be painted and asked whatever is open, also while they derive what is new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPointF
from skelgen_gui.diagrams.graph_view import GraphView
from skelgen_gui.diagrams.matrix_view import MatrixView
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.plot_view import Curves
from skelgen_gui.timeline.timeline import Timeline

from skelgen.model import Limbs, PointCloud, Project, StageReport, Trajectories

RESULTS = ("_trajectories", "_labelling", "_limbs", "_topology", "_skeleton", "_motion")
SIZE = (600, 300)


def until(project, n_results):
    """The project without the results after some."""
    return replace(project, **dict.fromkeys(RESULTS[n_results:]))


def labelled(positions):
    names = tuple(f"m{index}" for index in range(positions.shape[1]))
    take = Trajectories(positions, names, 100.0)
    return Project(take).with_trajectories(take, StageReport())


def left_out(positions):
    n_markers = positions.shape[1]
    limbs = Limbs(np.full(n_markers, -1), np.full((n_markers, n_markers), np.nan))
    return labelled(positions).with_limbs(limbs, StageReport())


STATES = {
    "a take": lambda project: until(project, 0),
    "labels": lambda project: until(project, 2),
    "limbs": lambda project: until(project, 3),
    "joints": lambda project: until(project, 4),
    "skeleton": lambda project: project,
    "a cloud": lambda _: Project(PointCloud(np.zeros((3, 3)), np.array([0, 2, 2, 3]), np.arange(3.0))),
    "no frame": lambda _: labelled(np.zeros((0, 3, 3))),
    "one frame": lambda _: labelled(np.zeros((1, 3, 3))),
    "no marker": lambda _: labelled(np.zeros((5, 0, 3))),
    "nothing seen, no limb": lambda _: left_out(np.full((5, 3, 3), np.nan)),
}


@pytest.fixture
def views(qtbot):
    session = Session()
    timeline = Timeline(session)
    found = [timeline, Curves(session, timeline.span), MatrixView(session), GraphView(session)]
    for view in found:
        qtbot.addWidget(view)
        view.resize(*SIZE)
        view.show()
    return session, found


def look(views):
    """Paint everything and ask everywhere."""
    for view in views:
        view.grab()
        asked = view.lane_view if isinstance(view, Timeline) else view
        for x in range(0, SIZE[0], 50):
            for y in range(0, SIZE[1], 25):
                assert asked.tip_at(QPointF(x, y))


@pytest.mark.parametrize("state", STATES)
def test_every_state_can_be_painted_and_asked(views, qtbot, walked, state):
    session, views = views
    derivers = [deriver for view in views for deriver in view.findChildren(Deriver)]
    session.open(walked[0])
    qtbot.waitUntil(lambda: not any(deriver.is_busy for deriver in derivers))
    session.select(Selection(frozenset({0, 40}), limb=3, joint=5))
    session.show_frame(399)
    session.open(STATES[state](walked[0]))
    look(views)
    qtbot.waitUntil(lambda: not any(deriver.is_busy for deriver in derivers))
    session.select(Selection(frozenset({0, 1}), limb=0, joint=0))
    session.show_frame(1)
    look(views)


def test_lanes_of_another_take_are_not_shown_for_those_of_this_one(views, walked, small_project, qtbot):
    session, (timeline, *_) = views
    session.open(walked[0])
    qtbot.waitUntil(lambda: timeline.lane_view.lanes is not None)
    session.open(small_project)
    assert timeline.lane_view.lanes is None


def test_lanes_of_an_earlier_result_stay_until_the_new_ones_are_there(views, walked, qtbot):
    session, (timeline, *_) = views
    session.open(walked[0])
    qtbot.waitUntil(lambda: timeline.lane_view.lanes is not None)
    session.change(until(walked[0], 2))
    assert timeline.lane_view.lanes.limbs.max() > 0
    qtbot.waitUntil(lambda: not timeline.lane_view.deriver.is_busy)
    assert timeline.lane_view.lanes.limbs.max() == -1
