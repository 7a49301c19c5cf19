"""The window by keyboard alone: Tab goes as one reads, the focus is seen, and colours are told apart by everybody."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QApplication, QDockWidget, QScrollArea, QWidget
from skelgen_gui.widgets.painting import colour_of_limb, component_colour, doubt_colour, theme_palette

Key = Qt.Key
ROW = 12  # px: what is at about the same height stands in one row
LEAST_DIFFERENCE = 20.0  # CIELAB; 2.3 are just noticed side by side, 20 in thin lines apart from each other
N_LIMBS, LEAST_OF_LIMBS = 16, 10.0  # of a person with hands and feet: any two of them may be neighbours in the tree
LEAST_ON_PAGE = 29.0  # CIELAB, of a limb and the page that it is drawn on

# From linear RGB to what is seen without one kind of cones (Machado, Oliveira and Fernandes 2009, severity 1)
BLINDNESS = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
XYZ = np.array([[0.4125, 0.3576, 0.1804], [0.2127, 0.7152, 0.0722], [0.0193, 0.1192, 0.9503]])


@pytest.fixture
def active(active, person, walked):
    active.document.open(walked[0])
    person.waits()
    return active


def tab_order(container):
    """Widgets in a container that Tab visits, in its order."""
    first, found = container, []
    widget = first.nextInFocusChain()
    while widget is not first:
        takes_tab = container.isAncestorOf(widget) and widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        if takes_tab and widget.isVisible() and widget.isEnabled() and widget.focusProxy() is None:
            found.append(widget)
        widget = widget.nextInFocusChain()
    return found


def area_of(widget):
    """The area in which a widget is scrolled, or None."""
    while widget is not None and not isinstance(widget, QScrollArea):
        widget = widget.parentWidget()
    return widget


def reads_on(before, after, container):
    """Whether a widget stands below another one, or in its row to the right."""
    areas = area_of(before), area_of(after)
    if areas[0] is not areas[1]:  # what is scrolled away stands where its area does
        before, after = areas[0] or before, areas[1] or after
    one, other = (widget.mapTo(container, QPoint(0, 0)) for widget in (before, after))
    return other.y() > one.y() + ROW or (abs(other.y() - one.y()) <= ROW and other.x() > one.x())


DOCKS = ("labelling", "marker_curves", "outline", "corrections", "timeline", "steps")
PAGES = ("takes", "open", "labels", "limbs", "joints", "skeleton", "export", "capture")


@pytest.mark.parametrize("place", [*DOCKS, *PAGES])
def test_tab_goes_from_above_to_below_and_from_left_to_right(qtbot, active, person, place):
    dock = active.findChild(QDockWidget, place)
    container = active.pages.page(place) if dock is None else dock.widget()
    if dock is not None:
        dock.show()
        dock.raise_()
    qtbot.waitUntil(container.isVisible)
    person.waits()
    if place == "marker_curves":
        container = container.tools.parentWidget()
    order = tab_order(container)
    assert len(order) > 1
    wrong = [(one, other) for one, other in pairwise(order) if not reads_on(one, other, container)]
    assert not [tuple(widget.accessibleName() or str(widget) for widget in pair) for pair in wrong]


def test_no_ring_is_there_before_a_key_moves_the_focus(window):
    assert not window.focus_ring.isVisible()


def test_a_ring_shows_where_tab_has_brought_the_focus_and_a_click_takes_it_away(qtbot, active):
    ring = active.focus_ring
    active.view3d.setFocus()
    visited: set[QWidget] = set()
    for _ in range(40):
        qtbot.keyClick(QApplication.focusWidget(), Key.Key_Tab)
        focus = QApplication.focusWidget()
        assert ring.widget() is focus
        assert ring.isVisible()
        visited.add(focus)
    assert len(visited) > 15
    highlight = active.palette().color(QPalette.ColorRole.Highlight)
    picture = ring.grab().toImage()
    assert picture.pixelColor(picture.width() // 2, 0).rgb() == highlight.rgb()
    qtbot.mouseClick(active.view3d, Qt.MouseButton.LeftButton)
    assert ring.widget() is None


def lab(colour, blindness):
    """CIELAB of a colour as it is seen."""
    encoded = np.array(colour.getRgbF()[:3])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.array(blindness) @ linear, 0, 1)
    xyz = XYZ @ seen / np.array([0.9505, 1.0, 1.0888])
    roots = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * roots[1] - 16, 500 * (roots[0] - roots[1]), 200 * (roots[1] - roots[2])])


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("blindness", BLINDNESS.values(), ids=BLINDNESS)
def test_components_are_told_apart_without_one_kind_of_cones(dark, blindness):
    palette = theme_palette(dark=dark)
    seen = [lab(component_colour(component, palette), blindness) for component in range(3)]
    assert min(np.linalg.norm(one - other) for one, other in combinations(seen, 2)) > LEAST_DIFFERENCE


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("blindness", [np.eye(3), *BLINDNESS.values()], ids=["none", *BLINDNESS])
def test_any_two_limbs_are_told_apart_in_view_graph_and_report(dark, blindness):
    palette = theme_palette(dark=dark)
    page = lab(palette.color(QPalette.ColorRole.Base), blindness)
    seen = [lab(colour_of_limb(limb, palette), blindness) for limb in range(N_LIMBS)]
    shown = [*seen, lab(doubt_colour(palette), blindness)]
    assert min(np.linalg.norm(one - other) for one, other in combinations(shown, 2)) > LEAST_OF_LIMBS
    assert min(np.linalg.norm(one - page) for one in seen) > LEAST_ON_PAGE
