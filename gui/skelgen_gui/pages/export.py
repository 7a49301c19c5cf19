"""The page that writes results for other programs: format, options, place, what will be written, and the writing."""

import html
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QStandardPaths, Qt, QUrl, Signal
from PySide6.QtGui import QDesktopServices, QShowEvent, QStandardItemModel
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QGroupBox,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)
from skelgen_formats.options import AUTO, Format

from skelgen.app.bodies import BODY
from skelgen.app.export import (
    Preview,
    export_formats,
    export_path,
    export_project,
    obstacle_to,
    preview_export,
    turn_upright,
)
from skelgen.app.outputs import stem_of
from skelgen.errors import Cancelled, ParameterError, SkelgenError, WriteError
from skelgen.model import Project
from skelgen.progress import Monitor
from skelgen_gui.model.viewpoint import DOWN
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.errors import show_error
from skelgen_gui.widgets.fields import choose_button
from skelgen_gui.widgets.forms import ParameterForm
from skelgen_gui.widgets.layouts import bare_column, put_behind, put_texts, row_of, scrolled, wrap
from skelgen_gui.widgets.painting import PROBLEM_ROLE
from skelgen_gui.widgets.preferences import AXES

_PER_MILLE = 1000  # steps of the progress bar
_NAME_WITHOUT_TAKE = "result"


