"""Autosave, and what a crash left behind: the open project is kept beside the user's files while it has changes.

Each window writes into a folder of its own below the application's data folder: the project, and a note of whose it is.
A clean end removes it; what a later window finds without a living process belongs to a window that crashed.
"""

import json
import os
import shutil
import threading
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QObject, QStandardPaths, QTimer, Signal

from skelgen.app.project_file.archive import open_project, save_project
from skelgen.errors import SkelgenError
from skelgen.files import replacing
from skelgen.model import Project
from skelgen_gui.model.view_state import ViewState
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.preferences import Preferences

_PROJECT, _NOTE = "project.skelgen", "note.json"


@dataclass(frozen=True)
class RecoveryEntry:
    """Unsaved work of a window that crashed.

    Attributes
    ----------
    folder : Path
        Where it is.
    name : str
        Of the take.
    path : Path or None
        The project file that it was opened from, if any.
    when : datetime
        When it was kept.
    """

    folder: Path
    name: str
    path: Path | None
    when: datetime

    def project(self) -> Project:
        """Read the project; raises `FormatError` if it is damaged."""
        return open_project(self.folder / _PROJECT)

    def forget(self) -> None:
        """Remove it."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _recovery_folder() -> Path:
    """Return the folder in which windows keep their projects."""
    base = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.AppLocalDataLocation)
    return Path(base) / "recovery"


def find_recovery_entries(folder: Path | None = None) -> tuple[RecoveryEntry, ...]:
    """Return the unsaved work of windows whose process ended, the newest first."""
    folder = folder or _recovery_folder()
    found = []
    for each in sorted(folder.glob("*/")) if folder.is_dir() else ():
        try:
            note = json.loads((each / _NOTE).read_text(encoding="utf-8"))
            path = Path(note["path"]) if note["path"] else None
            when = datetime.fromisoformat(note["time"]).replace(tzinfo=None)  # times with and without do not compare
            entry = RecoveryEntry(each, str(note["name"]), path, when)
            is_alive = _is_alive(int(note["process"]))
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
            continue  # being written just now, or not ours
        if not is_alive and (each / _PROJECT).is_file():
            found.append(entry)
    return tuple(sorted(found, key=lambda entry: entry.when, reverse=True))


class Autosave(QObject):
    """Keeps the session's project while it has unsaved changes.

    Parameters
    ----------
    session : Session
        Holds the project.
    preferences : Preferences
        Determine how often.
    folder : Path, optional
        Where all windows keep theirs.
    parent : QObject, optional
        Owner.
    view_state : callable () -> ViewState, optional
        What the window shows, which is kept with the project.

    Signals
    -------
    failed(str)
        The project cannot be kept, and why; emitted once, until it can be kept again.
    """

    failed = Signal(str)
    _tried = Signal(object, str)

    def __init__(
        self,
        session: Session,
        preferences: Preferences,
        folder: Path | None = None,
        parent: QObject | None = None,
        *,
        view_state: Callable[[], ViewState] | None = None,
    ) -> None:
        super().__init__(parent)
        self._session, self._view_state = session, view_state
        self._folder = (folder or _recovery_folder()) / f"{os.getpid()}-{id(self):x}"
        self._kept: Project | None = None
        self._inherited: list[RecoveryEntry] = []
        self._problem = ""
        self._thread: threading.Thread | None = None
        self._preferences = preferences
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.save)
        self._tried.connect(self._note)
        preferences.changed.connect(self._follow)
        session.state_changed.connect(self._drop_what_is_saved)
        self._follow()

    def save(self) -> None:
        """Keep the project now, on a thread of its own, if it has changes that are not kept yet."""
        project = self._session.project
        self._drop_what_is_saved()
        if self._thread is not None and self._thread.is_alive():
            return
        if project is None or not self._session.is_dirty or project is self._kept:
            return
        shown = project if self._view_state is None else self._view_state().kept_in(project)
        self._thread = threading.Thread(target=self._keep, args=(project, shown, self._session.path))
        self._thread.start()

    def take_over(self, entry: RecoveryEntry) -> None:
        """Save the restored project, which is open now, and then remove the file that it was restored from."""
        self._inherited.append(entry)
        self.save()

    def _drop_what_is_saved(self) -> None:
        """Remove what was kept once the user has saved, so that no older state is offered for recovery."""
        is_writing = self._thread is not None and self._thread.is_alive()  # that is not waited for: the next look does
        if self._kept is not None and not self._session.is_dirty and not is_writing:
            self._kept = None
            self._remove()

    def _follow(self) -> None:
        seconds = self._preferences.values.autosave
        if seconds:
            self._timer.start(1000 * seconds)
        else:
            self._timer.stop()

    def _keep(self, project: Project, shown: Project, path: Path | None) -> None:
        now, place = datetime.now().isoformat(), str(path or "")
        note = {"name": project.name, "path": place, "time": now, "process": os.getpid()}
        problem = ""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            save_project(shown, self._folder / _PROJECT)
            with replacing(self._folder / _NOTE) as temporary:
                temporary.write_text(json.dumps(note), encoding="utf-8")
        except (OSError, SkelgenError) as error:
            problem = str(error)
        self._tried.emit(project, problem)

    def _note(self, project: Project, problem: str) -> None:
        """Note whether a project is kept; a full disk does not stop the work, and is tried again."""
        if problem and not self._problem:
            self.failed.emit(self.tr("Unsaved work cannot be kept: {0}").format(problem))
        self._problem = problem
        if not problem:
            self._kept = project
            self._forget_inherited()

    def wait(self) -> None:
        """Wait for what is being written."""
        if self._thread is not None:
            self._thread.join()

    def leave(self) -> None:
        """Wait until the copy is written, and leave it to the next window."""
        self._timer.stop()
        self.wait()
        if (self._folder / _NOTE).is_file():
            self._forget_inherited()

    def end(self) -> None:
        """Wait until the copy is written, and delete it: it is not needed any more."""
        self._timer.stop()
        self._remove()
        self._forget_inherited()

    def _remove(self) -> None:
        self.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _forget_inherited(self) -> None:
        for entry in self._inherited:
            entry.forget()
        self._inherited.clear()


def _is_alive(process: int) -> bool:
    if process <= 0:  # which would stand for many processes
        raise ValueError(f"{process} is no process")
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
