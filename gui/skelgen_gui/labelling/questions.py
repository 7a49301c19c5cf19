"""Open questions of the labels as a list with their answers: the question that settles most comes first."""

from functools import partial

from PySide6.QtCore import QStringListModel, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QListView, QPushButton, QWidget

from skelgen.model import Project
from skelgen.model.labelling import Question
from skelgen_gui.model.labelling import Answer, answers, question_words
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import bare_column, describe

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
    nobody_said(Question)
        The track that was left out is no marker.
    """

    answered = Signal(object)
    nobody_said = Signal(object)

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
        tip = self.tr("A click shows what is meant; keys 1 and 2 answer")
        describe(self.list, self.tr("Questions"), tip)
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
            self._session.select(Selection(frozenset(question.markers)))
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
            self.nobody_said.emit(self.current)


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
