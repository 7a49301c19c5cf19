"""The pane: the table of markers, the name of the selected one, names that are left, and questions."""

from functools import partial
from typing import NamedTuple

from PySide6.QtCore import QEvent, QStringListModel, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QCheckBox, QComboBox, QLineEdit, QListView

from skelgen.app.advice import open_questions
from skelgen.errors import SkelgenError
from skelgen.model import Project
from skelgen.model.corrections import NOBODY
from skelgen.model.questions import Question
from skelgen_gui.labelling.lists import MarkerTable, Questions
from skelgen_gui.model.labelling import (
    MarkerRow,
    Span,
    marker_rows,
    names_left,
    naming,
    set_choices,
    set_of,
    with_point_named,
)
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.context import Runner
from skelgen_gui.project.corrections import CorrectionActions
from skelgen_gui.project.deriving import Deriver, PanelWhileSeen
from skelgen_gui.project.session import Document
from skelgen_gui.widgets.fields import keep_narrow
from skelgen_gui.widgets.layouts import column, put_texts, row_of

_MOST_NAMES = 200  # in the list
_NAMES_HEIGHT = 110  # px, at most
_NAME_LINES = 2  # at least
_LETTERS = 10  # of marker sets that are called by long words


class _State(NamedTuple):
    """The part of a project that the pane shows."""

    rows: tuple[MarkerRow, ...]
    questions: tuple[Question, ...]
    marker_set: str


