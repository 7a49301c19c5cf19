"""What the calibrations of targets and joints are told: settings, and where images come from."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFormLayout, QHBoxLayout, QLineEdit, QMenu, QPushButton, QSpinBox, QWidget

from skelgen_gui.capture.choice import FolderButton, SettingsField, SourceField
from skelgen_gui.capture.messages import LiveWish

SIMULATED_TARGET = "simulated:target?paced=yes&rate=30&frames=600&show={0}"
"""A target that is turned before the simulated rig for 20 seconds, as cameras would deliver it."""

SIMULATED_JOINTS = "simulated:arm?paced=yes&rate=30&frames=900"
"""The simulated arm as it moves for half a minute."""

_MOST_BALLS = 40


class SourceForm(QWidget):
    """Settings and source.

    Signals
    -------
    start_wanted()
        What the form says shall be taken.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    start_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.settings, self.source = SettingsField(self), SourceField(self)
        self.folder, self.simulated = FolderButton(self), QPushButton(self)
        self.source.show_hint(self.tr("that of the settings"))
        sources = QHBoxLayout()
        for button in (self.folder, self.simulated):
            sources.addWidget(button)
        sources.addStretch(1)
        self.rows = QFormLayout(self)
        self.rows.setContentsMargins(0, 0, 0, 0)
        self.rows.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        self.rows.addRow(self.tr("Settings"), self.settings)
        self.rows.addRow(self.tr("Source"), self.source)
        self.rows.addRow("", sources)
        self.folder.chosen.connect(self.take_source)

    @property
    def wish(self) -> LiveWish:
        """What the form says."""
        return LiveWish(self.settings.path, self.source.source)

    def take_source(self, source: str) -> None:
        """Fill in a source, and wish for its start."""
        self.source.show_source(source)
        self.start_wanted.emit()


class TargetForm(SourceForm):
    """Name and number of balls of a target, settings and source."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name, self.balls = QLineEdit(self), QSpinBox(self)
        self.name.setPlaceholderText(self.tr("such as upper arm"))
        self.name.setAccessibleName(self.tr("Name of the target"))
        self.name.setToolTip(self.tr("What the rigid body is called; one of the same name is replaced"))
        self.balls.setRange(3, _MOST_BALLS)
        self.balls.setSpecialValueText(self.tr("found"))
        self.balls.setAccessibleName(self.tr("Number of balls"))
        self.balls.setToolTip(self.tr("Found from the images; state it if other things shine as well"))
        self.simulated.setText(self.tr("Simulated target…"))
        self.simulated.setAccessibleName(self.tr("Look at a simulated target"))
        self.simulated.setToolTip(self.tr("Try it without cameras: a target of the simulated arm is turned"))
        self.targets = QMenu(self)
        for title, name in (
            (self.tr("Torso"), "torso"),
            (self.tr("Upper arm"), "upper arm"),
            (self.tr("Lower arm"), "lower arm"),
        ):
            self.targets.addAction(title).triggered.connect(partial(self.choose_simulation, name))
        self.simulated.setMenu(self.targets)
        self.rows.insertRow(1, self.tr("Name"), self.name)
        self.rows.insertRow(2, self.tr("Balls"), self.balls)

    @property
    def n_balls(self) -> int | None:
        """The number of balls; None if it is to be found."""
        return self.balls.value() if self.balls.value() > self.balls.minimum() else None

    def choose_simulation(self, name: str) -> None:
        """Fill in a target of the simulated arm, and wish for its start."""
        self.name.setText(name)
        self.balls.setValue(self.balls.minimum())
        self.take_source(SIMULATED_TARGET.format(name))


class JointForm(SourceForm):
    """Settings and source of joints."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.simulated.setText(self.tr("Simulated arm"))
        self.simulated.setAccessibleName(self.tr("Look at the simulated arm"))
        self.simulated.setToolTip(self.tr("Try it without cameras: an arm with three targets moves"))
        self.simulated.clicked.connect(self._choose_simulation)

    def _choose_simulation(self) -> None:
        self.take_source(SIMULATED_JOINTS)
