"""The dialog that opens a recording: as its file says, with options, or from the place to which it was moved."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QLabel, QWidget

from skelgen.app.files import NamedFile, name_of_format, open_input, readable_formats
from skelgen.app.first_look import AdaptParameters, adapted
from skelgen.app.project_file.archive import find_result, is_project_file, open_project
from skelgen.model import Project
from skelgen.parameters import ParameterValue
from skelgen.progress import Monitor
from skelgen_gui.widgets.forms import ParameterForm, stage_form
from skelgen_gui.widgets.layouts import answer_buttons, column

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
