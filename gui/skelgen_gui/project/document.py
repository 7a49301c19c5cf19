"""The open project as something that is corrected, undone and redone: every change is a step between two projects.

Projects are immutable, so that a step only has to remember the one before it and the one after it.
"""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject
from PySide6.QtGui import QUndoCommand, QUndoStack

from skelgen.app.corrections import with_correction, with_places, without_correction
from skelgen.model import Project
from skelgen.model.corrections import Correction
from skelgen_gui.project.session import Session


class _Step(QUndoCommand):
    """A step of undo: from one project to another."""

    def __init__(
        self, text: str, show: Callable[[Project], None], before: Project, after: Project, *, is_done: bool = False
    ) -> None:
        super().__init__(text)
        self._show, self._before = show, before
        self.after = after
        self._is_done = is_done

    def undo(self) -> None:
        """Show the project before."""
        self._show(self._before)

    def redo(self) -> None:
        """Show the project after, with what was computed from it since; nothing if it is shown when this is pushed."""
        if self._is_done:
            self._is_done = False
        else:
            self._show(self.after)


class Document(QObject):
    """Changes the session's project.

    Parameters
    ----------
    session : Session
        Holds the project.
    parent : QObject, optional
        Owner.
    """

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.session = session
        self.undo_stack = QUndoStack(self)

    def open(self, project: Project, path: Path | None = None) -> None:
        """Begin with another project; nothing of the last one can be undone.

        Parameters
        ----------
        project : Project
            The project.
        path : Path, optional
            The project file that it came from.
        """
        self.undo_stack.clear()
        self.session.open(project, path)

    def restore(self, project: Project, path: Path | None) -> None:
        """Open unsaved work again: it still belongs to its file, and each of its corrections can be undone.

        Parameters
        ----------
        project : Project
            The unsaved work.
        path : Path or None
            The project file that it came from.
        """
        states = [project]
        for _ in project.corrections:
            states.insert(0, without_correction(states[0], len(states[0].corrections) - 1))
        self.undo_stack.clear()
        self.session.open(project, path, is_saved=False)
        for correction, before, after in zip(project.corrections, states, states[1:], strict=False):
            self.undo_stack.push(_Step(correction.sentence, self.session.change, before, after, is_done=True))

    def computed(self, project: Project) -> None:
        """Show new results of the same project; undoing goes back to before the last correction, redoing to these."""
        stack = self.undo_stack
        if stack.index() > 0:
            step = stack.command(stack.index() - 1)
            if isinstance(step, _Step):
                step.after = project
        self.session.change(project)

    def correct(self, correction: Correction) -> None:
        """Add a correction.

        Raises
        ------
        InputError
            If it names what is not there; nothing has changed then.
        """
        before = self._project()
        located = self.located(correction)
        self.change(located.sentence, with_correction(before, located))

    def located(self, correction: Correction) -> Correction:
        """Return a correction with a place of each marker in the frame that is shown, by which later runs find it."""
        return with_places(self._project(), correction, self.session.frame)

    def take_back(self, index: int) -> None:
        """Drop one of the project's corrections."""
        before = self._project()
        text = self.tr("take back: {0}").format(before.corrections[index].sentence)
        self._push(text, before, without_correction(before, index))

    def change(self, text: str, project: Project) -> None:
        """Make any other change that can be undone.

        Parameters
        ----------
        text : str
            What the change is called in the menu.
        project : Project
            The changed project.
        """
        self._push(text, self._project(), project)

    def _push(self, text: str, before: Project, after: Project) -> None:
        self.undo_stack.push(_Step(text, self.session.change, before, after))

    def _project(self) -> Project:
        if self.session.project is None:
            raise RuntimeError("no project is open")
        return self.session.project
