"""Corrections by hand: the menu that offers them for a selection, their questions, and the list to take them back."""

from collections import deque
from collections.abc import Callable
from functools import partial, reduce

from PySide6.QtCore import QCoreApplication, QObject
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QInputDialog,
    QLabel,
    QListWidget,
    QMenu,
    QMessageBox,
    QPushButton,
    QSpinBox,
    QWidget,
)

from skelgen.app.corrections import frames_seen_together, is_by_subject, with_correction
from skelgen.errors import SkelgenError
from skelgen.files import read_table
from skelgen.model import Project
from skelgen.model.corrections import Correction
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.wording import Offer, new_name, offers
from skelgen_gui.project.context import Runner
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Document, Session
from skelgen_gui.widgets.layouts import answer_buttons, column, put_texts
from skelgen_gui.widgets.painting import as_rich_text


class CorrectionActions(QObject):
    """Fills menus with the corrections that a selection allows, and carries them out.

    Parameters
    ----------
    document : Document
        What is corrected.
    runner : Runner
        Computes again what a correction made invalid.
    report_error : callable (error)
        Shows what went wrong.
    window : QWidget
        Parent of questions.
    """

    def __init__(
        self, document: Document, runner: Runner, report_error: Callable[[Exception], None], window: QWidget
    ) -> None:
        super().__init__(window)
        self._document, self._runner, self._report_error, self._window = document, runner, report_error, window
        self._queue: deque[tuple[Correction, ...]] = deque()
        self.deriver = Deriver(self)

    def fill(self, menu: QMenu, selection: Selection | None = None) -> None:
        """Fill a menu with what the selection allows.

        Parameters
        ----------
        menu : QMenu
            Is cleared first.
        selection : Selection, optional
            What is selected; by default that of the session.
        """
        menu.clear()
        session = self._document.session
        # Kinds of which there are many: each has a menu of its own
        titles = {"move": self.tr("Move to the limb of"), "kind": self.tr("Type of the joint")}
        submenus: dict[str, QMenu] = {}
        for offer in offers(session.project, selection or session.selection):
            target = menu
            if offer.kind in titles:
                if offer.kind not in submenus:
                    submenus[offer.kind] = menu.addMenu(titles[offer.kind])
                    submenus[offer.kind].setToolTipsVisible(True)
                target = submenus[offer.kind]
            target.addAction(self._action(offer, target))
        if menu.isEmpty():
            nothing = menu.addAction(self.tr("Select markers, a joint or a limb first"))
            nothing.setEnabled(False)

    def apply(self, *corrections: Correction) -> None:
        """Correct beside the window, after the corrections before it, and compute again what was there."""
        if self._document.session.project is not None:
            self._queue.append(tuple(self._document.located(correction) for correction in corrections))
            self._go_on()

    def _go_on(self) -> None:
        """Derive the next correction that waits, from the project as it is by now."""
        project = self._document.session.project
        if project is None:
            self._queue.clear()
        elif self._queue and not self.deriver.is_busy:
            stated = self._queue[0]
            take = partial(self._take, project, stated)
            self.deriver.derive(partial(reduce, with_correction, stated, project), take, take)

    def _take(self, before: Project, stated: tuple[Correction, ...], after: Project | SkelgenError) -> None:
        if self._document.session.project is before:  # else it is derived anew from what is there now
            self._queue.popleft()
            if isinstance(after, SkelgenError):
                self._report_error(after)
            else:
                self._document.change(", ".join(correction.sentence for correction in stated), after)
                self._runner.run_again(before)
        self._go_on()

    def report(self, error: Exception) -> None:
        """Show why something cannot be stated."""
        self._report_error(error)

    def end(self) -> None:
        """Apply no more corrections: the window closes."""
        self._queue.clear()
        self.deriver.forget()

    def take_back(self, index: int) -> None:
        """Take one correction back, and compute again what was there."""
        before = self._document.session.project
        if before is not None and is_by_subject(before):
            self._runner.take_back(index)
        elif before is not None:
            self._document.take_back(index)
            self._runner.run_again(before)

    def _action(self, offer: Offer, parent: QObject) -> QAction:
        action = QAction(_text(offer).replace("&", "&&"), parent)  # a single one would mark a key
        action.setToolTip(as_rich_text(_text(offer)))
        action.triggered.connect(lambda _=False, offer=offer: self._ask_and_apply(offer))
        return action

    def _ask_and_apply(self, offer: Offer) -> None:
        correction = self._asked(offer)
        if correction is not None:
            self.apply(*offer.also, correction)

    def _asked(self, offer: Offer) -> Correction | None:
        session = self._document.session
        if offer.kind in {"swap", "split", "delete"}:
            proposed = (session.frame, session.n_frames - 1) if offer.kind != "delete" else (0, session.n_frames - 1)
            frames = _ask_frames(self._window, _text(offer), proposed, session.n_frames)
            if frames is None:
                return None
            value = self._asked_name(offer) if offer.kind == "split" else ""
            return None if value is None else offer.correction(value, *frames)
        if offer.kind == "merge" and not self._may_merge(offer):
            return None
        if offer.kind in {"rename", "name", "name-joint"}:
            value = self._asked_name(offer)
            return offer.correction(value) if value else None
        return offer.correction()

    def _may_merge(self, offer: Offer) -> bool:
        """Ask before markers are merged that are seen at the same time: no marker is in two places."""
        project = self._document.session.project
        n_frames = 0 if project is None else frames_seen_together(project, offer.names)
        if not n_frames:
            return True
        question = self.tr(
            "{0} are seen at the same time in {1} frames, so they are hardly one marker. Merge them all the same, and "
            "leave out the positions of the others there?"
        )
        question = question.format(self.tr(" and ").join(offer.names), n_frames)
        title, buttons = self.tr("Merge markers"), QMessageBox.StandardButton.Yes | QMessageBox.StandardButton.No
        answer = QMessageBox.question(
            self._window, title, as_rich_text(question), buttons, QMessageBox.StandardButton.No
        )
        return answer == QMessageBox.StandardButton.Yes

    def _asked_name(self, offer: Offer) -> str | None:
        project = self._document.session.project
        old = (*offer.about, *offer.names)[0]
        proposed = new_name(project, old) if project is not None and offer.kind == "split" else old
        name, is_accepted = QInputDialog.getText(self._window, _text(offer), self.tr("Name:"), text=proposed)
        return name.strip() if is_accepted and name.strip() else None


