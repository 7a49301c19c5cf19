"""The export page shows what will be written, has it written, and says in one sentence why it could not be."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog
from skelgen_gui.pages.export import ExportPage
from skelgen_gui.project.jobs import PROGRESS_INTERVAL, Jobs
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.errors import ErrorDialog

import skelgen
from skelgen.errors import Cancelled
from skelgen.model import Poses, Project
from skelgen.progress import SILENT


class AtOnce(Jobs):
    """Does the work before `start` returns."""

    def __init__(self, monitor=SILENT):
        super().__init__()
        self._monitor = monitor

    def start(self, title, work, done, failed=None):
        try:
            result = work(self._monitor)
        except Exception as error:
            failed(error)
        else:
            done(result)
        return True


class CancelledAmid:
    """A monitor that cancels when progress is told for the third time."""

    def __init__(self):
        self.n_told = 0

    def begin(self, name):
        pass

    def advance(self, done, total):
        self.n_told += 1
        if self.n_told == 3:
            raise Cancelled


@pytest.fixture
def open_page(qtbot, session, tmp_path):
    def make(jobs=None, session=session):
        page = ExportPage(session, jobs or AtOnce())
        qtbot.addWidget(page)
        page.target.suggest(tmp_path / "out", "walk")
        page.show()
        qtbot.waitUntil(lambda: not page.deriver.is_busy)  # which formats are possible
        return page

    return make


@pytest.fixture
def page(open_page):
    return open_page()


@pytest.fixture
def click(qtbot):
    return lambda button: qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def names_in(folder):
    return sorted(file.name for file in folder.iterdir()) if folder.exists() else []


def test_a_project_is_exported_as_the_page_says(page, click, tmp_path):
    page.choice.setCurrentText("Joint positions, CSV")
    assert "<b>walk.joints.csv</b>" in page.preview.text()
    assert "14 joints in 400 frames at 100 Hz" in page.preview.text()
    click(page.export)
    assert names_in(tmp_path / "out") == ["walk.joints.csv"]
    assert page.status.text() == f"Written to {tmp_path / 'out'}: walk.joints.csv"
    assert page.show_folder.isVisible()


def test_options_of_the_format_are_a_form_and_are_obeyed(page, click, tmp_path, session):
    page.choice.setCurrentText("Character Studio marker file")
    assert set(page.form.rows) == {"dropout", "axes", "unit", "rate", "filled"}
    assert page.form.rows["rate"].label.text() == "Rate, 0 as recorded"
    page.form.rows["dropout"].editor.setCurrentText("zero")
    click(page.export)
    back = skelgen.read(tmp_path / "out" / "walk.csm")
    assert back.n_markers == session.project.trajectories.n_markers
    assert "DROPOUT" not in (tmp_path / "out" / "walk.csm").read_text()


def test_options_change_the_preview(page):
    page.choice.setCurrentText("C3D")
    assert "filled.csv" not in page.preview.text()
    page.form.rows["filled"].editor.click()
    assert "<b>walk.filled.csv</b>" in page.preview.text()


def test_a_hidden_page_looks_through_no_take_until_it_is_seen_again(page, session):
    """What a format cannot hold is found by looking through all frames, which would delay every correction."""
    page.choice.setCurrentText("Joint positions, CSV")
    page.hide()
    session.change(Project(session.project.take))
    assert "400 frames" in page.preview.text()
    page.show()
    assert "400 frames" not in page.preview.text()


def test_options_stay_when_a_result_changes(page, session):
    page.form.rows["filled"].editor.click()
    session.change(session.project)
    assert page.form.values()["filled"] is True


def test_a_format_without_options_shows_none(page):
    page.choice.setCurrentText("Report, HTML")
    assert not page.options_box.isVisible()


def test_what_the_format_cannot_hold_is_said(page):
    page.choice.setCurrentText("Joint positions, CSV")
    assert "cannot hold the positions of the markers" in page.preview.text()


def test_files_that_will_be_replaced_are_said(page, click, qtbot, tmp_path):
    page.choice.setCurrentText("Joint positions, CSV")
    click(page.export)
    assert page.export.text() == "Export and replace"
    assert "<b>walk.joints.csv</b> (replaces the file that is there)" in page.preview.text()
    page.target.name_line.selectAll()
    qtbot.keyClicks(page.target.name_line, "run")
    assert page.export.text() == "Export"


def test_a_name_that_no_file_can_have_is_refused_at_once(qtbot, page):
    page.target.name_line.selectAll()
    qtbot.keyClicks(page.target.name_line, "a/b")
    assert page.preview.text() == "&#x27;a/b&#x27; cannot be the name of a file: it is empty or holds a slash"
    assert not page.export.isEnabled()


def test_names_with_markup_are_shown_and_written_as_they_are(page, click, tmp_path):
    page.target.name_line.setText("<b>Gänge & Läufe")
    page.choice.setCurrentText("Joint positions, CSV")
    assert "&lt;b&gt;Gänge &amp; Läufe.joints.csv" in page.preview.text()
    click(page.export)
    assert names_in(tmp_path / "out") == ["<b>Gänge & Läufe.joints.csv"]


def test_formats_that_need_more_results_are_grey_and_say_what(qtbot, open_page, walked, tmp_path):
    session = Session()
    session.open(Project(walked[0].take))
    page = open_page(session=session)
    row = page.choice.findText("Joint positions, CSV")
    item = page.choice.model().item(row)
    assert not item.isEnabled()
    assert "run the stage 'skeleton' first" in item.toolTip()
    session.change(walked[0])
    qtbot.waitUntil(item.isEnabled)


def test_bodies_are_offered_the_format_that_holds_them(open_page):
    session = Session()
    session.open(Project(Poses(np.tile(np.eye(4), (5, 2, 1, 1)), ("pelvis", "thigh"), 60.0)))
    page = open_page(session=session)
    assert page.choice.currentText() == "Poses CSV (skelgen)"
    assert page.export.isEnabled()


def test_where_there_are_several_bodies_each_gets_a_file_if_ticked(open_page, click, tmp_path):
    two = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100, subjects=2, seed=1, noise=0.2).take)
    session = Session()
    session.open(two)
    page = open_page(session=session)
    page.target.name_line.setText("walk")
    page.choice.setCurrentText("BVH")
    assert page.target.name == "walk_{body}"
    page.choice.setCurrentText("Joint positions, CSV")
    assert page.target.name == "walk"
    assert page.target.each_body.isVisible()
    page.target.each_body.click()
    click(page.export)
    assert names_in(tmp_path / "out") == ["walk_body1.joints.csv", "walk_body2.joints.csv"]
    session.change(Project(two.take))
    assert not page.target.each_body.isVisible()
    assert page.target.name == "walk"


def test_one_body_is_not_asked_for_files_of_each(page):
    assert not page.target.each_body.isVisible()


def test_without_a_project_the_page_says_what_to_do(open_page):
    page = open_page(session=Session())
    assert page.preview.text() == "Open a recording first."
    assert not page.export.isEnabled()


def test_another_recording_is_suggested_its_own_name(page, session, walked, tmp_path):
    take = skelgen.Trajectories(walked[0].trajectories.positions, walked[0].trajectories.names, 100.0, "jump.c3d")
    session.open(Project(take), tmp_path / "jumps" / "jump.skelgen")
    assert (page.target.folder, page.target.name) == (tmp_path / "jumps", "jump")


def test_a_folder_is_suggested_with_its_whole_path(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page.target.suggest(Path("walk"), "walk")
    assert page.target.folder_line.text() == str(tmp_path / "walk")


def test_a_folder_can_be_chosen(page, click, monkeypatch, tmp_path):
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *args: str(tmp_path / "chosen"))
    click(page.target.browse)
    assert page.target.folder == tmp_path / "chosen"


def test_a_folder_that_cannot_be_made_is_one_sentence(page, click, tmp_path):
    (tmp_path / "out").write_text("")
    click(page.export)
    assert page.status.text() == f"{tmp_path / 'out'}: cannot be created: there is a file of this name"
    assert page.export.isEnabled()


def test_a_full_disk_is_one_sentence_and_nothing_is_left(page, click, tmp_path, full_disk):
    page.choice.setCurrentText("Skeleton and motion, XML")
    with full_disk(100_000):
        click(page.export)
    assert page.status.text() == f"{tmp_path / 'out' / 'walk.xml'}: cannot be written: File too large"
    assert names_in(tmp_path) == []


def test_a_fault_of_the_program_opens_the_dialog_of_errors(open_page, click):
    class Faulty(Jobs):
        def start(self, title, work, done, failed=None):
            failed(ZeroDivisionError("division by zero"))
            return True

    page = open_page(Faulty())
    click(page.export)
    assert "ZeroDivisionError" in page.findChild(ErrorDialog).sentence.text()


class Slowed:
    """Passes everything on, and takes its time for its first step, so that its progress is due."""

    def __init__(self, monitor):
        self.monitor, self.begin, self.notice = monitor, monitor.begin, monitor.notice
        self.n_steps = 0

    def advance(self, done, total):
        self.n_steps += done > 0
        if self.n_steps == 1:
            time.sleep(2 * PROGRESS_INTERVAL)
        self.monitor.advance(done, total)


class Unhurried(Jobs):
    """Jobs of which no export is done before its progress is shown."""

    def start(self, title, work, done, failed=None):
        return super().start(title, lambda monitor: work(Slowed(monitor)), done, failed)


def test_while_it_runs_the_choices_wait_and_it_can_be_cancelled(open_page, qtbot, click, tmp_path):
    jobs = Jobs()
    page = open_page(jobs)
    page.choice.setCurrentText("Skeleton and motion, XML")
    click(page.export)
    assert jobs.is_busy
    assert page.progress.isVisible()
    assert not (page.export.isEnabled() or page.choice.isEnabled() or page.target.isEnabled())
    click(page.cancel)
    qtbot.waitUntil(lambda: not jobs.is_busy)
    assert page.status.text() == "Cancelled; nothing was written."
    assert page.export.isEnabled() and page.choice.isEnabled() and not page.cancel.isVisible()
    assert names_in(tmp_path) == []


def test_cancelling_in_the_middle_writes_nothing(open_page, click, tmp_path):
    monitor = CancelledAmid()
    page = open_page(AtOnce(monitor))
    page.choice.setCurrentText("Skeleton and motion, XML")
    click(page.export)
    assert monitor.n_told == 3
    assert page.status.text() == "Cancelled; nothing was written."
    assert names_in(tmp_path) == []


def test_progress_comes_from_another_thread_and_rises_to_the_end(open_page, qtbot, click, tmp_path):
    jobs = Unhurried()
    page = open_page(jobs)
    page.choice.setCurrentText("TRC (Motion Analysis, OpenSim)")
    shares = []
    page.progress.valueChanged.connect(shares.append)
    click(page.export)
    qtbot.waitUntil(lambda: not jobs.is_busy)
    until_done = shares[: shares.index(max(shares)) + 1]  # then the bar is empty again, for the next export
    assert until_done == sorted(until_done)
    assert max(shares) > 0
    assert page.status.text() == f"Written to {tmp_path / 'out'}: walk.trc"


def test_progress_of_other_jobs_is_not_shown(open_page):
    jobs = Jobs()
    page = open_page(jobs)
    jobs.progressed.emit("labels", 0.5)
    assert page.progress.value() <= 0


def test_an_export_runs_on_another_thread_and_its_end_is_told_on_this_one(open_page, qtbot, click, tmp_path):
    jobs = Jobs()
    page = open_page(jobs)
    page.choice.setCurrentText("Skeleton and motion, XML")
    click(page.export)
    assert jobs.is_busy
    qtbot.waitUntil(lambda: not jobs.is_busy)
    assert page.status.text() == f"Written to {tmp_path / 'out'}: walk.xml"
    assert names_in(tmp_path / "out") == ["walk.xml"]


def test_a_second_job_is_refused_with_a_sentence(open_page, qtbot, click):
    jobs, release = Jobs(), threading.Event()
    page = open_page(jobs)
    jobs.start("other", lambda _: release.wait(), lambda _: None)
    click(page.export)
    release.set()
    qtbot.waitUntil(lambda: not jobs.is_busy)
    assert page.status.text().startswith("Something else is still running")
    assert page.export.isEnabled()


def test_every_control_has_a_name_and_a_tool_tip(page):
    for widget in (page.choice, page.export, page.cancel, page.show_folder, page.target.browse):
        assert (widget.accessibleName() or widget.text()) and widget.toolTip()
    for line in (page.target.folder_line, page.target.name_line):
        assert line.accessibleName() and line.toolTip()
