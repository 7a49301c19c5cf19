"""Every view corrects: right click in the graph, the matrix, the lanes and the lists, as in the 3-D view."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtWidgets import QApplication, QMenu

Left, Control = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def graph(window, person, walked):
    """The graph of a person, as a tree."""
    window.document.open(walked[0])
    window.tabs.setCurrentWidget(window.graph)
    window.graph.layout_box.setCurrentIndex(1)
    person.waits(lambda: window.graph.graph is not None)
    return window.graph


@pytest.fixture
def menu_at(qtbot):
    """Right click at a place of a widget, and return the texts of the menu by its actions."""

    def ask(widget, place):
        event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, place, widget.mapToGlobal(place))
        QApplication.sendEvent(widget, event)
        qtbot.waitUntil(lambda: isinstance(QApplication.activePopupWidget(), QMenu))
        menu = QApplication.activePopupWidget()
        found = {action.text(): action for action in menu.actions()}
        menu.close()
        return found

    return ask


def at(place):
    return QPoint(*np.round(place).astype(int).tolist())


def middle(graph, pair):
    return at(graph.places[list(pair)].mean(axis=0))


def test_the_dashed_joint_is_used_instead_by_a_click_and_one_entry(qtbot, window, person, graph, menu_at):
    project = window.session.project
    joint = next(number for number, one in enumerate(graph.graph.joints) if one.rival is not None)
    rival, edge = set(graph.graph.joints[joint].rival), set(project.topology.edges[joint].tolist())
    qtbot.mouseClick(graph, Left, pos=middle(graph, edge))
    assert window.session.selection.joint == joint
    entries = menu_at(graph, middle(graph, rival))
    assert window.session.selection.limbs == rival
    (text,) = (text for text in entries if text.startswith("Use this joint instead"))
    window.runner.computes_at_once = False
    entries[text].trigger()
    person.waits(lambda: window.session.project is not project)
    assert [one.kind for one in window.session.project.corrections] == ["part", "join"]
    assert window.document.undo_stack.count() == 1


def test_two_limbs_are_selected_in_the_graph_and_made_one(qtbot, window, graph, menu_at):
    qtbot.mouseClick(graph, Left, pos=at(graph.places[2]))
    qtbot.mouseClick(graph, Left, Control, at(graph.places[5]))
    assert window.session.selection.limbs == {2, 5}
    entries = menu_at(graph, at(graph.places[5]))
    assert window.session.selection.limbs == {2, 5}
    assert any(text.startswith("One limb: ") for text in entries)
    qtbot.mouseClick(graph, Left, Control, at(graph.places[2]))
    assert window.session.selection.limbs == {5}


def test_distances_lanes_and_lists_have_the_menu_of_what_is_under_the_pointer(window, person, graph, menu_at):
    window.tabs.setCurrentWidget(window.matrix)
    entries = menu_at(window.matrix, window.matrix.cell_place(0, 4).toPoint())
    assert len(window.session.selection.markers) == 2
    assert any(text.startswith("Merge ") for text in entries)
    lanes = window.timeline.lane_view
    entries = menu_at(lanes, lanes.place_of(1, 3).toPoint())
    assert window.session.selection.markers == {int(lanes.lanes.markers[1])}
    assert any(text.startswith("Rename ") for text in entries)


def test_a_finding_has_the_menu_of_its_markers(window, person, doubted, menu_at):
    window.document.open(doubted)
    page = window.pages.page("labels")
    person.waits(lambda: page.warnings.count() > 0)
    viewport = page.warnings.viewport()
    entries = menu_at(viewport, page.warnings.visualItemRect(page.warnings.item(0)).center())
    assert window.session.selection.markers == {1}
    assert any(text.startswith("Rename ") for text in entries)
