"""What the open take gets from other files: the skeleton of another take of the same body, and the parameters of all
stages from a ``config.xml``, which are also saved to one or set back.
"""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from skelgen.app.configuration import Settings, write_settings
from skelgen.app.project_file.archive import SUFFIX
from skelgen.errors import SkelgenError
from skelgen.model import Project
from skelgen.model.project import STAGES
from skelgen.progress import Monitor
from skelgen_gui.project.context import Runner
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.project.session import Document


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
        self, document: Document, jobs: Jobs, runner: Runner, report_error: Callable[[Exception], None], window: QWidget
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
            from skelgen.app.subject import joined_subjects, run_with_subject  # noqa: PLC0415 - loads the stages

            settings = Settings({stage: entered for stage, entered in values.items() if entered})
            return run_with_subject(project, joined_subjects(paths), settings=settings, monitor=monitor)

        def done(result: Project) -> None:
            if self._document.session.project is project:  # else it was changed meanwhile
                called = ", ".join(path.stem for path in paths)
                self._document.change(self.tr("skeleton of {0}").format(called), result)
                self.applied.emit()

        self._jobs.start(self.tr("Skeleton of another take"), work, done, self._report_error)


_PROPOSED = "config.xml"


class ParameterFiles(QObject):
    """Loads and saves the parameters of all forms.

    Parameters
    ----------
    runner : Runner
        Holds the parameters.
    report_error : callable (error)
        Shows what went wrong.
    window : QWidget
        Parent of questions.

    Signals
    -------
    noticed(str)
        What a file chose, or sets without an effect.
    """

    noticed = Signal(str)

    def __init__(self, runner: Runner, report_error: Callable[[Exception], None], window: QWidget) -> None:
        super().__init__(window)
        self._runner, self._report_error, self._window = runner, report_error, window

    @property
    def _proposed(self) -> str:
        return str(Path(self._runner.folder) / _PROPOSED)

    def choose(self) -> None:
        """Ask for a file, and load it."""
        name, _ = QFileDialog.getOpenFileName(self._window, self.tr("Load parameters"), self._proposed, self._kinds)
        if name:
            self.load(Path(name))

    def load(self, path: Path) -> None:
        """Show the parameters of a file in all forms; what it does not mention takes its default."""
        try:
            settings = Settings(path)
        except SkelgenError as error:
            self._report_error(error)
            return
        self._runner.begin_with({stage: settings.of(stage).as_mapping() for stage in STAGES})
        for sentence in settings.all_notices():
            self.noticed.emit(sentence)

    def save_as(self) -> None:
        """Ask for a file, and save the parameters of all forms there."""
        name, _ = QFileDialog.getSaveFileName(self._window, self.tr("Save parameters"), self._proposed, self._kinds)
        if name:
            self.save(Path(name))

    def save(self, path: Path) -> None:
        """Write the parameters that the next run takes."""
        try:
            write_settings(Settings({stage: self._runner.values(stage) for stage in STAGES}), path)
        except SkelgenError as error:
            self._report_error(error)

    def clear(self) -> None:
        """Set all forms back to the defaults."""
        self._runner.begin_with({stage: Settings().of(stage).as_mapping() for stage in STAGES})

    @property
    def _kinds(self) -> str:
        return self.tr("Parameters (*.xml)")
