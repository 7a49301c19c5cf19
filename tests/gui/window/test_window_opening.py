"""Opening with options, and a project whose recording was moved."""

from __future__ import annotations

from PySide6.QtWidgets import QDialogButtonBox, QFileDialog, QMessageBox
from skelgen_gui.project.file_actions import OpenDialog

from skelgen.app.files import open_input
from skelgen.app.project_file.archive import save_project


def test_a_recording_is_opened_with_another_rate_and_its_beginning_alone(window, person, rods, monkeypatch):
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args: (str(rods), ""))
    person.does("open_with")
    dialog = window.findChild(OpenDialog)
    dialog.changes.set_values({"rate": 25.0, "last_frame": 49})
    dialog.buttons.button(QDialogButtonBox.StandardButton.Open).click()
    person.waits(lambda: window.session.project is not None)
    take = window.session.project.take
    assert (take.n_frames, take.rate) == (50, 25.0)
    assert "opened with last frame 49, rate 25.0" in window.pages.page("open").notices.text()


def test_a_recording_that_moved_is_located(window, person, rods, tmp_path, monkeypatch):
    path = save_project(open_input(rods), tmp_path / "rods.skelgen", embed=False)
    elsewhere = tmp_path / "moved" / "other.c3d"
    elsewhere.parent.mkdir()
    rods.rename(elsewhere)
    person.answers(QMessageBox.StandardButton.Yes)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args: (str(elsewhere), ""))
    person.opens(path)
    assert window.session.project.source.path == str(elsewhere)


def test_who_does_not_locate_a_recording_is_told_where_it_was(window, person, rods, tmp_path):
    path = save_project(open_input(rods), tmp_path / "rods.skelgen", embed=False)
    rods.unlink()
    person.answers(QMessageBox.StandardButton.No)
    window.open(path)
    assert "the recording that it refers to is not at" in person.is_told()
