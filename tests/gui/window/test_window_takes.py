"""Many takes run in the window with one skeleton or their own; results are opened and compared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFileDialog

import skelgen
from skelgen.model.corrections import Correction
from skelgen.simulation import simulate

Key = Qt.Key


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A project of rods with its skeleton, and two shorter takes of the same rods."""
    folder = tmp_path_factory.mktemp("takes")
    project = skelgen.reconstruct(simulate("rods", n_frames=120, noise=0.2).take)
    skelgen.write(project, folder / "calibrated.skelgen")
    takes = [folder / "first.c3d", folder / "second.c3d"]
    for n_frames, path in zip((60, 80), takes, strict=True):
        skelgen.write(simulate("rods", n_frames=n_frames, noise=0.2).take, path)
    return folder / "calibrated.skelgen", takes


def test_takes_run_with_one_skeleton_and_their_results_open(qtbot, window, person, calibrated, tmp_path, monkeypatch):
    subject, takes = calibrated
    names = [str(path) for path in takes]
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", lambda *args: (names, ""))
    page = window.pages.page("takes")
    qtbot.mouseClick(page.add, Qt.MouseButton.LeftButton)
    page.skeleton.setFocus()
    qtbot.keyClick(page.skeleton, Key.Key_Down)
    assert not page.go.isEnabled()
    page.subject.setText(str(subject))
    page.folder.setText(str(tmp_path / "results"))
    qtbot.mouseClick(page.go, Qt.MouseButton.LeftButton)
    person.waits(lambda: "2 of 2 takes" in page.status.text())
    assert [row.outcome.split(", ")[0] for row in page.takes.rows] == ["done", "done"]
    assert all("mm" in row.residual for row in page.takes.rows)
    page.table.selectRow(1)
    page.table.setFocus()
    with qtbot.waitSignal(window.files.opened, timeout=60_000):
        qtbot.mouseClick(page.open, Qt.MouseButton.LeftButton)
    project = window.session.project
    assert project.take.n_frames == 80
    assert project.skeleton.lengths == skelgen.load(subject).skeleton.lengths
    shown = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: shown.append(Path(url.toLocalFile())))
    qtbot.mouseClick(window.pages.page("takes").show_page, Qt.MouseButton.LeftButton)
    assert shown[0].is_file()


def test_the_skeleton_of_another_take_is_applied_to_the_open_one_and_undone(window, person, calibrated, monkeypatch):
    subject, takes = calibrated
    person.opens(takes[0])
    window.runner.computes_at_once = False
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", lambda *args: ([str(subject)], ""))
    person.does("subject")
    person.waits(lambda: window.session.project.has("skeleton"))
    assert window.session.project.skeleton.lengths == skelgen.load(subject).skeleton.lengths
    assert window.pages.current.key == "skeleton"
    person.does("undo")
    person.waits(lambda: not window.session.project.has("labels"))


def test_a_correction_is_taken_back_and_the_skeleton_of_another_take_stays(window, person, calibrated):
    subject, takes = calibrated
    person.opens(takes[0])
    window.commands.subjects.apply([subject])
    person.waits(lambda: window.session.project.has("skeleton"))
    before = window.session.project
    window.corrections.apply(Correction("swap", before.trajectories.names[:2], 20, 30))
    person.waits(lambda: len(window.session.project.corrections) == 1)
    window.corrections.take_back(0)
    person.waits(lambda: not window.session.project.corrections)
    after = window.session.project
    assert after.skeleton.lengths == before.skeleton.lengths
    np.testing.assert_array_equal(after.trajectories.positions, before.trajectories.positions)


def test_two_results_are_compared_line_by_line(qtbot, window, person, calibrated, tmp_path):
    subject, _ = calibrated
    person.opens(subject)
    project = window.session.project
    first, *_, last = project.trajectories.names
    other = skelgen.reconstruct(skelgen.correct(project, "swap", [first, last], frames=(0, 29)))
    skelgen.write(other, tmp_path / "other.skelgen")
    window.files.compare(tmp_path / "other.skelgen")
    panel = window.comparison.widget()
    person.waits(lambda: panel.lines.count() > 0)
    assert window.comparison.isVisible()
    assert "9 of 9 markers" in panel.summary.text()
    lines = [panel.lines.item(row).text() for row in range(panel.lines.count())]
    assert any(line.startswith(f"{first}:") and "75 %" in line for line in lines)
    row = next(row for row, line in enumerate(lines) if line.startswith(f"{first}:"))
    place = panel.lines.visualItemRect(panel.lines.item(row)).center()
    panel.lines.scrollToItem(panel.lines.item(row))
    place = panel.lines.visualItemRect(panel.lines.item(row)).center()
    qtbot.mouseClick(panel.lines.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert window.session.selection.markers == {0}
    person.does("compare_none")
    assert not window.comparison.isVisible()
    assert np.isfinite(project.motion.joint_positions).all()
