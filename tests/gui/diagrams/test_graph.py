"""The graph tells why the tree is as it is: costs, margins, rivals, kinds, ways round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from skelgen_gui.diagrams.graph_painting import NODE
from skelgen_gui.diagrams.graph_view import GraphView
from skelgen_gui.model.graph import (
    body_places,
    joint_sentences,
    margin_label,
    nearest_line,
    nearest_point,
    pair_sentences,
    place_words,
    tree_places,
)
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.painting import colour_of_limb, doubt_colour, theme_palette

from skelgen.app.drawing.graph import find_cost_graph
from skelgen.kinematics.hierarchy import tree_path
from skelgen.model import Project, Topology


@pytest.fixture
def view(session, shown):
    return shown(GraphView(session), 760, 660)


@pytest.fixture
def topology(walked):
    return walked[0].topology


@pytest.fixture
def ring():
    """Four limbs in a chain 0 - 1 - 2 - 3, whose ends could nearly as well be joined; limb 3 hangs doubtfully."""
    costs = np.array([[0, 1, 9, 3.2], [1, 0, 2, 9], [9, 2, 0, 3], [3.2, 9, 3, 0]], dtype=float)
    return Topology(np.array([-1, 0, 1, 2]), costs, np.zeros((2, 3, 3)), np.zeros(3, dtype=int), np.ones(3), 0.0)


@pytest.fixture
def ringed(ring):
    """A project of twelve markers with that tree."""
    from skelgen.model import Limbs, StageReport, Trajectories

    positions = np.random.default_rng(0).normal(size=(2, 12, 3))
    take = Trajectories(positions, tuple("abcdefghijkl"), 100.0)
    limbs = Limbs(np.repeat(np.arange(4), 3), np.ones((12, 12)))
    project = Project(take).with_trajectories(take, StageReport()).with_limbs(limbs, StageReport())
    return project.with_topology(ring, StageReport())


def middle(view, pair):
    first, second = view.places[list(pair)]
    return QPoint(*np.round((first + second) / 2).astype(int).tolist())


def test_a_click_on_a_disc_selects_the_limb(view, session, qtbot):
    for limb in (0, 7):
        place = QPoint(*np.round(view.places[limb]).astype(int).tolist())
        qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=place)
        assert session.selection == Selection(limb=limb)


def test_a_click_on_a_line_of_the_tree_selects_the_joint(view, session, qtbot, topology):
    view.layout_box.setCurrentIndex(1)
    for joint, edge in enumerate(topology.edges.tolist()):
        qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=middle(view, edge))
        assert session.selection == Selection(joint=joint)


def test_hover_over_a_joint_tells_cost_margin_rival_kind_and_range(view, topology, walked):
    view.layout_box.setCurrentIndex(1)
    joint = next(index for index, one in enumerate(walked[0].skeleton.joints) if one.kind == "hinge")
    told = view.tip_at(middle(view, topology.edges[joint]).toPointF())
    first, second = topology.rivals[joint]
    assert ": hinge" in told
    called = walked[0].limbs.called
    assert f"best other joint: {called(first)} – {called(second)}" in told
    assert "turn: " in told
    assert "mm²" in told


def test_a_doubtful_joint_is_told_with_its_probability_and_the_best_other(ringed, ring):
    known = replace(ring, edge_probability=[0.9, 0.7, 0.6], rival_probability=[0.1, 0.2, 0.3])
    joints = find_cost_graph(replace(ringed, _topology=known)).joints
    assert [joint.is_doubtful for joint in joints] == [False, True, True]
    assert joints[2].rival == (0, 3)
    assert joints[2].ratio == pytest.approx(3.2 / 3)
    assert margin_label(joints[2]) == "60 %"
    assert "probability 60 %, of the other 30 %" in joint_sentences(joints[2])


def test_without_probabilities_the_margin_is_told(ringed):
    joints = find_cost_graph(ringed).joints
    assert not any(joint.is_doubtful for joint in joints)
    assert margin_label(joints[2]) == "1.1×"


def test_a_pair_that_is_not_joined_says_which_way_the_tree_takes(ringed):
    told = pair_sentences(find_cost_graph(ringed), 0, 3)
    assert "cost 3.20 mm²" in told
    assert "by way of 1 and 2, at no joint for more than 3.00 mm²" in told


def test_a_kinematic_loop_is_told(ringed, ring):
    looped = replace(ringed, _topology=replace(ring, loops=((0, 3),)))
    assert "closes a kinematic loop" in pair_sentences(find_cost_graph(looped), 3, 0)


def test_separate_bodies_are_told():
    assert tree_path(np.array([-1, 0, -1]), 1, 2) == []
    assert tree_path(np.array([-1, 0, 0, 1]), 3, 2) == [3, 1, 0, 2]


def test_other_pairs_are_sorted_by_cost_with_the_cheapest_strongest(walked, topology):
    facts = find_cost_graph(walked[0])
    costs = topology.joint_costs[facts.pairs[:, 0], facts.pairs[:, 1]]
    assert (np.diff(costs) >= 0).all()
    assert (facts.strengths[0], facts.strengths[-1]) == (1.0, 0.0)
    assert (
        len(facts.pairs) + topology.n_joints
        == np.isfinite(np.triu(topology.joint_costs, 1))[np.triu_indices(15, 1)].sum()
    )


def test_ranges_of_motion_are_told_in_degrees(walked):
    project = walked[0]
    hinge = next(index for index, one in enumerate(project.skeleton.joints) if one.kind == "hinge")
    fact = find_cost_graph(project).joints[hinge]
    low, high = np.degrees([fact.ranges[0].low, fact.ranges[0].high]).round()
    assert f"turn: {low:.0f}° … {high:.0f}°".replace("-", "\N{MINUS SIGN}") in joint_sentences(fact)
    assert high - low > 20


def test_limbs_are_apart_and_in_the_box_in_both_layouts(walked, topology):
    for places in (body_places(walked[0]), tree_places(topology.parents)):
        gaps = np.linalg.norm(places[:, np.newaxis] - places, axis=2) + np.eye(len(places))
        assert gaps.min() > 0.05
        assert places.min() >= 0.0
        assert places.max() <= 1.0


def test_in_the_take_the_head_is_above_the_feet(walked):
    project = walked[0]
    places = body_places(project)
    names = project.trajectories.names
    heights = {
        name.rsplit(" ", 1)[0]: places[project.limbs.limb_of_marker[index], 1] for index, name in enumerate(names)
    }
    assert heights["head"] < heights["pelvis"] < heights["left foot"]


def test_limbs_without_any_marker_in_sight_have_places(ringed):
    blind = replace(ringed.trajectories, positions=np.full((2, 12, 3), np.nan))
    assert np.isfinite(body_places(replace(ringed, _trajectories=blind))).all()


@pytest.mark.parametrize("is_dark", [False, True])
def test_every_limb_has_its_colour(view, walked, has_colour, is_dark):
    view.setPalette(theme_palette(dark=is_dark))
    for limb in range(walked[0].limbs.n_limbs):
        assert has_colour(view, colour_of_limb(limb, view.palette()), 100)


def test_a_doubtful_joint_stands_out(shown, ringed, has_colour):
    session = Session()
    known = replace(ringed.topology, edge_probability=[0.9, 0.7, 0.6], rival_probability=[0.1, 0.2, 0.3])
    session.open(replace(ringed, _topology=known))
    view = shown(GraphView(session))
    assert has_colour(view, doubt_colour(view.palette()), 20)


def test_a_joint_can_be_selected_before_there_is_a_skeleton(shown, ringed):
    session = Session()
    session.open(ringed)
    view = shown(GraphView(session))
    session.select(Selection(joint=2))
    view.grab()
    assert session.selection.joint == 2


def test_arrows_go_from_limb_to_limb_and_j_to_the_joint_above(view, session, qtbot, topology):
    view.layout_box.setCurrentIndex(1)
    qtbot.keyClick(view, Qt.Key.Key_Down)
    root = int(topology.roots[0])
    assert session.selection.limb == root
    qtbot.keyClick(view, Qt.Key.Key_Down)
    child = session.selection.limb
    assert topology.parents[child] == root
    qtbot.keyClick(view, Qt.Key.Key_J)
    assert topology.children[session.selection.joint] == child
    qtbot.keyClick(view, Qt.Key.Key_Escape)
    assert session.selection == Selection()


def test_dragging_pans_and_a_double_click_shows_all(view, qtbot):
    before = view.places
    qtbot.mousePress(view, Qt.MouseButton.LeftButton, pos=QPoint(5, 640))
    qtbot.mouseMove(view, QPoint(45, 610))
    qtbot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=QPoint(45, 610))
    assert np.allclose(view.places - before, [40, -30])
    qtbot.mouseDClick(view, Qt.MouseButton.LeftButton, pos=QPoint(5, 640))
    assert np.allclose(view.places, before)


def test_nothing_is_near_where_there_is_nothing():
    assert nearest_point(np.zeros((0, 2)), np.zeros(2), 5) is None
    assert nearest_line(np.zeros((0, 2, 2)), np.zeros(2), 5) is None
    assert nearest_line(np.array([[[0.0, 0.0], [10.0, 0.0]]]), np.array([14.0, 3.0]), 4.9) is None
    assert nearest_line(np.array([[[0.0, 0.0], [10.0, 0.0]]]), np.array([14.0, 3.0]), 5.1) == 0


def test_before_the_joints_it_can_be_painted_and_clicked(shown, qtbot, small_project):
    session = Session()
    session.open(Project(small_project.take))
    view = shown(GraphView(session))
    view.grab()
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(100, 100))
    for key in (Qt.Key.Key_Down, Qt.Key.Key_J):
        qtbot.keyClick(view, key)
    assert session.selection == Selection()


def test_words_beside_joints_cover_no_disc_and_not_each_other():
    middles = np.array([[50.0, 50.0], [50.0, 80.0], [50.0, 110.0]])
    discs = np.array([[75.0, 50.0], [50.0, 20.0]])
    size = np.array([30.0, 14.0])
    up = np.array([0.0, 15.0])
    lines = np.stack([middles - up, middles + up], axis=1)
    placed = place_words(middles, np.tile(size, (3, 1)), discs, NODE, lines)
    for words in placed:
        assert (np.abs(discs - words) >= size / 2 + NODE).any(axis=1).all()
        others = placed[(placed != words).any(axis=1)]
        assert (np.abs(others - words) >= size).any(axis=1).all()


def test_a_joint_without_words_needs_no_place():
    middles = np.array([[5.0, 5.0]])
    placed = place_words(middles, np.zeros((1, 2)), np.zeros((0, 2)), NODE, np.zeros((0, 2, 2)))
    np.testing.assert_array_equal(placed, middles)


def test_limbs_are_called_by_their_names_where_there_is_room(view, session, shown):
    named, limbs = view.grab().toImage(), session.project.limbs
    assert view.tip_at(QPointF(*view.places[0].tolist())).startswith(limbs.called(0))
    numbers = tuple(f"limb{limb}" for limb in range(limbs.n_limbs))
    session.change(replace(session.project, _limbs=replace(limbs, names=numbers)))
    assert shown(view, 760, 660).grab().toImage() != named
