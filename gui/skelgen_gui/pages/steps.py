"""The first page, with what is open, and the page of one stage: its parameters, what came out, and what to look at."""

from functools import partial
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QPoint, Qt
from PySide6.QtWidgets import (
    QButtonGroup,
    QFileDialog,
    QGroupBox,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QRadioButton,
    QScrollArea,
    QWidget,
)

from skelgen.app import STAGE_SUMMARIES
from skelgen.app.configuration import parameters_class
from skelgen.app.constraints import stated_number
from skelgen.app.corrections import with_identities, with_number
from skelgen.app.project_file.archive import SUFFIX, find_result, open_project
from skelgen.app.project_file.packing import with_saved
from skelgen.app.stage_summary import Pointer, stage_pointers, stage_sentences, take_sentences
from skelgen.model import Project
from skelgen.progress import Monitor
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.context import Context
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.file_actions import SampleMenu
from skelgen_gui.widgets.fields import FoundOrGiven, choose_button
from skelgen_gui.widgets.forms import stage_form
from skelgen_gui.widgets.layouts import bare_column, column, put_texts, row_of, scrolled, scrolling, wrap
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


# Stages whose number the user may give, and the correction that holds it
_NUMBERS = {"labels": "n_markers", "limbs": "n_limbs"}

_POINTER = Qt.ItemDataRole.UserRole
_Outcome = tuple[tuple[str, ...], tuple[Pointer, ...]]


