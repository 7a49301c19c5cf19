"""The 3-D view as a person uses it: what mouse, keys and menus do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QContextMenuEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QToolButton
from skelgen_gui.model.selection import Selection
from skelgen_gui.widgets.shortcuts import COMMANDS


def test_a_click_selects_and_control_adds_and_takes_away(view, session, eye, hand):
    first, second = eye.lone_markers(view)[:2]
    hand.click(view, view.place_of_marker(first))
    assert session.selection == Selection(frozenset({first}))
    for wanted in ({first, second}, {first}):
        hand.click(view, view.place_of_marker(second), modifier=Qt.KeyboardModifier.ControlModifier)
        assert session.selection == Selection(frozenset(wanted))
    hand.click(view, QPointF(5, 350))
    assert session.selection == Selection()


def test_a_click_on_a_joint_selects_it_and_one_on_a_bone_its_limb(view, session, eye, hand):
    view.set_shown(replace(eye.BARE, bones=True, joints=True))
    eye.picture_of(view)
    joints, _ = view.viewpoint.project(session.project.motion.joint_positions[20], view.width(), view.height())
    hand.click(view, QPointF(*joints[0]))
    assert session.selection == Selection(joint=0)
    view.set_shown(replace(eye.BARE, bones=True))
    eye.picture_of(view)
    skeleton = session.project.skeleton
    pair, _ = max(skeleton.lengths.items(), key=lambda item: np.linalg.norm(joints[item[0][0]] - joints[item[0][1]]))
    hand.click(view, QPointF(*joints[list(pair)].mean(axis=0)))
    assert session.selection.limb is not None


def test_a_rubber_band_selects_exactly_the_markers_in_it(view, session, eye, hand):
    places = {marker: view.place_of_marker(marker) for marker in range(session.project.trajectories.n_markers)}
    middle = places[eye.lone_markers(view)[0]].toPoint()
    start, end = middle - QPoint(90, 60), middle + QPoint(70, 120)
    hand.drag(view, start, end, modifier=Qt.KeyboardModifier.ShiftModifier)
    inside = {
        marker
        for marker, place in places.items()
        if place is not None and start.x() <= place.x() <= end.x() and start.y() <= place.y() <= end.y()
    }
    assert 1 < len(inside) < len(places)
    assert session.selection.markers == inside


def test_the_rectangle_is_seen_while_it_is_drawn(qtbot, view, eye, hand):
    before = eye.picture_of(view)
    qtbot.mousePress(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier, QPoint(100, 100))
    hand.move(view, QPoint(300, 300), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier)
    assert eye.changed(before, eye.picture_of(view), QPointF(100, 200)) > 20


def test_with_the_select_button_down_dragging_selects(view, session, hand):
    view.commands.rectangle.trigger()
    before = view.viewpoint
    hand.drag(view, QPoint(2, 60), QPoint(897, 697))
    assert view.viewpoint == before
    assert len(session.selection.markers) > 20


def test_dragging_turns_or_shifts_and_the_wheel_zooms(view, session, hand):
    home = view.viewpoint
    hand.drag(view, QPoint(100, 500), QPoint(160, 500))
    turned = view.viewpoint
    assert turned.azimuth != home.azimuth
    assert turned.target == home.target
    hand.drag(view, QPoint(100, 500), QPoint(160, 500), button=Qt.MouseButton.RightButton)
    assert view.viewpoint.target != turned.target
    notch = QWheelEvent(
        QPointF(450, 350), QPointF(450, 350), QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(view, notch)
    assert view.viewpoint.distance < turned.distance
    assert session.selection == Selection()


@pytest.mark.parametrize("key", ["1", "3", "7", "F"])
def test_keys_do_what_the_buttons_do(qtbot, view, key):
    view.activateWindow()
    view.setFocus()
    qtbot.waitUntil(view.hasFocus)
    view.fit()
    view._camera.move(view.viewpoint.orbited(0.3, 0.2))
    before = view.viewpoint
    qtbot.keyClick(view, getattr(Qt.Key, f"Key_{key}"))
    by_key = view.viewpoint
    view._camera.move(before)
    actions = {key: view.commands.moves[act] for key, act in zip("137F", ("front", "side", "top", "fit"), strict=True)}
    actions[key].trigger()
    assert by_key == view.viewpoint


def test_keys_of_the_view_are_its_own(view):
    keys = [action.shortcut().toString() for action in view.actions()]
    assert "" not in keys
    assert len(set(keys)) == len(keys)
    assert set(keys).isdisjoint(command.key for command in COMMANDS)


def test_trails_and_names_have_keys(qtbot, view):
    view.activateWindow()
    view.setFocus()
    qtbot.waitUntil(view.hasFocus)
    for key, part in ((Qt.Key.Key_T, "trails"), (Qt.Key.Key_N, "names")):
        before = getattr(view.shown, part)
        qtbot.keyClick(view, key)
        assert getattr(view.shown, part) != before


def test_arrows_turn_and_shift_and_escape_selects_nothing(qtbot, view, session):
    home = view.viewpoint
    qtbot.keyClick(view, Qt.Key.Key_Left, Qt.KeyboardModifier.ControlModifier)
    assert view.viewpoint.azimuth != home.azimuth
    qtbot.keyClick(view, Qt.Key.Key_Up, Qt.KeyboardModifier.AltModifier)
    assert view.viewpoint.target != home.target
    qtbot.keyClick(view, Qt.Key.Key_Plus, Qt.KeyboardModifier.ControlModifier)
    assert view.viewpoint.distance < home.distance
    qtbot.keyClick(view, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    assert len(session.selection.markers) == session.project.trajectories.n_markers
    qtbot.keyClick(view, Qt.Key.Key_Escape)
    assert session.selection == Selection()


def test_what_is_under_the_pointer_is_explained(view, session, eye, hand):
    marker = eye.lone_markers(view)[0]
    place = view.place_of_marker(marker)
    before = eye.picture_of(view)
    hand.move(view, place.toPoint())
    text = view.note()
    assert session.project.trajectories.names[marker] in text
    assert session.project.limbs.called(int(session.project.limbs.limb_of_marker[marker])) in text
    assert "there with " in text
    assert " sure" in text
    assert "residual" in text
    assert f"{session.project.trajectories.positions[20, marker, 0]:.1f}" in text
    assert eye.changed(before, eye.picture_of(view), place + QPointF(60, 0), 50) > 200
    hand.move(view, QPoint(5, 350))
    assert view.note() == ""


def test_joints_bones_and_filled_markers_are_explained(view, session, eye, hand):
    view.set_shown(replace(eye.BARE, bones=True, joints=True))
    eye.picture_of(view)
    joints, _ = view.viewpoint.project(session.project.motion.joint_positions[20], view.width(), view.height())
    hand.move(view, QPointF(*joints[0]).toPoint())
    called = [session.project.limbs.called(int(limb)) for limb in session.project.topology.edges[0]]
    assert view.note().startswith(f"waist: {called[0]} and {called[1]}")
    assert "neighbours with " in view.note()
    assert "known to ±" in view.note()
    unseen = np.flatnonzero(~session.project.trajectories.seen[20])
    view.set_shown(replace(eye.BARE, filled=True))
    eye.picture_of(view)
    hand.move(view, view.place_of_marker(int(unseen[0])).toPoint())
    assert "unseen" in view.note()


def test_nothing_is_said_of_a_marker_that_is_unseen_in_another_frame(view, session, eye, hand):
    marker = eye.lone_markers(view)[0]
    hand.move(view, view.place_of_marker(marker).toPoint())
    assert view.note()
    unseen = np.flatnonzero(~session.project.trajectories.seen[:, marker])
    session.show_frame(int(unseen[0]))
    eye.picture_of(view)
    assert view.note() == ""


def test_the_right_button_asks_for_a_menu_about_what_it_clicked(qtbot, view, session, eye, hand):
    marker = eye.lone_markers(view)[0]
    with qtbot.waitSignal(view.context_requested) as asked:
        hand.click(view, view.place_of_marker(marker), button=Qt.MouseButton.RightButton)
    assert asked.args[1] == Selection(frozenset({marker})) == session.selection
    with qtbot.waitSignal(view.context_requested):
        event = QContextMenuEvent(QContextMenuEvent.Reason.Keyboard, QPoint(5, 5), QPoint(5, 5))
        QApplication.sendEvent(view, event)


def test_the_right_button_keeps_a_selection_that_it_hits(qtbot, view, session, eye, hand):
    chosen = Selection(frozenset(eye.lone_markers(view)[:2]))
    session.select(chosen)
    with qtbot.waitSignal(view.context_requested) as asked:
        hand.click(view, view.place_of_marker(min(chosen.markers)), button=Qt.MouseButton.RightButton)
    assert asked.args[1] == chosen


def test_the_menu_and_the_view_show_the_same(view):
    view.commands.switches["bones"].trigger()
    assert view.shown.bones
    view.commands.choices["trail_seconds"][-1].trigger()
    assert view.shown.trail_seconds == 2.0
    view.set_shown(replace(view.shown, bones=False, up=1))
    assert not view.commands.switches["bones"].isChecked()
    assert [action.isChecked() for action in view.commands.choices["up"]] == [False, False, True] + 4 * [False]


def test_every_change_of_what_is_shown_is_told_once(view, eye):
    told = []
    view.shown_changed.connect(told.append)
    view.set_shown(replace(eye.MARKERS, names=True, joints=True))
    view.set_shown(replace(eye.MARKERS, names=True, joints=True))
    assert told == [replace(eye.MARKERS, names=True, joints=True)]


def test_all_controls_have_names_and_tool_tips(view):
    assert view.accessibleName()
    for button in view.findChildren(QToolButton):
        assert button.accessibleName()
        assert button.toolTip()
