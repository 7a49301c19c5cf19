"""What is seen in the 3-D view: colours where things are, and what every change paints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QObject, QPointF
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.view_state import Shown
from skelgen_gui.model.viewpoint import DOWN, frustum
from skelgen_gui.view3d.colours import Colours
from skelgen_gui.widgets.painting import doubt_colour, theme_palette

from skelgen.app.drawing.scales import limb_colour
from skelgen.model import Project

SAME_HUE = 24  # degrees: light and fog change a colour, but hardly its hue; that of pale colours most


def hue_gap(first, second):
    return abs((first.hue() - second.hue() + 180) % 360 - 180)


@pytest.mark.parametrize("dark", [False, True])
def test_markers_have_the_colours_of_their_limbs_where_they_are_projected(view, session, dark, eye):
    view.setPalette(theme_palette(dark=dark))
    image = eye.picture_of(view)
    lone = eye.lone_markers(view)
    limbs = session.project.limbs.limb_of_marker
    assert len({int(limbs[marker]) for marker in lone}) > 5
    for marker in lone:
        wanted = QColor(limb_colour(int(limbs[marker]), dark=dark))
        assert hue_gap(eye.colour_at(image, view.place_of_marker(marker)), wanted) < SAME_HUE


def test_the_place_of_a_marker_is_that_of_its_projection(view, session, eye):
    places, _ = view.viewpoint.project(session.project.trajectories.positions[20], view.width(), view.height())
    for marker in eye.lone_markers(view):
        place = view.place_of_marker(marker)
        assert [place.x(), place.y()] == pytest.approx(places[marker].tolist())


def test_background_follows_the_palette(view, eye):
    light = eye.picture_of(view).pixelColor(5, 300)
    view.setPalette(theme_palette(dark=True))
    dark = eye.picture_of(view).pixelColor(5, 300)
    assert light.lightness() > 200
    assert dark.lightness() < 90


@pytest.mark.parametrize("part", ["markers", "filled", "names", "trails", "bones", "joints", "axes", "floor"])
def test_every_part_can_be_switched_on_and_off(view, session, part, eye):
    session.show_frame(60)
    view.set_shown(eye.BARE)
    without = eye.picture_of(view)
    shown = replace(eye.BARE, **{part: True, "markers": part in ("markers", "names", "trails")})
    view.set_shown(shown)
    assert eye.changed(without, eye.picture_of(view)) > 60
    view.set_shown(eye.BARE)
    assert eye.changed(without, eye.picture_of(view)) == 0


def test_trails_are_drawn_behind_moving_markers(view, eye):
    without = eye.picture_of(view)
    view.set_shown(replace(eye.MARKERS, trails=True, trail_seconds=2.0))
    assert eye.changed(without, eye.picture_of(view)) > 300


def test_ellipsoids_cover_their_joints_and_grow_with_their_magnification(view, session, eye):
    project, covered = session.project, []
    std = np.full_like(project.motion.joint_std, 10.0)
    session.change(replace(project, _motion=replace(project.motion, joint_std=std)))
    for times in (2, 5):
        view.set_shown(replace(eye.BARE, magnification=times))
        without = eye.picture_of(view)
        view.set_shown(replace(eye.BARE, uncertainty=True, magnification=times))
        covered.append(eye.ink(without, eye.picture_of(view)))
    assert covered[0] > 14 * 50  # 14 joints
    assert covered[1] > 2.5 * covered[0]


def test_unseen_markers_are_hollow_and_doubtful_ones_have_a_ring(view, session, eye):
    marker = eye.lone_markers(view)[0]
    sure = eye.picture_of(view)
    place = view.place_of_marker(marker)
    project = session.project
    confidence = project.labelling.confidence.copy()
    confidence[20, marker] = 0.5
    session.change(replace(project, _labelling=replace(project.labelling, confidence=confidence)))
    doubt = doubt_colour(view.palette())
    assert eye.near(eye.picture_of(view), place, doubt) > 8
    assert eye.near(sure, place, doubt) == 0
    positions = project.trajectories.positions.copy()
    positions[20, marker] = np.nan
    session.change(replace(project, _trajectories=replace(project.trajectories, positions=positions)))
    view.set_shown(replace(eye.MARKERS, filled=True))
    hollow = eye.colour_at(eye.picture_of(view), view.place_of_marker(marker))
    assert hollow.saturation() < eye.colour_at(sure, place).saturation() / 2


def test_selecting_draws_a_ring_around_a_marker_and_around_those_of_a_limb(view, session, eye):
    before, marker = eye.picture_of(view), eye.lone_markers(view)[0]
    session.select(Selection(frozenset({marker})))
    assert eye.near(eye.picture_of(view), view.place_of_marker(marker), view.palette().highlight().color()) > 8
    limb = int(session.project.limbs.limb_of_marker[marker])
    session.select(Selection(limb=limb))
    for other in set(eye.lone_markers(view)) & set(session.project.limbs.markers_of(limb).tolist()):
        assert eye.changed(before, eye.picture_of(view), view.place_of_marker(other)) > 20


def test_the_names_of_few_selected_markers_stand_beside_them(view, session, eye):
    marker = eye.lone_markers(view)[0]
    beside = view.place_of_marker(marker) + QPointF(34, -9)
    before = eye.picture_of(view)
    session.select(Selection(frozenset({marker})))
    assert eye.changed(before, eye.picture_of(view), beside, radius=8) > 10
    session.select(Selection(frozenset(range(40))))
    assert eye.changed(before, eye.picture_of(view), beside, radius=8) == 0


def test_front_side_and_top_look_along_the_axes(view):
    for look, level in ((view.look_from_front, 0), (view.look_from_side, 0), (view.look_from_top, 1)):
        look()
        basis = view.viewpoint.basis
        assert np.sort(np.abs(basis[2])) == pytest.approx([0, 0, 1], abs=1e-9)
        assert abs(basis[2, view.up]) == pytest.approx(level, abs=1e-9)


def test_fit_shows_all_of_the_frame_or_what_is_selected(view, session, eye):
    view.fit()
    eye.picture_of(view)
    places = [view.place_of_marker(marker) for marker in range(session.project.trajectories.n_markers)]
    assert all(view.rect().contains(place.toPoint()) for place in places if place is not None)
    distance = view.viewpoint.distance
    for selection in (Selection(frozenset(eye.lone_markers(view)[:2])), Selection(limb=3)):
        session.select(selection)
        view.fit()
        assert view.viewpoint.distance < distance


def test_a_second_result_is_drawn_in_one_hue(view, session, eye):
    project = session.project
    shifted = replace(project.trajectories, positions=project.trajectories.positions + np.array([0, 0, 120.0]))
    view.set_shown(eye.MARKERS)
    before = eye.picture_of(view)
    session.compare_with(Project(shifted))
    after = eye.picture_of(view)
    assert eye.changed(before, after) > 200
    new = eye.pixels(after)[np.abs(eye.pixels(before) - eye.pixels(after)).max(axis=2) > 40]
    hues = [QColor(*colour).hue() for colour in new.tolist()]
    wanted = Colours(view.palette(), is_other=True).limb(0).hue()
    assert np.median([abs((hue - wanted + 180) % 360 - 180) for hue in hues]) < SAME_HUE
    view.set_shown(replace(eye.MARKERS, other=False))
    assert eye.changed(before, eye.picture_of(view)) == 0


def test_cameras_are_drawn_as_what_they_see(view, eye):
    view.set_shown(eye.BARE)
    before = eye.picture_of(view)
    pose = np.eye(4)
    pose[:3, 3] = view.viewpoint.target
    view.show_cameras([frustum(pose, (640, 480), (600.0, 600.0))])
    assert eye.changed(before, eye.picture_of(view)) > 300
    view.set_shown(replace(eye.BARE, cameras=False))
    assert eye.changed(before, eye.picture_of(view)) == 0


def test_cameras_say_which_axis_points_down_until_somebody_says_otherwise(view, eye):
    camera = frustum(np.eye(4), (640, 480), (600.0, 600.0))
    view.show_cameras([camera], DOWN + 1)
    assert view.up == DOWN + 1
    canvas = view._camera.canvas_at(0)
    places, _ = canvas.project(np.concatenate([camera.reshape(-1, 3), view._camera.scene.inliers]))
    assert (places > 0).all()
    assert (places < (canvas.width, canvas.height)).all()
    view.set_shown(replace(eye.BARE, up=2))
    assert view.up == 2
    view.set_shown(replace(eye.BARE, up=None))
    view.show_cameras([])
    assert view.up == 2


def test_the_viewer_stays_when_a_stage_has_run_and_looks_anew_at_another_take(view, session, walked):
    view.look_from_side()
    before = view.viewpoint
    session.change(Project(session.project.take))
    assert view.viewpoint == before
    positions = walked[0].take.positions + 5000.0
    session.open(Project(replace(walked[0].take, positions=positions)))
    assert view.viewpoint != before


def test_a_view_that_follows_keeps_what_moves_in_its_place(view, session, eye):
    def middle():
        joints = session.project.motion.joint_positions[session.frame]
        canvas = view._camera.canvas_at(session.frame)
        return canvas.project(joints.mean(axis=0)[np.newaxis])[0][0]

    stays = middle()
    session.show_frame(250)
    assert np.linalg.norm(middle() - stays) > 30
    session.show_frame(20)
    view.set_shown(replace(eye.MARKERS, follow=True))
    session.show_frame(250)
    assert np.abs(middle() - stays)[0] < 5  # it goes along on the level; height is seen


@pytest.mark.parametrize(
    "change",
    [
        lambda view, session: session.show_frame(session.frame + 1),
        lambda view, session: session.select(Selection(joint=3)),
        lambda view, session: session.compare_with(session.project),
        lambda view, session: session.change(session.project),
        lambda view, session: view.set_shown(Shown(names=True)),
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


def test_the_up_axis_can_be_stated(view, eye):
    view.set_shown(replace(eye.MARKERS, up=1))
    assert view.up == 1
    assert view.viewpoint.basis[1] @ [0, 1, 0] > 0.9
    view.set_shown(replace(eye.MARKERS, up=None))
    assert view.up == 2
