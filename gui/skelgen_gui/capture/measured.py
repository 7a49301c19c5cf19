"""Tables of what the calibrations of targets and joints found, and of how far joints were moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from skelgen_gui.capture.results import ValueTable

if TYPE_CHECKING:
    from skelgen.capture.calibration.body import BodyCalibration
    from skelgen.capture.calibration.joints import JointCalibration, JointMotion

_MOST_ROWS = 9
_JOINT_ROWS = 3  # its name, and its place in both targets


class RowTable(ValueTable):
    """As high as its rows, up to some; hidden while there is none."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.hide()

    def show_rows(self, rows: Sequence[Sequence[str]]) -> None:
        """Show other rows, each a name and its numbers."""
        super().show_rows(rows)
        n_shown = min(len(rows), _MOST_ROWS)
        height = self.horizontalHeader().sizeHint().height() + 2 * self.frameWidth()
        self.setFixedHeight(height + n_shown * self.verticalHeader().defaultSectionSize())
        self.setVisible(bool(rows))


class BallTable(RowTable):
    """The balls of a target."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        tip = self.tr("Where its balls are in the target, with standard deviations; what has none is so by definition")
        titles = self.tr("Ball"), self.tr("x [mm]"), self.tr("y [mm]"), self.tr("z [mm]")
        self.describe(self.tr("Balls of the target"), tip, titles)

    def show_calibration(self, done: BodyCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.table import ball_rows  # noqa: PLC0415 - only where there is a result

        self.show_rows([[str(value) for value in row.values()] for row in ball_rows(done.target)])


class JointTable(RowTable):
    """Where joints are: a row for the place in each of both targets."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        tip = self.tr(
            "Where joints are in both targets, with standard deviations; the gap is how far these places are apart"
        )
        titles = self.tr("Joint"), self.tr("x [mm]"), self.tr("y [mm]"), self.tr("z [mm]")
        self.describe(self.tr("Joints that were found"), tip, titles)

    def show_calibration(self, done: JointCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.table import place_texts  # noqa: PLC0415

        rows: list[list[str]] = []
        self.clearSpans()
        for joint, fit in zip(done.joints, done.fits, strict=True):
            kind = self.tr("ball") if joint.kind == "ball" else self.tr("hinge")
            rows.append([self.tr("{0}: {1}, gap {2:.2f} mm").format(joint.name, kind, fit.gap), "", "", ""])
            for name, texts in zip((joint.parent, joint.child), place_texts(joint), strict=True):
                rows.append([f"   {name}", *texts])
        self.show_rows(rows)
        for row in range(0, len(rows), _JOINT_ROWS):
            self.setSpan(row, 0, 1, self.columnCount())


class MotionTable(RowTable):
    """How far targets have moved against each other."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        tip = self.tr(
            "How far one target has turned in another about three axes, and in how many pairs of images both are; "
            "the dots below show the chosen one"
        )
        titles = self.tr("Motion"), self.tr("Together"), self.tr("Turned [°]")
        self.describe(self.tr("How far joints were moved"), tip, titles)
        self._motions: tuple[JointMotion, ...] = ()

    @property
    def chosen(self) -> JointMotion | None:
        """The motion whose row is chosen, the first one if none is."""
        row = max(self.currentRow(), 0)
        return self._motions[row] if row < len(self._motions) else None

    def show_motions(self, motions: Sequence[JointMotion]) -> None:
        """Show motions; the rows stay while their numbers change."""
        names = [(motion.parent, motion.child) for motion in motions]
        is_other = names != [(motion.parent, motion.child) for motion in self._motions]
        self._motions = tuple(motions)
        rows = [
            (
                f"{motion.parent} – {motion.child}",
                str(motion.n_frames),
                " · ".join(f"{span:.0f}" for span in motion.spans) if motion.n_frames else "",
            )
            for motion in motions
        ]
        if is_other:
            self.show_rows(rows)
            return
        for row, (_, *texts) in enumerate(rows):
            self.show_row(row, texts)
