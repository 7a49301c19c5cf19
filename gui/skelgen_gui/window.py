"""The main window: pages at the left, views in the middle, timeline below, corrections at the right.

It only puts parts together: pages come from their table, commands from theirs, and all follow the session.
"""

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QByteArray, QCoreApplication, QPoint, Qt, QTimer
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QDockWidget, QMainWindow, QMenu, QMessageBox, QStackedWidget, QTabWidget, QWidget

from skelgen.model import Project
from skelgen_gui.diagrams.graph_view import GraphView
from skelgen_gui.diagrams.matrix_view import MatrixView
from skelgen_gui.labelling.pane import LabellingPane
from skelgen_gui.model import translate_with
from skelgen_gui.model.scene import Scene
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.view_state import ViewState
from skelgen_gui.model.viewpoint import up_axis
from skelgen_gui.page_stack import WIDTH, PageStack, Preloading
from skelgen_gui.pages import PAGES
from skelgen_gui.project.context import Cameras, Context, PageEntry, Runner, view_of
from skelgen_gui.project.corrections import CorrectionActions, CorrectionList
from skelgen_gui.project.deriving import PanelWhileSeen
from skelgen_gui.project.file_actions import FileActions
from skelgen_gui.project.jobs import Jobs, StatusLine
from skelgen_gui.project.panels import ComparisonPanel, Outline
from skelgen_gui.project.recovery import Autosave, RecoveryEntry
from skelgen_gui.project.session import Document, Session
from skelgen_gui.timeline.marker_curves import MarkerCurves
from skelgen_gui.timeline.player import VideoPane
from skelgen_gui.timeline.plot_view import Curves
from skelgen_gui.timeline.timeline import Timeline
from skelgen_gui.view3d.four_views import FourViews
from skelgen_gui.view3d.view import View3D
from skelgen_gui.widgets.errors import ErrorReporter
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import as_rich_text
from skelgen_gui.widgets.preferences import AXES, Preferences
from skelgen_gui.widgets.shortcuts import FocusRing, KeyKeeper, make_actions
from skelgen_gui.window_commands import Tutorial, WindowCommands

SIZE = (1440, 900)  # px, before the user has chosen one, where the screen has room for it
_STEPS, _TIMELINE = 0.34, 0.36  # of the window at first: the width of the steps at most, the height of the timeline
_PART = 0.92  # of the screen's room that the window takes at most at first: the frame of the window needs some


