"""Opening, saving and closing: nothing is lost, and every question is asked once; how recordings are read; samples."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFileDialog, QLabel, QMenu, QMessageBox, QWidget

from skelgen.app.files import NamedFile, file_filter, name_of_format, open_input, readable_formats
from skelgen.app.first_look import AdaptParameters, adapted
from skelgen.app.project_file.archive import SUFFIX, find_result, is_project_file, open_project, save_project
from skelgen.app.samples import SAMPLES, open_sample
from skelgen.errors import RecordingMovedError, SkelgenError
from skelgen.model import Project
from skelgen.parameters import ParameterValue
from skelgen.progress import Monitor
from skelgen_gui.model.view_state import ViewState
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.project.recovery import RecoveryEntry
from skelgen_gui.project.session import Document
from skelgen_gui.widgets.forms import ParameterForm, stage_form
from skelgen_gui.widgets.layouts import answer_buttons, column
from skelgen_gui.widgets.painting import as_rich_text
from skelgen_gui.widgets.preferences import Preferences

_WIDTH = 440  # px


@dataclass(frozen=True)
class Opening:
    """A file to open, and how to read it.

    Attributes
    ----------
    path : Path
        A recording or a project.
    options : mapping of str to value
        Of the format's reader.
    changes : AdaptParameters
        What of the take is changed after it was read.
    recording : Path or None
        Where the recording of a project is now, if it was moved.
    """

    path: Path
    options: Mapping[str, ParameterValue] = field(default_factory=dict)
    changes: AdaptParameters = field(default_factory=AdaptParameters)
    recording: Path | None = None

    def read(self, monitor: Monitor) -> Project:
        """Read it; runs on any thread."""
        if self.recording is not None:
            return open_project(find_result(self.path), self.recording)
        return adapted(open_input(NamedFile(self.path, options=self.options), monitor=monitor), self.changes)


class OpenDialog(QDialog):
    """Asks how a recording is to be read: options of its format, its part, rate, unit and axis.

    Signals
    -------
    chosen(Opening)
        The user wants it so.

    Parameters
    ----------
    path : Path
        A recording.
    parent : QWidget, optional
        Qt's parent.
    """

    chosen = Signal(object)

    def __init__(self, path: Path, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._path = path
        self.setWindowTitle(self.tr("Open {0}").format(path.name))
        self.setMinimumWidth(_WIDTH)
        known = {entry.name: entry for entry in readable_formats()}
        entry = None if is_project_file(path) else known[name_of_format(path)]
        declared = [option.declaration for option in entry.options if option.reading] if entry is not None else []
        self.changes = stage_form(AdaptParameters, self)
        self.reader = ParameterForm(declared, self)
        self.reader.setVisible(bool(declared))
        self.buttons = answer_buttons(self, QDialogButtonBox.StandardButton.Open)
        heading = QLabel("" if entry is None else self.tr("Read as {0}").format(entry.title), self)
        column(self, (heading, self.reader, self.changes, self.buttons))
        for form in (self.changes, self.reader):
            form.changed.connect(self._follow)

    def accept(self) -> None:
        """Open it so."""
        entered, defaults = self.reader.values(), self.reader.defaults
        options = {name: value for name, value in entered.items() if value != defaults[name]}
        self.chosen.emit(Opening(self._path, options, AdaptParameters.from_mapping(self.changes.values())))
        super().accept()

    def _follow(self) -> None:
        is_wrong = bool(self.changes.problem() or self.reader.problem())
        self.buttons.button(QDialogButtonBox.StandardButton.Open).setEnabled(not is_wrong)


Button = QMessageBox.StandardButton


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
        self._read(path, lambda monitor: open_input(path, monitor=monitor), self._document.session.compare_with)

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
