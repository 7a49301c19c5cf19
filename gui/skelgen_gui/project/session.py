"""The only mutable objects of the window: the session, and the document that is corrected, undone and redone.

The session is the open project, the frame that is shown, and what is selected. Pages and views read it, change it
through its methods, and follow its signals; they hold no state of the project. Every change of the document is a step
between two projects; these are immutable, so that a step only has to remember the one before it and the one after it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, QPoint, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from skelgen.app.corrections import is_by_subject, with_correction, with_places, without_correction
from skelgen.model import Project
from skelgen.model.corrections import Correction
from skelgen.model.project import STAGES
from skelgen_gui.model.selection import Selection, carried


class Session(QObject):
    """The open project, the frame that is shown, and the selection.

    Attributes
    ----------
    up : int or None
        Coordinate axis that points up in the 3-D view, 0 .. 2, or down, 3 .. 5; None while that is not known.

    Signals
    -------
    take_changed()
        A project of another take, before `project_changed`.
    project_changed()
        Another project, or another result of a stage.
    other_changed()
        Another project to compare with, or none.
    frame_changed(int)
        Another frame is shown.
    selection_changed()
        Something else is selected.
    menu_requested(QPoint)
        The user wants a menu for what is selected, at a place on the screen.
    state_changed()
        The path, or whether there are unsaved changes.
    """

    take_changed = Signal()
    project_changed = Signal()
    other_changed = Signal()
    frame_changed = Signal(int)
    selection_changed = Signal()
    menu_requested = Signal(QPoint)
    state_changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._project: Project | None = None
        self._other: Project | None = None
        self._path: Path | None = None
        self._saved: Project | None = None
        self._frame = 0
        self._selection = Selection()
        self._selected_in: tuple[Selection, Project] | None = None
        self._had: frozenset[str] = frozenset()
        self.up: int | None = None

    @property
    def project(self) -> Project | None:
        """The open project; None before a file is opened."""
        return self._project

    @property
    def other(self) -> Project | None:
        """A second project that is overlaid, or None."""
        return self._other

    @property
    def path(self) -> Path | None:
        """The project file; None if it was never saved."""
        return self._path

    @property
    def is_dirty(self) -> bool:
        """Whether something would be lost if the window closed."""
        return self._project is not None and self._project is not self._saved

    @property
    def folder(self) -> Path | None:
        """Path of the project's file, otherwise of its recording; None if neither is known."""
        if self._path is not None:
            return self._path.parent
        source = None if self._project is None else self._project.source
        return None if source is None else Path(source.path).parent

    @property
    def stale(self) -> frozenset[str]:
        """Stages that had a result of this take, which a change has made invalid."""
        project = self._project
        return self._had - frozenset(stage for stage in STAGES if project is not None and project.has(stage))

    @property
    def n_frames(self) -> int:
        """Number of frames, 0 without a project."""
        return 0 if self._project is None else self._project.take.n_frames

    @property
    def rate(self) -> float:
        """Frames per second of the take, 100 without a project."""
        return 100.0 if self._project is None else float(self._project.take.rate)

    @property
    def frame(self) -> int:
        """The frame that is shown."""
        return self._frame

    @property
    def selection(self) -> Selection:
        """The selection."""
        return self._selection

    def open(self, project: Project, path: Path | None = None, *, is_saved: bool = True) -> None:
        """Show another project, from its first frame, with nothing selected.

        Parameters
        ----------
        project : Project
            The project.
        path : Path, optional
            The project file that it came from; None for a recording that is not saved as a project yet.
        is_saved : bool
            Whether that file holds all of it.
        """
        self._path = path
        self._saved = project if path is not None and is_saved else None
        self._frame, self._other = 0, None
        self._selection, self._selected_in, self._had = Selection(), None, frozenset()
        self.change(project)
        self.other_changed.emit()
        self.frame_changed.emit(0)
        self.selection_changed.emit()

    def change(self, project: Project) -> None:
        """Show other results of the same take; what is selected stays selected where it is there again."""
        before, is_other = self._selection, self._project is None or self._project.take is not project.take
        self._project = project
        self._had |= frozenset(stage for stage in STAGES if project.has(stage))
        self._frame = min(self._frame, max(self.n_frames - 1, 0))
        if self._selected_in is not None:
            selection, selected_in = self._selected_in
            self._selection = self._still_there(carried(selection, selected_in, project))
        if is_other:
            self.take_changed.emit()
        self.project_changed.emit()
        self.state_changed.emit()
        if self._selection != before:
            self.selection_changed.emit()

    def compare_with(self, other: Project | None) -> None:
        """Overlay a second project, or none."""
        self._other = other
        self.other_changed.emit()

    def saved(self, path: Path, project: Project) -> None:
        """Note that a project is saved in a file.

        Parameters
        ----------
        path : Path
            The file.
        project : Project
            What was saved.
        """
        self._path, self._saved = path, project
        self.state_changed.emit()

    def show_frame(self, frame: int) -> None:
        """Show a frame; numbers beyond the take show its ends."""
        frame = min(max(int(frame), 0), max(self.n_frames - 1, 0))
        if frame != self._frame:
            self._frame = frame
            self.frame_changed.emit(frame)

    def select(self, selection: Selection) -> None:
        """Select something else."""
        selection = self._still_there(selection)
        self._selected_in = None if self._project is None else (selection, self._project)
        if selection != self._selection:
            self._selection = selection
            self.selection_changed.emit()

    def _still_there(self, selection: Selection) -> Selection:
        """The selection without what the project does not have."""
        project = self._project
        n_markers = project.trajectories.n_markers if project is not None and project.has("labels") else 0
        n_limbs = project.limbs.n_limbs if project is not None and project.has("limbs") else 0
        n_joints = project.topology.n_joints if project is not None and project.has("joints") else 0
        return Selection(
            frozenset(marker for marker in selection.markers if marker < n_markers),
            selection.limb if selection.limb is not None and selection.limb < n_limbs else None,
            selection.joint if selection.joint is not None and selection.joint < n_joints else None,
            point=selection.point,
        ).with_limbs(frozenset(limb for limb in selection.limbs if limb < n_limbs))


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
        """Show the changed project, with what was computed from it since; Qt also calls this at the change itself."""
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

        Where a calibrated skeleton labelled the take, they can only be taken back, as it labels the take again then.

        Parameters
        ----------
        project : Project
            The unsaved work.
        path : Path or None
            The project file that it came from.
        """
        states = [project]
        for _ in () if is_by_subject(project) else project.corrections:
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

    def take_back(self, index: int, after: Project | None = None) -> None:
        """Drop one of the project's corrections.

        Parameters
        ----------
        index : int
            Which of them.
        after : Project, optional
            The project without it, where its results were computed anew; by default they are dropped.
        """
        before = self._project()
        text = self.tr("take back: {0}").format(before.corrections[index].sentence)
        self._push(text, before, without_correction(before, index) if after is None else after)

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