class Window(QMainWindow):
    """The main window.

    Parameters
    ----------
    preferences : Preferences
        What is kept between runs.
    entries : tuple of PageEntry
        Which pages it has; all by default.
    recovery : Path, optional
        Folder in which unsaved work is kept; by default the application's own.
    """

    def __init__(
        self, preferences: Preferences, entries: tuple[PageEntry, ...] = PAGES, recovery: Path | None = None
    ) -> None:
        super().__init__()
        translate_with(QCoreApplication.translate)
        self.preferences = preferences
        self.errors = ErrorReporter(self)
        self.session, self.jobs, report = Session(self), Jobs(self), self.errors.report
        self.document = Document(self.session, self)
        self.runner = Runner(self.document, self.jobs, report, self)
        self.files = FileActions(self.document, self.jobs, preferences, self.view_state, report, self)
        self.cameras = Cameras(report, self)
        self.autosave = Autosave(self.session, preferences, recovery, self, view_state=self.view_state)
        self.corrections = CorrectionActions(self.document, self.runner, report, self)
        self.actions_by_id = make_actions(self)
        self.keys = KeyKeeper(self)
        self.keys.watch(self)
        self._make_views()
        context = Context(
            self.session, self.document, self.jobs, self.runner, preferences, report, self.files, self.cameras
        )
        self.pages = PageStack(entries, context)
        self._make_docks()
        self.status = StatusLine(self.jobs, self)
        self.setStatusBar(self.status)
        self.commands = WindowCommands(self, self.actions_by_id, context, self.pages, self.view3d, self.corrections)
        self.preloading = Preloading(self.pages, self)
        self.focus_ring = FocusRing(self)
        self._connect()
        self.setAcceptDrops(True)
        room = self.screen().availableSize() * _PART
        self.resize(min(SIZE[0], room.width()), min(SIZE[1], room.height()))
        self._share_room()
        self._first_layout = self.saveState()
        self.restoreGeometry(preferences.geometry)
        self.restoreState(preferences.layout)
        self._follow_state()
        self._follow_preferences()
        self._is_closing = False

    def open(self, path: Path) -> None:
        """Open a recording or a project."""
        self.files.open(path)

    def offer(self, entry: RecoveryEntry) -> None:
        """Ask whether to restore the unsaved work of a window that crashed."""
        question = self.tr("skelgen ended without saving {0} (kept at {1:%X}, {1:%x}). Restore it?")
        question = question.format(entry.name, entry.when)
        if QMessageBox.question(self, self.tr("Recovery"), as_rich_text(question)) == QMessageBox.StandardButton.Yes:
            self.files.restore(entry)
        else:
            entry.forget()

    def end_without_asking(self) -> None:
        """End at once: what runs is cancelled, and unsaved work is put aside for the next window to offer."""
        self.jobs.stop()
        if self.files.has_unsaved_work:
            self.autosave.save()
            self.autosave.leave()
        else:
            self.autosave.end()
        self._rest()

    def reset_layout(self) -> None:
        """Put docks and tool bar where they are at first, with the room that the window has by now."""
        self.middle.reset_layout(self._first_layout)
        self._share_room()

    def show_full_screen(self, is_full: bool) -> None:
        """Fill the screen, or no longer."""
        self.setWindowState(self.windowState() & ~Qt.WindowState.WindowFullScreen)
        if is_full:
            self.setWindowState(self.windowState() | Qt.WindowState.WindowFullScreen)

    def view_state(self) -> ViewState:
        """Return what the window shows and its forms hold, for the project file."""
        page, tab, frame = self.pages.current.key, self.tabs.currentIndex(), self.session.frame
        viewpoint, shown = self.view3d.viewpoint, self.view3d.shown
        forms, cameras, video = self.runner.entered, self.cameras.shown, self.video.kept
        return ViewState(page, tab, frame, forms, cameras, video, viewpoint, shown)

    def _make_views(self) -> None:
        self.view3d, self.matrix, self.graph = View3D(self.session), MatrixView(self.session), GraphView(self.session)
        self.timeline = Timeline(self.session, self.actions_by_id)
        self.curves = Curves(self.session, self.timeline.span)
        self.tabs = QTabWidget(self)
        self.tabs.setDocumentMode(True)
        put_texts(self)
        for view, title, tip in (
            (FourViews(self.session, self.view3d), self.tr("3-D"), self.tr("Markers, bones and joints in space")),
            (self.matrix, self.tr("Distances"), self.tr("How distances between markers vary: why limbs are limbs")),
            (self.graph, self.tr("Joints"), self.tr("Costs of joints: why the tree is as it is")),
        ):
            self.tabs.setTabToolTip(self.tabs.addTab(view, title), tip)
        self.middle = CentralViews(self.tabs, self)
        self.setCentralWidget(self.middle)

    def _make_docks(self) -> None:
        left, below = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.BottomDockWidgetArea
        self.setCorner(Qt.Corner.BottomLeftCorner, left)
        self._dock("steps", self.tr("Steps"), self.pages, left)
        timeline = self._dock("timeline", self.tr("Timeline"), self.timeline, below)
        self._dock("curves", self.tr("Curves"), self.curves, timeline)
        self.marker_curves = MarkerCurves(self.session, self.timeline.span, self.corrections.apply)
        self.marker_curves_dock = self._dock("marker_curves", self.tr("Markers"), self.marker_curves, timeline)
        timeline.raise_()
        listed = CorrectionList(self.session, self.corrections, self.runner)
        corrections = self._dock("corrections", self.tr("Corrections"), listed, Qt.DockWidgetArea.RightDockWidgetArea)
        self.outline = Outline(self.session, self.corrections)
        self._outline_dock = self._dock("outline", self.tr("Names"), self.outline, corrections)
        self.labelling = LabellingPane(self.document, self.corrections, self.runner)
        self.labelling_dock = self._dock("labelling", self.tr("Labelling"), self.labelling, corrections)
        self.video = VideoPane(self.session, self.errors.report)
        self.video_dock = self._dock("video", self.tr("Video"), self.video, corrections)
        compared = ComparisonPanel(self.session)
        self.comparison = self._dock("comparison", self.tr("Comparison"), compared, corrections)
        self.tutorial = Tutorial()
        self.tutorial.asked.connect(self._do)
        tutorial = self._dock("tutorial", self.tr("First steps"), self.tutorial, corrections)
        for dock in (self.video_dock, self.comparison, tutorial):
            dock.hide()
        corrections.raise_()

    def _share_room(self) -> None:
        """Leave most of a small screen to the views and to what stands beside them."""
        docks = {dock.objectName(): dock for dock in self.findChildren(QDockWidget)}
        self.resizeDocks([docks["steps"]], [min(WIDTH, int(_STEPS * self.width()))], Qt.Orientation.Horizontal)
        self.resizeDocks([docks["timeline"]], [int(_TIMELINE * self.height())], Qt.Orientation.Vertical)

    def _do(self, kind: str, name: str) -> None:
        """Do what a link of the first steps says."""
        if kind == "sample":
            self.files.open_sample(name)
        else:
            self.actions_by_id[name].trigger()

    def _follow_preferences(self) -> None:
        """Show recordings with the axis up that the user prefers."""
        wanted = self.preferences.values.up_axis
        up = AXES.index(wanted) if wanted in AXES else None
        self.view3d.set_shown(replace(self.view3d.shown, up=up))

    def _dock(self, name: str, title: str, widget: QWidget, where: Qt.DockWidgetArea | QDockWidget) -> QDockWidget:
        """Make a dock in an area, or behind another one."""
        dock = QDockWidget(title, self)
        dock.setObjectName(name)
        dock.setWidget(widget)
        if isinstance(widget, PanelWhileSeen):
            dock.visibilityChanged.connect(widget.come_into_sight)
        if isinstance(where, QDockWidget):
            self.addDockWidget(self.dockWidgetArea(where), dock)
            self.tabifyDockWidget(where, dock)
        else:
            self.addDockWidget(where, dock)
        self.keys.watch(dock)
        return dock

    def _connect(self) -> None:
        self.session.state_changed.connect(self._follow_state)
        self.preferences.changed.connect(self._follow_preferences)
        self.files.opened.connect(self._show_opened)
        self.files.restored.connect(self.autosave.take_over)
        self.runner.finished.connect(self.pages.page)
        self.autosave.failed.connect(self.status.notice)
        self.files.saved.connect(self.status.notice)
        self.session.project_changed.connect(self._note_up)
        self.outline.hidden_wanted.connect(self.view3d.hide_markers)
        self.view3d.shown_changed.connect(lambda shown: self.outline.show_hidden(shown.hidden))
        self.actions_by_id["rename"].triggered.connect(self._rename_selected)
        self.actions_by_id["full_screen"].toggled.connect(self.show_full_screen)
        self.actions_by_id["reset_layout"].triggered.connect(self.reset_layout)
        self.view3d.shown_changed.connect(self._note_up)
        self.commands.parameter_files.noticed.connect(self.status.notice)
        self.view3d.context_requested.connect(self._show_corrections)
        self.session.menu_requested.connect(lambda place: self._show_corrections(place, self.session.selection))
        self.view3d.clicked.connect(self.labelling.clicked_in_view)
        self.actions_by_id["labelling"].triggered.connect(self._show_labelling)
        self.timeline.player.settings_changed.connect(self._note_span)
        self.cameras.changed.connect(self._show_cameras)
        self.session.other_changed.connect(self._show_comparison)
        self.pages.shown.connect(self._show_view)
        self._show_view(self.pages.current.key)

    def _follow_state(self) -> None:
        project, path = self.session.project, self.session.path
        name = "" if project is None else (path.name if path is not None else project.name or self.tr("unnamed"))
        self.setWindowTitle(f"{name}[*] - skelgen" if name else "skelgen")
        self.setWindowModified(self.session.is_dirty)

    def _show_opened(self, project: Project) -> None:
        """Show an opened project as it was left."""
        state = ViewState.of(project)
        self.runner.begin_with(state.forms)
        self.cameras.begin_with(project, state.cameras)
        self.video.begin_with(state.video)
        self.video_dock.setVisible(state.video is not None or self.video_dock.isVisible())
        keys = [entry.key for entry in self.pages.entries]
        self.pages.page(state.page if state.page in keys else keys[min(self.pages.home + 1, len(keys) - 1)])
        self.tabs.setCurrentIndex(state.tab)
        self.session.show_frame(state.frame)
        if state.shown is not None:
            up = self.view3d.shown.up if state.shown.up is None else state.shown.up
            self.view3d.set_shown(replace(state.shown, up=up))
        if state.viewpoint is not None:
            self.view3d.stand_at(state.viewpoint)
        else:
            self.view3d.look_home()

    def _rename_selected(self) -> None:
        """Let the user type a name in the panel of names, wherever something was selected."""
        self._outline_dock.show()
        self._outline_dock.raise_()
        self.outline.rename_selected()

    def _show_comparison(self) -> None:
        """Show how both results differ while there are two."""
        self.comparison.setVisible(self.session.other is not None)
        if self.session.other is not None:
            self.comparison.raise_()

    def _show_labelling(self) -> None:
        """Show the pane of labels, and go to what needs most work."""
        self.labelling_dock.show()
        self.labelling_dock.raise_()
        self.labelling.table.setFocus(Qt.FocusReason.OtherFocusReason)

    def _note_span(self) -> None:
        """Tell labels and curves which part of the take is chosen: what is stated there holds for that part."""
        span, whole = self.timeline.player.range, (0, self.session.n_frames - 1)
        self.labelling.span = self.marker_curves.range = None if span == whole else span

    def _note_up(self) -> None:
        """Tell the pages which axis the 3-D view has up: exports are turned as it is."""
        self.session.up = None if self.session.project is None else self.view3d.up

    def _show_cameras(self) -> None:
        project, cameras = self.session.project, self.cameras.shown
        points = None if project is None else Scene(project).inliers
        self.view3d.show_cameras([camera.lines_to(points) for camera in cameras], up_axis(cameras))
        self._note_up()

    def _show_view(self, key: str) -> None:
        """Give the middle to the view of a page, if it brings one."""
        self.middle.show_view(view_of(self.pages.page(key)))

    def _show_corrections(self, place: QPoint, selection: Selection) -> None:
        menu = QMenu(self)
        self.corrections.fill(menu, selection)
        menu.aboutToHide.connect(menu.deleteLater)
        menu.popup(place)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accept files."""
        if event.mimeData().hasUrls() and event.mimeData().urls()[0].isLocalFile():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the file that was dropped."""
        self.open(Path(event.mimeData().urls()[0].toLocalFile()))

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask, cancel and wait; then close for good."""
        if self._is_closing:
            event.accept()
            return
        event.ignore()
        self.files.close(self._close)

    def _close(self) -> None:
        self._is_closing = True
        self._rest()
        self.autosave.end()
        QTimer.singleShot(0, self.close)  # Qt closes no window from within its closeEvent

    def _rest(self) -> None:
        """Stop playing and loading, and remember the layout of the window."""
        self.timeline.player.pause()
        self.corrections.end()
        self.jobs.stop()  # what a correction has begun meanwhile
        self.preloading.end()
        self.preferences.keep_window(self.saveGeometry(), self.middle.layout_of_window())


class CentralViews(QStackedWidget):
    """Shows the views of the take until a page brings another one, which also gets the room of the take's docks.

    Parameters
    ----------
    take_views : QWidget
        The views of the take.
    window : QMainWindow
        Whose docks make room; that of the pages stays.
    """

    def __init__(self, take_views: QWidget, window: QMainWindow) -> None:
        super().__init__(window)
        self._take_views, self._window = take_views, window
        self._layout: QByteArray | None = None
        self.addWidget(take_views)

    def show_view(self, view: QWidget | None) -> None:
        """Show the view of a page; None shows those of the take."""
        if view is not None and self.indexOf(view) < 0:
            self.addWidget(view)
        self.setCurrentWidget(view or self._take_views)
        if view is not None and self._layout is None:
            self._layout = self._window.saveState()
            for dock in self._window.findChildren(QDockWidget):
                if dock.objectName() != "steps":  # the others have to do with a take only
                    dock.hide()
        elif view is None and self._layout is not None:
            layout, self._layout = self._layout, None
            self._window.restoreState(layout)

    def reset_layout(self, layout: QByteArray) -> None:
        """Arrange the docks anew; while a page's view is shown, for when it has gone."""
        if self._layout is None:
            self._window.restoreState(layout)
        else:
            self._layout = layout

    def layout_of_window(self) -> QByteArray:
        """Return the arrangement of the window's docks as it is while the views of the take are shown."""
        return self._window.saveState() if self._layout is None else self._layout
