"""The step that calibrates a rigid body: turn it before the cameras, name it, add it to the settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from skelgen.app.capture import add_body
from skelgen.app.capture_jobs.messages import CollectingControl, Feed, TargetShot
from skelgen.model.rig import AnySettings
from skelgen_gui.capture.forms import TargetForm
from skelgen_gui.capture.measured import BallTable
from skelgen_gui.capture.steps import AddingStep, Plan
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.widgets.layouts import row_of

if TYPE_CHECKING:
    from skelgen.app.capture_jobs.collecting import BodyCollector
    from skelgen.capture.calibration.body import BodyCalibration
    from skelgen.capture.calibration.taking import BodyProgress


class TargetStep(AddingStep["BodyCollector", "BodyCalibration", "BodyProgress"]):
    """Takes pairs of images of one target, calibrates it, says what it is worth, adds it to the settings.

    Parameters
    ----------
    jobs, report_error, parent
        As of `Step`.
    """

    form: TargetForm

    def __init__(self, jobs: Jobs, report_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(TargetForm(), jobs, report_error, parent)
        self.balls = BallTable(self)
        self.results = (self.balls,)
        self.add.setToolTip(self.tr("Write the target into the settings, in place of one of the same name"))
        self.lay_out((self.form, self.go, self.state, row_of(self.calibrate, self.add), self.verdict, self.balls))
        self.form.name.textChanged.connect(self.follow)
        self.follow()

    @property
    def invitation(self) -> str:
        """What the user is asked to do, before anything is seen."""
        return self.tr(
            "Press Start, hold one target before the cameras, nothing else that shines, and turn it slowly to all "
            "sides."
        )

    def plan(self) -> Plan[BodyCollector, BodyCalibration, BodyProgress]:
        """Return what is to be done as the form says now."""
        options, name, n_balls = self.form.options, self._name, self.form.n_balls

        def collector(control: CollectingControl, feed: Feed[TargetShot[BodyProgress]]) -> BodyCollector:
            from skelgen.app.capture_jobs.collecting import BodyCollector  # noqa: PLC0415 - loads what captures need

            return BodyCollector(options, control, feed, name, n_balls)

        return Plan(collector, lambda collector, monitor: collector.calibrate(name, n_balls, monitor))

    def show_progress(self, progress: BodyProgress) -> None:
        """Show how far it is."""
        if progress.problem:
            self.verdict.show_problem(progress.problem)
        else:
            self.verdict.clear()
        if not progress.n_balls:
            self.state.setText(self.tr("No target is seen in {0} pairs of images.").format(progress.n_frames))
            return
        counts = self.tr("{0} balls, seen alone in {1} of {2} pairs of images; turned by {3:.0f}°.")
        counts = counts.format(progress.n_balls, progress.n_alone, progress.n_frames, progress.turn)
        more = self.tr("That is enough.") if progress.is_enough else self.tr("Turn it further, to all sides.")
        self.state.setText(f"{counts} {more}")

    def show_found(self, found: BodyCalibration | None) -> None:
        """Show what came out."""
        if found is None:
            self.balls.hide()
        else:
            self.balls.show_calibration(found)

    def adding(self, found: BodyCalibration) -> Callable[[Path, AnySettings], tuple[str, ...]]:
        """Return what adds the target to settings, under the name that stands in the form by now."""
        named = replace(found, target=replace(found.target, name=self._name))
        return lambda path, used: add_body(path, used, named)

    def follow(self) -> None:
        """Enable what can be done now."""
        super().follow()
        self.add.setEnabled(self.add.isEnabled() and bool(self.form.name.text().strip()))

    @property
    def _name(self) -> str:
        """What the target is called; it may be named when it was calibrated."""
        return self.form.name.text().strip() or self.tr("target")