class ExportPage(QWidget):
    """Writes the open project in a format of the user's choice.

    Parameters
    ----------
    session : Session
        Whose project is written.
    jobs : Jobs
        Where files are written.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, session: Session, jobs: Jobs, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("page-export")
        self._session, self._jobs = session, jobs
        self._take: object = None
        self._turned: object = None
        self.deriver = Deriver(self)
        self._is_running = False
        self._written: Path | None = None
        self.formats = export_formats()
        self.choice = QComboBox(self)
        self.note, self.preview, self.status = QLabel(self), QLabel(self), QLabel(self)
        self.form = ParameterForm((), self)
        self.options_box = QGroupBox(self.tr("Options"), self)
        self._options = QVBoxLayout(self.options_box)
        self._options.setContentsMargins(6, 6, 6, 6)  # no more than fits into the narrowest window
        self.target = _ExportTarget(self)
        self.export, self.cancel, self.show_folder = QPushButton(self), QPushButton(self), QPushButton(self)
        self.progress = QProgressBar(self)
        self._describe()
        self._lay_out()
        self._connect()
        self._follow_choice()
        self._follow_project()

    def showEvent(self, event: QShowEvent) -> None:
        """Look again which files there are."""
        super().showEvent(event)
        self._enable_formats()
        self._turn_upright()
        self._follow()

    def _describe(self) -> None:
        for entry in self.formats:
            self.choice.addItem(QCoreApplication.translate("Formats", entry.title))
        for label in (self.note, self.preview, self.status):
            wrap(label)
        self.preview.setTextFormat(Qt.TextFormat.RichText)
        self.preview.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.progress.setRange(0, _PER_MILLE)
        put_texts(self)
        for widget in (self.cancel, self.progress, self.show_folder):
            widget.hide()

    def _lay_out(self) -> None:
        parts = (self.choice, self.note, self.options_box, self.target, self.preview)
        buttons = row_of(self.export, self.cancel, self.show_folder, room=True)  # seen however long the preview is
        bare_column(self, (scrolled(parts, QScrollArea(self)), buttons, self.progress, self.status))

    def _connect(self) -> None:
        self._session.project_changed.connect(self._follow_project)
        self.choice.currentIndexChanged.connect(self._follow_choice)
        self.target.changed.connect(self._follow)
        self.export.clicked.connect(self._begin)
        self.cancel.clicked.connect(self._cancel)
        self._jobs.progressed.connect(self._show_progress)
        self.show_folder.clicked.connect(self._open_folder)

    def _follow_project(self) -> None:
        """Offer the formats that the project can be written in; suggest a place when it is another recording's."""
        project = self._session.project
        if project is not None and project.take is not self._take:
            self._take = project.take
            self.target.suggest(self._session.folder, stem_of(project.name) or _NAME_WITHOUT_TAKE)
        self.target.offer_bodies(project is not None and project.has("joints") and len(project.bodies) > 1)
        if self.isVisible():  # else when it is shown
            self._enable_formats()
        self._follow()

    def _enable_formats(self) -> None:
        """See beside the window which formats the project can be written in: some look through the whole take."""
        project = self._session.project
        if project is None:
            self.deriver.forget()
            self._take_obstacles(["" for _ in self.formats])
        else:
            self.deriver.derive(partial(_obstacles, project, self.formats), self._take_obstacles)

    def _take_obstacles(self, obstacles: list[str]) -> None:
        model = self.choice.model()
        if not isinstance(model, QStandardItemModel):  # the one that a combo box has by itself
            return
        for row, obstacle in enumerate(obstacles):
            model.item(row).setEnabled(not obstacle)
            model.item(row).setToolTip(obstacle or QCoreApplication.translate("Formats", self.formats[row].note))
        if obstacles[self.choice.currentIndex()] and not all(obstacles):
            self.choice.setCurrentIndex(obstacles.index(""))

    def _follow_choice(self) -> None:
        """Show the options of another format."""
        entry = self.formats[self.choice.currentIndex()]
        self.note.setText(QCoreApplication.translate("Formats", entry.note))
        self.form.hide()
        self.form.deleteLater()
        options = [option.declaration for option in entry.options if option.writing]
        self.form = ParameterForm(options, self)
        self.form.changed.connect(self._follow)
        self._options.addWidget(self.form)
        put_behind(self.choice, self.form)
        self.options_box.setVisible(bool(options))
        self.target.each_body.setChecked(entry.holds == "skeleton")  # as programs take a file for one character
        self._turned = None
        self._turn_upright()
        self._follow()

    def _turn_upright(self) -> None:
        """Turn what is up in the 3-D view to where the format has it, unless the user has chosen otherwise."""
        row = self.form.rows.get("axes")
        if row is None or row.declaration.default != AUTO or self._session.up is None:
            return
        entry, up = self.formats[self.choice.currentIndex()], self._session.up
        wanted = AUTO if up >= DOWN else turn_upright(entry, AXES[up])
        if row.editor.entered() in {AUTO, self._turned}:
            self._turned = wanted
            row.show_value(wanted)

    def _follow(self) -> None:
        """Show what would be written now, while the page is seen: some formats look through the whole take."""
        if not self.isVisible():
            return
        preview = self._preview()
        self.preview.setText(self._preview_text(preview))
        self.preview.setForegroundRole(PROBLEM_ROLE if preview.obstacle else self.foregroundRole())
        replaces = any(file.exists() for file in preview.files)
        self.export.setText(self.tr("Export and replace") if replaces else self.tr("Export"))
        self.export.setEnabled(not preview.obstacle and not self._is_running)

    def _preview(self) -> Preview:
        project, entry = self._session.project, self.formats[self.choice.currentIndex()]
        if project is None:
            return Preview(obstacle=self.tr("Open a recording first."))
        try:
            path = export_path(self.target.folder, self.target.name, entry)
            return preview_export(project, entry, path, self.form.values())
        except (WriteError, ParameterError) as error:
            return Preview(obstacle=str(error))

    def _preview_text(self, preview: Preview) -> str:
        """Return the preview as rich text; names may hold any character."""
        if preview.obstacle:
            return html.escape(preview.obstacle)
        replaces = self.tr(" (replaces the file that is there)")
        lines = [f"<b>{html.escape(file.name)}</b>{replaces if file.exists() else ''}" for file in preview.files]
        lines += [html.escape(preview.contents)] if preview.contents else []
        return "<br>".join(lines) + "".join(f"<p>{html.escape(remark)}</p>" for remark in preview.remarks)

    def _begin(self) -> None:
        """Start the export."""
        project, entry = self._session.project, self.formats[self.choice.currentIndex()]
        if project is None:
            return
        path, options = export_path(self.target.folder, self.target.name, entry), self.form.values()

        def work(monitor: Monitor) -> list[Path] | None:
            try:
                return export_project(project, entry, path, options, monitor)
            except Cancelled:
                return None

        self._show_running(True)
        if not self._jobs.start(self.tr("Exporting {0}").format(path.name), work, self._done, self._failed):
            self._show_running(False)
            self.status.setText(self.tr("Something else is still running; export when that is done."))

    def _cancel(self) -> None:
        self._jobs.cancel()
        self.cancel.setEnabled(False)

    def _show_progress(self, _: str, share: float) -> None:
        if self._is_running:
            self.progress.setValue(round(share * _PER_MILLE))

    def _show_running(self, is_running: bool) -> None:
        self._is_running = is_running
        self.status.clear()
        self.status.setForegroundRole(self.foregroundRole())
        self.progress.setValue(0)
        self.cancel.setEnabled(is_running)
        for widget in (self.cancel, self.progress):
            widget.setVisible(is_running)
        self.show_folder.hide()
        for choice in (self.choice, self.form, self.target):
            choice.setEnabled(not is_running)
        self._follow()

    def _done(self, files: list[Path] | None) -> None:
        self._show_running(False)
        if files is None:
            self.status.setText(self.tr("Cancelled; nothing was written."))
            return
        self._written = files[0].parent
        names = ", ".join(file.name for file in files)
        self.status.setText(self.tr("Written to {0}: {1}").format(self._written, names))
        self.show_folder.show()

    def _failed(self, error: Exception) -> None:
        self._show_running(False)
        if isinstance(error, SkelgenError):
            self.status.setForegroundRole(PROBLEM_ROLE)
            self.status.setText(str(error))
        else:
            show_error(self, error)

    def _open_folder(self) -> None:
        if self._written is not None:
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._written)))


