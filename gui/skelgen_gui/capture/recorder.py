"""The row that records: a file, a button that begins and ends, and one that opens what was recorded."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFileDialog, QGridLayout, QLineEdit, QPushButton, QWidget

_NUMBERED = re.compile(r"(.*)-(\d+)")
_SUFFIX = ".mfml"


class RecordRow(QWidget):
    """Says into which file is recorded.

    Signals
    -------
    changed(object)
        Another file shall be recorded, a path; or none, None.
    open_wanted(object)
        The recording at this path shall be opened.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    changed = Signal(object)
    open_wanted = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.line, self.browse = QLineEdit(str(Path.home() / f"capture{_SUFFIX}"), self), QPushButton(self)
        self.record, self.open = QPushButton(self.tr("● Record"), self), QPushButton(self)
        self.recorded: Path | None = None
        self._describe()
        layout = QGridLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.line, 0, 0)
        layout.addWidget(self.browse, 0, 1)
        layout.addWidget(self.open, 1, 0)
        layout.addWidget(self.record, 1, 1)
        self.browse.clicked.connect(self._choose)
        self.record.toggled.connect(self._switch)
        self.open.clicked.connect(self._open)

    @property
    def target(self) -> Path | None:
        """The file that shall be recorded; None if nothing shall."""
        return Path(self.line.text()) if self.record.isChecked() else None

    def stop(self) -> None:
        """Record no more."""
        self.record.setChecked(False)

    def keep(self, recorded: Path | None) -> None:
        """Note what was recorded last, so that it can be opened."""
        self.recorded = recorded
        self.open.setEnabled(recorded is not None)

    def set_running(self, is_running: bool) -> None:
        """Follow whether something is captured, which alone can be recorded; what is recorded opens when it ended."""
        self.record.setEnabled(is_running)
        self.open.setEnabled(not is_running and self.recorded is not None)

    def _describe(self) -> None:
        tip = self.tr(".mfml keeps all points without names, .c3d the balls of the bodies with theirs")
        self.line.setAccessibleName(self.tr("File to record"))
        self.line.setToolTip(tip)
        self.browse.setText(self.tr("Choose…"))
        self.browse.setAccessibleName(self.tr("Choose the file to record"))
        self.browse.setToolTip(tip)
        self.record.setCheckable(True)
        self.record.setEnabled(False)
        self.record.setAccessibleName(self.tr("Record"))
        self.record.setToolTip(self.tr("Record while capturing; a file that is there is never overwritten"))
        self.open.setText(self.tr("Open this recording"))
        self.open.setEnabled(False)
        self.open.setAccessibleName(self.open.text())
        self.open.setToolTip(self.tr("Go on to markers, limbs, joints and skeleton with what was recorded"))

    def _choose(self) -> None:
        title, kinds = self.tr("Record into"), self.tr("Recordings (*.mfml *.c3d)")
        name, _ = QFileDialog.getSaveFileName(self, title, self.line.text(), kinds)
        if name:
            path = Path(name)
            self.line.setText(str(path if path.suffix else path.with_suffix(_SUFFIX)))

    def _switch(self, is_on: bool) -> None:
        if is_on:
            self.line.setText(str(free_path(Path(self.line.text()))))
        self.line.setEnabled(not is_on)
        self.browse.setEnabled(not is_on)
        self.record.setText(self.tr("■ End recording") if is_on else self.tr("● Record"))
        self.changed.emit(self.target)

    def _open(self) -> None:
        if self.recorded is not None:
            self.open_wanted.emit(self.recorded)


def free_path(path: Path) -> Path:
    """Return a path, or the next one with a number behind its name that is not there yet."""
    while path.exists():
        match = _NUMBERED.fullmatch(path.stem)
        stem, number = (match[1], int(match[2])) if match is not None else (path.stem, 1)
        path = path.with_stem(f"{stem}-{number + 1}")
    return path
