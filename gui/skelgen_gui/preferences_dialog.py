"""The dialog in which preferences are changed; the form is generated from their declarations."""

from __future__ import annotations

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QVBoxLayout, QWidget

from skelgen_gui.forms import stage_form
from skelgen_gui.preferences import Preferences, Wanted

_WIDTH = 420  # px: the help fits into its lines


class PreferencesDialog(QDialog):
    """Changes preferences when it is accepted.

    Parameters
    ----------
    preferences : Preferences
        What is changed.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, preferences: Preferences, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._preferences = preferences
        self.form = stage_form(Wanted, self)
        self.buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel, parent=self
        )
        self.setWindowTitle(self.tr("Preferences"))
        self.setMinimumWidth(_WIDTH)
        layout = QVBoxLayout(self)
        layout.addWidget(self.form)
        layout.addWidget(self.buttons)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)
        self.form.changed.connect(self._follow)
        self.form.set_values(preferences.values.as_mapping())

    def accept(self) -> None:
        """Keep what is entered."""
        self._preferences.change(Wanted.from_mapping(self.form.values()))
        super().accept()

    def _follow(self) -> None:
        self.buttons.button(QDialogButtonBox.StandardButton.Ok).setEnabled(not self.form.problem())
