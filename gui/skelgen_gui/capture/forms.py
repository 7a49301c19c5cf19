"""Forms of the Capture page: settings, source of images, name of a target."""

from collections.abc import Iterable
from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFileDialog,
    QFormLayout,
    QLineEdit,
    QMenu,
    QPushButton,
    QSizePolicy,
    QSpinBox,
    QWidget,
)

from skelgen.app.capture_jobs.messages import SIMULATED, SIMULATED_ROOM, CaptureOptions
from skelgen.capture.sources import SOURCES
from skelgen_gui.widgets.fields import Expander, choose_button, keep_narrow
from skelgen_gui.widgets.layouts import bare_column, describe, put_texts, row_of

# A target that is turned before the simulated rig for 20 seconds, as cameras would deliver it
_SIMULATED_TARGET = "simulated:target?paced=yes&rate=30&frames=600&show={0}"

_SIMULATED_JOINTS = "simulated:arm?paced=yes&rate=30&frames=900"  # the simulated arm as it moves for half a minute

_MOST_BALLS = 40


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
        self.line = QLineEdit(self)
        self.browse = choose_button(self.line, title, kinds)
        describe(self.line, title, tip)
        describe(self.browse, self.tr("Choose: {0}").format(title), tip)
        bare_column(self, [row_of(self.line, self.browse)])
        self.setFocusProxy(self.line)
        self.line.textChanged.connect(self.changed)

    @property
    def path(self) -> str:
        """What stands there."""
        return self.line.text().strip()

    def show_path(self, path: str) -> None:
        """Show another path."""
        self.line.setText(path)


class SourceField(QComboBox):
    """The field for the source of images: a text, with an example of each kind to choose.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setEditable(True)
        self.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
        keep_narrow(self, 12)
        for kind in SOURCES:
            self.addItem(kind.example)
            self.setItemData(self.count() - 1, kind.help, Qt.ItemDataRole.ToolTipRole)
        self.setCurrentIndex(-1)
        self.setEditText("")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        put_texts(self)

    @property
    def source(self) -> str:
        """What stands there."""
        return self.currentText().strip()

    def show_source(self, text: str) -> None:
        """Show a text, from its beginning."""
        self.setEditText(text)
        if (edit := self.lineEdit()) is not None:
            edit.setCursorPosition(0)

    def setPlaceholderText(self, text: str) -> None:
        """Show what an empty field means."""
        if (edit := self.lineEdit()) is not None:
            edit.setPlaceholderText(text)


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
        put_texts(self)
        self.clicked.connect(self._choose)

    def _choose(self) -> None:
        name = QFileDialog.getExistingDirectory(self, self.tr("Folder with images"))
        if name:
            self.chosen.emit(f"folder:{name}")


class ImageForm(QWidget):
    """Fields below each other, among them where images come from.

    Signals
    -------
    start_wanted()
        The job shall start with what the form holds.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    start_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.fields = QFormLayout(self)
        self.fields.setContentsMargins(0, 0, 0, 0)
        self.fields.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)

    def add_source(self) -> None:
        """Add the source of images."""
        self.source = SourceField(self)
        self.fields.addRow(self.tr("Source"), self.source)

    def add_buttons(self) -> None:
        """Add the buttons that take a folder, and simulated images."""
        self.folder, self.simulated = FolderButton(self), QPushButton(self)
        self.fields.addRow("", row_of(self.folder, self.simulated, room=True))
        self.folder.chosen.connect(self.take_source)

    def take_source(self, source: str) -> None:
        """Fill in a source, and ask for its start."""
        self.source.show_source(source)
        self.start_wanted.emit()


class AdvancedFields(QWidget):
    """Fields that most captures do not need, behind a button that shows them.

    Parameters
    ----------
    fields : iterable of tuple of str and QWidget
        Title and field of each row; a box that says what it is has no title.
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, fields: Iterable[tuple[str, QWidget]], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        box = QWidget(self)
        self.expander = Expander(box, self.tr("Show or hide what most captures do not need"), self)
        self.expander.show_text(self.tr("Advanced"))
        rows = QFormLayout(box)
        rows.setContentsMargins(0, 0, 0, 0)
        for title, field in fields:
            rows.addRow(title, field)
        bare_column(self, (self.expander, box))


class SourceForm(ImageForm):
    """Settings and source.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        title, kinds = self.tr("Settings of the capture"), self.tr("Settings (*.xml)")
        tip = self.tr("The XML file with cameras, bodies and joints, written by the calibrations")
        self.settings = FileField(title, tip, kinds, self)
        self.fields.addRow(self.tr("Settings"), self.settings)
        self.add_source()
        self.source.setPlaceholderText(self.tr("that of the settings"))

    @property
    def options(self) -> CaptureOptions:
        """What the form holds."""
        return CaptureOptions(self.settings.path, self.source.source)


class LiveChoice(SourceForm):
    """The form above a live capture.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.simulated, self.room = QPushButton(self), QPushButton(self)
        self.predicts, self.predicts_joints = QCheckBox(self), QCheckBox(self)
        self.fields.addRow("", row_of(self.simulated, self.room, room=True))
        self.fields.addRow("", self.predicts)
        put_texts(self)
        self.advanced = AdvancedFields([("", self.predicts_joints)], self)
        self.fields.addRow(self.advanced)
        self.simulated.clicked.connect(lambda: self.choose_simulation(SIMULATED))
        self.room.clicked.connect(lambda: self.choose_simulation(SIMULATED_ROOM))

    @property
    def options(self) -> CaptureOptions:
        """What the form holds."""
        chosen = self.predicts.isChecked(), self.predicts_joints.isChecked()
        return CaptureOptions(self.settings.path, self.source.source, *chosen)

    def choose_simulation(self, source: str) -> None:
        """Fill in the simulated rig or room, and ask for its start."""
        self.settings.show_path("")
        self.take_source(source)


class TargetForm(SourceForm):
    """Name and number of balls of a target, settings and source."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name, self.balls = QLineEdit(self), QSpinBox(self)
        self.balls.setRange(3, _MOST_BALLS)
        self.balls.setSpecialValueText(self.tr("found"))
        self.add_buttons()
        put_texts(self)
        self.targets = QMenu(self)
        titles = self.tr("Torso"), self.tr("Upper arm"), self.tr("Lower arm")
        for title, name in zip(titles, ("torso", "upper arm", "lower arm"), strict=True):
            self.targets.addAction(title).triggered.connect(partial(self.choose_simulation, name))
        self.simulated.setMenu(self.targets)
        self.fields.insertRow(1, self.tr("Name"), self.name)
        self.fields.insertRow(2, self.tr("Balls"), self.balls)

    @property
    def n_balls(self) -> int | None:
        """The number of balls; None if it is to be found."""
        return self.balls.value() if self.balls.value() > self.balls.minimum() else None

    def choose_simulation(self, name: str) -> None:
        """Fill in a target of the simulated arm, and ask for its start."""
        self.name.setText(name)
        self.balls.setValue(self.balls.minimum())
        self.take_source(_SIMULATED_TARGET.format(name))


class JointForm(SourceForm):
    """Settings and source of joints."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.add_buttons()
        self.simulated.clicked.connect(lambda: self.take_source(_SIMULATED_JOINTS))
        self.use_frames = QLineEdit(self)
        put_texts(self)
        self.advanced = AdvancedFields([(self.tr("Frames"), self.use_frames)], self)
        self.fields.addRow(self.advanced)
