"""Which joints there are, said by the user; found if nothing is said."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from PySide6.QtCore import Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QComboBox, QGridLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from skelgen_gui.capture.measured import RowTable
from skelgen_gui.capture.step import row_of


class Wished(NamedTuple):
    """A joint that the user names; its kind is empty if it is to be found."""

    name: str
    parent: str
    child: str
    kind: str = ""


class WishTable(RowTable):
    """The joints that were named; Delete takes the chosen ones away.

    Signals
    -------
    removal_wanted()
        The chosen ones shall go.
    """

    removal_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        tip = self.tr("Joints that are measured; Delete takes the chosen ones away. Without any, joints are found")
        titles = self.tr("Joint"), self.tr("Parent"), self.tr("Child"), self.tr("Kind")
        self.describe(self.tr("Joints that are measured"), tip, titles)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Take the chosen ones away."""
        if event.matches(QKeySequence.StandardKey.Delete):
            self.removal_wanted.emit()
        else:
            super().keyPressEvent(event)


class WishList(QWidget):
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
        self.wishes: tuple[Wished, ...] = ()
        self.name, self.parent_box, self.child_box = QLineEdit(self), QComboBox(self), QComboBox(self)
        self.kind, self.more, self.table = QComboBox(self), QPushButton(self.tr("Name joint"), self), WishTable(self)
        self.less = QPushButton(self.tr("Remove joint"), self)
        self._kinds = {self.tr("kind is found"): "", self.tr("ball"): "ball", self.tr("hinge"): "hinge"}
        self._describe()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        fields = QGridLayout()
        for number, widget in enumerate((self.name, self.kind, self.parent_box, self.child_box)):
            fields.addWidget(widget, number // 2, number % 2)
            fields.setColumnStretch(number % 2, 1)
        layout.addLayout(fields)
        layout.addLayout(row_of(self.more, self.less))
        layout.addWidget(self.table)
        self.name.textChanged.connect(self._follow)
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
        self._show(tuple(wish for wish in self.wishes if wish.parent in names and wish.child in names))

    def _describe(self) -> None:
        self.name.setPlaceholderText(self.tr("Joint, such as elbow"))
        self.name.setAccessibleName(self.tr("Name of the joint"))
        self.name.setToolTip(self.tr("Without names, joints are found from the motion, with their kinds"))
        self.kind.addItems(list(self._kinds))
        for box, name, tip, hint in (
            (self.kind, self.tr("Kind of the joint"), self.tr("Found from the motion, or stated"), ""),
            (
                self.parent_box,
                self.tr("Parent of the joint"),
                self.tr("The target that carries the joint, such as the upper arm of the elbow"),
                self.tr("Parent"),
            ),
            (
                self.child_box,
                self.tr("Child of the joint"),
                self.tr("The target that turns, such as the lower arm of the elbow"),
                self.tr("Child"),
            ),
        ):
            box.setAccessibleName(name)
            box.setToolTip(tip)
            box.setPlaceholderText(hint)
            box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.setMinimumContentsLength(8)
        for button, tip in (
            (self.more, self.tr("Measure this joint, and others that are named")),
            (self.less, self.tr("Do not measure the chosen joints")),
        ):
            button.setAccessibleName(button.text())
            button.setToolTip(tip)

    @property
    def _wish(self) -> Wished:
        """What the fields say."""
        kind = self._kinds[self.kind.currentText()]
        return Wished(self.name.text().strip(), self.parent_box.currentText(), self.child_box.currentText(), kind)

    def _follow(self) -> None:
        name, parent, child, _ = self._wish
        is_new = bool(name) and name not in [wish.name for wish in self.wishes]
        self.more.setEnabled(is_new and bool(parent) and bool(child) and parent != child)
        self.less.setVisible(bool(self.wishes))
        self.less.setEnabled(bool(self.table.selectedIndexes()))

    def _add(self) -> None:
        self._show((*self.wishes, self._wish))
        self.name.clear()

    def _remove(self) -> None:
        rows = {index.row() for index in self.table.selectedIndexes()}
        self._show(tuple(wish for row, wish in enumerate(self.wishes) if row not in rows))

    def _show(self, wishes: tuple[Wished, ...]) -> None:
        if wishes != self.wishes:
            self.wishes = wishes
            kinds = {kind: title for title, kind in self._kinds.items()}
            self.table.show_rows([(*wish[:3], kinds[wish.kind]) for wish in wishes])
            self.changed.emit()
        self._follow()
