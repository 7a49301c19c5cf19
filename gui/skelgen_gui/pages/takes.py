"""The page of many takes: a list of them, one skeleton for all or each its own, results to open, and their page."""

from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QObject, QUrl
from PySide6.QtGui import QDesktopServices, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QComboBox, QFileDialog, QLabel, QLineEdit, QPushButton, QTableView, QWidget

from skelgen.app.files import file_filter
from skelgen.app.project_file.archive import SUFFIX
from skelgen.progress import Monitor
from skelgen_gui.project.context import Context
from skelgen_gui.widgets.fields import choose_button
from skelgen_gui.widgets.layouts import (
    Index,
    Role,
    RowModel,
    choose_by_rows,
    column,
    fit_columns,
    put_texts,
    row_of,
    wrap,
)

_OWN, _OF_PROJECT = "own", "project"


@dataclass(frozen=True)
class _Row:
    """A take of a batch, and its outcome."""

    path: Path
    outcome: str = ""
    length: str = ""
    residual: str = ""
    tip: str = ""
    result: Path | None = None


class _TakesModel(RowModel[_Row]):
    """Takes as rows."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        names = self.tr("Take"), self.tr("State"), self.tr("Length"), self.tr("Residual")
        self.heads = [(name, None) for name in names]

    def data(self, index: Index, role: int = Role.DisplayRole) -> object:
        """Return what a cell shows."""
        row = self.rows[index.row()]
        if role == Role.DisplayRole:
            return (row.path.name, row.outcome, row.length, row.residual)[index.column()]
        return (row.tip or str(row.path)) if role == Role.ToolTipRole else None


class TakesPage(QWidget):
    """Runs all steps on many takes, and opens what came of them.

    Parameters
    ----------
    context : Context
        What pages are given.
    """

    def __init__(self, context: Context) -> None:
        super().__init__()
        self._context = context
        self.setObjectName("page-takes")
        self.setAcceptDrops(True)
        self.add, self.remove = QPushButton(self), QPushButton(self)
        self.takes, self.table = _TakesModel(self), QTableView(self)
        self.skeleton, self.subject, self.folder = QComboBox(self), QLineEdit(self), QLineEdit(self)
        title, kinds = self.tr("Project with the skeleton"), self.tr("Projects (*{0})").format(SUFFIX)
        self._browse_subject = choose_button(self.subject, title, kinds, lambda: context.runner.folder)
        self._browse = choose_button(self.folder, self.tr("Folder of the results"))
        self.go, self.open, self.compare, self.show_page = (QPushButton(self) for _ in range(4))
        self.status = QLabel(self)
        self._page: Path | None = None
        self._describe()
        where = QLabel(self.tr("Results go into the folder"), self)
        self._with = row_of(self.subject, self._browse_subject)
        parts = (row_of(self.add, self.remove), self.table, self.skeleton, self._with, where)
        ends = (row_of(self.folder, self._browse), self.go, self.status)
        column(self, (*parts, *ends, row_of(self.open, self.compare, self.show_page))).setStretchFactor(self.table, 1)
        self._connect()
        self._follow()

    def _describe(self) -> None:
        self.table.setModel(self.takes)
        choose_by_rows(self.table)
        fit_columns(self.table.horizontalHeader(), 1)
        self.skeleton.addItem(self.tr("Each take finds its own skeleton"), _OWN)
        self.skeleton.addItem(self.tr("All take the skeleton of a project"), _OF_PROJECT)
        self.subject.setPlaceholderText(self.tr("project file, {0}").format(SUFFIX))
        wrap(self.status, self.tr("What became of the takes"))
        put_texts(self)

    def _connect(self) -> None:
        self.add.clicked.connect(self._choose_takes)
        self.remove.clicked.connect(self._remove)
        self.go.clicked.connect(self.run)
        self.open.clicked.connect(self._open)
        self.table.activated.connect(self._open)
        self.compare.clicked.connect(self._compare)
        self.show_page.clicked.connect(self._show_page)
        for signal in (self.skeleton.currentIndexChanged, self.subject.textChanged, self.folder.textChanged):
            signal.connect(self._follow)
        self.takes.modelReset.connect(self._follow)
        self.table.selectionModel().selectionChanged.connect(self._follow)
        self._context.jobs.begun.connect(self._follow)
        self._context.jobs.ended.connect(self._follow)

    def add_takes(self, paths: list[Path]) -> None:
        """Add takes to the list; those that are there stay as they are."""
        there = {row.path for row in self.takes.rows}
        new = tuple(_Row(path) for path in dict.fromkeys(paths) if path not in there)
        self.takes.show_rows((*self.takes.rows, *new))
        if not self.folder.text() and paths:
            self.folder.setText(str(paths[0].parent / "results"))

    def run(self) -> None:
        """Run all steps on every take, beside the window."""
        paths, folder = [row.path for row in self.takes.rows], Path(self.folder.text())
        subject = Path(self.subject.text()) if self.skeleton.currentData() == _OF_PROJECT else None

        def work(monitor: Monitor) -> object:
            from skelgen.app.batch.run import run_batch  # noqa: PLC0415 - loads the stages
            from skelgen.app.batch.work import Job, subject_files  # noqa: PLC0415

            job = Job(subjects=subject_files([] if subject is None else [subject]))
            return run_batch(paths, folder, job, resume=True, monitor=monitor)

        self.status.clear()
        title = self.tr("Running {0} takes").format(len(paths))
        self._context.jobs.start(title, work, self._take_result, self._context.report_error)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accept files."""
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Add the files that were dropped."""
        self.add_takes([Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()])

    def _take_result(self, result: object) -> None:
        from skelgen.app.batch.run import BatchResult, result_rows  # noqa: PLC0415 - loads the stages

        if not isinstance(result, BatchResult):
            return
        self._page = result.page
        found = {Path(row.source): row for row in result_rows(result)}
        rows = []
        for take in self.takes.rows:
            row = found.get(take.path.absolute())
            if row is None:
                rows.append(take)
                continue
            tip = "\n".join(filter(None, (str(take.path), row.error, *row.notices)))
            rows.append(_Row(take.path, row.outcome, row.length, row.residual, tip, row.project))
        self.takes.show_rows(tuple(rows))
        words = self.tr("{0} of {1} takes are done")
        before = self.tr("{0} of them were done before").format(result.n_kept) if result.n_kept else ""
        self.status.setText(", ".join(filter(None, (words.format(result.n_done, len(result.records)), before))))

    def _chosen(self) -> list[_Row]:
        return [self.takes.rows[place.row()] for place in self.table.selectionModel().selectedRows()]

    def _remove(self) -> None:
        gone = {row.path for row in self._chosen()}
        self.takes.show_rows(tuple(row for row in self.takes.rows if row.path not in gone))

    def _open(self) -> None:
        results = [row.result for row in self._chosen() if row.result is not None]
        if results:
            self._context.files.open(results[0])

    def _compare(self) -> None:
        results = [row.result for row in self._chosen() if row.result is not None]
        if results:
            self._context.files.compare(results[0])

    def _show_page(self) -> None:
        if self._page is not None:
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._page.absolute())))

    def _choose_takes(self) -> None:
        names, _ = QFileDialog.getOpenFileNames(self, self.tr("Add takes"), self._context.runner.folder, file_filter())
        self.add_takes([Path(name) for name in names])

    def _follow(self) -> None:
        """Enable what can be done now."""
        is_busy, with_subject = self._context.jobs.is_busy, self.skeleton.currentData() == _OF_PROJECT
        self.subject.setEnabled(with_subject)
        self._browse_subject.setEnabled(with_subject)
        is_ready = bool(self.takes.rows and self.folder.text().strip())
        self.go.setEnabled(is_ready and not is_busy and (not with_subject or bool(self.subject.text().strip())))
        has_result = any(row.result is not None for row in self._chosen())
        self.open.setEnabled(has_result and not is_busy)
        self.compare.setEnabled(has_result and not is_busy and self._context.session.project is not None)
        self.remove.setEnabled(bool(self._chosen()) and not is_busy)
        self.show_page.setEnabled(self._page is not None)