def _obstacles(project: Project, formats: Sequence[Format]) -> list[str]:
    return [obstacle_to(project, entry, {}) for entry in formats]


class _ExportTarget(QWidget):
    """A folder and a name, and where there are several bodies, whether each gets a file of its own.

    Signals
    -------
    changed()
        Another folder or name, or another answer.
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        documents = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.DocumentsLocation)
        self.folder_line = QLineEdit(documents, self)
        self.browse = choose_button(self.folder_line, self.tr("Folder of the export"))
        self.name_line = QLineEdit(self)
        self.each_body = QCheckBox(self.tr("A file for each body"), self)
        self._rows = QFormLayout(self)
        self._rows.setContentsMargins(0, 0, 0, 0)
        self._rows.addRow(self.tr("Folder"), row_of(self.folder_line, self.browse))
        self._rows.addRow(self.tr("Name"), self.name_line)
        self._rows.addRow(self.each_body)
        self._rows.setRowVisible(self.each_body, False)
        self.folder_line.textChanged.connect(self.changed)
        self.name_line.textChanged.connect(self.changed)
        put_texts(self)
        self.each_body.toggled.connect(self.changed)

    @property
    def folder(self) -> Path:
        """The folder."""
        return Path(self.folder_line.text()).expanduser()

    @property
    def name(self) -> str:
        """The beginning of the files' names; where each body gets a file, with the place of its name."""
        name = self.name_line.text()
        is_wanted = self.each_body.isChecked() and not self.each_body.isHidden()
        return f"{name}_{BODY}" if is_wanted and name.strip() and BODY not in name else name

    def offer_bodies(self, are_several: bool) -> None:
        """Offer a file for each body, or no longer.

        Parameters
        ----------
        are_several : bool
            Whether the project has several bodies.
        """
        self._rows.setRowVisible(self.each_body, are_several)

    def suggest(self, folder: Path | None, name: str) -> None:
        """Show the place of another project; None keeps the folder that is shown.

        Parameters
        ----------
        folder : Path or None
            The folder; None keeps the one that is shown.
        name : str
            Beginning of the files' names.
        """
        if folder is not None:
            self.folder_line.setText(str(folder.absolute()))  # not as the command line named it
        self.name_line.setText(name)
