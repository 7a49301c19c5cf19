"""What can be wrong with files and disks is one sentence; nothing is lost, and nothing half-written."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox

import skelgen
from skelgen.app.project_file.archive import open_project
from skelgen.simulation import simulate

SMALL = 5000  # bytes that each file may have: less than what is written here, more than the settings


@pytest.fixture
def locked(tmp_path):
    """A folder into which nobody may write, also not an administrator."""
    if os.geteuid() == 0:
        folder = "/proc/skelgen"
        if not os.path.isdir("/proc"):  # noqa: PTH112 - not a path of ours
            pytest.skip("an administrator may write everywhere, and there is no /proc")
    else:
        folder = tmp_path / "locked"
        folder.mkdir(mode=0o500)
    return type(tmp_path)(folder)


def test_a_broken_file_is_told_and_what_was_open_stays(window, person, rods, tmp_path):
    person.opens(rods)
    before = window.session.project
    (tmp_path / "broken.c3d").write_bytes(rods.read_bytes()[:700])
    window.open(tmp_path / "broken.c3d")
    assert "broken.c3d" in person.is_told()
    assert window.session.project is before


def test_a_project_of_a_newer_version_is_told(window, person, rods, tmp_path):
    saved, newer = tmp_path / "a.skelgen", tmp_path / "b.skelgen"
    skelgen.write(skelgen.read(rods), saved)
    with zipfile.ZipFile(saved) as old, zipfile.ZipFile(newer, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "project.json":
                content = json.dumps(json.loads(content) | {"version": 99}).encode()
            new.writestr(name, content)
    window.open(newer)
    assert "update skelgen" in person.is_told()


@pytest.mark.parametrize("name", ["a b", "ä€漢", "it's & <b>"])
def test_names_of_files_with_any_character_are_opened(window, person, rods, tmp_path, name):
    path = tmp_path / f"{name}.c3d"
    shutil.copy(rods, path)
    person.opens(path)
    assert name in window.windowTitle()


def test_names_of_markers_with_any_character_are_shown_saved_and_opened(window, person, tmp_path):
    take = simulate("rods", n_frames=60, noise=0.2).take
    names = ("<b>1</b>", "a & b", "ä€漢", "it's", 'say "x"', "%1 {0}", "a/b\\c", "\u200b.", "e\u0301")
    take = replace(take, names=names[: take.n_markers])
    path = tmp_path / "odd.skelgen"
    skelgen.write(take, path)
    person.opens(path)
    person.runs_all()
    window.session.select(type(window.session.selection)(frozenset(range(take.n_markers))))
    window.corrections.fill(window.commands.correct_menu)
    window.grab()
    person.saves_as(tmp_path / "again.skelgen")
    assert open_project(tmp_path / "again.skelgen").trajectories.names == take.names


def test_a_take_of_one_frame_is_shown_and_what_it_cannot_give_is_a_sentence(window, person, tmp_path):
    take = simulate("rods", n_frames=30).take
    path = tmp_path / "one.skelgen"
    skelgen.write(replace(take, positions=take.positions[:1]), path)
    person.opens(path)
    for index in range(window.tabs.count()):
        window.tabs.setCurrentIndex(index)
        window.grab()
    person.does("run_all")
    assert "frame" in person.is_told()
    assert window.session.project.take.n_frames == 1


def test_a_full_disk_is_told_on_save_and_the_file_before_stays(window, person, computed, tmp_path, full_disk):
    path = tmp_path / "rods.skelgen"
    person.saves_as(path)
    before = path.read_bytes()
    window.session.change(replace(window.session.project, view={"frame": 3}))
    with full_disk(SMALL):
        person.does("save")
        assert person.is_told() == f"{path}: cannot be written: File too large"
    assert window.session.is_dirty
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.glob(".rods*")] == []
    person.does("save")
    person.waits(lambda: not window.session.is_dirty)


def test_a_full_disk_keeps_a_window_open_that_was_to_save_first(window, person, computed, tmp_path, full_disk):
    person.chooses(tmp_path / "rods.skelgen")
    person.answers(QMessageBox.StandardButton.Save)
    with full_disk(SMALL):
        window.close()
        assert "cannot be written" in person.is_told()
    assert window.isVisible()
    assert window.session.project is computed
    assert window.session.is_dirty
    assert not (tmp_path / "rods.skelgen").exists()


def test_a_folder_without_rights_is_told_on_save(window, person, computed, locked):
    person.chooses(locked / "rods.skelgen")
    person.does("save_as")
    assert person.is_told().startswith(f"{locked / 'rods.skelgen'}: cannot be written: ")
    assert window.session.is_dirty
    assert window.session.path is None


def exported(qtbot, person, page, folder):
    """What the page says after it was told to export as XML."""
    page.choice.setCurrentText("Skeleton and motion, XML")
    page.target.suggest(folder, "walk")
    qtbot.mouseClick(page.export, Qt.MouseButton.LeftButton)
    person.waits()
    return page.status.text()


def test_a_folder_without_rights_is_told_on_export(qtbot, window, person, computed, locked):
    page = window.pages.page("export")
    assert str(locked) in exported(qtbot, person, page, locked)
    assert page.export.isEnabled()


def test_a_full_disk_is_told_on_export_and_the_file_before_stays(qtbot, window, person, computed, tmp_path, full_disk):
    page, folder = window.pages.page("export"), tmp_path / "out"
    assert exported(qtbot, person, page, folder).startswith("Written to")
    before = (folder / "walk.xml").read_bytes()
    with full_disk(SMALL):
        assert exported(qtbot, person, page, folder) == f"{folder / 'walk.xml'}: cannot be written: File too large"
    assert (folder / "walk.xml").read_bytes() == before
    assert [file.name for file in folder.iterdir()] == ["walk.xml"]


def test_a_full_disk_is_told_once_when_unsaved_work_is_put_aside_and_it_is_tried_again(
    qtbot, window, computed, tmp_path, full_disk
):
    told = []
    window.autosave.failed.connect(told.append)
    with full_disk(SMALL):
        for _ in range(2):
            window.autosave.save()
            window.autosave.wait()
            qtbot.wait(1)  # in which the thread's signal arrives
    assert len(told) == 1
    assert "cannot be kept" in window.statusBar().currentMessage()
    window.autosave.save()
    window.autosave.wait()
    (kept,) = (tmp_path / "recovery").rglob("project.skelgen")
    assert open_project(kept).has("skeleton")
