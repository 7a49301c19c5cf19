"""Opening, saving and closing: nothing is lost, and every question is asked once. With the menu of recent files."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QFileDialog, QMenu, QMessageBox, QWidget

from skelgen.app.files import file_filter, open_input
from skelgen.app.project_file.archive import SUFFIX, is_project_file, save_project
from skelgen.app.samples import SAMPLES, open_sample
from skelgen.errors import RecordingMovedError, SkelgenError
from skelgen.model import Project
from skelgen.progress import Monitor
from skelgen_gui.model.view_state import ViewState
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.project.opening import OpenDialog, Opening
from skelgen_gui.project.recovery import RecoveryEntry
from skelgen_gui.project.session import Document
from skelgen_gui.widgets.painting import as_rich_text
from skelgen_gui.widgets.preferences import Preferences

Button = QMessageBox.StandardButton

_WITH_DIGIT = 9  # entries that a digit key chooses


class FileActions(QObject):
    """Opens and saves the document.

    Parameters
    ----------
    document : Document
        What is opened and saved.
    jobs : Jobs
        Reads and writes.
    preferences : Preferences
        Remembers files.
    view_state : callable () -> ViewState
        What the window shows, for the project file.
    report_error : callable (error)
        Shows what went wrong.
    window : QWidget
        Parent of questions.

    Signals
    -------
    opened(object)
        A project was opened.
    restored(object)
        The unsaved work of a window that crashed is open now.
    saved(str)
        The project was saved, and where, as a sentence.
    """

    opened = Signal(object)
    restored = Signal(object)
    saved = Signal(str)

    def __init__(
        self,
        document: Document,
        jobs: Jobs,
        preferences: Preferences,
        view_state: Callable[[], ViewState],
        report_error: Callable[[Exception], None],
        window: QWidget,
    ) -> None:
        super().__init__(window)
        self._document, self._jobs, self._preferences = document, jobs, preferences
        self._view_state, self._report_error, self._window = view_state, report_error, window

    @property
    def has_unsaved_work(self) -> bool:
        """Whether unsaved work would be lost; a recording without results can be opened again."""
        project, is_dirty = self._document.session.project, self._document.session.is_dirty
        return is_dirty and project is not None and bool(project.reports or project.corrections or project.identities)

    def open(self, path: Path) -> None:
        """Open a recording or a project, after asking whether to save changes."""
        if self._jobs.is_busy:
            return
        self._after_saving(lambda: self._begin(Opening(path)))

    def open_sample(self, key: str) -> None:
        """Open a take that the simulation makes, after asking whether to save changes."""

        def done(project: Project) -> None:
            self._document.open(project)
            self.opened.emit(project)

        if not self._jobs.is_busy:
            self._after_saving(lambda: self._read(Path(key), lambda _: open_sample(key), done))

    def choose_with_options(self) -> None:
        """Ask for a recording and how it is to be read, and open it."""
        path = self._asked(self.tr("Open with options"))
        if path is None or self._jobs.is_busy:
            return
        try:
            dialog = OpenDialog(path, self._window)
        except SkelgenError as error:
            self._report_error(error)
            return
        dialog.chosen.connect(lambda opening: self._after_saving(lambda: self._begin(opening)))
        dialog.open()

    def choose(self) -> None:
        """Ask for a recording or a project, and open it."""
        path = self._asked(self.tr("Open"))
        if path is not None:
            self.open(path)

    def choose_other(self) -> None:
        """Ask for a second result, and overlay it."""
        path = self._asked(self.tr("Compare with"))
        if path is not None:
            self.compare(path)

    def compare(self, path: Path) -> None:
        """Overlay the result of another project."""
        self._read(path, partial(_opened, path), self._document.session.compare_with)

    def restore(self, entry: RecoveryEntry) -> None:
        """Open the unsaved work of a window that crashed; it stays unsaved until the user saves it."""

        def done(project: Project) -> None:
            self._document.restore(project, entry.path)
            self.opened.emit(project)
            self.restored.emit(entry)

        self._read(entry.folder, lambda _: entry.project(), done)

    def save(self, then: Callable[[], None] | None = None) -> None:
        """Save in the project's file; ask for one if there is none."""
        path = self._document.session.path
        if path is None:
            self.save_as(then)
        else:
            self._write(path, then)

    def save_as(self, then: Callable[[], None] | None = None) -> None:
        """Ask for a file, and save there."""
        project = self._document.session.project
        if project is None:
            return
        folder = self._document.session.folder or Path()
        proposed = str(folder / Path(project.name or "take").with_suffix(SUFFIX))
        title, kinds = self.tr("Save the project"), self.tr("Projects (*{0})").format(SUFFIX)
        name, _ = QFileDialog.getSaveFileName(self._window, title, proposed, kinds)
        if name:
            path = Path(name)
            self._write(path if path.suffix.lower() == SUFFIX else path.with_name(path.name + SUFFIX), then)

    def close(self, then: Callable[[], None]) -> None:
        """Ask whether to stop running work and to save changes, then close."""
        if self._jobs.is_busy:
            question = self.tr("Something is still running. Stop it and close?")
            if QMessageBox.question(self._window, self.tr("Close"), question) != Button.Yes:
                return
            self._jobs.stop()
        self._after_saving(then)

    def _after_saving(self, then: Callable[[], None]) -> None:
        session = self._document.session
        if not self.has_unsaved_work:
            then()
            return
        question = as_rich_text(
            self.tr("Save the changes of {0}?").format(session.project.name if session.project else "")
        )
        buttons = Button.Save | Button.Discard | Button.Cancel
        answer = QMessageBox.question(self._window, self.tr("Unsaved changes"), question, buttons, Button.Save)
        if answer == Button.Save:
            self.save(then)
        elif answer == Button.Discard:
            then()

    def _asked(self, title: str) -> Path | None:
        folder = self._document.session.folder
        if folder is None:
            folder = next((path.parent for path in self._preferences.recent if path.parent.is_dir()), None)
        name, _ = QFileDialog.getOpenFileName(self._window, title, str(folder or ""), file_filter())
        return Path(name) if name else None

    def _begin(self, opening: Opening) -> None:
        path = opening.path

        def done(project: Project) -> None:
            self._document.open(project, path if is_project_file(path) else None)
            self._preferences.remember(path)
            self.opened.emit(project)

        def failed(error: Exception) -> None:
            recording = self._located(error) if isinstance(error, RecordingMovedError) else None
            if recording is None:
                self._report_error(error)
            else:
                self._begin(replace(opening, recording=recording))

        self._read(path, opening.read, done, failed)

    def _located(self, error: RecordingMovedError) -> Path | None:
        """Ask where the recording of a project is now."""
        question = as_rich_text(self.tr("{0}\n\nLocate the recording?").format(error))
        if QMessageBox.question(self._window, self.tr("The recording was moved"), question) != Button.Yes:
            return None
        return self._asked(self.tr("Locate the recording"))

    def _read(
        self,
        path: Path,
        read: Callable[[Monitor], Project],
        done: Callable[[Project], None],
        failed: Callable[[Exception], None] | None = None,
    ) -> None:
        def work(monitor: Monitor) -> Project:
            monitor.begin("reading")
            return read(monitor)

        self._jobs.start(self.tr("Reading {0}").format(path.name), work, done, failed or self._report_error)

    def _write(self, path: Path, then: Callable[[], None] | None) -> None:
        project = self._document.session.project
        if project is None:
            return
        shown = self._view_state().kept_in(project)
        embed = self._preferences.values.embed or project.source is None  # a sample is in no other file

        def work(monitor: Monitor) -> Path:
            monitor.begin("saving")
            return save_project(shown, path, embed=embed)

        def done(saved: Path) -> None:
            self._document.session.saved(saved, project)
            self._preferences.remember(saved)
            self.saved.emit(self.tr("Saved: {0}").format(saved))
            if then is not None:
                then()

        self._jobs.start(self.tr("Saving {0}").format(path.name), work, done, self._report_error)


