"""The 3-D view as a person sees and uses it: colours where things are, and what mouse and keys do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, Qt
from PySide6.QtGui import QColor, QContextMenuEvent, QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QToolButton
from skelgen_gui.palette import doubt_colour
from skelgen_gui.session import Selection, Session
from skelgen_gui.shortcuts import COMMANDS
from skelgen_gui.theme import theme_palette
from skelgen_gui.view3d import Shown, View3D, frustum
from skelgen_gui.view3d.colours import Colours
from skelgen_gui.view3d.sprites import Sprites

from skelgen.app.report.colours import limb_colour
from skelgen.model import PointCloud, Poses, Project, Trajectories

ALONE = 26  # px to the next thing that is drawn: nothing covers it, nor the light and the shade of its ball
SAME_HUE = 16  # degrees: light and fog change a colour, but hardly its hue
NOTHING = Shown(**dict.fromkeys(("filled", "trails", "bones", "joints", "uncertainty", "axes", "floor"), False))
MARKERS, BARE = NOTHING, replace(NOTHING, markers=False)


@pytest.fixture
def view(qtbot, session):
    """A view of `walked`, shown, in which only seen markers are drawn; frame 20."""
    view = make_view(qtbot, session)
    session.show_frame(20)
    view.show_only(MARKERS)
    picture_of(view)
    return view


def make_view(qtbot, session, size=(900, 700)):
    view = View3D(session)
    qtbot.addWidget(view)
    view.setPalette(theme_palette(dark=False))
    view.resize(*size)
    view.show()
    return view


def picture_of(view):
    return view.grab().toImage()


def pixels(image):
    """Red, green and blue of all pixels, shape (height, width, 3)."""
    image = image.convertToFormat(image.Format.Format_RGB32)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
    return rows[:, : image.width(), 2::-1].astype(int)


def changed(before, after, place=None, radius=20):
    """How many pixels differ clearly, around a place or anywhere."""
    difference = np.abs(pixels(before) - pixels(after)).max(axis=2) > 12
    if place is not None:
        x, y = round(place.x()), round(place.y())
        difference = difference[max(y - radius, 0) : y + radius, max(x - radius, 0) : x + radius]
    return int(difference.sum())


def lone_markers(view, least=ALONE):
    """Markers that are drawn with nothing else near, and not below the buttons."""
    places = {marker: place for marker in range(100) if (place := view.place_of_marker(marker)) is not None}
    return [
        marker
        for marker, place in places.items()
        if place.y() > 60
        and all((place - other).manhattanLength() > least for index, other in places.items() if index != marker)
    ]


def click(qtbot, view, place, button=Qt.MouseButton.LeftButton, modifier=Qt.KeyboardModifier.NoModifier):
    qtbot.mouseClick(view, button, modifier, place.toPoint())


def drag(qtbot, view, start, end, button=Qt.MouseButton.LeftButton, modifier=Qt.KeyboardModifier.NoModifier):
    qtbot.mousePress(view, button, modifier, start)
    for part in (0.3, 0.6, 1.0):
        send_move(view, start + (end - start) * part, button, modifier)
    qtbot.mouseRelease(view, button, modifier, end)


def send_move(view, place, buttons=Qt.MouseButton.NoButton, modifier=Qt.KeyboardModifier.NoModifier):
    spot = QPointF(place)
    event = QMouseEvent(
        QEvent.Type.MouseMove, spot, QPointF(view.mapToGlobal(place)), Qt.MouseButton.NoButton, buttons, modifier
    )
    QApplication.sendEvent(view, event)


def hue_gap(first, second):
    return abs((first.hue() - second.hue() + 180) % 360 - 180)


@pytest.mark.parametrize("dark", [False, True])
def test_markers_have_the_colours_of_their_limbs_where_they_are_projected(view, session, dark):
    view.setPalette(theme_palette(dark=dark))
    image = picture_of(view)
    lone = lone_markers(view)
    limbs = session.project.limbs.limb_of_marker
    assert len({int(limbs[marker]) for marker in lone}) > 5
    for marker in lone:
        wanted = QColor(limb_colour(int(limbs[marker]), dark=dark))
        assert hue_gap(image.pixelColor(view.place_of_marker(marker).toPoint()), wanted) < SAME_HUE


def test_the_place_of_a_marker_is_that_of_its_projection(view, session):
    places, _ = view.viewpoint.project(session.project.trajectories.positions[20], view.width(), view.height())
    for marker in lone_markers(view):
        place = view.place_of_marker(marker)
        assert [place.x(), place.y()] == pytest.approx(places[marker].tolist())


def test_background_follows_the_palette(view):
    light = picture_of(view).pixelColor(5, 300)
    view.setPalette(theme_palette(dark=True))
    dark = picture_of(view).pixelColor(5, 300)
    assert light.lightness() > 200
    assert dark.lightness() < 90


@pytest.mark.parametrize("part", ["markers", "filled", "names", "trails", "bones", "joints", "axes", "floor"])
def test_every_part_can_be_switched_on_and_off(view, session, part):
    session.show_frame(60)
    view.show_only(BARE)
    without = picture_of(view)
    shown = replace(BARE, **{part: True, "markers": part in ("markers", "names", "trails")})
    view.show_only(shown)
    assert changed(without, picture_of(view)) > 60
    view.show_only(BARE)
    assert changed(without, picture_of(view)) == 0


def test_trails_are_drawn_behind_moving_markers(view):
    without = picture_of(view)
    view.show_only(replace(MARKERS, trails=True, trail_seconds=2.0))
    assert changed(without, picture_of(view)) > 300


def test_ellipsoids_cover_their_joints_and_grow_with_their_magnification(view, session):
    project, covered = session.project, []
    std = np.full_like(project.motion.joint_std, 10.0)
    session.change(replace(project, _motion=replace(project.motion, joint_std=std)))
    for times in (2, 5):
        view.show_only(replace(BARE, magnification=times))
        without = picture_of(view)
        view.show_only(replace(BARE, uncertainty=True, magnification=times))
        covered.append(ink(without, picture_of(view)))
    assert covered[0] > 14 * 50  # 14 joints
    assert covered[1] > 2.5 * covered[0]


def ink(without, image):
    """Number of pixels above the legend that differ at all."""
    return int((np.abs(pixels(without) - pixels(image)).max(axis=2)[:660] > 4).sum())


def test_unseen_markers_are_hollow_and_doubtful_ones_have_a_ring(view, session):
    marker = lone_markers(view)[0]
    sure = picture_of(view)
    place = view.place_of_marker(marker)
    project = session.project
    confidence = project.labelling.confidence.copy()
    confidence[20, marker] = 0.5
    session.change(replace(project, _labelling=replace(project.labelling, confidence=confidence)))
    doubt = doubt_colour(view.palette())
    assert near(picture_of(view), place, doubt) > 8
    assert near(sure, place, doubt) == 0
    positions = project.trajectories.positions.copy()
    positions[20, marker] = np.nan
    session.change(replace(project, _trajectories=replace(project.trajectories, positions=positions)))
    view.show_only(replace(MARKERS, filled=True))
    hollow = picture_of(view).pixelColor(view.place_of_marker(marker).toPoint())
    assert hollow.saturation() < sure.pixelColor(place.toPoint()).saturation() / 2


def near(image, place, colour, radius=14, tolerance=40):
    """How many pixels around a place have a colour."""
    x, y = round(place.x()), round(place.y())
    patch = pixels(image)[y - radius : y + radius, x - radius : x + radius]
    return int((np.abs(patch - colour.getRgb()[:3]).max(axis=2) < tolerance).sum())


def test_selecting_draws_a_ring_around_a_marker_and_around_those_of_a_limb(view, session):
    before, marker = picture_of(view), lone_markers(view)[0]
    session.select(Selection(frozenset({marker})))
    assert near(picture_of(view), view.place_of_marker(marker), view.palette().highlight().color()) > 8
    limb = int(session.project.limbs.limb_of_marker[marker])
    session.select(Selection(limb=limb))
    for other in set(lone_markers(view)) & set(session.project.limbs.markers_of(limb).tolist()):
        assert changed(before, picture_of(view), view.place_of_marker(other)) > 20


def test_the_names_of_few_selected_markers_stand_beside_them(view, session):
    marker = lone_markers(view)[0]
    beside = view.place_of_marker(marker) + QPointF(34, -9)
    before = picture_of(view)
    session.select(Selection(frozenset({marker})))
    assert changed(before, picture_of(view), beside, radius=8) > 10
    session.select(Selection(frozenset(range(40))))
    assert changed(before, picture_of(view), beside, radius=8) == 0


def test_a_click_selects_and_control_adds_and_takes_away(qtbot, view, session):
    first, second = lone_markers(view)[:2]
    click(qtbot, view, view.place_of_marker(first))
    assert session.selection == Selection(frozenset({first}))
    for wanted in ({first, second}, {first}):
        click(qtbot, view, view.place_of_marker(second), modifier=Qt.KeyboardModifier.ControlModifier)
        assert session.selection == Selection(frozenset(wanted))
    click(qtbot, view, QPointF(5, 350))
    assert session.selection == Selection()


def test_a_click_on_a_joint_selects_it_and_one_on_a_bone_its_limb(qtbot, view, session):
    view.show_only(replace(BARE, bones=True, joints=True))
    picture_of(view)
    joints, _ = view.viewpoint.project(session.project.motion.joint_positions[20], view.width(), view.height())
    click(qtbot, view, QPointF(*joints[0]))
    assert session.selection == Selection(joint=0)
    view.show_only(replace(BARE, bones=True))
    picture_of(view)
    skeleton = session.project.skeleton
    pair, _ = max(skeleton.lengths.items(), key=lambda item: np.linalg.norm(joints[item[0][0]] - joints[item[0][1]]))
    click(qtbot, view, QPointF(*joints[list(pair)].mean(axis=0)))
    assert session.selection.limb is not None


def test_a_rubber_band_selects_exactly_the_markers_in_it(qtbot, view, session):
    places = {marker: view.place_of_marker(marker) for marker in range(session.project.trajectories.n_markers)}
    middle = places[lone_markers(view)[0]].toPoint()
    start, end = middle - QPoint(90, 60), middle + QPoint(70, 120)
    drag(qtbot, view, start, end, modifier=Qt.KeyboardModifier.ShiftModifier)
    inside = {
        marker
        for marker, place in places.items()
        if place is not None and start.x() <= place.x() <= end.x() and start.y() <= place.y() <= end.y()
    }
    assert 1 < len(inside) < len(places)
    assert session.selection.markers == inside


def test_the_rectangle_is_seen_while_it_is_drawn(qtbot, view):
    before = picture_of(view)
    qtbot.mousePress(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier, QPoint(100, 100))
    send_move(view, QPoint(300, 300), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier)
    assert changed(before, picture_of(view), QPointF(100, 200)) > 20


def test_with_the_select_button_down_dragging_selects(qtbot, view, session):
    view.commands.rectangle.trigger()
    before = view.viewpoint
    drag(qtbot, view, QPoint(2, 60), QPoint(897, 697))
    assert view.viewpoint == before
    assert len(session.selection.markers) > 20


def test_dragging_turns_or_shifts_and_the_wheel_zooms(qtbot, view, session):
    home = view.viewpoint
    drag(qtbot, view, QPoint(100, 500), QPoint(160, 500))
    turned = view.viewpoint
    assert turned.azimuth != home.azimuth
    assert turned.target == home.target
    drag(qtbot, view, QPoint(100, 500), QPoint(160, 500), button=Qt.MouseButton.RightButton)
    assert view.viewpoint.target != turned.target
    notch = QWheelEvent(
        QPointF(450, 350), QPointF(450, 350), QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(view, notch)
    assert view.viewpoint.distance < turned.distance
    assert session.selection == Selection()


def test_front_side_and_top_look_along_the_axes(view):
    for look, level in ((view.look_from_front, 0), (view.look_from_side, 0), (view.look_from_top, 1)):
        look()
        basis = view.viewpoint.basis
        assert np.sort(np.abs(basis[2])) == pytest.approx([0, 0, 1], abs=1e-9)
        assert abs(basis[2, view.up]) == pytest.approx(level, abs=1e-9)


def test_fit_shows_all_of_the_frame_or_what_is_selected(view, session):
    view.fit()
    picture_of(view)
    places = [view.place_of_marker(marker) for marker in range(session.project.trajectories.n_markers)]
    assert all(view.rect().contains(place.toPoint()) for place in places if place is not None)
    distance = view.viewpoint.distance
    for selection in (Selection(frozenset(lone_markers(view)[:2])), Selection(limb=3)):
        session.select(selection)
        view.fit()
        assert view.viewpoint.distance < distance


@pytest.mark.parametrize("key", ["1", "3", "7", "F"])
def test_keys_do_what_the_buttons_do(qtbot, view, key):
    view.activateWindow()
    view.setFocus()
    qtbot.waitUntil(view.hasFocus)
    view.fit()
    view._outlook.move(view.viewpoint.orbited(0.3, 0.2))
    before = view.viewpoint
    qtbot.keyClick(view, getattr(Qt.Key, f"Key_{key}"))
    by_key = view.viewpoint
    view._outlook.move(before)
    actions = {"1": view.commands.front, "3": view.commands.side, "7": view.commands.top, "F": view.commands.fit}
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


def test_what_is_under_the_pointer_is_explained(qtbot, view, session):
    marker = lone_markers(view)[0]
    place = view.place_of_marker(marker)
    before = picture_of(view)
    send_move(view, place.toPoint())
    text = view.note()
    assert session.project.trajectories.names[marker] in text
    assert f"limb {session.project.limbs.limb_of_marker[marker]}" in text
    assert "confidence" in text
    assert "residual" in text
    assert f"{session.project.trajectories.positions[20, marker, 0]:.1f}" in text
    assert changed(before, picture_of(view), place + QPointF(60, 0), 50) > 200
    send_move(view, QPoint(5, 350))
    assert view.note() == ""


def test_joints_bones_and_filled_markers_are_explained(view, session):
    view.show_only(replace(BARE, bones=True, joints=True))
    picture_of(view)
    joints, _ = view.viewpoint.project(session.project.motion.joint_positions[20], view.width(), view.height())
    send_move(view, QPointF(*joints[0]).toPoint())
    assert view.note().startswith("joint 0: limbs")
    assert "known to ±" in view.note()
    unseen = np.flatnonzero(~session.project.trajectories.seen[20])
    view.show_only(replace(BARE, filled=True))
    picture_of(view)
    send_move(view, view.place_of_marker(int(unseen[0])).toPoint())
    assert "unseen" in view.note()


def test_nothing_is_said_of_a_marker_that_is_unseen_in_another_frame(view, session):
    marker = lone_markers(view)[0]
    send_move(view, view.place_of_marker(marker).toPoint())
    assert view.note()
    unseen = np.flatnonzero(~session.project.trajectories.seen[:, marker])
    session.show_frame(int(unseen[0]))
    picture_of(view)
    assert view.note() == ""


def test_the_right_button_asks_for_a_menu_about_what_it_clicked(qtbot, view, session):
    marker = lone_markers(view)[0]
    with qtbot.waitSignal(view.context_requested) as asked:
        click(qtbot, view, view.place_of_marker(marker), button=Qt.MouseButton.RightButton)
    assert asked.args[1] == Selection(frozenset({marker})) == session.selection
    with qtbot.waitSignal(view.context_requested):
        event = QContextMenuEvent(QContextMenuEvent.Reason.Keyboard, QPoint(5, 5), QPoint(5, 5))
        QApplication.sendEvent(view, event)


def test_the_right_button_keeps_a_selection_that_it_hits(qtbot, view, session):
    chosen = Selection(frozenset(lone_markers(view)[:2]))
    session.select(chosen)
    with qtbot.waitSignal(view.context_requested) as asked:
        click(qtbot, view, view.place_of_marker(min(chosen.markers)), button=Qt.MouseButton.RightButton)
    assert asked.args[1] == chosen


def test_a_second_result_is_drawn_in_one_hue(view, session):
    project = session.project
    shifted = replace(project.trajectories, positions=project.trajectories.positions + np.array([0, 0, 120.0]))
    view.show_only(MARKERS)
    before = picture_of(view)
    session.compare_with(Project(shifted))
    after = picture_of(view)
    assert changed(before, after) > 200
    new = pixels(after)[np.abs(pixels(before) - pixels(after)).max(axis=2) > 40]
    hues = [QColor(*colour).hue() for colour in new.tolist()]
    wanted = Colours(view.palette(), is_other=True).limb(0).hue()
    assert np.median([abs((hue - wanted + 180) % 360 - 180) for hue in hues]) < SAME_HUE
    view.show_only(replace(MARKERS, other=False))
    assert changed(before, picture_of(view)) == 0


def test_cameras_are_drawn_as_what_they_see(view):
    view.show_only(BARE)
    before = picture_of(view)
    pose = np.eye(4)
    pose[:3, 3] = view.viewpoint.target
    view.show_cameras([frustum(pose, (640, 480), (600.0, 600.0))])
    assert changed(before, picture_of(view)) > 300
    view.show_only(replace(BARE, cameras=False))
    assert changed(before, picture_of(view)) == 0


def test_the_viewer_stays_when_a_stage_has_run_and_looks_anew_at_another_take(view, session, walked):
    view.look_from_side()
    before = view.viewpoint
    session.change(Project(session.project.take))
    assert view.viewpoint == before
    positions = walked[0].take.positions + 5000.0
    session.open(Project(replace(walked[0].take, positions=positions)))
    assert view.viewpoint != before


def test_a_view_that_follows_keeps_what_moves_in_its_place(view, session):
    def middle():
        joints = session.project.motion.joint_positions[session.frame]
        canvas = view._outlook.canvas_at(session.frame)
        return canvas.project(joints.mean(axis=0)[np.newaxis])[0][0]

    stays = middle()
    session.show_frame(250)
    assert np.linalg.norm(middle() - stays) > 30
    session.show_frame(20)
    view.show_only(replace(MARKERS, follow=True))
    session.show_frame(250)
    assert np.abs(middle() - stays)[0] < 5  # it goes along on the level; height is seen


@pytest.mark.parametrize(
    "change",
    [
        lambda view, session: session.show_frame(session.frame + 1),
        lambda view, session: session.select(Selection(joint=3)),
        lambda view, session: session.compare_with(session.project),
        lambda view, session: session.change(session.project),
        lambda view, session: view.show_only(Shown(names=True)),
        lambda view, session: view.fit(),
        lambda view, session: view.look_from_top(),
        lambda view, session: view.show_cameras([]),
    ],
)
def test_every_change_is_painted(qtbot, view, session, change):
    class Painted(QObject):
        count = 0

        def eventFilter(self, watched, event):  # noqa: N802 - Qt's name
            self.count += event.type() == QEvent.Type.Paint
            return False

    view.repaint()  # what is still to be painted of the first look
    QApplication.processEvents()
    painted = Painted()
    view.installEventFilter(painted)
    change(view, session)
    qtbot.waitUntil(lambda: painted.count > 0)


def test_the_up_axis_can_be_stated(view):
    view.show_only(replace(MARKERS, up=1))
    assert view.up == 1
    assert view.viewpoint.basis[1] @ [0, 1, 0] > 0.9
    view.show_only(replace(MARKERS, up=None))
    assert view.up == 2


def test_the_menu_and_the_view_show_the_same(view):
    view.commands.switches["bones"].trigger()
    assert view.shown.bones
    view.commands.choices["trail_seconds"][-1].trigger()
    assert view.shown.trail_seconds == 2.0
    view.show_only(replace(view.shown, bones=False, up=1))
    assert not view.commands.switches["bones"].isChecked()
    assert [action.isChecked() for action in view.commands.choices["up"]] == [False, False, True, False]


def test_every_change_of_what_is_shown_is_told_once(view):
    told = []
    view.shown_changed.connect(told.append)
    view.show_only(replace(MARKERS, names=True, joints=True))
    view.show_only(replace(MARKERS, names=True, joints=True))
    assert told == [replace(MARKERS, names=True, joints=True)]


def test_all_controls_have_names_and_tool_tips(view):
    assert view.accessibleName()
    for button in view.findChildren(QToolButton):
        assert button.accessibleName()
        assert button.toolTip()


def cloud(n_frames):
    """An unlabelled take: two points a frame, none in every third."""
    counts = [0 if frame % 3 == 2 else 2 for frame in range(n_frames)]
    starts = np.concatenate([[0], np.cumsum(counts)])
    return PointCloud(np.arange(3.0 * starts[-1]).reshape(-1, 3), starts, np.arange(n_frames) / 100)


def labelled(positions):
    positions = np.asarray(positions, dtype=float)
    return Trajectories(positions, tuple(f"m{index}" for index in range(positions.shape[1])), 100.0)


def bodies():
    poses = np.broadcast_to(np.eye(4), (4, 2, 4, 4)).copy()
    poses[:, 1, 0, 3] = 300
    poses[1, 0] = np.nan
    return Poses(poses, ("left", "right"), 60.0)


STRANGE = {
    "a cloud": cloud(7),
    "a cloud without points": PointCloud(np.zeros((0, 3)), np.zeros(4, dtype=int), np.arange(3.0)),
    "a take without frames": labelled(np.zeros((0, 3, 3))),
    "one frame": labelled([[[0, 0, 0], [100, 0, 0], [0, 50, 900]]]),
    "one marker that rests": labelled(np.zeros((5, 1, 3))),
    "no marker": labelled(np.zeros((5, 0, 3))),
    "all unseen in a frame": labelled([[[0, 0, 0], [9, 0, 0]], [[np.nan] * 3] * 2]),
    "never anything seen": labelled(np.full((3, 2, 3), np.nan)),
    "markers far apart": labelled([[[0, 0, 0], [1e7, 0, 0], [0, -1e7, 1e-3]]]),
    "bodies": bodies(),
}


@pytest.mark.parametrize("take", STRANGE.values(), ids=STRANGE.keys())
def test_strange_takes_are_drawn_without_error_or_warning(qtbot, qtlog, take):
    session = Session()
    view = make_view(qtbot, session)
    session.open(Project(take))
    view.show_only(Shown(names=True, follow=True, trail_seconds=2.0))
    session.compare_with(Project(cloud(2)))
    for frame in range(take.n_frames):
        session.show_frame(frame)
        picture_of(view)
        send_move(view, QPoint(450, 350))
        view.fit()
    for act in (view.fit_take, view.look_from_top, view.look_from_side):
        act()
        assert not picture_of(view).isNull()
    assert [record.message for record in qtlog.records] == []


@pytest.mark.parametrize("stage", ["labels", "limbs", "joints", "skeleton"])
def test_every_stage_is_drawn(qtbot, qtlog, walked, stage):
    project, later = walked[0], ("limbs", "topology", "skeleton", "motion")
    first = {"labels": 0, "limbs": 1, "joints": 2, "skeleton": 4}[stage]
    session = Session()
    view = make_view(qtbot, session)
    session.open(replace(project, **{f"_{name}": None for name in later[first:]}))
    assert session.project.has(stage)
    view.show_only(BARE)
    bare = picture_of(view)
    view.show_only(Shown())
    assert changed(bare, picture_of(view)) > 2000
    assert [record.message for record in qtlog.records] == []


@pytest.mark.parametrize(
    "path",
    ["arm/arm-4-4-4_clean_30fps.c3d", "human/markers_Squat2.trc", "wheelchair/racing_full.c3d", "hand/recording.tsv"],
)
def test_recordings_are_seen_whole_at_the_first_look(qtbot, qtlog, recording, path):
    session, take = Session(), recording(path)
    view = make_view(qtbot, session)
    session.open(Project(take))
    for frame in np.linspace(0, take.n_frames - 1, 5).astype(int).tolist():
        session.show_frame(frame)
        picture_of(view)
        seen = np.flatnonzero(take.seen[frame]).tolist()
        inside = [view.rect().contains(view.place_of_marker(marker).toPoint()) for marker in seen]
        assert np.mean(inside) > 0.9  # strays may lie outside
    assert [record.message for record in qtlog.records] == []


def test_without_a_project_the_view_is_empty(qtbot, qtlog):
    view = make_view(qtbot, Session())
    for act in (view.fit, view.fit_take, view.look_from_front):
        act()
    click(qtbot, view, QPointF(300, 300))
    assert pixels(picture_of(view))[300, 100].min() > 200
    assert [record.message for record in qtlog.records] == []


def test_a_small_window_is_painted(qtbot, session):
    view = make_view(qtbot, session, size=(1, 1))
    assert not picture_of(view).isNull()


def test_sprites_do_not_pile_up(qtbot):
    from PySide6.QtGui import QImage, QPainter
    from skelgen_gui.view3d.sprites import MOST_SPRITES, Style

    image = QImage(40, 40, QImage.Format.Format_RGB32)
    sprites, painter = Sprites(1.0), QPainter(image)
    for number in range(MOST_SPRITES + 50):
        sprites.draw(painter, (20.0, 20.0), 4.0, Style.RING, QColor(number % 256, number // 256, 0))
    painter.end()
    assert len(sprites._kept) <= MOST_SPRITES
