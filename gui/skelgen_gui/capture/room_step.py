"""The step that calibrates the cameras of a room: a wand is waved, an L-frame laid on the floor, settings written."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLineEdit, QPushButton, QWidget

from skelgen.app.capture import save_cameras
from skelgen.app.capture_jobs.images import NO_BODY
from skelgen.app.capture_jobs.messages import CaptureControl, FoundInSpace, WandShot
from skelgen.app.room import Ground, on_floor
from skelgen.capture.values import numbers_from_text
from skelgen.errors import InputError
from skelgen.progress import Monitor
from skelgen_gui.capture.forms import ImageForm, SourceField
from skelgen_gui.capture.steps import Step
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.widgets.layouts import describe, put_texts, row_of

if TYPE_CHECKING:
    from skelgen.app.capture_jobs.collecting import WandCollector
    from skelgen.capture.room.calibrate import WandCalibration
    from skelgen.capture.room.taking import WandProgress

_WAVED = "room:wand?cameras=4&frames=600&rate=30&width=480"
_LYING = "room:frame?cameras=4&frames=3&width=480"
_MOST_SHOWN = 3000  # balls in space


class RoomStep(Step[WandShot]):
    """Takes a waved wand by all cameras, calibrates them, puts the world on the floor, and saves settings.

    Signals
    -------
    calibrated(object, object)
        The cameras that were found, and where the wand was, a `FoundInSpace`.

    Parameters
    ----------
    jobs, report_error, parent
        As of `Step`.
    """

    calibrated = Signal(object, object)

    def __init__(self, jobs: Jobs, report_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(jobs, report_error, parent)
        self.form = RoomForm(self)
        self.calibrate, self.floor, self.save = QPushButton(self), QPushButton(self), QPushButton(self)
        self.found: WandCalibration | None = None
        self._collectors: list[WandCollector] = []
        put_texts(self)
        self.lay_out((self.form, self.go, self.state, row_of(self.calibrate, self.floor, self.save), self.verdict))
        self.form.start_wanted.connect(self.start)
        self.calibrate.clicked.connect(self.run_calibration)
        self.floor.clicked.connect(self.find_floor)
        self.save.clicked.connect(self.save_settings)
        self.follow()

    def start(self) -> None:
        """Take the wand from the beginning."""
        if self._jobs.is_busy:
            return
        source, control, feed, collectors = self.form.source.source, CaptureControl(), self.feed, self._collectors
        if not source:
            self.verdict.show_problem(self.tr("Choose where the images come from, or the simulated wand."))
            return
        try:
            distances = self.form.distances
        except InputError as error:
            self.verdict.show_problem(str(error))
            return
        title = self.tr("Waving the wand")
        collectors.clear()
        self.found = None
        self.verdict.clear()

        def work(monitor: Monitor) -> None:
            from skelgen.app.capture_jobs.collecting import WandCollector  # noqa: PLC0415 - loads what captures need

            collector = WandCollector(source, distances, control, feed)
            collectors.append(collector)  # at once: what it takes stays, whatever ends it
            collector.run(title, monitor)

        self.collect(title, control, work, lambda _: None)

    def run_calibration(self) -> None:
        """Calibrate with what was taken."""
        if self._jobs.is_busy or not self._collectors:
            return
        collector, title = self._collectors[0], self.tr("Calibrating")

        def work(monitor: Monitor) -> WandCalibration:
            monitor.begin(title)
            return collector.calibrate()

        def done(found: WandCalibration) -> None:
            self.state.setText(self.tr("2. Lay the L-frame on the floor, put the wand away, and press Find the floor."))
            self._show_found(found)

        self.verdict.clear()
        self.run(title, work, done)

    def find_floor(self) -> None:
        """Put the world where the L-frame lies."""
        found = self.found
        if self._jobs.is_busy or found is None:
            return
        try:
            ground = self.form.lying
        except InputError as error:
            self.verdict.show_problem(str(error))
            return

        def done(on_ground: WandCalibration) -> None:
            self.state.setText(self.tr("3. Save the settings, and capture with them."))
            self._show_found(on_ground)

        self.run(self.tr("Looking for the L-frame"), lambda monitor: on_floor(found, ground, monitor), done)

    def save_settings(self) -> None:
        """Ask for a file, and write the settings of the cameras."""
        found, path = self.found, self.asked_settings("room.xml")
        if found is None or path is None:
            return

        def done(_: int) -> None:
            self.state.setText(self.tr("Saved: {0}.").format(path))
            self.saved.emit(path)

        self.run(self.tr("Saving"), lambda _: save_cameras(found.rig, path, path), done)

    def show_newest(self) -> None:
        """Show the newest pictures, and what they have covered by now."""
        newest, _ = self.feed.take()
        if newest is not None:
            self.shot.emit(newest)
            self.state.setText(self._guide(newest.progress))
            if newest.progress.room is not None:
                self._show_room(newest.progress.room)

    def follow(self) -> None:
        """Enable what can be done now."""
        super().follow()
        is_free = not self._jobs.is_busy
        describe(self.go, self.tr("Stop waving") if self.is_running else self.tr("Wave the wand"))
        self.form.setEnabled(is_free)
        self.calibrate.setEnabled(is_free and bool(self._collectors))
        self.floor.setEnabled(is_free and self.found is not None)
        self.save.setEnabled(is_free and self.found is not None)

    def _guide(self, progress: WandProgress) -> str:
        """Say what is missing, or that it is enough."""
        missing = progress.sentences()
        if progress.is_enough:
            missing = [self.tr("Enough: stop waving, and calibrate."), *missing]
        return "\n".join([self.tr("{0} moments taken.").format(progress.n_frames), *missing])

    def _show_found(self, found: WandCalibration) -> None:
        self.found = found
        self.verdict.show_verdict(found.verdict)
        self._show_room(found)
        self.show_end()
        self.follow()

    def _show_room(self, found: WandCalibration) -> None:
        some = found.room[:: len(found.room) // _MOST_SHOWN + 1]
        self.calibrated.emit(found.rig, FoundInSpace(some, np.full(len(some), NO_BODY, dtype=np.intp)))


class RoomForm(ImageForm):
    """Wand, L-frame, and where their images come from.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.wand, self.arms = QLineEdit("0, 180, 500", self), QLineEdit("600, 400", self)
        self.fields.addRow(self.tr("Wand"), self.wand)
        self.add_source()
        self.add_buttons()
        self.ground = SourceField(self)
        put_texts(self)
        self.fields.addRow(self.tr("L-frame"), self.arms)
        self.fields.addRow(self.tr("its source"), self.ground)
        self.simulated.clicked.connect(self._choose_simulation)

    @property
    def distances(self) -> tuple[float, ...]:
        """Where the balls are along the wand [mm]."""
        return _numbers(self.wand)

    @property
    def lying(self) -> Ground:
        """The L-frame."""
        return Ground(self.ground.source or self.source.source, _numbers(self.arms))

    def _choose_simulation(self) -> None:
        self.wand.setText("0, 180, 500")
        self.arms.setText("600, 400")
        self.ground.show_source(_LYING)
        self.take_source(_WAVED)


def _numbers(field: QLineEdit) -> tuple[float, ...]:
    return numbers_from_text(field.text(), field.accessibleName())
