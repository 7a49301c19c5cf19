"""Twenty tasks as a user would put them, each done by mouse and keys; docs/window-tasks.md says in how many steps."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication, QFileDialog, QMessageBox, QTabBar

import skelgen
from skelgen.model import Labelling, Trajectories
from skelgen.model.labelling import Doubt
from skelgen.simulation import simulate

Key = Qt.Key
PAGE = Path(__file__).parents[3] / "docs" / "window-tasks.md"
_ROW = re.compile(r"\| (\d+) \|[^|]*\| [^|]* \| (\d+) \|")
TOLD = {int(number): int(steps) for number, steps in _ROW.findall(PAGE.read_text(encoding="utf-8"))}
N_FRAMES = 60


class Hand:
    """Uses the window, and counts the steps of the task at hand."""

    def __init__(self, qtbot, window, person, monkeypatch):
        self._qtbot, self._window, self._person, self._monkeypatch = qtbot, window, person, monkeypatch
        self.steps = 0

    def begins(self):
        self.steps = 0

    def clicks(self, widget, place=None):
        self.steps += 1
        self._qtbot.mouseClick(widget, Qt.MouseButton.LeftButton, pos=place or widget.rect().center())

    def clicks_row(self, view, row, column=0):
        index = view.model().index(row, column)
        view.scrollTo(index)
        self.clicks(view.viewport(), view.visualRect(index).center())

    def clicks_marker(self, marker):
        self._window.view3d.grab()
        self.clicks(self._window.view3d, self._window.view3d.place_of_marker(marker).toPoint())

    def clicks_dock(self, title):
        bars = [bar for bar in self._window.findChildren(QTabBar) if bar.isVisible()]
        bar, index = next((bar, index) for bar in bars for index in range(bar.count()) if bar.tabText(index) == title)
        self.clicks(bar, bar.tabRect(index).center())

    def presses(self, key, modifier=Qt.KeyboardModifier.NoModifier):
        self.steps += 1
        self._qtbot.keyClick(QApplication.focusWidget() or self._window, key, modifier)

    def types(self, text):
        self.steps += 1
        self._qtbot.keyClicks(QApplication.focusWidget(), text)

    def enters(self, field, text):
        """Into a field that is clicked for it: the text is a step of its own."""
        self.clicks(field)
        field.selectAll()
        self.steps += 1
        self._qtbot.keyClicks(field, text)

    def chooses_files(self, *paths):
        """In the next dialog for files."""
        self.steps += 1
        names = [str(path) for path in paths]
        self._monkeypatch.setattr(QFileDialog, "getOpenFileNames", lambda *args: (names, ""))
        self._monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args: (names[0], ""))

    def has_done(self, number, is_done=lambda: True):
        self._person.waits(is_done)
        assert self.steps == TOLD[number], f"task {number} took {self.steps} steps"


@pytest.fixture
def hand(qtbot, active, person, monkeypatch):
    return Hand(qtbot, active, person, monkeypatch)


@pytest.fixture(scope="module")
def unnamed():
    """53 stiff markers; m3 has two gaps, m5 is perhaps m6, and m52 goes on as m53 after a gap."""
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 1000, (54, 3)) + 50 * np.sin(np.arange(N_FRAMES) / 9)[:, np.newaxis, np.newaxis]
    places[10:15, 3] = places[30:40, 3] = np.nan
    places[25:, 52] = places[:30, 53] = np.nan
    project = skelgen.reconstruct(
        Trajectories(places, tuple(f"m{number}" for number in range(54)), 100.0), until="labels"
    )
    confidence = np.where(project.trajectories.seen, 0.99, np.nan)
    confidence[20:40, 5] = 0.2
    doubt = Doubt(5, 20, 39, "rival", 6, 0.2, "m6 fits as well")
    return replace(project, _labelling=Labelling(confidence, (doubt,), (), np.zeros(N_FRAMES, dtype=int)))


def names_in(window):
    return window.session.project.trajectories.names


def test_tasks_of_labelling(qtbot, window, person, hand, unnamed):
    window.document.open(unnamed)
    window.runner.computes_at_once = False
    pane = window.labelling
    qtbot.keyClick(window.view3d, Key.Key_L, Qt.KeyboardModifier.ControlModifier)
    person.waits(lambda: pane.table.filtered.rowCount() == 54)

    hand.begins()
    hand.clicks_marker(7)
    hand.types("LKNE")
    hand.presses(Key.Key_Return)
    hand.has_done(1, lambda: "LKNE" in names_in(window))

    hand.begins()
    hand.types("RKNE")
    hand.presses(Key.Key_Return)
    hand.has_done(2, lambda: "RKNE" in names_in(window))

    hand.begins()
    hand.presses(Key.Key_F3)
    hand.has_done(3, lambda: window.session.frame == 20)

    hand.begins()
    window.outline.parent().raise_()
    hand.presses(Key.Key_L, Qt.KeyboardModifier.ControlModifier)
    hand.clicks_row(pane.questions.list, 0)
    hand.has_done(4, lambda: len(window.session.selection.markers) == 2)

    hand.begins()
    hand.presses(Key.Key_1)
    hand.has_done(5, lambda: window.session.project.corrections[-1].kind == "confirm")
    person.does("undo")
    person.waits(lambda: not pane.questions.list.isHidden())

    hand.begins()
    hand.clicks_row(pane.questions.list, 0)
    hand.presses(Key.Key_2)
    hand.has_done(6, lambda: window.session.project.corrections[-1].kind == "swap")

    hand.begins()
    header = pane.table.horizontalHeader()
    for _ in range(2):
        hand.clicks(header.viewport(), QPoint(header.sectionViewportPosition(2) + 4, 4))
    hand.has_done(7, lambda: pane.table.filtered.index(0, 0).data() == "m3")

    hand.begins()
    hand.enters(pane.search, "m17")
    hand.presses(Key.Key_Tab)
    hand.has_done(8, lambda: pane.table.filtered.rowCount() == 1)
    pane.search.clear()

    window.session.show_frame(40)
    hand.begins()
    hand.clicks_marker(names_in(window).index("m53"))
    hand.types("m52")
    hand.presses(Key.Key_Return)
    hand.has_done(9, lambda: "m53" not in names_in(window))


def test_tasks_of_curves_and_gaps(qtbot, window, person, hand, gapped):
    window.document.open(gapped)
    window.runner.computes_at_once = False
    pane, tools = window.marker_curves, window.marker_curves.tools
    person.waits()

    hand.begins()
    hand.clicks_dock("Markers")
    person.waits(lambda: tools.table.gaps.rowCount() == 1)
    hand.clicks_row(tools.table, 0)
    hand.has_done(10, lambda: window.session.frame == 150)

    hand.begins()
    hand.presses(Key.Key_2)
    person.waits(lambda: pane.preview is not None and pane.preview.correction.value == "rigid")
    hand.presses(Key.Key_Return)
    hand.has_done(11, lambda: [one.value for one in window.session.project.corrections] == ["rigid"])

    hand.begins()
    hand.presses(Key.Key_3)
    person.waits(lambda: pane.preview is not None and pane.preview.correction.value == "spline")
    hand.clicks(tools.fill_all)
    hand.has_done(12, lambda: window.session.project.corrections[-1].value == "spline")

    hand.begins()
    hand.presses(Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    hand.has_done(13, lambda: len(window.session.project.corrections) == 1)

    for number, title in ((14, "Speed"), (15, "Distance")):
        hand.begins()
        hand.clicks(pane.quantity)
        hand.presses(Key.Key_Down)
        hand.presses(Key.Key_Return)
        hand.has_done(number, lambda title=title: pane.plot.panels and pane.plot.panels[0].title == title)

    hand.begins()
    hand.enters(tools.cutoff, "6")
    hand.clicks(tools.smooth)
    hand.has_done(16, lambda: window.session.project.corrections[-1].kind == "smooth")
    assert window.session.project.corrections[-1].value == "6"

    hand.begins()
    window.activateWindow()  # after a list that unfolded, a window without a display is not
    qtbot.waitUntil(window.isActiveWindow)
    window.view3d.setFocus()
    hand.presses(Key.Key_4)
    hand.has_done(17, lambda: len(window.view3d.parentWidget().others) == 3)


def test_tasks_of_many_takes(window, person, hand, tmp_path):
    project = skelgen.reconstruct(simulate("rods", n_frames=120, noise=0.2).take)
    subject, other = tmp_path / "calibrated.skelgen", tmp_path / "other.skelgen"
    skelgen.write(project, subject)
    takes = [tmp_path / f"{name}.c3d" for name in ("first", "second")]
    for n_frames, path in zip((120, 80), takes, strict=True):
        skelgen.write(simulate("rods", n_frames=n_frames, noise=0.2).take, path)
    first, *_, last = project.trajectories.names
    skelgen.write(skelgen.reconstruct(skelgen.correct(project, "swap", [first, last], frames=(0, 29))), other)
    person.opens(takes[0])
    window.runner.computes_at_once = False

    hand.begins()
    hand.chooses_files(subject)
    hand.presses(Key.Key_K, Qt.KeyboardModifier.ControlModifier)
    hand.has_done(18, lambda: window.session.project.has("skeleton"))

    hand.begins()
    hand.chooses_files(other)
    hand.presses(Key.Key_O, Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier)
    lines = window.comparison.widget().lines
    person.waits(lambda: lines.count() > 0)
    hand.clicks_row(lines, 0)
    hand.has_done(19, lambda: window.session.selection.joint is not None or window.session.selection.markers)

    hand.begins()
    hand.clicks_row(window.pages.list, [entry.key for entry in window.pages.entries].index("takes"))
    page = window.pages.page("takes")
    hand.chooses_files(*takes)
    hand.clicks(page.add)
    hand.presses(Key.Key_Tab)
    page.skeleton.setFocus()
    hand.presses(Key.Key_Down)
    page.subject.setFocus()
    hand.types(str(subject))
    hand.clicks(page.go)
    person.waits(lambda: "2 of 2" in page.status.text())
    hand.clicks_row(page.table, 1)
    person.answers(QMessageBox.StandardButton.Discard)
    hand.clicks(page.open)
    hand.has_done(20, lambda: window.session.project.take.n_frames == 80)
