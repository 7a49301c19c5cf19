"""The line below: what is running, how far it is, and how to stop it."""

from __future__ import annotations

from PySide6.QtWidgets import QProgressBar, QPushButton, QStatusBar, QWidget

from skelgen_gui.project.jobs import Jobs
from skelgen_gui.widgets.layouts import describe

_PERCENT = 100
_NOTICE_MS = 8000


class StatusLine(QStatusBar):
    """Follows jobs.

    Parameters
    ----------
    jobs : Jobs
        What runs.
    parent : QWidget, optional
        The window.
    """

    def __init__(self, jobs: Jobs, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.progress, self.cancel = QProgressBar(self), QPushButton(self.tr("Cancel"), self)
        self.progress.setMaximumWidth(240)
        self.progress.setRange(0, _PERCENT)
        describe(self.progress, self.tr("Progress"), self.tr("How much of what is running is done"))
        describe(self.cancel, self.tr("Cancel what is running"))
        for widget in (self.progress, self.cancel):
            self.addPermanentWidget(widget)
            widget.hide()
        self.cancel.clicked.connect(jobs.cancel)
        jobs.begun.connect(self._begin)
        jobs.progressed.connect(self._advance)
        jobs.noticed.connect(self.notice)
        jobs.ended.connect(self._end)

    def _begin(self, title: str) -> None:
        self.progress.setValue(0)
        self.progress.show()
        self.cancel.show()
        self.showMessage(title)

    def _advance(self, name: str, share: float) -> None:
        self.progress.setValue(round(_PERCENT * share))
        self.showMessage(name)

    def notice(self, sentence: str) -> None:
        """Show a sentence for a while."""
        self.showMessage(sentence, _NOTICE_MS)

    def _end(self) -> None:
        self.progress.hide()
        self.cancel.hide()
        self.clearMessage()
