"""The question from which frame to which something holds."""

from __future__ import annotations

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFormLayout, QSpinBox, QWidget


class FramesDialog(QDialog):
    """First and last frame, both included.

    Parameters
    ----------
    parent : QWidget
        The window.
    title : str
        What the frames are for.
    proposed : tuple of int
        First and last frame to begin with.
    n_frames : int
        Of the take.
    """

    def __init__(self, parent: QWidget, title: str, proposed: tuple[int, int], n_frames: int) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.first, self.last = (self._box(value, n_frames) for value in proposed)
        self.first.setAccessibleName(self.tr("First frame"))
        self.last.setAccessibleName(self.tr("Last frame"))
        self.first.setToolTip(self.tr("The first frame in which it holds; at first the one that is shown"))
        self.last.setToolTip(self.tr("The last frame in which it holds, itself included"))
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel, self)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        self.first.valueChanged.connect(self.last.setMinimum)
        self.last.setMinimum(proposed[0])
        layout = QFormLayout(self)
        layout.addRow(self.tr("From frame"), self.first)
        layout.addRow(self.tr("to frame"), self.last)
        layout.addRow(buttons)

    def frames(self) -> tuple[int, int]:
        """Return what was chosen."""
        return self.first.value(), self.last.value()

    def _box(self, value: int, n_frames: int) -> QSpinBox:
        box = QSpinBox(self)
        box.setRange(0, n_frames - 1)
        box.setValue(value)
        return box


def ask_frames(
    parent: QWidget, title: str, proposed: tuple[int, int], n_frames: int
) -> tuple[int | None, int | None] | None:
    """Ask for frames; None if the user cancels, and None for an end that is the take's own."""
    dialog = FramesDialog(parent, title, proposed, n_frames)
    is_said = dialog.exec() == QDialog.DialogCode.Accepted
    first, last = dialog.frames()
    dialog.deleteLater()
    if not is_said:
        return None
    return first or None, None if last == n_frames - 1 else last
