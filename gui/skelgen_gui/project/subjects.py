"""The open take is labelled and posed by the skeleton of another take of the same body."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from skelgen.app.configuration import Settings
from skelgen.app.project_file.archive import SUFFIX
from skelgen.model import Project
from skelgen.progress import Monitor
from skelgen_gui.project.context import Runner
from skelgen_gui.project.document import Document
from skelgen_gui.project.jobs import Jobs


class SubjectActions(QObject):
    """Applies calibrated skeletons.

    Parameters
    ----------
    document : Document
        Whose take is labelled and posed.
    jobs : Jobs
        Where.
    runner : Runner
        Knows the parameters that were entered.
    report_error : callable (error)
        Shows what went wrong.
    window : QWidget
        Parent of the dialog.

    Signals
    -------
    applied()
        The take has the skeleton of another one.
    """

    applied = Signal()

    def __init__(
        self,
        document: Document,
        jobs: Jobs,
        runner: Runner,
        report_error: Callable[[Exception], None],
        window: QWidget,
    ) -> None:
        super().__init__(window)
        self._document, self._jobs, self._runner = document, jobs, runner
        self._report_error, self._window = report_error, window

    def choose(self) -> None:
        """Ask for the project of another take, and apply its skeleton."""
        kinds = self.tr("Projects (*{0})").format(SUFFIX)
        title = self.tr("Skeleton of another take")
        names, _ = QFileDialog.getOpenFileNames(self._window, title, self._runner.folder, kinds)
        if names:
            self.apply([Path(name) for name in names])

    def apply(self, paths: list[Path]) -> None:
        """Label and pose the open take by skeletons, one for each body that it shows."""
        project = self._document.session.project
        if project is None:
            return
        values = {stage: self._runner.values(stage) for stage in ("labels", "skeleton")}

        def work(monitor: Monitor) -> Project:
            from skelgen.app.subject import known_bodies, run_with_subject  # noqa: PLC0415 - loads the stages

            settings = Settings({stage: entered for stage, entered in values.items() if entered})
            return run_with_subject(project, known_bodies(paths), settings=settings, monitor=monitor)

        def done(result: Project) -> None:
            if self._document.session.project is project:  # else it was changed meanwhile
                called = ", ".join(path.stem for path in paths)
                self._document.change(self.tr("skeleton of {0}").format(called), result)
                self.applied.emit()

        self._jobs.start(self.tr("Skeleton of another take"), work, done, self._report_error)