_WORDS = read_table(__file__, "offers")


def _text(offer: Offer) -> str:
    if offer.kind == "move":
        return offer.about[0]
    if offer.kind == "kind":
        return offer.value
    words = offer.about or offer.names
    if offer.kind == "instead":
        return _tr("Use this joint instead: {0} – {1}, and not {2} – {3}").format(*words)
    if offer.about:
        return _tr(_WORDS["about"][offer.kind]).format(_tr(" and ").join(words))
    return _tr(_WORDS["of"][offer.kind]).format(", ".join(words))


def _tr(text: str) -> str:
    return QCoreApplication.translate("CorrectionActions", text)


class FramesDialog(QDialog):
    """First and last frame, both included.

    Parameters
    ----------
    parent : QWidget
        The window.
    title : str
        What the frames are for.
    proposed : tuple of int
        First and last frame to begin with.
    n_frames : int
        Of the take.
    """

    def __init__(self, parent: QWidget, title: str, proposed: tuple[int, int], n_frames: int) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.first, self.last = QSpinBox(self), QSpinBox(self)
        for box, value in zip((self.first, self.last), proposed, strict=True):
            box.setRange(0, n_frames - 1)
            box.setValue(value)
        put_texts(self)
        self.first.valueChanged.connect(self.last.setMinimum)
        self.last.setMinimum(proposed[0])
        layout = QFormLayout(self)
        layout.addRow(self.tr("From frame"), self.first)
        layout.addRow(self.tr("to frame"), self.last)
        layout.addRow(answer_buttons(self, QDialogButtonBox.StandardButton.Ok))

    def frames(self) -> tuple[int, int]:
        """Return what was chosen."""
        return self.first.value(), self.last.value()


def _ask_frames(
    parent: QWidget, title: str, proposed: tuple[int, int], n_frames: int
) -> tuple[int | None, int | None] | None:
    """Ask for first and last frame; None if the user cancels, and None for an end of the take.

    Parameters
    ----------
    parent : QWidget
        The window.
    title : str
        What the frames are for.
    proposed : tuple of int
        First and last frame to begin with.
    n_frames : int
        Number of frames of the take.
    """
    dialog = FramesDialog(parent, title, proposed, n_frames)
    is_accepted = dialog.exec() == QDialog.DialogCode.Accepted
    first, last = dialog.frames()
    dialog.deleteLater()
    if not is_accepted:
        return None
    return first or None, None if last == n_frames - 1 else last


class CorrectionList(QWidget):
    """The corrections that the user made by hand.

    Parameters
    ----------
    session : Session
        Whose project is shown.
    actions : CorrectionActions
        Takes corrections back.
    runner : Runner
        Its switch for computing at once is shown.
    """

    def __init__(self, session: Session, actions: CorrectionActions, runner: Runner) -> None:
        super().__init__()
        self._session, self._runner = session, runner
        self.entries = QListWidget(self)
        self.entries.setWordWrap(True)
        self.hint = QLabel(
            self.tr("Select markers, a joint or a limb, then right click or choose Edit, Correct."), self
        )
        self.hint.setWordWrap(True)
        self.take_back = QPushButton(self.tr("Take back"), self)
        self.at_once = QCheckBox(self.tr("Compute again at once"), self)
        put_texts(self)
        self.at_once.setChecked(runner.computes_at_once)
        column(self, (self.hint, self.entries, self.take_back, self.at_once))
        session.project_changed.connect(self._follow)
        self.entries.currentRowChanged.connect(self._follow_row)
        self.take_back.clicked.connect(lambda: actions.take_back(self.entries.currentRow()))
        self.at_once.toggled.connect(self._set_at_once)
        self._follow()

    def _follow(self) -> None:
        project = self._session.project
        self.entries.clear()
        self.entries.addItems([] if project is None else [one.sentence for one in project.corrections])
        self.hint.setVisible(not self.entries.count())
        self._follow_row(self.entries.currentRow())

    def _follow_row(self, row: int) -> None:
        self.take_back.setEnabled(row >= 0)

    def _set_at_once(self, is_wanted: bool) -> None:
        self._runner.computes_at_once = is_wanted
