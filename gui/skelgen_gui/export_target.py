"""Where an export goes: a folder and the beginning of the files' names."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QStandardPaths, Signal
from PySide6.QtWidgets import QFileDialog, QGridLayout, QLabel, QLineEdit, QPushButton, QWidget


class ExportTarget(QWidget):
    """A folder and a name.

    Signals
    -------
    changed()
        Another folder or name.
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        documents = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.DocumentsLocation)
        self.folder_line = QLineEdit(documents, self)
        self.name_line = QLineEdit(self)
        self.browse = QPushButton(self.tr("Browse…"), self)
        self._lay_out()
        self.folder_line.textChanged.connect(self.changed)
        self.name_line.textChanged.connect(self.changed)
        self.browse.clicked.connect(self._browse)

    @property
    def folder(self) -> Path:
        """The folder."""
        return Path(self.folder_line.text()).expanduser()

    @property
    def name(self) -> str:
        """The beginning of the files' names."""
        return self.name_line.text()

    def suggest(self, folder: Path | None, name: str) -> None:
        """Show the place of another project; None keeps the folder that is shown."""
        if folder is not None:
            self.folder_line.setText(str(folder))
        self.name_line.setText(name)

    def _lay_out(self) -> None:
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        for row, (text, line, tip) in enumerate(
            (
                (self.tr("Folder"), self.folder_line, self.tr("Where the files go; it is made if it is not there")),
                (self.tr("Name"), self.name_line, self.tr("Beginning of the files' names")),
            )
        ):
            label = QLabel(text, self)
            label.setBuddy(line)
            line.setAccessibleName(text)
            line.setToolTip(tip)
            grid.addWidget(label, row, 0)
            grid.addWidget(line, row, 1, 1, 1 if line is self.folder_line else 2)
        self.browse.setToolTip(self.tr("Choose the folder"))
        grid.addWidget(self.browse, 0, 2)

    def _browse(self) -> None:
        chosen = QFileDialog.getExistingDirectory(self, self.tr("Folder of the export"), self.folder_line.text())
        if chosen:
            self.folder_line.setText(chosen)
