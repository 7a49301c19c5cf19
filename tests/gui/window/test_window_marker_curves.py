"""Markers are drawn as curves, and gaps are filled and motion smoothed where the curves show it."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication
from skelgen_gui.model.marker_curves import gap_rows, marker_panels
from skelgen_gui.model.selection import Selection

import skelgen
from skelgen.model.filled import PositionSource

Key = Qt.Key
FIRST, LAST = 150, 189
MARKER = "head 1"


@pytest.fixture
def pane(qtbot, active, window, person, gapped):
    window.document.open(gapped)
    window.marker_curves_dock.raise_()
    qtbot.waitUntil(window.marker_curves.isVisible)
    person.waits(lambda: window.marker_curves.tools.table.gaps.rowCount() == 1)
    return window.marker_curves


def clicks_gap(qtbot, pane, row=0):
    table = pane.tools.table
    place = table.visualRect(table.gaps.index(row, 0)).center()
    qtbot.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=place)


def test_a_click_on_a_gap_shows_it_and_every_way_says_how_far_it_is_off(qtbot, window, pane, person):
    clicks_gap(qtbot, pane)
    person.waits(lambda: pane.preview is not None)
    assert window.session.frame == FIRST
    assert {window.session.project.trajectories.names[one] for one in window.session.selection.markers} == {MARKER}
    assert window.timeline.span.first > 0
    errors = {}
    for key, way in ((Key.Key_1, "skeleton"), (Key.Key_2, "rigid"), (Key.Key_3, "spline"), (Key.Key_4, "pattern")):
        qtbot.keyClick(pane.tools.table, key)
        person.waits(lambda way=way: pane.preview is not None and pane.preview.correction.value == way)
        assert "mm expected" in pane.tools.words.text()
        errors[way] = float(np.sqrt((pane.preview.path.std**2).mean()))
    assert errors["rigid"] < 1.0 < errors["spline"]
    assert [curve.name for curve in pane.plot.panels[0].curves] == [MARKER, "preview"]
    assert pane.plot.panels[0].curves[1].band is not None


def test_enter_fills_the_gap_as_it_was_shown_and_undo_takes_it_back(qtbot, window, pane, person):
    clicks_gap(qtbot, pane)
    qtbot.keyClick(pane.tools.table, Key.Key_2)
    person.waits(lambda: pane.preview is not None and pane.preview.correction.value == "rigid")
    skeleton = window.session.project.skeleton
    qtbot.keyClick(pane.tools.table, Key.Key_Return)
    person.waits(lambda: len(window.session.project.corrections) == 1)
    project = window.session.project
    assert project.skeleton is skeleton
    column = project.trajectories.names.index(MARKER)
    filled = skelgen.fill(project)
    assert set(filled.source[FIRST : LAST + 1, column]) == {PositionSource.LIMB}
    assert gap_rows(project)[0].stated == "rigid"
    (panel, *_) = marker_panels(project, (column,), "position")
    np.testing.assert_array_equal(panel.curves[0].line.low, filled.positions[:, column, 0])
    person.does("undo")
    person.waits(lambda: not gap_rows(window.session.project)[0].stated)


def test_position_speed_and_distances_are_drawn_of_any_selection(qtbot, window, pane, person):
    window.session.select(Selection(frozenset({0, 1, 2})))
    person.waits(lambda: len(pane.plot.panels) == 3)
    assert [panel.title for panel in pane.plot.panels] == ["x", "y", "z"]
    assert [len(panel.curves) for panel in pane.plot.panels] == [3, 3, 3]
    pane.quantity.setFocus()
    qtbot.keyClick(QApplication.focusWidget(), Key.Key_Down)
    person.waits(lambda: pane.plot.panels[0].title == "Speed")
    qtbot.keyClick(QApplication.focusWidget(), Key.Key_Down)
    person.waits(lambda: pane.plot.panels[0].title == "Distance")
    assert len(pane.plot.panels[0].curves) == 3
    window.session.select(Selection(frozenset({window.session.project.trajectories.names.index(MARKER)})))
    person.waits(lambda: len(pane.plot.panels[0].curves) > 4)


def test_panels_behind_the_tab_of_another_one_wait_until_they_are_raised(window, person, gapped):
    window.document.open(gapped)
    person.waits()
    rows, tree = window.marker_curves.tools.table.gaps, window.outline.tree
    assert not rows.rows
    assert not tree.topLevelItemCount()
    window.marker_curves_dock.raise_()
    person.waits(lambda: bool(rows.rows))
    window.outline.parentWidget().raise_()
    person.waits(lambda: bool(tree.topLevelItemCount()))


def test_smoothing_is_drawn_with_its_deviation_before_it_is_stated(qtbot, window, pane, person):
    window.session.select(Selection(frozenset({3})))
    person.waits()
    pane.tools.cutoff.setFocus()  # as Tab and a click do
    person.waits(lambda: pane.preview is not None)
    fine = pane.preview
    assert fine.correction.kind == "smooth"
    assert [curve.name for curve in pane.plot.panels[0].curves][-1] == "preview"
    pane.tools.cutoff.setValue(1.0)
    person.waits(lambda: pane.preview is not fine)
    assert "mm at most" in pane.tools.words.text()
    coarse, positions = pane.preview, window.session.project.trajectories.positions[:, 3]
    assert np.nanmax(np.abs(coarse.path.positions - positions)) > np.nanmax(np.abs(fine.path.positions - positions))
    assert not window.session.project.corrections
    assert not pane.tools.fill.isEnabled()
    pane.tools.way.setCurrentIndex(pane.tools.way.currentIndex() + 1)  # back to gaps
    person.waits()
    assert pane.preview is None or pane.preview.correction.kind == "fill"


def test_smooth_holds_for_the_selected_markers_in_the_chosen_range(qtbot, window, pane, person):
    window.runner.computes_at_once = False
    window.session.select(Selection(frozenset({3})))
    window.timeline.player.set_range(100, 200)
    person.waits()
    pane.tools.cutoff.setValue(6.0)
    before = window.session.project.trajectories.positions[:, 3]
    qtbot.mouseClick(pane.tools.smooth, Qt.MouseButton.LeftButton)
    person.waits(lambda: bool(window.session.project.corrections))
    (stated,) = window.session.project.corrections
    assert (stated.kind, stated.value, stated.first_frame, stated.last_frame) == ("smooth", "6", 100, 200)
    after = window.session.project.trajectories.positions[:, 3]
    changed = np.flatnonzero((before != after).any(axis=1))
    assert (changed.min(), changed.max()) == (100, 200)
    assert 0.05 < np.abs(after - before).max() < 20
