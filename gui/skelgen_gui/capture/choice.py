"""What shall be captured: settings, source, and whether poses are smoothed."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QSizePolicy,
    QWidget,
)

from skelgen.capture.sources import SOURCES
from skelgen_gui.capture.messages import SIMULATED, LiveWish


class FileField(QWidget):
    """A path, to be typed or chosen.

    Signals
    -------
    changed()
        Another path.

    Parameters
    ----------
    title : str
        What it is, for readers of the screen and for the dialog.
    tip : str
        What it is for.
    kinds : str
        Filter of the dialog.
    parent : QWidget, optional
        Parent widget.
    """

    changed = Signal()

    def __init__(self, title: str, tip: str, kinds: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._title, self._kinds = title, kinds
        self.line, self.browse = QLineEdit(self), QPushButton(self.tr("Choose…"), self)
        self.line.setAccessibleName(title)
        self.line.setToolTip(tip)
        self.browse.setAccessibleName(self.tr("Choose: {0}").format(title))
        self.browse.setToolTip(tip)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.line, 1)
        layout.addWidget(self.browse)
        self.setFocusProxy(self.line)
        self.line.textChanged.connect(self.changed)
        self.browse.clicked.connect(self._choose)

    @property
    def path(self) -> str:
        """What stands there."""
        return self.line.text().strip()

    def show_path(self, path: str) -> None:
        """Show another path."""
        self.line.setText(path)

    def _choose(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, self._title, self.path, self._kinds)
        if name:
            self.show_path(name)


class SourceField(QComboBox):
    """Where images come from: a text, with an example of each kind to choose.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setEditable(True)
        self.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(12)
        for kind in SOURCES:
            self.addItem(kind.example)
            self.setItemData(self.count() - 1, kind.help, Qt.ItemDataRole.ToolTipRole)
        self.setCurrentIndex(-1)
        self.setEditText("")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(self.tr("Source of images"))
        self.setToolTip(self.tr("Where images come from; the list shows an example of each kind"))

    @property
    def source(self) -> str:
        """What stands there."""
        return self.currentText().strip()

    def show_source(self, text: str) -> None:
        """Show a text, from its beginning."""
        self.setEditText(text)
        edit = self.lineEdit()
        if edit is not None:
            edit.setCursorPosition(0)

    def show_hint(self, text: str) -> None:
        """Say what an empty field means."""
        edit = self.lineEdit()
        if edit is not None:
            edit.setPlaceholderText(text)


class SettingsField(FileField):
    """The settings file of the capture.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            QCoreApplication.translate("SettingsField", "Settings of the capture"),
            QCoreApplication.translate(
                "SettingsField", "The XML file with cameras, bodies and joints, written by the calibrations"
            ),
            QCoreApplication.translate("SettingsField", "Settings (*.xml)"),
            parent,
        )


class FolderButton(QPushButton):
    """Asks for a folder with images, as a source.

    Signals
    -------
    chosen(str)
        The source that was chosen.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setText(self.tr("Image folder…"))
        self.setAccessibleName(self.tr("Take the images of a folder"))
        self.setToolTip(self.tr("A folder with pairs of images such as left01.jpg and right01.jpg"))
        self.clicked.connect(self._choose)

    def _choose(self) -> None:
        name = QFileDialog.getExistingDirectory(self, self.tr("Folder with images"))
        if name:
            self.chosen.emit(f"folder:{name}")


class LiveChoice(QWidget):
    """The form above a live capture.

    Signals
    -------
    simulation_wanted()
        The simulated rig shall be started.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    simulation_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.settings = SettingsField(self)
        self.source = SourceField(self)
        self.source.show_hint(self.tr("that of the settings"))
        self.simulated = QPushButton(self.tr("Simulated rig"), self)
        self.simulated.setAccessibleName(self.tr("Start the simulated rig"))
        self.simulated.setToolTip(self.tr("Try everything without cameras: two simulated ones look at a moving arm"))
        self.predicts = QCheckBox(self.tr("Predict, smooth poses"), self)
        self.predicts.setToolTip(self.tr("A Kalman filter: steadier poses and a shorter search, a little later"))
        layout = QFormLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        layout.addRow(self.tr("Settings"), self.settings)
        layout.addRow(self.tr("Source"), self.source)
        row = QHBoxLayout()
        row.addWidget(self.simulated)
        row.addWidget(self.predicts, 1)
        layout.addRow("", row)
        self.simulated.clicked.connect(self.choose_simulation)

    @property
    def wish(self) -> LiveWish:
        """What the form says."""
        return LiveWish(self.settings.path, self.source.source, self.predicts.isChecked())

    def choose_simulation(self) -> None:
        """Fill in the simulated rig, and wish for its start."""
        self.settings.show_path("")
        self.source.show_source(SIMULATED)
        self.simulation_wanted.emit()
