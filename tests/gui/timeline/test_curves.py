"""Curves keep every peak, show what is selected, and say values of the frame that is shown."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from skelgen_gui.model.curves import Curve, Panel, joint_curve
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.plot_view import Curves
from skelgen_gui.widgets.painting import colour_of_limb, component_colour

from skelgen.app.drawing.scales import Extremes
from skelgen.model import Project

EXACT = 1e-9  # degrees: only rounding


@pytest.fixture
def curves(session, shown):
    return shown(Curves(session))


@pytest.mark.parametrize("first, end", [(0, 100_000), (0, 2000), (137.5, 9000.25), (40_000, 40_050)])
def test_extremes_of_columns_are_those_of_their_frames(first, end):
    values = np.random.default_rng(1).normal(size=100_000)
    low, high = Extremes.of(values).columns(first, end, 500)
    inside = values[int(first) : int(np.ceil(end))]
    if end - first > 500:
        assert low.min() == pytest.approx(inside.min())
        assert high.max() == pytest.approx(inside.max())
    assert (low <= high).all()
    assert low.min() >= inside.min()


def test_a_peak_of_one_frame_in_two_hours_is_drawn():
    values = np.zeros(720_000)
    values[654_321] = 7.0
    high = Extremes.of(values).columns(0, 720_000, 800)[1]
    assert high.max() == 7.0
    assert abs(int(high.argmax()) - 654_321 * 800 / 720_000) <= 1


def test_what_is_unknown_is_neither_drawn_nor_bridged():
    values = np.array([1.0, 1.0, np.nan, 1.0, 1.0])
    low, _ = Extremes.of(values).columns(0, 5, 50)
    assert np.isnan(low[20:30]).all()
    assert (low[:10] == 1.0).all()


def test_scales_hold_curves_bands_and_zero():
    line = np.array([2.0, 4.0])
    curve = Curve("a", Extremes.of(line), Extremes.of(line - 1, line + 1))
    for from_zero, wanted in ((True, (0.0, 5.0)), (False, (1.0, 5.0))):
        panel = Panel("", "", (curve,), from_zero=from_zero)
        assert panel.scale(panel.columns(0, 2, 2)) == wanted


def test_a_panel_without_values_has_a_scale():
    panel = Panel("", "", (Curve("a", Extremes.of(np.full(5, np.nan))),))
    assert panel.scale(panel.columns(0, 5, 50)) == (0.0, 1.0)


def test_angles_are_those_of_the_motion_up_to_full_turns(walked):
    from skelgen.kinematics.joints.angles import joint_angles

    project = walked[0]
    for joint, one in enumerate(project.skeleton.joints):
        found = joint_curve(project, joint)
        world = project.motion.rotations
        frame = 100
        relative = world[[frame], one.parent].swapaxes(1, 2) @ world[[frame], one.child]
        difference = np.degrees(found.angles[frame] - joint_angles(one, relative)[0])
        assert np.abs((difference + 180) % 360 - 180).max(initial=0.0) < EXACT
        assert found.std.shape == found.angles.shape
        assert len(found.names) == found.angles.shape[1]


def test_selected_markers_are_added_to_the_mean(curves, session, qtbot, walked):
    assert [curve.name for curve in curves.panels[0].curves] == ["mean"]
    session.select(Selection(frozenset({2, 7})))
    qtbot.waitUntil(lambda: not curves.deriver.is_busy)
    names = walked[0].trajectories.names
    assert [curve.name for curve in curves.panels[0].curves] == ["mean", names[2], names[7]]


def test_the_mean_residual_is_that_of_the_motion(curves, walked):
    wanted = np.nanmean(walked[0].motion.residuals, axis=1)
    assert np.allclose(curves.panels[0].curves[0].line.low, wanted)


def test_a_selected_joint_shows_its_angles_with_bands_and_its_deviation(curves, session, qtbot, walked):
    joints = walked[0].skeleton.joints
    ball = next(index for index, joint in enumerate(joints) if joint.kind == "ball")
    session.select(Selection(joint=ball))
    qtbot.waitUntil(lambda: len(curves.panels) == 3)
    angles = curves.panels[1]
    assert [curve.name for curve in angles.curves] == ["x", "y", "z"]
    assert angles.unit == "°"
    assert all((curve.band.high > curve.line.high).all() for curve in angles.curves)


def test_a_selected_limb_shows_the_joint_above_it(curves, session, qtbot, walked):
    joint = walked[0].skeleton.joints[2]
    session.select(Selection(limb=joint.child))
    qtbot.waitUntil(lambda: len(curves.panels) == 3)
    assert curves.panels[1].title == session.project.skeleton.joint_name(joint).capitalize()


def test_curves_have_their_colours(curves, session, qtbot, has_colour, walked):
    session.select(Selection(frozenset({0}), joint=0))
    qtbot.waitUntil(lambda: len(curves.panels) == 3)
    limb = int(walked[0].limbs.limb_of_marker[0])
    assert has_colour(curves, colour_of_limb(limb, curves.palette()), 20)
    assert has_colour(curves, component_colour(1, curves.palette()), 20)


def test_a_click_goes_to_the_frame_and_the_hover_says_its_values(curves, session, qtbot):
    place = curves.panel_rect(0).center()
    qtbot.mouseClick(curves, Qt.MouseButton.LeftButton, pos=place.toPoint())
    assert abs(session.frame - 200) <= 1
    told = curves.tip_at(QPointF(place))
    assert told.startswith("Residual, frame ")
    assert "mean: " in told


def test_before_the_skeleton_it_says_what_to_do(shown, small_project):
    session = Session()
    session.open(Project(small_project.take))
    curves = shown(Curves(session))
    assert curves.panels == ()
    assert curves.hint == "Run the step Skeleton to see residuals and angles of joints"


def test_a_result_that_was_overtaken_is_not_shown(curves, session, qtbot):
    session.select(Selection(joint=0))
    session.select(Selection(joint=3))
    joint = session.project.skeleton.joints[3]
    qtbot.waitUntil(lambda: not curves.deriver.is_busy)
    assert curves.panels[1].title == session.project.skeleton.joint_name(joint).capitalize()