class StagePage(QWidget):
    """The page of one stage.

    Parameters
    ----------
    stage : str
        Its name.
    context : Context
        What pages are given.
    """

    def __init__(self, stage: str, context: Context) -> None:
        super().__init__()
        self._stage, self._context = stage, context
        self.setObjectName(f"page-{stage}")
        self.runs, self.uses_saved = QRadioButton(self), QRadioButton(self)
        self.path, title = QLineEdit(self), self.tr("Project file with the saved result")
        kinds = self.tr("Projects (*{0})").format(SUFFIX)
        self._browse = choose_button(self.path, title, kinds, lambda: context.runner.folder)
        titles = {"labels": self.tr("Number of markers"), "limbs": self.tr("Number of limbs")}
        self.number = FoundOrGiven(titles[stage], self) if stage in titles else None
        self.form = stage_form(parameters_class(stage), self)
        self.go = QPushButton(self)
        self._box = QGroupBox(self.tr("What came out"), self)
        self.result = QLabel(self)
        self.warnings = QListWidget(self)
        self.deriver = Deriver(self)
        self._describe()
        self._lay_out()
        self._connect()
        self._follow_values()
        self._follow_project()

    @property
    def _summary(self) -> str:
        return QCoreApplication.translate("Pages", STAGE_SUMMARIES[self._stage])

    def _describe(self) -> None:
        self.path.setPlaceholderText(self.tr("project file, {0}").format(SUFFIX))
        wrap(self.result, self.tr("What came out of this step"))
        self.result.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        put_texts(self)
        self.warnings.setWordWrap(True)
        self.warnings.setAlternatingRowColors(True)
        self.warnings.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.warnings.hide()  # until there is something to look at
        self.runs.setChecked(True)

    def _lay_out(self) -> None:
        self._choice = QButtonGroup(self)
        for button in (self.runs, self.uses_saved):
            self._choice.addButton(button)
        summary = QLabel(self._summary, self)
        summary.setWordWrap(True)
        saved = row_of(self.path, self._browse)
        number = () if self.number is None else (self.number,)
        area = scrolled((summary, self.runs, self.uses_saved, saved, *number, self.form), QScrollArea(self))
        self._column = bare_column(self, (area, self.go, self._box))
        self._column.setStretchFactor(area, 3)
        outcome = QWidget(self)
        bare_column(outcome, (self.result, self.warnings)).setStretchFactor(self.warnings, 1)
        column(self._box, (scrolling(outcome, QScrollArea(self)),))

    def _connect(self) -> None:
        session, jobs = self._context.session, self._context.jobs
        session.project_changed.connect(self._follow_project)
        self._context.runner.values_changed.connect(self._follow_values)
        jobs.begun.connect(self._follow_jobs)
        jobs.ended.connect(self._follow_jobs)
        self.runs.toggled.connect(self._follow_jobs)
        self.path.textChanged.connect(self._follow_jobs)
        self.form.changed.connect(self._keep_values)
        self.go.clicked.connect(self.start)
        self.warnings.itemActivated.connect(self._look)
        self.warnings.itemClicked.connect(self._look)
        self.warnings.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.warnings.customContextMenuRequested.connect(self._ask_for_menu)

    def start(self) -> None:
        """Run the stage, or take the saved result."""
        project = self._context.session.project
        if project is None or not self.go.isEnabled():
            return
        if self.uses_saved.isChecked():
            self._take_saved(project)
            return
        self.apply_number()
        self._context.runner.run(self._stage)

    def apply_number(self) -> None:
        """Write the number that is given on this page into the project."""
        project = self._context.session.project
        if self.number is None or project is None:
            return
        kind, number = _NUMBERS[self._stage], self.number.value()
        if number != stated_number(project, kind):
            self._context.document.change(self.number.accessibleName(), with_number(project, kind, number))

    def _take_saved(self, project: Project) -> None:
        path, stage, document = Path(self.path.text()), self._stage, self._context.document

        def work(monitor: Monitor) -> Project:
            monitor.begin(stage)
            return with_saved(project, open_project(find_result(path)), stage)

        def done(result: Project) -> None:
            document.change(self.tr("take a saved result"), result)

        self._context.jobs.start(self.tr("Reading {0}").format(path.name), work, done, self._context.report_error)

    def _keep_values(self) -> None:
        if not self.form.problem():
            self._context.runner.set_values(self._stage, self.form.values())
        self._follow_jobs()

    def _follow_jobs(self) -> None:
        project = self._context.session.project
        is_ready = bool(self.path.text()) if self.uses_saved.isChecked() else not self.form.problem()
        self.go.setEnabled(project is not None and is_ready and not self._context.jobs.is_busy)
        title = QCoreApplication.translate("Pages", self._stage)
        words = self.tr("Use the saved {0}") if self.uses_saved.isChecked() else self.tr("Run {0}")
        self.go.setText(words.format(title))
        self.go.setToolTip(self._summary)
        for widget in (self.path, self._browse):
            widget.setEnabled(self.uses_saved.isChecked())

    def _follow_values(self) -> None:
        """Show the values of the next run, and the defaults of all others."""
        self.form.blockSignals(True)
        self.form.set_values({**self.form.defaults, **self._context.runner.values(self._stage)})
        self.form.blockSignals(False)
        self._follow_jobs()

    def _follow_project(self) -> None:
        project = self._context.session.project
        if self.number is not None:
            kind = _NUMBERS[self._stage]
            self.number.set_value(None if project is None else stated_number(project, kind))
            self.number.show_found(_found(project, kind))
        self._follow_result(project)
        if not (self._context.runner.has_entered(self._stage) or self.form.problem()):
            self._follow_values()  # those that the stage ran with; what somebody is entering stays
        self._follow_jobs()

    def _follow_result(self, project: Project | None) -> None:
        """Show what came out; until that is known, the result before stays."""
        self.deriver.forget()
        if project is None or not project.has(self._stage):
            self._show_result(((self.tr("This step has not run yet."),), ()))
        else:
            self.deriver.derive(partial(_outcome, project, self._stage), self._show_result)

    def _show_result(self, outcome: _Outcome) -> None:
        sentences, pointers = outcome
        self.result.setText(" ".join(sentences))
        self.warnings.clear()
        for pointer in pointers:
            item = QListWidgetItem(pointer.sentence, self.warnings)
            item.setData(_POINTER, pointer)
        self.warnings.setVisible(bool(pointers))
        self._column.setStretchFactor(self._box, 3 if pointers else 1)

    def _look(self, item: QListWidgetItem) -> None:
        pointer: Pointer = item.data(_POINTER)
        session = self._context.session
        if pointer.frame is not None:
            session.show_frame(pointer.frame)
        if pointer.markers:
            session.select(Selection(frozenset(pointer.markers)))

    def _ask_for_menu(self, place: QPoint) -> None:
        """Ask for a menu of corrections for the markers of a line."""
        item = self.warnings.itemAt(place)
        if item is not None:
            self._look(item)
            self._context.session.menu_requested.emit(self.warnings.viewport().mapToGlobal(place))


def _outcome(project: Project, stage: str) -> _Outcome:
    return stage_sentences(project, stage), stage_pointers(project, stage)


def _found(project: Project | None, kind: str) -> int | None:
    if project is None or not project.has("labels" if kind == "n_markers" else "limbs"):
        return None
    if stated_number(project, kind) is not None:
        return None  # it was given: nothing was found
    return project.trajectories.n_markers if kind == "n_markers" else project.limbs.n_limbs
