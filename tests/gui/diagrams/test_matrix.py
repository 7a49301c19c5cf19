"""The matrix of distances names pairs, selects them, and shows parts of itself."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication
from skelgen_gui.diagrams.matrix_view import MatrixView
from skelgen_gui.model.matrix import Region, cell_sentence
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.painting import colour_of_limb, theme_palette

from skelgen.app.drawing.measures import find_deviation_matrix
from skelgen.app.drawing.wording import millimetres
from skelgen.model import Project


@pytest.fixture
def view(session, shown):
    return shown(MatrixView(session), 760, 660)


@pytest.fixture
def matrix(walked):
    return find_deviation_matrix(walked[0])


def pixel(view, place):
    picture = view.grab().toImage()
    return picture.pixelColor((place * picture.devicePixelRatio()).toPoint())


def test_hover_names_the_pair_and_its_value(view, matrix, walked):
    row, column = 4, 31
    project = walked[0]
    value = project.limbs.distance_deviation[matrix.markers[row], matrix.markers[column]]
    told = view.tip_at(view.cell_place(row, column))
    assert f"{matrix.names[row]} ({project.limbs.called(matrix.limbs[row])}) – {matrix.names[column]}" in told
    assert told.endswith(f" {millimetres(value)}")


def test_a_click_selects_both_markers(view, matrix, session, qtbot):
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=view.cell_place(2, 17).toPoint())
    assert session.selection.markers == {int(matrix.markers[2]), int(matrix.markers[17])}


def test_a_click_with_control_adds_to_what_is_selected(view, matrix, session, qtbot):
    for cell in ((2, 17), (5, 5)):
        place = view.cell_place(*cell).toPoint()
        qtbot.mouseClick(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier, place)
    assert session.selection.markers == {int(matrix.markers[row]) for row in (2, 17, 5)}


def test_dragging_shows_the_cells_inside(view, qtbot):
    qtbot.mousePress(view, Qt.MouseButton.LeftButton, pos=view.cell_place(6, 12).toPoint())
    qtbot.mouseMove(view, view.cell_place(11, 17).toPoint())
    qtbot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=view.cell_place(11, 17).toPoint())
    assert view.region == Region(6.0, 12.0, 6.0)
    qtbot.mouseDClick(view, Qt.MouseButton.LeftButton, pos=view.cell_place(8, 14).toPoint())
    assert view.region == Region.whole(45)


def test_the_wheel_zooms_about_the_pointer(view):
    place = view.cell_place(10, 20)
    event = QWheelEvent(
        place, view.mapToGlobal(place), QPoint(), QPoint(0, 480), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(view, event)
    assert view.region.size < 20
    assert (view.cell_place(10, 20) - place).manhattanLength() < 1


def test_keys_go_from_cell_to_cell_and_select(view, matrix, session, qtbot):
    for key in (Qt.Key.Key_Down, Qt.Key.Key_Right, Qt.Key.Key_Right, Qt.Key.Key_Return):
        qtbot.keyClick(view, key)
    assert session.selection.markers == {int(matrix.markers[1]), int(matrix.markers[2])}


def test_keys_bring_cells_into_sight(view, qtbot):
    view._show(Region(0, 0, 5))
    for _ in range(7):
        qtbot.keyClick(view, Qt.Key.Key_Down)
    assert view.region.row <= 7 < view.region.row + view.region.size


@pytest.mark.parametrize("is_dark", [False, True])
def test_cells_within_limbs_are_warm_and_others_are_not(view, matrix, is_dark):
    view.setPalette(theme_palette(dark=is_dark))
    inside, outside = pixel(view, view.cell_place(0, 1)), pixel(view, view.cell_place(0, 40))
    assert matrix.limbs[0] == matrix.limbs[1] != matrix.limbs[40]
    assert inside.red() > inside.blue() + 80
    assert outside.red() <= outside.blue()


def test_every_limb_has_its_strip(view, walked, has_colour):
    for limb in range(walked[0].limbs.n_limbs):
        assert has_colour(view, colour_of_limb(limb, view.palette()), 100)


def test_rows_are_ordered_by_limb(matrix):
    assert len(set(matrix.limbs.tolist())) == len(matrix.borders) - 1
    assert np.array_equal(np.sort(matrix.markers), np.arange(matrix.n))


def test_a_pair_that_is_never_seen_together_says_so(small_project):
    from dataclasses import replace

    from skelgen.model import Limbs

    deviation = np.full((10, 10), np.nan)
    limbs = Limbs(small_project.limbs.limb_of_marker, deviation)
    matrix = find_deviation_matrix(replace(small_project, _limbs=limbs))
    assert cell_sentence(matrix, 0, 4).endswith("never seen together")
    assert matrix.pixels.shape == (10, 10, 4)


@pytest.mark.parametrize("region", [Region(-5, 90, 20), Region(0, 0, 1e9), Region(3.5, 3.5, 0.01)])
def test_regions_are_brought_into_the_matrix(region):
    found = region.within(40)
    assert 3 <= found.size <= 40
    assert 0 <= found.row <= 40 - found.size
    assert 0 <= found.column <= 40 - found.size


def test_before_the_limbs_it_can_be_painted_and_clicked(shown, qtbot, small_project):
    session = Session()
    session.open(Project(small_project.take))
    view = shown(MatrixView(session))
    view.grab()
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPointF(300, 200).toPoint())
    qtbot.keyClick(view, Qt.Key.Key_Down)
    assert session.selection.markers == frozenset()
