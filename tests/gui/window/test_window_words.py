"""Every text of the window can be translated: a translator that marks texts finds those that it is not asked for."""

from __future__ import annotations

import re

import pytest
from PySide6.QtCore import QTranslator
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QGroupBox,
    QLabel,
    QLineEdit,
    QMenu,
    QTabWidget,
    QWidget,
)
from skelgen_gui.model.curves import joint_panels
from skelgen_gui.model.graph import joint_sentences, pair_sentences
from skelgen_gui.model.matrix import cell_sentence
from skelgen_gui.widgets.errors import sentence_of
from skelgen_gui.window_commands import RecentMenu

from skelgen.app.configuration import parameters_class
from skelgen.app.drawing.graph import find_cost_graph
from skelgen.app.drawing.measures import find_deviation_matrix
from skelgen.model.project import STAGES

COMPUTED = {"What is open", "What came out of this step", "What will be written"}
"""What these labels say is composed where there is no Qt, as on the command line and in reports: in English only."""

CODES = {"ChoiceBox", "SourceField"}
"""Values of parameters and sources, which are called so on the command line as well."""

UNITS = {declaration.unit for stage in STAGES for declaration in parameters_class(stage).declarations()} | {"Hz", "s"}
OPEN, CLOSE = "⟦", "⟧"


class Marking(QTranslator):
    """Puts brackets around every text."""

    def translate(self, context, source, disambiguation=None, n=-1):
        return f"{OPEN}{source}{CLOSE}"


@pytest.fixture
def marked(qtbot):
    """All texts are marked until the test ends."""
    translator = Marking()
    app = QApplication.instance()
    assert app.installTranslator(translator)
    yield
    app.removeTranslator(translator)


def texts_of(window):
    """Whatever a person reads or is read to, with where it stands."""
    for widget in window.findChildren(QWidget):
        if widget.objectName().startswith("qt_"):
            continue
        where = type(widget).__name__
        yield where, widget.toolTip()
        yield where, widget.accessibleName()
        yield where, widget.windowTitle()
        if isinstance(widget, QLabel | QAbstractButton) and widget.accessibleName().strip(OPEN + CLOSE) not in COMPUTED:
            yield where, widget.text()
        if isinstance(widget, QGroupBox | QMenu):
            yield where, widget.title()
        if isinstance(widget, QLineEdit):
            yield where, widget.placeholderText()
        if isinstance(widget, QComboBox):
            yield from ((where, widget.itemText(index)) for index in range(widget.count()))
        if isinstance(widget, QTabWidget):
            yield from ((where, widget.tabText(index)) for index in range(widget.count()))
        for action in widget.actions() if not isinstance(widget, RecentMenu) else ():
            yield "QAction", action.text()
            yield "QAction", action.toolTip()


@pytest.mark.usefixtures("marked")
def test_every_text_of_the_window_can_be_translated(request):
    window, person, rods = (request.getfixturevalue(name) for name in ("window", "person", "rods"))
    person.opens(rods)
    person.runs_all()
    for entry in window.pages.entries:
        window.pages.page(entry.key)
    person.waits()
    bare = [one for one in texts_of(window) if re.search("[A-Za-z]{2}", one[1]) and OPEN not in one[1]]
    own = UNITS | {*window.session.project.trajectories.names}
    assert not [one for one in bare if one[0] not in CODES and one[1] not in own]


@pytest.mark.usefixtures("marked")
def test_what_is_said_under_the_pointer_can_be_translated(qtbot, request):
    request.getfixturevalue("window")
    project, _ = request.getfixturevalue("walked")
    matrix, graph = find_deviation_matrix(project), find_cost_graph(project)
    told = [cell_sentence(matrix, 0, 1), joint_sentences(graph.joints[0])]
    told.append(pair_sentences(graph, *graph.pairs[0].tolist()))
    told += [words for panel in joint_panels(project, 0) for words in (panel.title, panel.note, panel.about)]
    told.append(sentence_of(ValueError("x")))
    assert all(OPEN in words for words in told if words)
