"""The lists of the pane: all markers, and the open questions of the labels.

The table of markers is searched, sorted and selected with the session, what needs most work first. Questions stand with
their answers, the one that settles most comes first.
"""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import (
    QItemSelection,
    QItemSelectionModel,
    QObject,
    QSortFilterProxyModel,
    QStringListModel,
    Qt,
    Signal,
)
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QHBoxLayout, QLabel, QListView, QPushButton, QTableView, QWidget

from skelgen.app.drawing.wording import whole_percent
from skelgen.model import Project
from skelgen.model.questions import Question
from skelgen_gui.model.labelling import Answer, MarkerRow, answers, question_words
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import Index, Role, RowModel, bare_column, choose_by_rows, describe, put_texts

_NAME = 0
_LEAST_ROWS = 6  # in sight, one of them for the heads


class MarkerTableModel(RowModel[MarkerRow]):
    """Markers as rows, whatever their number."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.heads = (
            (self.tr("Marker"), self.tr("What it is called")),
            (self.tr("Work"), self.tr("Frames that are expected to be called wrongly")),
            (self.tr("Gaps"), self.tr("Number of gaps between frames in which it is seen")),
            (self.tr("Doubts"), self.tr("Number of doubtful spans")),
            (self.tr("Seen"), self.tr("Part of the frames in which it is seen")),
            (self.tr("Limb"), self.tr("The limb that it is on")),
        )

    def data(self, index: Index, role: int = Role.DisplayRole) -> object:
        """Return the text of a cell, and its sort key."""
        row, column = self.rows[index.row()], index.column()
        values = (row.name, row.work, row.gaps, row.doubts, row.seen, row.limb)
        if role == Role.UserRole:
            return values[column]
        if role in {Role.DisplayRole, Role.ToolTipRole}:
            texts = (row.name, f"{row.work:.0f}", str(row.gaps), str(row.doubts), whole_percent(row.seen), row.limb)
            return texts[column] if texts[column] != "0" else ""
        if role == Role.TextAlignmentRole and not isinstance(values[column], str):
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None


class MarkerTable(QTableView):
    """The table; a click or an arrow key selects markers, Enter goes on to their name.

    Parameters
    ----------
    session : Session
        Whose selection is followed.

    Signals
    -------
    chosen()
        The selected marker is to be named.
    """

    chosen = Signal()

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session, self._is_following = session, False
        self.markers, self.filtered = MarkerTableModel(self), QSortFilterProxyModel(self)
        self.filtered.setSourceModel(self.markers)
        self.filtered.setSortRole(Role.UserRole)
        self.filtered.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.setModel(self.filtered)
        self.setSortingEnabled(True)
        self.horizontalHeader().setSortIndicatorClearable(True)
        self.sortByColumn(-1, Qt.SortOrder.AscendingOrder)  # as the rows come: what needs most work first
        choose_by_rows(self)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setWordWrap(False)
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        self.setMinimumHeight(_LEAST_ROWS * self.verticalHeader().defaultSectionSize())
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        put_texts(self)
        self.customContextMenuRequested.connect(
            lambda place: session.menu_requested.emit(self.viewport().mapToGlobal(place))
        )
        self.selectionModel().selectionChanged.connect(self._select)
        session.selection_changed.connect(self.follow_selection)

    def show_rows(self, rows: tuple[MarkerRow, ...]) -> None:
        """Show other markers, the selected ones selected."""
        self._is_following = True
        self.markers.show_rows(rows)
        self._is_following = False
        for column in range(self.markers.columnCount()):
            self.resizeColumnToContents(column)
        self.follow_selection()

    def search(self, text: str) -> None:
        """Show only markers that have a text in their names."""
        self._is_following = True
        self.filtered.setFilterFixedString(text.strip())
        self._is_following = False
        self.follow_selection()

    def marker_after(self, marker: int) -> int | None:
        """Return the marker in the row below that of another one; None if it is the last one."""
        order = [self._marker(row) for row in range(self.filtered.rowCount())]
        below = order.index(marker) + 1 if marker in order else 0
        return order[below] if below < len(order) else None

    def follow_selection(self) -> None:
        """Select here what the session has selected."""
        if self._is_following:
            return
        wanted, found = self._session.selection.markers, QItemSelection()
        rows = [row for row in range(self.filtered.rowCount()) if self._marker(row) in wanted]
        for row in rows:
            place = self.filtered.index(row, _NAME)
            found.select(place, place)
        flags = QItemSelectionModel.SelectionFlag
        self._is_following = True
        if rows and self.currentIndex().row() not in rows:
            self.selectionModel().setCurrentIndex(self.filtered.index(rows[0], _NAME), flags.NoUpdate)
        self.selectionModel().select(found, flags.ClearAndSelect | flags.Rows)
        if rows:
            self.scrollTo(self.filtered.index(rows[0], _NAME))
        self._is_following = False

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Go on to the name by Enter."""
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.chosen.emit()
        else:
            super().keyPressEvent(event)

    def _marker(self, row: int) -> int:
        return self.markers.rows[self.filtered.mapToSource(self.filtered.index(row, _NAME)).row()].marker

    def _select(self) -> None:
        """Select in the session what is selected here."""
        if not self._is_following:
            chosen = frozenset(self._marker(place.row()) for place in self.selectionModel().selectedRows())
            self._is_following = True
            self._session.select(Selection(chosen))
            self._is_following = False


