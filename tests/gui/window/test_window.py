"""The window as a person uses it: open, run, correct, undo, save, reopen, export, close."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QFileDialog, QMessageBox, QRadioButton
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.wording import limb_words

import skelgen
from skelgen.simulation import simulate

WAIT = 60_000  # ms; a loaded machine runs all stages of a small take in a few seconds
MOST_OF_WIDTH = 0.4  # 350 px, which the steps need at least, of the smallest window
ARM = Path(__file__).parents[4] / "shared" / "data" / "arm" / "arm-4-4-4_clean_30fps.c3d"


@pytest.mark.skipif(not ARM.exists(), reason="the recordings are not beside the project")
def test_a_recording_is_opened_run_corrected_undone_saved_reopened_exported(qtbot, window, person, tmp_path):
    person.opens(ARM)
    person.runs_all()
    project = window.session.project
    assert project.limbs.n_limbs == 3
    moved, target = (int(project.limbs.markers_of(limb)[0]) for limb in (0, 1))
    names = project.trajectories.names
    window.session.select(Selection(frozenset({moved})))
    window.corrections.fill(window.commands.correct_menu)
    submenu = next(action.menu() for action in window.commands.correct_menu.actions() if action.menu())
    next(action for action in submenu.actions() if action.text() == limb_words(project, 1)).trigger()
    person.waits(lambda: window.session.project.has("skeleton"))
    limbs = window.session.project.limbs.limb_of_marker
    assert limbs[moved] == limbs[target]
    person.does("undo")
    assert window.session.project is project
    person.does("redo")
    path = tmp_path / "arm.skelgen"
    person.saves_as(path)
    person.opens(path)
    assert len(window.session.project.corrections) == 1
    np.testing.assert_array_equal(window.session.project.limbs.limb_of_marker, limbs)
    page = window.pages.page("export")
    page.target.suggest(tmp_path / "out", "arm")
    qtbot.mouseClick(page.export, Qt.MouseButton.LeftButton)
    person.waits()
    assert skelgen.read(tmp_path / "out" / "arm.c3d").n_markers >= len(names)


def test_an_unlabelled_take_is_labelled_and_every_page_tells_what_came_out(window, person, tmp_path):
    path = tmp_path / "cloud.mfml"
    skelgen.write(simulate("rods", n_frames=200, noise=0.2, labelled=False).take, path)
    person.opens(path)
    person.runs_all()
    for stage in ("labels", "limbs", "joints", "skeleton"):
        page = window.pages.page(stage)
        person.waits()
        assert page.result.text() != ""
        assert "has not run" not in page.result.text()


def test_steps_leave_most_of_a_new_windows_width_to_the_views(window):
    assert window.pages.width() < MOST_OF_WIDTH * window.width()


def test_limbs_are_seen_in_their_colours(window, person, rods):
    person.opens(rods)
    person.runs_all()
    window.view3d.fit()
    picture = window.view3d.grab().toImage()
    colours = {picture.pixelColor(x, y).name() for x in range(picture.width()) for y in range(0, picture.height(), 2)}
    saturated = {name for name in colours if _saturation(name) > 100}
    assert len(saturated) > 20


def _saturation(name):
    parts = [int(name[start : start + 2], 16) for start in (1, 3, 5)]
    return max(parts) - min(parts)


def test_one_step_is_run_from_its_page_with_the_number_that_is_given(qtbot, window, person, rods):
    person.opens(rods)
    person.runs_all()
    page = window.pages.page("limbs")
    page.number.set_value(2)
    qtbot.mouseClick(page.go, Qt.MouseButton.LeftButton)
    person.waits(lambda: window.session.project.has("limbs"))
    assert window.session.project.limbs.n_limbs == 2
    assert [one.text() for one in page.number.findChildren(QRadioButton)] == ["found", "given:"]
    person.does("undo")
    assert window.session.project.limbs.n_limbs == 3


def test_a_saved_result_is_taken_instead_of_a_run(qtbot, window, person, rods, tmp_path):
    saved = tmp_path / "saved.skelgen"
    skelgen.write(skelgen.reconstruct(skelgen.read(rods)), saved)
    person.opens(rods)
    page = window.pages.page("labels")
    page.path.setText(str(saved))
    page.uses_saved.setChecked(True)
    qtbot.mouseClick(page.go, Qt.MouseButton.LeftButton)
    person.waits(lambda: window.session.project.has("labels"))
    assert "taken from a saved project" in window.session.project.reports["labels"].notices


def identities_file(take, path):
    """A file that says which point is `wrist` in the first frame."""
    x, y, z = take.positions[0, 0].tolist()
    path.write_text(f"frame,x,y,z,name\n0,{x},{y},{z},wrist\n", encoding="utf-8")
    return path


def test_identities_are_read_beside_the_window_and_can_be_undone(qtbot, window, person, rods, tmp_path, monkeypatch):
    person.opens(rods)
    path = identities_file(window.session.project.take, tmp_path / "known.csv")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args: (str(path), ""))
    page = window.pages.page("open")
    qtbot.mouseClick(page.identities, Qt.MouseButton.LeftButton)
    assert window.jobs.is_busy
    assert not page.identities.isEnabled()
    person.waits(lambda: window.session.project.identities is not None)
    person.does("undo")
    assert window.session.project.identities is None


def test_a_broken_file_of_identities_is_told(qtbot, window, person, rods, tmp_path, monkeypatch):
    person.opens(rods)
    (tmp_path / "known.csv").write_text("neither,nor\n", encoding="utf-8")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args: (str(tmp_path / "known.csv"), ""))
    qtbot.mouseClick(window.pages.page("open").identities, Qt.MouseButton.LeftButton)
    assert "known.csv" in person.is_told()
    assert window.session.project.identities is None


def test_a_second_result_is_overlaid_until_that_is_stopped(window, person, rods, tmp_path, monkeypatch):
    other = tmp_path / "other.skelgen"
    skelgen.write(skelgen.reconstruct(skelgen.read(rods)), other)
    person.opens(rods)
    stop = window.actions_by_id["compare_none"]
    assert not stop.isEnabled()
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args: (str(other), ""))
    person.does("compare")
    person.waits(lambda: window.session.other is not None)
    assert window.session.other.has("skeleton")
    assert not window.session.project.has("skeleton")
    person.does("compare_none")
    assert window.session.other is None
    assert not stop.isEnabled()


def test_a_warning_goes_to_its_frame_and_markers(window, person, tmp_path):
    path = tmp_path / "human.c3d"
    skelgen.write(simulate("human", n_frames=300, noise=0.5, dropouts=0.05).take, path)
    person.opens(path)
    person.runs_all()
    page = window.pages.page("skeleton")
    person.waits(lambda: page.warnings.count() > 0)
    (item,) = page.warnings.findItems("interpolated", Qt.MatchFlag.MatchStartsWith)
    page.warnings.itemActivated.emit(item)
    unknown = ~window.session.project.motion.limb_seen[window.session.frame]
    selected = window.session.project.limbs.limb_of_marker[list(window.session.selection.markers)]
    assert unknown[selected].any()


def test_a_file_is_dropped_on_the_window(qtbot, window, rods):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(rods))])
    arguments = (Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier)
    with qtbot.waitSignal(window.files.opened, timeout=WAIT):
        window.dropEvent(QDropEvent(QPointF(QPoint(9, 9)), *arguments))
    assert window.session.project.take.n_markers == 9


def test_closing_with_changes_asks_and_cancel_keeps_the_window(qtbot, window, person, rods):
    person.opens(rods)
    person.runs_all()
    person.answers(QMessageBox.StandardButton.Cancel)
    assert not window.close()
    assert window.isVisible()
    person.answers(QMessageBox.StandardButton.Discard)
    window.close()
    qtbot.waitUntil(lambda: not window.isVisible(), timeout=WAIT)


def test_closing_cancels_what_runs_and_waits(qtbot, window, person, tmp_path):
    path = tmp_path / "cloud.mfml"
    skelgen.write(simulate("human", n_frames=400, labelled=False).take, path)
    person.opens(path)
    person.does("run_all")
    assert window.jobs.is_busy
    person.answers(QMessageBox.StandardButton.Yes)
    window.close()
    qtbot.waitUntil(lambda: not window.isVisible() and not window.jobs.is_busy, timeout=WAIT)


def test_the_project_reopens_as_it_was_left(window, person, rods, tmp_path):
    person.opens(rods)
    person.runs_all()
    window.session.show_frame(77)
    window.pages.page("joints")
    person.saves_as(tmp_path / "rods.skelgen")
    window.session.show_frame(0)
    window.pages.page("open")
    person.opens(tmp_path / "rods.skelgen")
    assert window.session.frame == 77
    assert window.pages.current.key == "joints"


def test_forms_hold_what_the_project_keeps_and_defaults_for_another_recording(window, person, rods, tmp_path):
    person.opens(rods)
    row = window.pages.page("limbs").form.rows["sampling"]
    default = row.value()
    row.show_value(default + 8)
    person.saves_as(tmp_path / "rods.skelgen")
    person.opens(rods)
    assert row.value() == default
    person.opens(tmp_path / "rods.skelgen")
    assert row.value() == default + 8


def test_a_file_that_is_opened_is_told_to_the_views_once(window, person, rods):
    told = []
    window.session.project_changed.connect(lambda: told.append(window.session.project))
    person.opens(rods)
    assert len(told) == 1


def test_the_axis_that_is_wanted_up_is_up(window, person, rods):
    person.opens(rods)
    found = window.view3d.up
    other = "xyz"[(found + 1) % 3]
    window.preferences.change(replace(window.preferences.values, up_axis=other))
    assert window.view3d.up == "xyz".index(other)
    window.preferences.change(replace(window.preferences.values, up_axis="found"))
    assert window.view3d.up == found