class LabellingPane(PanelWhileSeen):
    """Names all markers of a take by keys and clicks, without a dialog.

    Parameters
    ----------
    document : Document
        What is labelled.
    corrections : CorrectionActions
        Applies corrections.
    runner : Runner
        Finds the labels anew where points were named.
    """

    def __init__(self, document: Document, corrections: CorrectionActions, runner: Runner) -> None:
        super().__init__()
        self._document, self._corrections, self._runner = document, corrections, runner
        self._session = session = document.session
        self._knows_sets = False
        self.span: Span | None = None  # for which names are given, where the user has chosen one
        self.deriver = Deriver(self)
        self.search, self.table = QLineEdit(self), MarkerTable(session, self)
        self.name, self.sets = _NameLine(self), QComboBox(self)
        self.names, self._left = QListView(self), QStringListModel(self)
        self.after_click = QCheckBox(self)
        self.questions = Questions(session, self)
        self._describe()
        parts = (self.search, self.table, row_of(self.name, self.sets), self.names, self.after_click, self.questions)
        layout = column(self, parts)
        layout.setStretchFactor(self.table, 4)
        layout.setStretchFactor(self.names, 1)
        self._connect()
        self._follow_selection()

    def _describe(self) -> None:
        keep_narrow(self.sets, _LETTERS)
        self.names.setModel(self._left)
        self.names.setEditTriggers(QListView.EditTrigger.NoEditTriggers)
        self.names.setMaximumHeight(_NAMES_HEIGHT)
        self.names.setMinimumHeight(_NAME_LINES * (self.fontMetrics().height() + 6))
        self.names.setFlow(QListView.Flow.LeftToRight)
        self.names.setWrapping(True)
        self.names.setResizeMode(QListView.ResizeMode.Adjust)
        self.names.setSpacing(2)
        put_texts(self)
        self.after_click.setChecked(True)

    def _connect(self) -> None:
        session = self._session
        session.project_changed.connect(self._follow_project)
        session.selection_changed.connect(self._follow_selection)
        self.search.textChanged.connect(self.table.search)
        self.table.chosen.connect(self._begin_to_name)
        self.name.textEdited.connect(self._list_names)
        self.name.returnPressed.connect(self._take_name)
        self.name.left.connect(self.table.setFocus)
        self.name.went_down.connect(self._go_to_names)
        self.names.clicked.connect(lambda place: self.give(place.data()))
        self.names.activated.connect(lambda place: self.give(place.data()))
        self.sets.activated.connect(lambda _: self._list_names())
        self.questions.answered.connect(lambda stated: self._corrections.apply(*stated))
        self.questions.nobody_chosen.connect(lambda question: self._name_point(question, NOBODY))

    def give(self, name: str) -> None:
        """Give a name to the selected marker, and select the one in the next row."""
        project, markers = self._session.project, self._session.selection.markers
        if project is None or not project.has("labels") or len(markers) != 1:
            return
        (marker,) = markers
        following = self.table.marker_after(marker)
        stated = naming(project, marker, name, self._session.frame, self.span)
        if stated is None:
            return
        self._corrections.apply(stated)
        if following is not None:
            self._session.select(Selection(frozenset({following})))

    def clicked_in_view(self) -> None:
        """Let the user type the name of the one marker that was clicked in a view, if that is wished."""
        if self.isVisible() and self.after_click.isChecked() and len(self._session.selection.markers) == 1:
            self._begin_to_name()

    def _list_project(self) -> None:
        project = self._session.project
        if project is None or not project.has("labels"):
            self.deriver.forget()
            self._take(None, _State((), (), ""))
        else:
            self.deriver.derive(partial(_state_of, project), partial(self._take, project))

    def _take(self, project: Project | None, state: _State) -> None:
        if not self._knows_sets:
            self._knows_sets = True
            self.sets.addItem(self.tr("No marker set"), "")
            for name, title in set_choices().items():
                self.sets.addItem(title, name)
        if self.sets.currentIndex() <= 0 and state.marker_set:
            self.sets.setCurrentIndex(self.sets.findData(state.marker_set))
        self.table.show_rows(state.rows)
        self.questions.show_questions(project, state.questions)
        self._follow_selection()

    def _follow_selection(self) -> None:
        project, markers = self._session.project, self._session.selection.markers
        is_one = project is not None and project.has("labels") and len(markers) == 1
        self.name.setEnabled(is_one or self._asks_for_point())
        name = project.trajectories.names[next(iter(markers))] if is_one and project is not None else ""
        self.name.setText(name)
        self.name.setPlaceholderText("" if name else self.tr("Select a marker"))
        if self.name.hasFocus():
            self.name.selectAll()
        self._is_stale = self._is_stale or not self.is_seen
        self._list_names("")

    def _asks_for_point(self) -> bool:
        question = self.questions.current
        return question is not None and question.kind == "whose"

    def _begin_to_name(self) -> None:
        if self.name.isEnabled():
            self.name.setFocus(Qt.FocusReason.OtherFocusReason)
            self.name.selectAll()

    def _take_name(self) -> None:
        question = self.questions.current
        if not self._session.selection.markers and question is not None and question.kind == "whose":
            self._name_point(question, self.name.text())
        else:
            self.give(self.name.text())

    def _name_point(self, question: Question, name: str) -> None:
        project = self._session.project
        if project is None or not name.strip():
            return
        try:
            named = with_point_named(project, question, name)
        except SkelgenError as error:
            self._corrections.report(error)
            return
        self._document.change(self.tr("the point in frame {0} is {1}").format(question.first_frame, name), named)
        self._runner.run_again(project)

    def _list_names(self, typed: str | None = None) -> None:
        """Offer unused names that contain what is typed; once something is typed, also the names of other markers."""
        project = self._session.project
        typed = (self.name.text() if typed is None else typed).strip().lower()
        found: tuple[str, ...] = ()
        if project is not None and project.has("labels") and self.is_seen:
            found = names_left(project, self.sets.currentData() or "")
            found += project.trajectories.names if typed else ()
        self._left.setStringList([name for name in found if typed in name.lower()][:_MOST_NAMES])
        self.names.setVisible(bool(found))

    def _go_to_names(self) -> None:
        if self.names.isVisible():
            self.names.setFocus(Qt.FocusReason.OtherFocusReason)
            self.names.setCurrentIndex(self._left.index(0))


def _state_of(project: Project) -> _State:
    return _State(marker_rows(project), open_questions(project), set_of(project))


class _NameLine(QLineEdit):
    """A name; Space plays while all of it is selected, Down goes on to the names, Escape back to the table."""

    left, went_down = Signal(), Signal()

    def event(self, event: QEvent) -> bool:
        """Leave Space to the window where no name has begun: none begins with it."""
        if event.type() == QEvent.Type.ShortcutOverride and isinstance(event, QKeyEvent):
            is_whole = self.selectedText() == self.text()
            if event.key() == Qt.Key.Key_Space and is_whole and not event.modifiers():
                event.ignore()
                return False
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Go elsewhere, or type."""
        if event.key() == Qt.Key.Key_Down:
            self.went_down.emit()
        elif event.key() == Qt.Key.Key_Escape:
            self.left.emit()
        else:
            super().keyPressEvent(event)