def _opened(path: Path, monitor: Monitor) -> Project:
    return open_input(path, monitor=monitor)


class SampleMenu(QMenu):
    """Takes that the simulation makes, to begin with.

    Parameters
    ----------
    files : FileActions
        Opens them.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, files: FileActions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setTitle(self.tr("Open a sam&ple"))
        self.setToolTipsVisible(True)
        for sample in SAMPLES:
            action = self.addAction(self.tr(sample.title), partial(files.open_sample, sample.key))
            action.setToolTip(self.tr(sample.about))
            action.setStatusTip(action.toolTip())


class RecentMenu(QMenu):
    """Recent files, the last one first.

    Signals
    -------
    chosen(Path)
        The user wants this file.

    Parameters
    ----------
    preferences : Preferences
        Knows the files.
    parent : QWidget, optional
        Qt's parent.
    """

    chosen = Signal(object)

    def __init__(self, preferences: Preferences, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._preferences = preferences
        self.setTitle(self.tr("Open &recent"))
        self.setToolTipsVisible(True)
        self.aboutToShow.connect(self.fill)
        self.triggered.connect(self._choose)
        preferences.recent_changed.connect(self.fill)
        self.fill()

    def fill(self) -> None:
        """List the files as they are now."""
        self.clear()
        recent = self._preferences.recent
        for number, path in enumerate(recent, start=1):
            self.addAction(self._entry(number, path))
        self.addSeparator()
        clear = self.addAction(self.tr("&Clear this list"))
        clear.setToolTip(self.tr("Forget these names; the files stay"))
        clear.setEnabled(bool(recent))
        self.menuAction().setEnabled(bool(recent))

    def _entry(self, number: int, path: Path) -> QAction:
        name = path.name.replace("&", "&&")  # a single one would mark a key
        entry = QAction(f"&{number} {name}" if number <= _WITH_DIGIT else name, self)
        is_there = path.exists()
        entry.setEnabled(is_there)
        entry.setToolTip(as_rich_text(str(path) if is_there else self.tr("{0}: no longer there").format(path)))
        entry.setData(path)
        return entry

    def _choose(self, entry: QAction) -> None:
        path = entry.data()
        if isinstance(path, Path):
            self.chosen.emit(path)
        else:
            self._preferences.forget_recent()
