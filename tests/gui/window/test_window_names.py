"""Names of limbs and markers are given in the panel and from the views, searched, and what they name is hidden."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit
from skelgen_gui.model.picture import place_names
from skelgen_gui.model.selection import Selection

from skelgen.app.project_file.archive import open_project

Key = Qt.Key


@pytest.fixture
def named(active, window, person, walked):
    """A person open in the window, the keys going to it, the panel of names in front."""
    window.document.open(walked[0])
    window.findChild(type(window.outline.parent()), "outline").raise_()
    person.waits()
    return window


def items(window, kind):
    return {item.text(0): item for item in window.outline._items() if item.data(0, Qt.ItemDataRole.UserRole) == kind}


def types_name(qtbot, window, name):
    """Press F2 in the 3-D view, and type a name."""
    qtbot.keyClick(window.view3d, Key.Key_F2)
    qtbot.waitUntil(lambda: isinstance(QApplication.focusWidget(), QLineEdit))
    editor = QApplication.focusWidget()
    editor.selectAll()
    qtbot.keyClicks(editor, name)
    qtbot.keyClick(editor, Key.Key_Return)


def test_f2_names_the_limb_that_is_selected_in_a_view_and_the_name_is_saved(qtbot, named, person, tmp_path):
    named.session.select(Selection(limb=3))
    types_name(qtbot, named, "my limb")
    person.waits(lambda: named.session.project.limbs.names[3] == "my limb")
    assert "my limb" in items(named, "limb")
    assert named.session.selection.limb == 3
    person.saves_as(tmp_path / "named.skelgen")
    assert open_project(tmp_path / "named.skelgen").limbs.names[3] == "my limb"
    person.does("undo")
    assert "my limb" not in items(named, "limb")


def test_f2_names_the_joint_that_is_selected_in_a_view_and_undo_takes_it_back(qtbot, named, person, tmp_path):
    joint = next(index for index, one in enumerate(named.session.project.skeleton.joint_names) if one == "left elbow")
    assert "left elbow" in items(named, "joint")
    named.session.select(Selection(joint=joint))
    types_name(qtbot, named, "hinge of the arm")
    person.waits(lambda: named.session.project.skeleton.joint_names[joint] == "hinge of the arm")
    assert "hinge of the arm" in items(named, "joint")
    person.saves_as(tmp_path / "named.skelgen")
    assert open_project(tmp_path / "named.skelgen").skeleton.joint_names[joint] == "hinge of the arm"
    person.does("undo")
    assert "left elbow" in items(named, "joint")


def test_f2_renames_the_marker_that_is_selected(qtbot, named, person):
    named.session.select(Selection(frozenset({2})))
    types_name(qtbot, named, "my marker")
    person.waits(lambda: named.session.project.trajectories.names[2] == "my marker")
    assert named.session.selection.markers == {2}


def test_a_line_that_is_chosen_is_selected_in_all_views(qtbot, named):
    (name, item), *_ = items(named, "marker").items()
    named.outline.tree.setCurrentItem(item)
    assert named.session.selection.markers == {named.session.project.trajectories.names.index(name)}
    joint = next(iter(items(named, "joint").values()))
    named.outline.tree.setCurrentItem(joint)
    assert named.session.selection.joint is not None


def test_search_shows_what_has_the_text(qtbot, named):
    qtbot.keyClicks(named.outline.search, "head 1")
    shown = [name for name, item in items(named, "marker").items() if not item.isHidden()]
    assert shown == ["head 1"]


def test_a_box_hides_and_keys_isolate_and_show_all(qtbot, named):
    project = named.session.project
    limb = items(named, "limb")[project.limbs.names[0]]
    limb.setCheckState(0, Qt.CheckState.Unchecked)
    markers = project.limbs.markers_of(0).tolist()
    named.view3d.grab()
    assert all(named.view3d.place_of_marker(marker) is None for marker in markers)
    named.session.select(Selection(limb=1))
    qtbot.keyClick(named.view3d, Key.Key_H, Qt.KeyboardModifier.ShiftModifier)
    named.view3d.grab()
    seen = {marker for marker in range(project.trajectories.n_markers) if named.view3d.place_of_marker(marker)}
    assert seen <= set(project.limbs.markers_of(1).tolist())
    qtbot.keyClick(named.view3d, Key.Key_H, Qt.KeyboardModifier.ControlModifier)
    assert named.view3d.shown.hidden == ()
    assert all(item.checkState(0) == Qt.CheckState.Checked for item in items(named, "limb").values())


def test_ellipsoids_are_those_of_the_selected_joint_until_all_are_wanted(named):
    def ellipsoids():
        named.view3d.grab()
        return np.flatnonzero(~np.isnan(named.view3d._painted[1].ellipses[:, 0, 0, 0])).tolist()

    assert ellipsoids() == []
    named.session.select(Selection(joint=2))
    assert ellipsoids() == [2]
    named.view3d.commands.switches["uncertainty"].trigger()
    assert len(ellipsoids()) > 2


def test_names_in_the_view_do_not_cover_each_other():
    rng = np.random.default_rng(0)
    markers, sizes = rng.uniform(0, 200, (40, 2)), np.tile([40.0, 14.0], (40, 1))
    corners = place_names(markers, sizes)
    placed = corners[~np.isnan(corners[:, 0])]
    assert 8 < len(placed) < 40
    apart = (np.abs(placed[:, np.newaxis] - placed) >= [40.0, 14.0]).any(axis=2)
    assert apart[~np.eye(len(placed), dtype=bool)].all()


def test_names_need_no_scrolling_sideways_in_a_narrow_panel(qtbot, named, person):
    names = ["the limb with a name as long as this", *named.session.project.limbs.names[1:]]
    named.document.change("names", named.session.project.with_limb_names(names))
    named.resize(1024, 700)
    person.waits()
    tree = named.outline.tree
    assert tree.horizontalScrollBar().maximum() == 0
    assert tree.visualItemRect(items(named, "limb")[names[0]]).right() >= tree.columnViewportPosition(2)
