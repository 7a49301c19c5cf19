"""The step that calibrates both cameras from views of a chessboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QDoubleSpinBox, QLabel, QPushButton, QSpinBox, QWidget

from skelgen.app.capture import save_cameras
from skelgen.app.capture_jobs.images import ENOUGH, CameraImage, CollectedView, ViewCollection, gaps
from skelgen.app.capture_jobs.messages import CaptureControl, FoundInSpace
from skelgen.capture.calibration.chessboard import Board
from skelgen.progress import Monitor
from skelgen_gui.capture.forms import ImageForm
from skelgen_gui.capture.measured import CameraTable, CoverageView, Fit, ViewList
from skelgen_gui.capture.steps import Step
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.widgets.fields import set_up_number
from skelgen_gui.widgets.layouts import describe, put_texts, row_of

if TYPE_CHECKING:
    from skelgen.capture.calibration.stereo import StereoCalibration


# A simulated chessboard as cameras would deliver it, for a minute
_SIMULATED_BOARD = "simulated:board?paced=yes&rate=30&frames=1800"

_MOST_CORNERS, _LARGEST_SQUARE = 40, 1000.0


class CameraStep(Step[tuple[CameraImage, ...]]):
    """Collects views, calibrates, says what the calibration is worth, and saves settings.

    Signals
    -------
    calibrated(object, object)
        The rig that was found, and the boards in space, a `FoundInSpace`.
    forgotten()
        What was seen belongs to other images, or to another board.

    Parameters
    ----------
    jobs, report_error
        As of `Step`.
    settings : callable () -> str
        The settings file that is in use, whose bodies and joints are kept; empty if there is none.
    parent : QWidget
        Parent widget.
    """

    calibrated = Signal(object, object)
    forgotten = Signal()

    def __init__(
        self, jobs: Jobs, report_error: Callable[[Exception], None], settings: Callable[[], str], parent: QWidget
    ) -> None:
        super().__init__(jobs, report_error, parent)
        self._settings = settings
        self._fits: dict[str, Fit] = {}
        self.found: StereoCalibration | None = None
        self.collection = ViewCollection()
        self.form, self.take = BoardForm(self), QPushButton(self)
        self.coverage, self.views = CoverageView(self), ViewList(self)
        self.remove, self.clear = QPushButton(self), QPushButton(self)
        self.calibrate, self.save = QPushButton(self), QPushButton(self)
        self.cameras = CameraTable(self)
        put_texts(self)
        parts = (self.form, row_of(self.go, self.take), self.state, self.coverage, row_of(self.calibrate, self.save))
        self.lay_out((*parts, self.verdict, self.views, row_of(self.remove, self.clear), self.cameras))
        self._connect()
        self.follow()

    def start(self) -> None:
        """Look for the board in the images of the source."""
        if self._jobs.is_busy:
            return
        board, text, collection, feed = self.form.board, self.form.source.source, self.collection, self.feed
        title = self.tr("Looking for the board")
        if not text:
            self.verdict.show_problem(self.tr("Choose where the images come from, or the simulated board."))
            return
        self._forget_result()
        control = CaptureControl()

        def work(monitor: Monitor) -> None:
            from skelgen.app.capture_jobs.collecting import BoardCollector  # noqa: PLC0415 - loads what captures need

            BoardCollector(text, board, collection, control, feed).run(title, monitor)

        self.collect(title, control, work, lambda _: None)

    def run_calibration(self) -> None:
        """Calibrate with the views that are there."""
        views, board = self.collection.views, self.form.board
        if self._jobs.is_busy or not views:
            return

        title = self.tr("Calibrating")

        def work(monitor: Monitor) -> tuple[StereoCalibration, FoundInSpace]:
            monitor.begin(title)
            from skelgen.capture.calibration.stereo import (  # noqa: PLC0415 - loads what captures need
                boards_in_space,
                calibrate_views,
            )

            seen = [(view.left, view.right) for view in views]
            found = calibrate_views([view.name for view in views], seen, board, views[0].size)
            return found, FoundInSpace(*boards_in_space(found.rig, found.pairs, board))

        self._forget_result()
        self.run(title, work, self._show_found)

    def save_settings(self) -> None:
        """Ask for a file, and write the settings of the cameras."""
        found, before, source = self.found, self._settings(), self.form.source.source
        path = self.asked_settings(before or "rig.xml")
        if found is None or path is None:
            return

        def work(_: Monitor) -> int:
            return save_cameras(found.rig, path, Path(before) if before else None, source)

        def done(n_kept: int) -> None:
            sentence = self.tr("Saved: {0}.").format(path)
            if n_kept:
                sentence += " " + self.tr("Its {0} bodies and joints are those of the settings before.").format(n_kept)
            self.state.setText(sentence)
            self.saved.emit(path)

        self.run(self.tr("Saving"), work, done)

    def _connect(self) -> None:
        self.take.clicked.connect(self._take_this)
        self.form.start_wanted.connect(self._start_anew)
        self.form.changed.connect(self._start_over)
        self.form.size_changed.connect(self._forget_result)
        self.remove.clicked.connect(self._remove)
        self.clear.clicked.connect(self._start_over)
        self.views.removal_wanted.connect(self._remove)
        self.views.itemSelectionChanged.connect(lambda: self.coverage.mark_views(self.views.selected_views))
        self.views.itemSelectionChanged.connect(self.follow)
        self.calibrate.clicked.connect(self.run_calibration)
        self.save.clicked.connect(self.save_settings)

    def _start_anew(self) -> None:
        """Another source was chosen: its views belong to other cameras."""
        if not self._jobs.is_busy:
            self._start_over()
            self.start()

    def _start_over(self) -> None:
        self.collection.clear()
        self.feed.take()  # what is still on its way belongs to the images before
        self.forgotten.emit()
        self._forget_result()
        self._show_views()

    def _take_this(self) -> None:
        if self._control is not None:
            self._control.keep_next.set()

    def _remove(self) -> None:
        if self.views.selected_views:
            self.collection.remove(self.views.selected_views)
            self._forget_result()
            self._show_views()

    def show_newest(self) -> None:
        """Show the newest pair, and the views that there are by now."""
        newest, _ = self.feed.take()
        if newest is not None:
            self.shot.emit(newest)
        self._show_views()

    def _show_found(self, result: tuple[StereoCalibration, FoundInSpace]) -> None:
        self.found, boards = result
        found = self.found
        self._fits = {pair.name: (pair.left_rms, pair.right_rms, pair.is_used) for pair in found.pairs}
        self.verdict.show_verdict(found.verdict)
        self.cameras.show_calibration(found)
        self._show_views()
        self.show_end()
        self.calibrated.emit(found.rig, boards)

    def _forget_result(self) -> None:
        self.found, self._fits = None, {}
        self.views.show_views(self.collection.views, self._fits)
        self.verdict.clear()
        self.cameras.hide()

    def _show_views(self) -> None:
        views = self.collection.views
        self.views.show_views(views, self._fits)
        self.coverage.show_views(views)
        self.state.setText(self._summary(views))
        self.follow()

    def _summary(self, views: tuple[CollectedView, ...]) -> str:
        """How many views there are, and what is missing."""
        n_whole = sum(view.is_whole for view in views)
        if not n_whole:
            return self.tr("Hold the board so that both cameras see it whole, and still for a moment.")
        sentences = [self.tr("{0} good views; {1} to {2} are needed.").format(n_whole, ENOUGH, 2 * ENOUGH)]
        for side, missing in zip((self.tr("left"), self.tr("right")), gaps(views), strict=True):
            if missing:
                sentences.append(self.tr("Still empty in the {0} image: {1}.").format(side, ", ".join(missing)))
        return " ".join(sentences)

    def follow(self) -> None:
        """Enable what can be done now."""
        super().follow()
        is_busy, has_views = self._jobs.is_busy, bool(self.collection.views)
        describe(self.go, self.tr("Stop looking") if self.is_running else self.tr("Look for the board"))
        self.take.setEnabled(self.is_running)
        self.form.setEnabled(not is_busy)
        self.clear.setEnabled(has_views)
        self.remove.setEnabled(bool(self.views.selected_views))
        self.calibrate.setEnabled(has_views and not is_busy)
        self.save.setEnabled(self.found is not None and not is_busy)


class BoardForm(ImageForm):
    """Board, size of a square, and source.

    Signals
    -------
    changed()
        Another board: views of the one before do not count for it.
    size_changed()
        Another size of its squares.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    changed = Signal()
    size_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.columns, self.rows, self.square = QSpinBox(self), QSpinBox(self), QDoubleSpinBox(self)
        words = QLabel("×", self), QLabel(self.tr("corners"), self)
        corners = row_of(self.columns, words[0], self.rows, words[1], room=True)
        self.fields.addRow(self.tr("Board"), corners)
        self.fields.addRow(self.tr("Square"), self.square)
        self.add_source()
        self.add_buttons()
        put_texts(self)
        set_up_number(self.square, (0.1, _LARGEST_SQUARE), 3, self.tr(" mm"))
        for box in (self.columns, self.rows):
            box.setRange(3, _MOST_CORNERS)
        self._show_usual()
        for box in (self.columns, self.rows):
            box.valueChanged.connect(self.changed)
        self.square.valueChanged.connect(self.size_changed)
        self.simulated.clicked.connect(self._choose_simulation)

    @property
    def board(self) -> Board:
        """The board."""
        return Board(self.columns.value(), self.rows.value(), self.square.value())

    def _show_usual(self) -> None:
        self.columns.setValue(9)
        self.rows.setValue(6)
        self.square.setValue(25.0)

    def _choose_simulation(self) -> None:
        self._show_usual()
        self.take_source(_SIMULATED_BOARD)