_KEYS = (Qt.Key.Key_1, Qt.Key.Key_2)  # of the answers, in their order


class Questions(QWidget):
    """Questions, and the answers to the one that is chosen.

    Parameters
    ----------
    session : Session
        Whose frame and selection show what a question is about.

    Signals
    -------
    answered(object)
        Corrections that an answer states, a tuple of `Correction`.
    nobody_chosen(Question)
        The track that was left out is no marker.
    """

    answered = Signal(object)
    nobody_chosen = Signal(object)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._questions: tuple[Question, ...] = ()
        self.title, self.list, self._texts = QLabel(self), _List(self), QStringListModel(self)
        self.list.setModel(self._texts)
        self._buttons = QWidget(self)
        row = QHBoxLayout(self._buttons)
        row.setContentsMargins(0, 0, 0, 0)
        self.buttons = [QPushButton(self._buttons) for _ in _KEYS]
        for number, button in enumerate(self.buttons):
            row.addWidget(button)
            describe(button, self.tr("Answer {0}").format(number + 1))
            button.clicked.connect(partial(self._say, number))
        self.hint = QLabel(self.tr("Type its name above, and press Enter"), self)
        self.hint.setWordWrap(True)
        put_texts(self)
        bare_column(self, (self.title, self.list, self.hint, self._buttons))
        self.list.selectionModel().currentChanged.connect(self._show)
        self.list.clicked.connect(self._show)
        self.list.answered.connect(self._say)
        self.show_questions(None, ())

    @property
    def current(self) -> Question | None:
        """The question that is chosen."""
        row = self.list.currentIndex().row()
        return self._questions[row] if 0 <= row < len(self._questions) else None

    def show_questions(self, project: Project | None, questions: tuple[Question, ...]) -> None:
        """Show other questions.

        Parameters
        ----------
        project : Project or None
            What they are about.
        questions : tuple of Question
            What settles most first.
        """
        self._questions = ()  # nothing is chosen meanwhile
        names = () if project is None else project.trajectories.names
        self._texts.setStringList([question_words(question, names) for question in questions])
        self._questions = questions
        words = self.tr("Questions, what settles most first: {0}")
        self.title.setText(words.format(len(questions)) if questions else self.tr("No open question"))
        self.list.setVisible(bool(questions))
        self._offer()

    def _show(self) -> None:
        """Show what a question is about, and offer its answers."""
        question = self.current
        if question is not None:
            self._session.show_frame(question.first_frame)
            point = None if question.point is None else (question.first_frame, question.point)
            self._session.select(Selection(frozenset(question.markers), point=point))
        self._offer()

    def _offer(self) -> None:
        question, project = self.current, self._session.project
        self._answers: tuple[Answer, ...] = ()
        if question is not None and project is not None and project.has("labels"):
            self._answers = answers(project, question)
        words = [answer.words for answer in self._answers] or [self.tr("No marker")]
        self.hint.setVisible(question is not None and not self._answers)
        self._buttons.setVisible(question is not None)
        for number, button in enumerate(self.buttons):
            button.setVisible(number < len(words))
            if number < len(words):
                button.setText(f"{number + 1}  {words[number]}")
                describe(button, words[number])

    def _say(self, number: int, _: bool = False) -> None:
        if number < len(self._answers):
            self.answered.emit(self._answers[number].corrections)
        elif self.current is not None and not self._answers:
            self.nobody_chosen.emit(self.current)


class _List(QListView):
    """Questions by keys."""

    answered = Signal(int)
    own_keys = frozenset(_KEYS)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWordWrap(True)
        self.setEditTriggers(QListView.EditTrigger.NoEditTriggers)
        self.setUniformItemSizes(False)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Answer by 1 and 2."""
        if event.key() in _KEYS and self.currentIndex().isValid():
            self.answered.emit(_KEYS.index(Qt.Key(event.key())))
        else:
            super().keyPressEvent(event)
