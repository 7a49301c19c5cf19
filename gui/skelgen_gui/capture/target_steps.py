"""The steps that calibrate a rigid target, and joints between targets.

A target is turned before the cameras and named, joints are moved as far as they go; what was measured is added to the
settings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QGridLayout, QLabel, QLineEdit, QPushButton, QWidget
from skelgen_formats.capture_settings import read_any_settings

from skelgen.app.capture import add_body, add_joints
from skelgen.app.capture_jobs.messages import CaptureControl, Feed, TargetShot
from skelgen.capture.values import JointRequest, frames_from_text, start_from_text
from skelgen.errors import InputError, SkelgenError
from skelgen.model.rig import AnySettings
from skelgen_gui.capture.forms import AdvancedFields, JointForm, TargetForm
from skelgen_gui.capture.measured import BallTable, JointTable, MotionTable, RowTable, TurnView
from skelgen_gui.capture.steps import AddingStep, Plan
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.jobs import Jobs
from skelgen_gui.widgets.fields import keep_narrow
from skelgen_gui.widgets.layouts import bare_column, put_texts, row_of

if TYPE_CHECKING:
    from skelgen.app.capture_jobs.collecting import BodyCollector, JointCollector
    from skelgen.capture.calibration.body import BodyCalibration
    from skelgen.capture.calibration.joints import JointCalibration
    from skelgen.capture.calibration.taking import BodyProgress, JointProgress


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
        put_texts(self)
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

        def collector(control: CaptureControl, feed: Feed[TargetShot[BodyProgress]]) -> BodyCollector:
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


class JointStep(AddingStep["JointCollector", "JointCalibration", "JointProgress"]):
    """Takes pairs of images of targets that move, calibrates their joints, adds these to the settings.

    Parameters
    ----------
    jobs, report_error, parent
        As of `Step`.
    """

    def __init__(self, jobs: Jobs, report_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        self._form = JointForm()
        super().__init__(self._form, jobs, report_error, parent)
        self.requests, self.motions, self.turns = RequestList(self), MotionTable(self), TurnView(self)
        self.joints = JointTable(self)
        self._reader = Deriver(self)
        self.results = (self.joints,)
        put_texts(self)
        heading = QLabel(self.tr("Joints (found if none is named)"), self)
        parts = (self.form, heading, self.requests, self.go, self.state, self.motions, self.turns)
        self.lay_out((*parts, row_of(self.calibrate, self.add), self.verdict, self.joints))
        self.form.settings.changed.connect(self.read_targets)
        self.motions.itemSelectionChanged.connect(self._show_chosen)
        self.follow()

    def read_targets(self) -> None:
        """Read which targets the settings have by now."""
        self._reader.derive(partial(_targets_in, self.form.settings.path), self.requests.show_targets)

    @property
    def invitation(self) -> str:
        """What the user is asked to do, before anything is seen."""
        return self.tr(
            "Begin in the pose whose angles shall be zero, press Start, and move all joints as far as they go, balls "
            "about all axes."
        )

    def plan(self) -> Plan[JointCollector, JointCalibration, JointProgress]:
        """Return what is to be done as the form says now."""
        options, requests, chosen = self.form.options, self.requests.requests, self._form.use_frames.text()

        def collector(control: CaptureControl, feed: Feed[TargetShot[JointProgress]]) -> JointCollector:
            from skelgen.app.capture_jobs.collecting import JointCollector  # noqa: PLC0415 - loads what captures need

            return JointCollector(options, control, feed, requests)

        return Plan(collector, lambda collector, _: collector.calibrate(requests, frames_from_text(chosen)))

    def show_progress(self, progress: JointProgress) -> None:
        """Show how far it is."""
        if progress.n_found:
            self.requests.show_targets(list(progress.n_found))
        self.motions.show_motions(progress.motions)
        self._show_chosen()
        sentences = [self.tr("{0} pairs of images.").format(progress.n_frames)]
        for name, count in progress.n_found.items():
            if 2 * count < progress.n_frames:
                share = 100 * count / progress.n_frames
                sentences.append(self.tr("{0} is seen in {1:.0f} % of them.").format(name, share))
        self.state.setText(" ".join([*sentences, self._advice(progress)]).strip())

    def show_found(self, found: JointCalibration | None) -> None:
        """Show what came out."""
        if found is None:
            self.joints.hide()
        else:
            self.joints.show_calibration(found)
            self.motions.show_motions(found.motions)
            self._show_chosen()

    def adding(self, found: JointCalibration) -> Callable[[Path, AnySettings], tuple[str, ...]]:
        """Return what adds the joints to settings."""

        def add(path: Path, used: AnySettings) -> tuple[str, ...]:
            add_joints(path, used, found)
            return ()

        return add

    def _advice(self, progress: JointProgress) -> str:
        """What is still to be done: for the joints that were named, or for any motion at all."""
        types = {(request.parent, request.child): request.kind for request in self.requests.requests}
        if not types:
            is_moved = any(not motion.advice() for motion in progress.motions)
            return "" if is_moved else self.tr("Move all joints as far as they go.")
        advice = [motion.advice(types.get((motion.parent, motion.child), "")) for motion in progress.motions]
        first = next(filter(None, advice), "")
        return f"{first[0].upper()}{first[1:]}." if first else self.tr("That is enough.")

    def _show_chosen(self) -> None:
        self.turns.show_motion(self.motions.chosen)


def _targets_in(path: str) -> tuple[str, ...]:
    """Names of the targets in a settings file; none if there is no such file, or it is none. On a thread."""
    if not Path(path).is_file():
        return ()
    try:
        return tuple(body.name for body in read_any_settings(path).bodies)
    except SkelgenError:
        return ()  # the user sees the reason when the settings are used


class RequestList(QWidget):
    """A row to name a joint, and the joints that were named.

    Signals
    -------
    changed()
        Others were named.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.requests: tuple[JointRequest, ...] = ()
        self.name, self.parent_box, self.child_box = QLineEdit(self), QComboBox(self), QComboBox(self)
        self.kind, self.more, self.table = QComboBox(self), QPushButton(self.tr("Name joint"), self), RowTable(self)
        self.less, self.start = QPushButton(self.tr("Remove joint"), self), QLineEdit(self)
        self.advanced = AdvancedFields([(self.tr("Start of search"), self.start)], self)
        self._types = {self.tr("type is found"): "", self.tr("ball"): "ball", self.tr("hinge"): "hinge"}
        self._describe()
        fields = QGridLayout()
        for number, widget in enumerate((self.name, self.kind, self.parent_box, self.child_box)):
            fields.addWidget(widget, number // 2, number % 2)
            fields.setColumnStretch(number % 2, 1)
        bare_column(self, (fields, self.advanced, row_of(self.more, self.less), self.table))
        for line in (self.name, self.start):
            line.textChanged.connect(self._follow)
        for box in (self.parent_box, self.child_box):
            box.currentIndexChanged.connect(self._follow)
        self.more.clicked.connect(self._add)
        self.less.clicked.connect(self._remove)
        self.table.removal_wanted.connect(self._remove)
        self.table.itemSelectionChanged.connect(self._follow)
        self._follow()

    def show_targets(self, names: Sequence[str]) -> None:
        """Offer other targets; joints between targets that are gone go with them."""
        for box in (self.parent_box, self.child_box):
            chosen = box.currentText()
            if [box.itemText(row) for row in range(box.count())] != list(names):
                box.clear()
                box.addItems(list(names))
                box.setCurrentIndex(max(box.findText(chosen), -1))
        self._show(tuple(request for request in self.requests if request.parent in names and request.child in names))

    def _describe(self) -> None:
        self.kind.addItems(list(self._types))
        for box in (self.kind, self.parent_box, self.child_box):
            keep_narrow(box, 8)
        put_texts(self)

    @property
    def _request(self) -> JointRequest:
        """The values of the fields."""
        kind, start = self._types[self.kind.currentText()], self.start.text().strip()
        names = self.name.text().strip(), self.parent_box.currentText(), self.child_box.currentText()
        return JointRequest(*names, kind, start_from_text(start) if start else None)

    def _follow(self) -> None:
        self.more.setToolTip(self.tr("Measure this joint, and others that are named"))
        try:
            wanted = self._request
            is_new = bool(wanted.name) and wanted.name not in [request.name for request in self.requests]
            are_two = bool(wanted.parent) and bool(wanted.child) and wanted.parent != wanted.child
            self.more.setEnabled(is_new and are_two)
        except InputError as error:
            self.more.setEnabled(False)
            self.more.setToolTip(str(error))
        self.less.setVisible(bool(self.requests))
        self.less.setEnabled(bool(self.table.selectedIndexes()))

    def _add(self) -> None:
        self._show((*self.requests, self._request))
        self.name.clear()
        self.start.clear()

    def _remove(self) -> None:
        rows = {index.row() for index in self.table.selectedIndexes()}
        self._show(tuple(request for row, request in enumerate(self.requests) if row not in rows))

    def _show(self, requests: tuple[JointRequest, ...]) -> None:
        if requests != self.requests:
            self.requests = requests
            kinds = {kind: title for title, kind in self._types.items()}
            self.table.show_rows(
                [(request.name, request.parent, request.child, kinds[request.kind]) for request in requests]
            )
            self.changed.emit()
        self._follow()
