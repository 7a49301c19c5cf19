"""The timeline shows every marker in the colour of its limb, goes where it is clicked, and obeys its keys."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.span import GUTTER, clock
from skelgen_gui.timeline.timeline import Timeline
from skelgen_gui.widgets.painting import colour_of_limb, doubt_colour, theme_palette

from skelgen.model import Labelling, PointCloud, Project, Trajectories
from skelgen.model.labelling import Doubt

NEAR = 1  # frame: a pixel of the test's window is less than a frame


@pytest.fixture
def timeline(session, shown):
    return shown(Timeline(session))


def click(qtbot, widget, place, modifier=Qt.KeyboardModifier.NoModifier):
    qtbot.mouseClick(widget, Qt.MouseButton.LeftButton, modifier, place.toPoint())


def focused(widget, qtbot):
    """The widget, with the focus: keys of actions work only there."""
    with qtbot.waitActive(widget.window()):
        widget.window().activateWindow()
    widget.setFocus()
    return widget


def wheel(widget, place, notches, modifiers=Qt.KeyboardModifier.NoModifier):
    event = QWheelEvent(
        place, widget.mapToGlobal(place), QPoint(), QPoint(0, 120 * notches), Qt.MouseButton.NoButton, modifiers,
        Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(widget, event)


def test_a_click_on_a_lane_goes_to_the_frame(timeline, session, qtbot):
    lanes = timeline.lane_view
    for frame in (250, 3, 399):
        click(qtbot, lanes, lanes.place_of(2, frame))
        assert abs(session.frame - frame) <= NEAR


def test_dragging_goes_on_to_other_frames(timeline, session, qtbot):
    lanes = timeline.lane_view
    qtbot.mousePress(lanes, Qt.MouseButton.LeftButton, pos=lanes.place_of(1, 100).toPoint())
    qtbot.mouseMove(lanes, lanes.place_of(1, 300).toPoint())
    assert abs(session.frame - 300) <= NEAR


def test_a_click_on_a_name_selects_the_marker_and_control_adds_one(timeline, session, qtbot):
    lanes = timeline.lane_view
    first, second = (int(marker) for marker in lanes.lanes.markers[:2])
    click(qtbot, lanes, QPointF(30, lanes.place_of(0, 0).y()))
    assert session.selection.markers == {first}
    click(qtbot, lanes, QPointF(30, lanes.place_of(1, 0).y()), Qt.KeyboardModifier.ControlModifier)
    assert session.selection.markers == {first, second}


def test_a_click_on_the_ruler_goes_to_the_frame(timeline, session, qtbot):
    x = timeline.lane_view.place_of(0, 200).x()
    click(qtbot, timeline.ruler, QPointF(x, 8))
    assert abs(session.frame - 200) <= NEAR


def test_handles_on_the_ruler_set_the_range(timeline, session, qtbot):
    ruler, low = timeline.ruler, timeline.ruler.height() - 5
    qtbot.mousePress(ruler, Qt.MouseButton.LeftButton, pos=QPoint(GUTTER - 5, low))
    qtbot.mouseMove(ruler, QPoint(round(timeline.lane_view.place_of(0, 100).x()), low))
    first, last = timeline.player.range
    assert abs(first - 100) <= NEAR
    assert (last, session.frame) == (399, 0)


@pytest.mark.parametrize("is_dark", [False, True])
def test_every_limb_has_its_colour(timeline, has_colour, walked, is_dark):
    palette = theme_palette(dark=is_dark)
    timeline.setPalette(palette)
    timeline.resize(900, 1000)
    for limb in range(walked[0].limbs.n_limbs):
        assert has_colour(timeline.lane_view, colour_of_limb(limb, timeline.palette()), 200)


def test_a_doubt_can_be_seen_and_says_its_reason(qtbot, shown, has_colour, small_project):
    doubt = Doubt(1, 3, 5, "misfit", -1, 0.3, "it is off its place")
    seen = small_project.trajectories.seen
    labelling = Labelling(np.where(seen, 0.95, np.nan), (doubt,), (), np.zeros(len(seen), dtype=int))
    session = Session()
    session.open(small_project)
    timeline = shown(Timeline(session))
    lanes = timeline.lane_view
    assert not has_colour(lanes, doubt_colour(lanes.palette()), 20)
    session.change(replace(small_project, _labelling=labelling))
    qtbot.waitUntil(lambda: not lanes.deriver.is_busy)
    assert has_colour(lanes, doubt_colour(lanes.palette()), 20)
    told = lanes.tip_at(lanes.place_of(lanes.lanes.markers.tolist().index(1), 4))
    assert "M<1>&" in told
    assert "it is off its place" in told


def test_a_name_tells_marker_and_limb_without_a_frame(timeline, walked):
    lanes = timeline.lane_view
    told = lanes.tip_at(QPointF(30, lanes.place_of(0, 0).y()))
    limb = walked[0].limbs.called(int(lanes.lanes.limbs[0]))
    assert told == f"{walked[0].trajectories.names[lanes.lanes.markers[0]]} · {limb}"


def test_the_wheel_zooms_about_the_pointer(timeline):
    lanes = timeline.lane_view
    place = lanes.place_of(0, 100)
    wheel(lanes, place, 4)
    assert timeline.span.end - timeline.span.first < 200
    assert abs(lanes.place_of(0, 100).x() - place.x()) <= 1


def test_the_wheel_with_shift_pans_and_stays_in_the_take(timeline):
    lanes = timeline.lane_view
    wheel(lanes, lanes.place_of(0, 100), 8)
    length = timeline.span.end - timeline.span.first
    wheel(lanes, lanes.place_of(0, 100), -100, Qt.KeyboardModifier.ShiftModifier)
    assert timeline.span.end == 400
    assert timeline.span.end - timeline.span.first == pytest.approx(length)


def test_zooming_ends_at_few_frames_and_at_the_whole_take(timeline):
    timeline.span.zoom(1e9, 50)
    assert timeline.span.end - timeline.span.first == 8
    timeline.span.zoom(1e-9, 50)
    assert (timeline.span.first, timeline.span.end) == (0, 400)


def test_the_shown_frame_is_kept_in_sight(timeline, session):
    timeline.span.show(0, 50)
    session.show_frame(200)
    assert timeline.span.first <= 200 < timeline.span.end
    assert timeline.span.end - timeline.span.first == 50


def test_keys_of_the_lanes_step_play_and_set_the_range(timeline, session, qtbot):
    lanes = focused(timeline.lane_view, qtbot)
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Right, Qt.Key.Key_Left, Qt.Key.Key_I):
        qtbot.keyClick(lanes, key)
    assert (session.frame, timeline.player.range) == (1, (1, 399))
    qtbot.keyClick(lanes, Qt.Key.Key_Space)
    assert timeline.player.is_playing
    qtbot.keyClick(lanes, Qt.Key.Key_Space)
    assert not timeline.player.is_playing


def test_up_and_down_select_the_marker_beside(timeline, session, qtbot):
    lanes = timeline.lane_view
    for key, lane in ((Qt.Key.Key_Down, 0), (Qt.Key.Key_Down, 1), (Qt.Key.Key_Up, 0), (Qt.Key.Key_Up, 0)):
        qtbot.keyClick(lanes, key)
        assert session.selection.markers == {int(lanes.lanes.markers[lane])}


def test_a_marker_that_is_selected_elsewhere_is_scrolled_to(timeline, session):
    lanes = timeline.lane_view
    last = lanes.lanes.n_lanes - 1
    assert lanes.place_of(last, 0).y() > lanes.height()
    session.select(Selection(frozenset({int(lanes.lanes.markers[last])})))
    assert 0 <= lanes.place_of(last, 0).y() <= lanes.height()


def test_frame_and_speed_can_be_typed_and_chosen(timeline, session):
    timeline.transport.frame.setValue(123)
    assert session.frame == 123
    timeline.transport.speed.setCurrentIndex(0)
    timeline.transport.speed.activated.emit(0)
    assert timeline.player.speed == 0.1


def test_buttons_follow_the_player(timeline):
    timeline.player.play()
    timeline.player.set_loop(True)
    timeline.player.set_speed(2.0)
    assert timeline.transport.speed.currentText() == "2 ×"
    assert [timeline.transport._actions[name].isChecked() for name in ("play", "loop")] == [True, True]


def test_next_doubt_goes_to_its_frame_and_marker(qtbot, shown, small_project):
    doubt = Doubt(4, 6, 7, "misfit", -1, 0.3, "it is off its place")
    labelling = Labelling(np.full((12, 10), 0.95), (doubt,), (), np.zeros(12, dtype=int))
    session = Session()
    session.open(replace(small_project, _labelling=labelling))
    timeline = shown(Timeline(session))
    qtbot.keyClick(focused(timeline.lane_view, qtbot), Qt.Key.Key_D)
    assert (session.frame, session.selection.markers) == (6, {4})


def test_a_cloud_shows_its_points_before_it_has_markers(shown):
    session = Session()
    session.open(Project(PointCloud(np.zeros((3, 3)), np.array([0, 2, 2, 3]), np.arange(3.0))))
    timeline = shown(Timeline(session))
    assert timeline.counts.isVisible()
    assert timeline.counts.panels[0].curves[0].line.low.tolist() == [2, 0, 1]
    assert timeline.lane_view.lanes.n_lanes == 0


def test_a_take_with_one_frame_can_be_shown_and_played(shown, qtbot):
    take = Trajectories(np.zeros((1, 2, 3)), ("a", "b"), 100.0)
    session = Session()
    session.open(Project(take).with_trajectories(take, None))
    timeline = shown(Timeline(session))
    click(qtbot, timeline.lane_view, timeline.lane_view.place_of(1, 0))
    timeline.player.set_loop(True)
    timeline.player.play()
    qtbot.wait(50)
    timeline.grab()
    assert session.frame == 0


def test_without_a_take_it_can_be_painted_and_clicked(shown, qtbot):
    timeline = shown(Timeline(Session()))
    timeline.grab()
    click(qtbot, timeline.lane_view, QPointF(300, 20))
    click(qtbot, timeline.ruler, QPointF(300, 5))
    assert not timeline.transport.isEnabled()


def test_every_control_can_be_named(timeline):
    for control in (timeline, timeline.ruler, timeline.lane_view, timeline.counts, timeline.transport.frame):
        assert control.accessibleName()


def test_times_are_shown_as_finely_as_needed():
    assert [clock(*each) for each in ((75.0, 5.0), (3.25, 0.05), (3725.0, 60.0), (0.9999, 0.01))] == [
        "1:15",
        "0:03.25",
        "1:02:05",
        "0:01.00",
    ]
