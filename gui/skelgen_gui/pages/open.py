"""The first page: what is open, how to open something else, and identities that are known."""

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QLabel, QListWidget, QListWidgetItem, QPushButton, QWidget

from skelgen.app.corrections import with_identities
from skelgen.app.stage_summary import take_sentences
from skelgen.model import Project
from skelgen.progress import Monitor
from skelgen_gui.project.context import Context
from skelgen_gui.project.file_actions import SampleMenu
from skelgen_gui.widgets.layouts import column, put_texts, row_of, wrap
from skelgen_gui.widgets.painting import as_rich_text

_PATH = Qt.ItemDataRole.UserRole


class OpenPage(QWidget):
    """Open a recording or a project.

    Parameters
    ----------
    context : Context
        What pages are given.
    """

    def __init__(self, context: Context) -> None:
        super().__init__()
        self._context = context
        self.setObjectName("page-open")
        self.take = QLabel(self)
        self.notices = QLabel(self)
        self.browse = QPushButton(self.tr("Open a file…"), self)
        self.samples = QPushButton(self.tr("Open a sample"), self)
        self.identities = QPushButton(self.tr("Identities…"), self)
        self.recent = QListWidget(self)
        for label, name in ((self.take, self.tr("What is open")), (self.notices, self.tr("What the reader did"))):
            wrap(label, name)
        self.samples.setMenu(SampleMenu(context.files, self.samples))
        put_texts(self)
        invitation = QLabel(self.tr("Drop a recording or a project anywhere on this window, or"), self)
        wrap(invitation)
        buttons = row_of(self.browse, self.samples, self.identities, room=True)
        heading = QLabel(self.tr("Recent files"), self)
        layout = column(self, (invitation, buttons, self.take, self.notices, heading, self.recent))
        layout.setStretchFactor(self.recent, 1)
        context.session.project_changed.connect(self._follow)
        context.jobs.begun.connect(self._follow_jobs)
        context.jobs.ended.connect(self._follow_jobs)
        context.preferences.recent_changed.connect(self._follow_recent)
        self.browse.clicked.connect(context.files.choose)
        self.identities.clicked.connect(self._choose_identities)
        self.recent.itemActivated.connect(lambda item: context.files.open(item.data(_PATH)))
        self._follow()
        self._follow_recent()

    def _choose_identities(self) -> None:
        project = self._context.session.project
        name, _ = QFileDialog.getOpenFileName(
            self, self.tr("Identities"), self._context.runner.folder, self.tr("Identities (*.csv)")
        )
        if name and project is not None:
            self._read_identities(Path(name), project)

    def _read_identities(self, path: Path, project: Project) -> None:
        def work(monitor: Monitor) -> Project:
            monitor.begin("reading")
            return with_identities(project, path).before("labels")

        def done(changed: Project) -> None:
            self._context.document.change(self.tr("identities of {0}").format(path.name), changed)

        self._context.jobs.start(self.tr("Reading {0}").format(path.name), work, done, self._context.report_error)

    def _follow_jobs(self) -> None:
        """Enable what can be done now: one job at a time."""
        is_busy = self._context.jobs.is_busy
        self.browse.setEnabled(not is_busy)
        self.samples.setEnabled(not is_busy)
        self.identities.setEnabled(not is_busy and self._context.session.project is not None)

    def _follow(self) -> None:
        project = self._context.session.project
        self._follow_jobs()
        if project is None:
            self.take.setText(self.tr("Nothing is open. Help > First steps leads through a sample."))
            self.notices.clear()
            return
        self.take.setText("\n".join((project.name, *take_sentences(project.take))))
        self.notices.setText("\n".join(project.take.notices))

    def _follow_recent(self) -> None:
        self.recent.clear()
        for path in self._context.preferences.recent:
            item = QListWidgetItem(path.name, self.recent)
            item.setToolTip(as_rich_text(str(path)))
            item.setData(_PATH, path)
            if not path.exists():
                item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEnabled)
