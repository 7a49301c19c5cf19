"""What every page is given, and the entry of a page in the table of pages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtWidgets import QWidget

from skelgen_gui.project.cameras import Cameras
from skelgen_gui.project.document import Document
from skelgen_gui.project.file_actions import FileActions
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.project.runner import Runner
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.preferences import Preferences

HOME = "open"
"""Key of the page that is shown first; those before it lead to it."""


@dataclass(frozen=True, eq=False)
class Context:
    """What pages read and change.

    Attributes
    ----------
    session : Session
        The open project, frame and selection.
    document : Document
        Changes the project.
    jobs : Jobs
        Long work.
    runner : Runner
        Runs stages.
    preferences : Preferences
        What is kept between runs.
    report_error : callable (error)
        Shows what went wrong.
    files : FileActions
        Opens recordings and projects.
    cameras : Cameras
        Knows which cameras took recordings.
    """

    session: Session
    document: Document
    jobs: Jobs
    runner: Runner
    preferences: Preferences
    report_error: Callable[[Exception], None]
    files: FileActions
    cameras: Cameras


@dataclass(frozen=True)
class PageEntry:
    """One page of the window.

    Attributes
    ----------
    key : str
        Name in project files and tests.
    title : str
        What the user reads, in English.
    tip : str
        One sentence on what it is for.
    make : callable (context) -> QWidget
        Builds it when it is first shown.
    stage : str
        The stage whose result it shows, or empty.
    """

    key: str
    title: str
    tip: str
    make: Callable[[Context], QWidget]
    stage: str = ""


def view_of(page: QWidget) -> QWidget | None:
    """Return the view that a page brings as its attribute ``view``, to take the middle of the window; None if none."""
    view = getattr(page, "view", None)
    return view if isinstance(view, QWidget) else None
