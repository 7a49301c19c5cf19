"""The window as a person uses it: open, run, correct, undo, save, reopen, close."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, QSettings, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QMessageBox
from skelgen_gui.derived import Deriver
from skelgen_gui.preferences import Preferences
from skelgen_gui.session import Selection
from skelgen_gui.window import Window

import skelgen
from skelgen.simulation import simulate

WAIT = 60_000  # ms; a loaded machine runs all stages of a small take in a few seconds
ARM = Path(__file__).parents[3] / "shared" / "data" / "arm" / "arm-4-4-4_clean_30fps.c3d"


@pytest.fixture
def window(qtbot, tmp_path):
    preferences = Preferences(QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat))
    window = Window(preferences, recovery=tmp_path / "recovery")
    qtbot.addWidget(window, before_close_func=_end)
    with qtbot.waitExposed(window):
        window.show()
    return window


def _end(window):
    """Close without a question, which nobody is there to answer."""
    assert window.jobs.stop()
    window.care.close = lambda then: then()


@pytest.fixture
def answers(monkeypatch):
    """`answers(button)`: what the user says to the next questions."""

    def say(button):
        monkeypatch.setattr(QMessageBox, "question", lambda *args, **kwargs: button)

    return say


@pytest.fixture
def rods(tmp_path):
    """A labelled recording of three rods."""
    path = tmp_path / "rods.c3d"
    skelgen.write(simulate("rods", n_frames=120, noise=0.2).take, path)
    return path


def is_idle(window):
    return not window.jobs.is_busy and not any(deriver.is_busy for deriver in window.findChildren(Deriver))


def opened(qtbot, window, path):
    with qtbot.waitSignal(window.care.opened, timeout=WAIT):
        window.open(path)


def run_all(qtbot, window):
    window.actions_by_id["run_all"].trigger()
    qtbot.waitUntil(lambda: is_idle(window) and window.session.project.has("skeleton"), timeout=WAIT)


@pytest.mark.skipif(not ARM.exists(), reason="the recordings are not beside the project")
def test_a_recording_is_opened_run_corrected_undone_saved_reopened(qtbot, window, tmp_path):
    opened(qtbot, window, ARM)
    run_all(qtbot, window)
    project = window.session.project
    assert project.limbs.n_limbs == 3
    moved, target = (int(project.limbs.markers_of(limb)[0]) for limb in (0, 1))
    names = project.trajectories.names
    window.session.select(Selection(frozenset({moved})))
    window.corrections.fill(window.commanding.correct_menu)
    submenu = next(action.menu() for action in window.commanding.correct_menu.actions() if action.menu())
    next(action for action in submenu.actions() if action.text() == names[target]).trigger()
    qtbot.waitUntil(lambda: is_idle(window) and window.session.project.has("skeleton"), timeout=WAIT)
    limbs = window.session.project.limbs.limb_of_marker
    assert limbs[moved] == limbs[target]
    window.actions_by_id["undo"].trigger()
    assert window.session.project is project
    window.actions_by_id["redo"].trigger()
    path = tmp_path / "arm.skelgen"
    window.care._write(path, None)
    qtbot.waitUntil(lambda: is_idle(window) and not window.session.is_dirty, timeout=WAIT)
    opened(qtbot, window, path)
    assert len(window.session.project.corrections) == 1
    np.testing.assert_array_equal(window.session.project.limbs.limb_of_marker, limbs)


def test_an_unlabelled_take_is_labelled_and_every_page_tells_what_came_out(qtbot, window, tmp_path):
    path = tmp_path / "cloud.mfml"
    skelgen.write(simulate("rods", n_frames=200, noise=0.2, labelled=False).take, path)
    opened(qtbot, window, path)
    run_all(qtbot, window)
    for stage in ("labels", "limbs", "joints", "skeleton"):
        page = window.pages.page(stage)
        qtbot.waitUntil(lambda: is_idle(window))
        assert page.result.text() != ""
        assert "has not run" not in page.result.text()


def test_limbs_are_seen_in_their_colours(qtbot, window, rods):
    opened(qtbot, window, rods)
    run_all(qtbot, window)
    window.view3d.fit()
    picture = window.view3d.grab().toImage()
    colours = {picture.pixelColor(x, y).name() for x in range(picture.width()) for y in range(0, picture.height(), 2)}
    saturated = {name for name in colours if _saturation(name) > 100}
    assert len(saturated) > 20


def _saturation(name):
    parts = [int(name[start : start + 2], 16) for start in (1, 3, 5)]
    return max(parts) - min(parts)


def test_one_step_is_run_from_its_page_with_the_number_that_is_given(qtbot, window, rods):
    opened(qtbot, window, rods)
    run_all(qtbot, window)
    page = window.pages.page("limbs")
    page.number.set_value(2)
    qtbot.mouseClick(page.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: is_idle(window) and window.session.project.has("limbs"), timeout=WAIT)
    assert window.session.project.limbs.n_limbs == 2
    window.actions_by_id["undo"].trigger()
    assert window.session.project.limbs.n_limbs == 3


def test_a_saved_result_is_taken_instead_of_a_run(qtbot, window, rods, tmp_path):
    saved = tmp_path / "saved.skelgen"
    skelgen.write(skelgen.reconstruct(skelgen.read(rods)), saved)
    opened(qtbot, window, rods)
    page = window.pages.page("labels")
    page.path.setText(str(saved))
    page.uses_saved.setChecked(True)
    qtbot.mouseClick(page.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: is_idle(window) and window.session.project.has("labels"), timeout=WAIT)
    assert "taken from a saved project" in window.session.project.reports["labels"].notices


def test_a_broken_file_is_told_and_what_was_open_stays(qtbot, window, rods, tmp_path):
    opened(qtbot, window, rods)
    before = window.session.project
    (tmp_path / "broken.c3d").write_bytes(rods.read_bytes()[:700])
    told = []
    window.errors.report = told.append
    window.care._tell_error = told.append
    window.open(tmp_path / "broken.c3d")
    qtbot.waitUntil(lambda: bool(told), timeout=WAIT)
    assert "broken.c3d" in str(told[0])
    assert window.session.project is before


def test_a_project_of_a_newer_version_is_told(qtbot, window, rods, tmp_path):
    import json
    import zipfile

    saved, newer = tmp_path / "a.skelgen", tmp_path / "b.skelgen"
    skelgen.write(skelgen.read(rods), saved)
    with zipfile.ZipFile(saved) as old, zipfile.ZipFile(newer, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "project.json":
                content = json.dumps(json.loads(content) | {"version": 99}).encode()
            new.writestr(name, content)
    told = []
    window.care._tell_error = told.append
    window.open(newer)
    qtbot.waitUntil(lambda: bool(told), timeout=WAIT)
    assert "update skelgen" in str(told[0])


def test_a_file_is_dropped_on_the_window(qtbot, window, rods):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(rods))])
    arguments = (Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier)
    with qtbot.waitSignal(window.care.opened, timeout=WAIT):
        window.dropEvent(QDropEvent(QPointF(QPoint(9, 9)), *arguments))
    assert window.session.project.take.n_markers == 9


def test_closing_with_changes_asks_and_cancel_keeps_the_window(qtbot, window, rods, answers):
    opened(qtbot, window, rods)
    run_all(qtbot, window)
    answers(QMessageBox.StandardButton.Cancel)
    assert not window.close()
    assert window.isVisible()
    answers(QMessageBox.StandardButton.Discard)
    window.close()
    qtbot.waitUntil(lambda: not window.isVisible(), timeout=WAIT)


def test_closing_cancels_what_runs_and_waits(qtbot, window, tmp_path, answers):
    path = tmp_path / "cloud.mfml"
    skelgen.write(simulate("human", n_frames=400, labelled=False).take, path)
    opened(qtbot, window, path)
    window.actions_by_id["run_all"].trigger()
    assert window.jobs.is_busy
    answers(QMessageBox.StandardButton.Yes)
    window.close()
    qtbot.waitUntil(lambda: not window.isVisible() and not window.jobs.is_busy, timeout=WAIT)


def test_the_project_reopens_as_it_was_left(qtbot, window, rods, tmp_path):
    opened(qtbot, window, rods)
    run_all(qtbot, window)
    window.session.show_frame(77)
    window.pages.page("joints")
    window.care._write(tmp_path / "rods.skelgen", None)
    qtbot.waitUntil(lambda: is_idle(window) and not window.session.is_dirty, timeout=WAIT)
    window.session.show_frame(0)
    window.pages.page("open")
    opened(qtbot, window, tmp_path / "rods.skelgen")
    assert window.session.frame == 77
    assert window.pages.current.key == "joints"


def test_forms_hold_what_the_project_keeps_and_defaults_for_another_recording(qtbot, window, rods, tmp_path):
    opened(qtbot, window, rods)
    row = window.pages.page("limbs").form.rows["sampling"]
    default = row.value()
    row.show_value(default * 2)
    window.care._write(tmp_path / "rods.skelgen", None)
    qtbot.waitUntil(lambda: is_idle(window), timeout=WAIT)
    opened(qtbot, window, rods)
    assert row.value() == default
    opened(qtbot, window, tmp_path / "rods.skelgen")
    assert row.value() == default * 2


def test_a_file_that_is_opened_is_told_to_the_views_once(qtbot, window, rods):
    told = []
    window.session.project_changed.connect(lambda: told.append(window.session.project))
    opened(qtbot, window, rods)
    assert len(told) == 1


def test_a_take_of_one_frame_is_shown(qtbot, window, tmp_path):
    path = tmp_path / "one.c3d"
    skelgen.write(simulate("rods", n_frames=3).take, path)
    opened(qtbot, window, path)
    window.grab()


@pytest.mark.parametrize("name", ["a b", "ä€漢", "it's & <b>"])
def test_names_with_any_character_are_opened(qtbot, window, rods, tmp_path, name):
    path = tmp_path / f"{name}.c3d"
    shutil.copy(rods, path)
    opened(qtbot, window, path)
    assert name in window.windowTitle()


def test_a_folder_without_rights_is_told_on_save(qtbot, window, rods):
    opened(qtbot, window, rods)
    told = []
    window.care._tell_error = told.append
    window.care._write(Path("/proc/nowhere/rods.skelgen"), None)
    qtbot.waitUntil(lambda: bool(told), timeout=WAIT)
    assert "/proc/nowhere" in str(told[0])
    assert window.session.is_dirty


def test_every_control_has_a_name_for_screen_readers(qtbot, window, rods):
    from PySide6.QtWidgets import QAbstractButton, QAbstractSpinBox, QComboBox, QListWidget

    opened(qtbot, window, rods)
    for key in ("open", "labels", "limbs", "joints", "skeleton"):
        page = window.pages.page(key)
        for kind in (QAbstractButton, QAbstractSpinBox, QComboBox, QListWidget):
            for control in page.findChildren(kind):
                if control.objectName().startswith("qt_") or control.parent() in page.findChildren(QComboBox):
                    continue
                text = getattr(control, "text", str)()
                assert control.accessibleName() or text, control
