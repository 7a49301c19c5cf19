"""Parameters of all stages as a ``config.xml``: loaded into the forms, saved from them, or set back."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from skelgen.app.configuration import Settings, write_settings
from skelgen.errors import SkelgenError
from skelgen.model.project import STAGES
from skelgen_gui.project.context import Runner

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
