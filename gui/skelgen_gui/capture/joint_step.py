"""The step that calibrates joints: move them before the cameras, as far as they go, and add them to the settings."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from PySide6.QtWidgets import QLabel, QWidget

from skelgen.errors import SkelgenError
from skelgen_gui.capture.adding import AddingStep, Plan
from skelgen_gui.capture.measured import JointTable, MotionTable
from skelgen_gui.capture.messages import JointProgress
from skelgen_gui.capture.source_form import JointForm
from skelgen_gui.capture.step import row_of
from skelgen_gui.capture.turn_view import TurnView
from skelgen_gui.capture.wish_list import WishList
from skelgen_gui.derived import Deriver
from skelgen_gui.jobs import Jobs

if TYPE_CHECKING:
    from skelgen.capture.calibration.joints import JointCalibration
    from skelgen.model.rig import CaptureSettings


class JointStep(AddingStep):
    """Takes pairs of images of targets that move, calibrates their joints, adds these to the settings.

    Parameters
    ----------
    jobs, tell_error, parent
        As of `Step`.
    """

    def __init__(self, jobs: Jobs, tell_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(JointForm(), jobs, tell_error, parent)
        self.wishes, self.motions, self.turns = WishList(self), MotionTable(self), TurnView(self)
        self.joints = JointTable(self)
        self._reader = Deriver(self)
        self.results = (self.joints,)
        self.add.setToolTip(self.tr("Write the joints into the settings, in place of those of the same names"))
        heading = QLabel(self.tr("Joints (found if none is named)"), self)
        parts = (self.form, heading, self.wishes, self.go, self.state, self.motions, self.turns)
        self.lay_out((*parts, row_of(self.calibrate, self.add), self.verdict, self.joints))
        self.form.settings.changed.connect(self.read_targets)
        self.motions.itemSelectionChanged.connect(self._show_chosen)
        self.follow()

    def read_targets(self) -> None:
        """Look which targets the settings have by now."""
        self._reader.derive(partial(_targets_in, self.form.settings.path), self.wishes.show_targets)

    @property
    def invitation(self) -> str:
        """What to do, before anything is seen."""
        return self.tr(
            "Begin in the pose whose angles shall be zero, press Start, and move all joints as far as they go, balls "
            "about all axes."
        )

    def plan(self) -> Plan:
        """Return what is to be done as the form says now."""
        wish, wished = self.form.wish, self.wishes.wishes

        def take(stop: Event, feed: Any) -> Any:
            from skelgen.capture.calibration.joints import JointWish  # noqa: PLC0415 - with what captures need, a second
            from skelgen_gui.capture.taking import JointsTaking  # noqa: PLC0415

            return JointsTaking(wish, stop, feed, [JointWish(*one) for one in wished])

        def calibrate(taking: Any, _: Any) -> Any:
            from skelgen.capture.calibration.joints import JointWish  # noqa: PLC0415

            return taking.calibrate([JointWish(*one) for one in wished])

        return Plan(take, calibrate)

    def show_progress(self, progress: JointProgress) -> None:
        """Show how far it is."""
        if progress.n_found:
            self.wishes.show_targets(list(progress.n_found))
        self.motions.show_motions(progress.motions)
        self._show_chosen()
        told = [self.tr("{0} pairs of images.").format(progress.n_frames)]
        for name, count in progress.n_found.items():
            if 2 * count < progress.n_frames:
                share = 100 * count / progress.n_frames
                told.append(self.tr("{0} is seen in {1:.0f} % of them.").format(name, share))
        self.state.setText(" ".join([*told, self._advice(progress)]).strip())

    def show_found(self, found: JointCalibration | None) -> None:
        """Show what came out."""
        if found is None:
            self.joints.hide()
        else:
            self.joints.show_calibration(found)
            self.motions.show_motions(found.motions)
            self._show_chosen()

    def change(self, told: list[str]) -> Callable[[CaptureSettings], CaptureSettings]:
        """Return what adds the joints to settings."""
        found = self.found

        def added(settings: CaptureSettings) -> CaptureSettings:
            from skelgen.app.capture import with_joints  # noqa: PLC0415

            return with_joints(settings, found)

        return added

    def _advice(self, progress: JointProgress) -> str:
        """What is still to be done: for the joints that were named, or for any motion at all."""
        kinds = {(wish.parent, wish.child): wish.kind for wish in self.wishes.wishes}
        if not kinds:
            is_moved = any(not motion.advice() for motion in progress.motions)
            return "" if is_moved else self.tr("Move all joints as far as they go.")
        advice = [motion.advice(kinds.get((motion.parent, motion.child), "")) for motion in progress.motions]
        told = next(filter(None, advice), "")
        return f"{told[0].upper()}{told[1:]}." if told else self.tr("That is enough.")

    def _show_chosen(self) -> None:
        self.turns.show_motion(self.motions.chosen)


def _targets_in(path: str) -> tuple[str, ...]:
    """Names of the targets in a settings file; none if there is no such file, or it is none. On a thread."""
    from skelgen_formats.capture_settings import read_settings  # noqa: PLC0415 - lxml costs 50 ms

    if not Path(path).is_file():
        return ()
    try:
        return tuple(body.name for body in read_settings(path).bodies)
    except SkelgenError:
        return ()  # the reason is told when the settings are used
