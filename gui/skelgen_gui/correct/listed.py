"""The list of corrections: every one can be taken back."""

from __future__ import annotations

from PySide6.QtWidgets import QCheckBox, QLabel, QListWidget, QPushButton, QVBoxLayout, QWidget

from skelgen_gui.correct.actions import CorrectionActions
from skelgen_gui.runner import Runner
from skelgen_gui.session import Session


class CorrectionList(QWidget):
    """What was corrected by hand.

    Parameters
    ----------
    session : Session
        Whose project is shown.
    actions : CorrectionActions
        Takes corrections back.
    runner : Runner
        Is told whether to compute at once.
    """

    def __init__(self, session: Session, actions: CorrectionActions, runner: Runner) -> None:
        super().__init__()
        self._session, self._actions, self._runner = session, actions, runner
        self.entries = QListWidget(self)
        self.entries.setWordWrap(True)
        self.hint = QLabel(self)
        self.hint.setWordWrap(True)
        self.hint.setText(self.tr("Select markers, a joint or a limb, then right click or choose Edit, Correct."))
        self.entries.setAccessibleName(self.tr("Corrections by hand"))
        self.entries.setToolTip(self.tr("What later runs obey"))
        self.take_back = QPushButton(self.tr("Take back"), self)
        self.take_back.setAccessibleName(self.tr("Take the chosen correction back"))
        self.take_back.setToolTip(self.take_back.accessibleName())
        self.at_once = QCheckBox(self.tr("Compute again at once"), self)
        self.at_once.setToolTip(self.tr("After a correction, run again the steps that had run before"))
        self.at_once.setAccessibleName(self.at_once.text())
        self.at_once.setChecked(runner.computes_at_once)
        layout = QVBoxLayout(self)
        for widget in (self.hint, self.entries, self.take_back, self.at_once):
            layout.addWidget(widget)
        session.project_changed.connect(self._follow)
        self.entries.currentRowChanged.connect(self._follow_row)
        self.take_back.clicked.connect(self._take_back)
        self.at_once.toggled.connect(self._set_at_once)
        self._follow()

    def _follow(self) -> None:
        project = self._session.project
        self.entries.clear()
        self.entries.addItems([] if project is None else [one.sentence for one in project.corrections])
        self.hint.setVisible(not self.entries.count())
        self._follow_row(self.entries.currentRow())

    def _follow_row(self, row: int) -> None:
        self.take_back.setEnabled(row >= 0)

    def _take_back(self) -> None:
        if self.entries.currentRow() >= 0:
            self._actions.take_back(self.entries.currentRow())

    def _set_at_once(self, is_wanted: bool) -> None:
        self._runner.computes_at_once = is_wanted
