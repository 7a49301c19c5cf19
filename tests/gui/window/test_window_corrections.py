"""Every correction by hand as a person makes it: select, choose from the menu, answer; what is computed obeys; undo."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QApplication, QInputDialog, QMessageBox
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.corrections import FramesDialog

import skelgen
from skelgen.app.project_file.archive import find_result, open_project
from skelgen.model.corrections import Correction
from skelgen.model.project import STAGES
from skelgen.simulation import simulate

FRAME = 60
LAST = 119
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}


@pytest.fixture
def computed(window, person, tmp_path):
    """A window in which all stages of three rods have run, frame 60 shown; its project."""
    path = tmp_path / "rods.c3d"
    skelgen.write(simulate("rods", n_frames=LAST + 1, noise=0.2).take, path)
    person.opens(path)
    person.runs_all()
    window.session.show_frame(FRAME)
    return window.session.project


@pytest.fixture
def answers(monkeypatch):
    """Answer questions for frames and names: `answers(first, last, name)`; other ones end with the test."""
    timer = QTimer()
    timer.setSingleShot(True)
    timer.setInterval(200)

    def say(first=None, last=None, name=""):
        monkeypatch.setattr(QInputDialog, "getText", lambda *args, **kwargs: (name, True))

        def choose():
            dialog = QApplication.activeModalWidget()
            if isinstance(dialog, FramesDialog):
                dialog.first.setValue(dialog.first.value() if first is None else first)
                dialog.last.setValue(dialog.last.value() if last is None else last)
                dialog.accept()

        timer.timeout.connect(choose)
        timer.start()

    yield say
    timer.stop()


@pytest.fixture
def chooses(window, person):
    """Select something, and choose an entry of the menu of corrections, perhaps of a menu in it."""

    def choose(selection, text, inner=None):
        window.session.select(selection)
        menu = window.commands.correct_menu
        window.corrections.fill(menu)
        (action,) = (one for one in menu.actions() if one.text().startswith(text))
        if inner is not None:
            (action,) = (one for one in action.menu().actions() if one.text() == inner)
        action.trigger()
        person.waits(lambda: window.session.project.has("skeleton"))
        return window.session.project

    return choose


def markers(*indices):
    return Selection(frozenset(indices))


def undone(window, person, computed):
    person.does("undo")
    assert window.session.project is computed
    person.does("redo")
    assert len(window.session.project.corrections) == 1
    return True


def test_two_markers_change_places_from_here_to_there(window, person, computed, chooses, answers):
    answers(last=80)
    project = chooses(markers(0, 1), "Exchange")
    (correction,) = project.corrections
    assert (correction.kind, correction.first_frame, correction.last_frame) == ("swap", FRAME, 80)
    before, after = computed.trajectories.positions, project.trajectories.positions
    np.testing.assert_array_equal(after[FRAME:81, [0, 1]], before[FRAME:81, [1, 0]])
    np.testing.assert_array_equal(after[:FRAME], before[:FRAME])
    np.testing.assert_array_equal(after[81:], before[81:])
    assert undone(window, person, computed)


def test_a_marker_is_split_and_the_part_has_its_name(window, person, computed, chooses, answers):
    answers(name="other")
    project = chooses(markers(2), "Split")
    names = project.trajectories.names
    assert "other" in names
    seen = project.trajectories.seen[:, names.index("other")]
    assert seen[FRAME:].all()
    assert not seen[:FRAME].any()
    assert undone(window, person, computed)


def test_markers_are_merged(window, person, computed, chooses, answers):
    answers(name="other")
    chooses(markers(2), "Split")
    names = window.session.project.trajectories.names
    old = computed.trajectories.names[2]
    project = chooses(markers(names.index(old), names.index("other")), "Merge")
    assert project.trajectories.n_markers == computed.trajectories.n_markers
    assert project.trajectories.seen.all()


def test_markers_that_are_seen_together_are_merged_only_after_a_warning(window, person, computed, monkeypatch):
    asked = []

    def refuse(parent, title, text, *rest):
        asked.append(text)
        return QMessageBox.StandardButton.No

    monkeypatch.setattr(QMessageBox, "question", refuse)
    trigger(window, markers(0, 1), "Merge")
    person.waits()
    assert "in 120 frames" in asked[0]
    assert window.session.project is computed
    person.answers(QMessageBox.StandardButton.Yes)
    trigger(window, markers(0, 1), "Merge")
    person.waits(lambda: window.session.project.has("skeleton") and window.session.project is not computed)
    assert window.session.project.trajectories.n_markers == computed.trajectories.n_markers - 1


def test_what_contradicts_is_refused_with_the_name_of_the_other(window, person, computed):
    first, mate = computed.limbs.markers_of(0)[:2].tolist()
    window.runner.computes_at_once = False
    trigger(window, markers(first, mate), "On one limb")
    person.waits(lambda: len(window.session.project.corrections) == 1)
    window.corrections.apply(Correction("apart", tuple(computed.trajectories.names[each] for each in (mate, first))))
    assert "share a limb'; take that one back first" in person.is_told()
    assert len(window.session.project.corrections) == 1


def test_undo_says_what_it_takes_back(window, person, computed, chooses):
    chooses(Selection(limb=int(np.flatnonzero(computed.topology.parents >= 0)[0])), "Root")
    assert window.actions_by_id["undo"].text().startswith("&Undo: the limb of")
    person.does("undo")
    assert window.actions_by_id["undo"].text() == "&Undo"
    assert window.actions_by_id["redo"].text().startswith("&Redo: the limb of")


def test_a_marker_is_renamed(window, person, computed, chooses, answers):
    answers(name="ankle & <toe>")
    project = chooses(markers(0), "Rename")
    assert project.trajectories.names[0] == "ankle & <toe>"
    assert undone(window, person, computed)


def test_a_marker_is_deleted_in_some_frames(window, person, computed, chooses, answers):
    answers(first=10, last=20)
    project = chooses(markers(0), "Delete")
    column = project.trajectories.names.index(computed.trajectories.names[0])
    assert np.flatnonzero(~project.trajectories.seen[:, column]).tolist() == list(range(10, 21))
    assert undone(window, person, computed)


def test_markers_are_said_to_be_on_one_limb_or_on_different_ones(window, person, computed, chooses):
    limbs = computed.limbs.limb_of_marker
    first, mate = computed.limbs.markers_of(0)[:2].tolist()
    stranger = int(computed.limbs.markers_of(1)[0])
    apart = chooses(markers(first, mate), "On different limbs").limbs.limb_of_marker
    assert apart[first] != apart[mate]
    person.does("undo")
    together = chooses(markers(first, stranger), "On one limb").limbs.limb_of_marker
    assert together[first] == together[stranger]
    assert limbs[first] != limbs[stranger]


def pairs(project):
    """Pairs of limbs that are joined, each as the names of its markers."""
    names = np.array(project.trajectories.names)
    limbs = [frozenset(names[project.limbs.markers_of(limb)]) for limb in range(project.limbs.n_limbs)]
    return {frozenset((limbs[parent], limbs[child])) for parent, child in project.topology.edges.tolist()}


def test_a_joint_is_forbidden_and_another_one_forced(window, person, computed, chooses):
    joined = pairs(computed)
    parted = chooses(Selection(joint=0), "No joint")
    assert len(pairs(parted) & joined) == len(joined) - 1
    person.does("undo")
    limbs = computed.limbs
    (apart,) = (
        (first, second)
        for first in range(3)
        for second in range(first)
        if not {(first, second), (second, first)} & {tuple(edge) for edge in computed.topology.edges.tolist()}
    )
    forced = chooses(markers(*(int(limbs.markers_of(limb)[0]) for limb in apart)), "Joint between")
    assert pairs(forced) - joined


def test_a_joint_is_said_to_be_of_a_type(window, person, computed, chooses):
    wanted = "hinge" if computed.skeleton.joints[0].kind != "hinge" else "ball"
    project = chooses(Selection(joint=0), "Type", wanted)
    assert project.skeleton.joints[0].kind == wanted
    assert undone(window, person, computed)


def test_a_limb_is_made_the_root(window, person, computed, chooses):
    limb = int(np.flatnonzero(computed.topology.parents >= 0)[0])
    project = chooses(Selection(limb=limb), "Root")
    assert project.topology.parents[limb] == -1
    assert undone(window, person, computed)


def test_a_correction_is_listed_and_taken_back_there(window, person, computed, chooses):
    chooses(Selection(limb=int(np.flatnonzero(computed.topology.parents >= 0)[0])), "Root")
    listed = window.findChild(type(window.pages.parent()), "corrections").widget()
    assert "is the root" in listed.entries.item(0).text()
    listed.entries.setCurrentRow(0)
    listed.take_back.click()
    person.waits(lambda: window.session.project.has("skeleton"))
    assert listed.entries.count() == 0
    np.testing.assert_array_equal(window.session.project.topology.parents, computed.topology.parents)


def trigger(window, selection, text):
    """Select, and choose from the menu, without waiting for anything."""
    window.session.select(selection)
    menu = window.commands.correct_menu
    window.corrections.fill(menu)
    next(one for one in menu.actions() if one.text().startswith(text)).trigger()


def test_corrections_in_a_row_do_not_wait_and_all_of_them_are_obeyed(qtbot, window, person, computed):
    limb = int(np.flatnonzero(computed.topology.parents >= 0)[0])
    first, mate = computed.limbs.markers_of(int(computed.topology.roots[0]))[:2].tolist()
    trigger(window, Selection(limb=limb), "Root")
    qtbot.waitUntil(lambda: window.jobs.is_busy)
    trigger(window, markers(first, mate), "On different limbs")
    person.waits(lambda: window.session.project.has("skeleton"))
    project = window.session.project
    assert [one.kind for one in project.corrections] == ["root", "apart"]
    limbs = project.limbs.limb_of_marker
    assert limbs[first] != limbs[mate]
    person.does("undo")
    person.waits(lambda: window.session.project.has("skeleton"))
    assert [one.kind for one in window.session.project.corrections] == ["root"]
    person.does("undo")
    assert window.session.project is computed


def test_a_correction_leaves_page_selection_and_timeline_where_they_are(window, person, computed, chooses):
    window.pages.page("export")
    window.timeline.span.show(20.0, 80.0)
    limb = int(np.flatnonzero(computed.topology.parents >= 0)[0])
    names = {computed.trajectories.names[marker] for marker in computed.limbs.markers_of(limb)}
    project = chooses(Selection(limb=limb), "Root")
    assert window.pages.current.key == "export"
    selected = project.limbs.markers_of(window.session.selection.limb)
    assert {project.trajectories.names[marker] for marker in selected} == names
    assert (window.session.frame, window.timeline.span.first, window.timeline.span.end) == (FRAME, 20.0, 80.0)


def test_steps_that_a_correction_made_stale_are_told_from_open_ones(window, person, computed):
    window.runner.computes_at_once = False
    trigger(window, Selection(limb=int(np.flatnonzero(computed.topology.parents >= 0)[0])), "Root")
    person.waits(lambda: not window.session.project.has("joints"))
    keys = [entry.key for entry in window.pages.entries]
    said = [window.pages.list.item(keys.index(stage)).data(Qt.ItemDataRole.AccessibleTextRole) for stage in STAGES]
    assert ["done" in words for words in said[:2]] == [True, True]
    assert ["run again" in words for words in said[2:]] == [True, True]


def test_later_runs_and_the_command_line_obey_what_is_saved(window, person, computed, chooses, tmp_path):
    limb = int(np.flatnonzero(computed.topology.parents >= 0)[0])
    chooses(Selection(limb=limb), "Root")
    person.saves_as(tmp_path / "rods.skelgen")
    command = ["run", str(tmp_path / "rods.skelgen"), "--from", "labels", "--output", str(tmp_path / "out")]
    subprocess.run([sys.executable, "-m", "skelgen", *command], env=ENVIRONMENT, capture_output=True, check=True)
    assert open_project(find_result(tmp_path / "out")).topology.parents[limb] == -1
