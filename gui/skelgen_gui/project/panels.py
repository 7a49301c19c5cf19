"""Panels beside the views: limbs, joints and markers with their names; and how two results differ."""

import math
from collections.abc import Iterable
from functools import partial

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QIcon, QPixmap
from PySide6.QtWidgets import (
    QAbstractItemView,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QSizePolicy,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from skelgen.app.comparison import Comparison, compare_results, comparison_sentences
from skelgen.app.drawing.wording import digits, whole_percent
from skelgen.model import Project
from skelgen.model.corrections import Correction
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.wording import ends_of_joint, joint_words, limb_words, naming_markers
from skelgen_gui.project.corrections import CorrectionActions
from skelgen_gui.project.deriving import Deriver, PanelWhileSeen
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import bare_column, column, fit_columns, put_texts, wrap
from skelgen_gui.widgets.painting import colour_of_limb

_KIND, _INDEX = Qt.ItemDataRole.UserRole, Qt.ItemDataRole.UserRole + 1
_LIMB, _JOINT, _MARKER, _GROUP = "limb", "joint", "marker", "group"
_NAME, _SEEN, _DOUBTS = range(3)  # columns
_SWATCH = 12  # px
_EDITABLE = Qt.ItemFlag.ItemIsEditable
_CHECKABLE = Qt.ItemFlag.ItemIsUserCheckable


class _Item(QTreeWidgetItem):
    """A line that is sorted by numbers where its column holds numbers."""

    def __lt__(self, other: QTreeWidgetItem) -> bool:
        """Whether it stands before another line."""
        column = self.treeWidget().sortColumn() if self.treeWidget() is not None else _NAME
        mine, theirs = self.data(column, _INDEX), other.data(column, _INDEX)
        if column != _NAME and mine is not None and theirs is not None:
            return float(mine) < float(theirs)
        mine, theirs = ((one.data(_NAME, _KIND) == _GROUP, one.text(_NAME)) for one in (self, other))
        return mine < theirs


class Outline(PanelWhileSeen):
    """Limbs with their markers, and joints.

    F2 or a second click renames a limb, a joint or a marker, the box before a name hides it in the 3-D view. Columns
    say how much of a marker is seen, and how many of its spans are doubtful; a click on their heads sorts by them.

    Parameters
    ----------
    session : Session
        Whose project is shown.
    corrections : CorrectionActions
        Rename.

    Signals
    -------
    hidden_wanted(object)
        Names of the markers that are to be hidden, a frozenset; all others are to be shown.
    """

    hidden_wanted = Signal(object)

    def __init__(self, session: Session, corrections: CorrectionActions) -> None:
        super().__init__()
        self._session, self._corrections = session, corrections
        self._hidden: frozenset[str] = frozenset()
        self.search, self.tree = QLineEdit(self), QTreeWidget(self)
        self.tree.setHeaderLabels([self.tr("Name"), self.tr("Seen"), self.tr("Doubts")])
        fit_columns(self.tree.header(), _NAME)
        self.tree.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.tree.setEditTriggers(
            QAbstractItemView.EditTrigger.EditKeyPressed | QAbstractItemView.EditTrigger.SelectedClicked
        )
        self.tree.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.tree.setSortingEnabled(True)
        self.tree.sortByColumn(_NAME, Qt.SortOrder.AscendingOrder)
        put_texts(self)
        bare_column(self, (self.search, self.tree))
        self._is_following = False
        session.project_changed.connect(self._follow_project)
        session.selection_changed.connect(self._follow_selection)
        self.search.textChanged.connect(self._filter)
        self.tree.itemSelectionChanged.connect(self._select)
        self.tree.itemChanged.connect(self._take_change)
        self.tree.customContextMenuRequested.connect(
            lambda place: session.menu_requested.emit(self.tree.viewport().mapToGlobal(place))
        )

    def rename_selected(self) -> None:
        """Let the user type another name for what is selected."""
        self._catch_up()
        items = [item for item in self._items() if item.isSelected() and item.flags() & _EDITABLE]
        if items:
            self.tree.setFocus()
            self.tree.setCurrentItem(items[0], _NAME)
            self.tree.scrollToItem(items[0])
            self.tree.editItem(items[0], _NAME)

    def _items(self) -> list[QTreeWidgetItem]:
        tops = self._tops()
        return [item for top in tops for item in (top, *_children(top))]

    def _tops(self) -> list[QTreeWidgetItem]:
        found = [self.tree.topLevelItem(row) for row in range(self.tree.topLevelItemCount())]
        return [item for item in found if item is not None]

    def _list_project(self) -> None:
        """List what there is by now; what was folded stays folded."""
        folded = {item.text(_NAME) for item in self._items() if item.childCount() and not item.isExpanded()}
        self._is_following = True
        self.tree.clear()
        project = self._session.project
        if project is not None and project.has("labels"):
            self._fill(project)
        for item in self._items():
            item.setExpanded(item.text(_NAME) not in folded)
        self._is_following = False
        self._check()
        self._follow_selection()
        self._filter(self.search.text())

    def _fill(self, project: Project) -> None:
        names, tops = project.trajectories.names, {}
        doubts = [0] * len(names)
        for doubt in project.labelling.doubts if project.has_labelling else ():
            doubts[doubt.marker] += 1
        seen = project.trajectories.seen.mean(axis=0).tolist() if project.trajectories.n_frames else [0.0] * len(names)
        limb_of_marker = project.limbs.limb_of_marker.tolist() if project.has("limbs") else [-1] * len(names)
        if project.has("limbs"):
            for limb in range(project.limbs.n_limbs):
                tops[limb] = self._line(_LIMB, limb, limb_words(project, limb), self.tree)
                tops[limb].setIcon(_NAME, self._swatch(limb))
        for marker, limb in enumerate(limb_of_marker):
            item = self._line(_MARKER, marker, names[marker], tops.get(limb, self.tree))
            for number, text, value in (
                (_SEEN, whole_percent(seen[marker]), seen[marker]),
                (_DOUBTS, str(doubts[marker] or ""), doubts[marker]),
            ):
                item.setText(number, text)
                item.setData(number, _INDEX, value)
                item.setTextAlignment(number, Qt.AlignmentFlag.AlignRight)
        if project.has("joints"):
            group = self._line(_GROUP, -1, self.tr("Joints"), self.tree)
            for joint, ends in enumerate(project.topology.edges.tolist()):
                item = self._line(_JOINT, joint, joint_words(project, joint), group)
                item.setToolTip(_NAME, self.tr("{0} – {1}").format(*(limb_words(project, limb) for limb in ends)))
                if project.has("skeleton"):
                    item.setFlags(item.flags() | _EDITABLE)

    def _swatch(self, limb: int) -> QIcon:
        """A limb's colour in all views."""
        pixmap = QPixmap(_SWATCH, _SWATCH)
        pixmap.fill(colour_of_limb(limb, self.palette()))
        return QIcon(pixmap)

    def changeEvent(self, event: QEvent) -> None:
        """Follow the colours of the window."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._follow_project()

    def _line(self, kind: str, index: int, text: str, parent: QTreeWidget | QTreeWidgetItem) -> QTreeWidgetItem:
        item = _Item([text])
        item.setData(_NAME, _KIND, kind)
        item.setData(_NAME, _INDEX, index)
        item.setToolTip(_NAME, text)
        if kind in {_JOINT, _GROUP}:
            item.setFlags(item.flags() & ~_CHECKABLE)
        else:
            item.setFlags(item.flags() | _EDITABLE | _CHECKABLE)
            item.setCheckState(_NAME, Qt.CheckState.Checked)
        if isinstance(parent, QTreeWidget):
            parent.addTopLevelItem(item)
        else:
            parent.addChild(item)
        item.setFirstColumnSpanned(kind != _MARKER)  # of others only the name is told
        return item

    def _select(self) -> None:
        """Select in the session what is selected here."""
        if self._is_following:
            return
        chosen: dict[str, list[int]] = {_LIMB: [], _JOINT: [], _MARKER: [], _GROUP: []}
        for item in self.tree.selectedItems():
            chosen[item.data(_NAME, _KIND)].append(item.data(_NAME, _INDEX))
        joint = chosen[_JOINT][-1] if chosen[_JOINT] else None
        found = Selection(frozenset(chosen[_MARKER]), joint=joint).with_limbs(frozenset(chosen[_LIMB]))
        self._is_following = True
        self._session.select(found)
        self._is_following = False

    def _follow_selection(self) -> None:
        if self._is_following:
            return
        selection = self._session.selection
        joints: frozenset[int | None] = frozenset({selection.joint})
        wanted = {_MARKER: selection.markers, _LIMB: selection.limbs, _JOINT: joints}
        self._is_following = True
        first = None
        for item in self._items():
            is_chosen = item.data(_NAME, _INDEX) in wanted.get(item.data(_NAME, _KIND), ())
            item.setSelected(is_chosen)
            first = item if is_chosen and first is None else first
        if first is not None:
            self.tree.scrollToItem(first)
        self._is_following = False

    def _take_change(self, item: QTreeWidgetItem, column: int) -> None:
        """Rename, or hide and show."""
        project = self._session.project
        if self._is_following or column != _NAME or project is None:
            return
        kind, index, text = item.data(_NAME, _KIND), item.data(_NAME, _INDEX), item.text(_NAME).strip()
        words = {_LIMB: limb_words, _JOINT: joint_words}.get(kind)
        before = words(project, index) if words else project.trajectories.names[index]
        if text != before:
            self._rename(project, item, before, text)
        elif kind != _JOINT:
            markers = project.limbs.markers_of(index).tolist() if kind == _LIMB else [index]
            names = {project.trajectories.names[marker] for marker in markers}
            is_shown = item.checkState(_NAME) == Qt.CheckState.Checked
            self.hidden_wanted.emit(self._hidden - names if is_shown else self._hidden | names)

    def _rename(self, project: Project, item: QTreeWidgetItem, before: str, text: str) -> None:
        self._is_following = True
        item.setText(_NAME, before)  # until it is so
        self._is_following = False
        if not text:
            return
        kind, index = item.data(_NAME, _KIND), item.data(_NAME, _INDEX)
        if kind == _LIMB:
            self._corrections.apply(Correction("name", naming_markers(project, index), value=text))
        elif kind == _JOINT:
            self._corrections.apply(Correction("name-joint", ends_of_joint(project, index), value=text))
        else:
            self._corrections.apply(Correction("rename", (before,), value=text))

    def show_hidden(self, hidden: Iterable[str]) -> None:
        """Note which markers are hidden by now."""
        self._hidden = frozenset(hidden)
        self._check()

    def _check(self) -> None:
        """Check what is to be seen; a limb is hidden if all its markers are."""
        self._is_following = True
        for item in self._items():
            if item.flags() & _CHECKABLE:
                markers = [child.text(_NAME) for child in _children(item)] or [item.text(_NAME)]
                is_hidden = set(markers) <= self._hidden
                item.setCheckState(_NAME, Qt.CheckState.Unchecked if is_hidden else Qt.CheckState.Checked)
        self._is_following = False

    def _filter(self, text: str) -> None:
        """Show what has a text in its name: markers with their limb, limbs with all their markers."""
        has = partial(_has, text.strip().lower())
        for top in self._tops():
            for child in _children(top):
                child.setHidden(not has(child) and not has(top))
            top.setHidden(not has(top) and not any(has(child) for child in _children(top)))


def _children(item: QTreeWidgetItem) -> list[QTreeWidgetItem]:
    found = [item.child(row) for row in range(item.childCount())]
    return [child for child in found if child is not None]


def _has(text: str, item: QTreeWidgetItem) -> bool:
    return text in item.text(_NAME).lower()


_SELECTION = Qt.ItemDataRole.UserRole


class ComparisonPanel(QWidget):
    """A panel that says how much is the same in both results, and lists each difference; a click selects it.

    Parameters
    ----------
    session : Session
        Holds both.
    """

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session = session
        self.summary, self.lines = QLabel(self), QListWidget(self)
        wrap(self.summary, self.tr("How both results agree"))
        self.summary.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Minimum)
        self.lines.setWordWrap(True)
        put_texts(self)
        column(self, (self.summary, self.lines)).setStretchFactor(self.lines, 1)
        self.deriver = Deriver(self)
        session.project_changed.connect(self._follow)
        session.other_changed.connect(self._follow)
        self.lines.currentItemChanged.connect(self._select)
        self._follow()

    def _follow(self) -> None:
        project, other = self._session.project, self._session.other
        self.lines.clear()
        if project is None or other is None or not project.has("labels") or not other.has("labels"):
            self.deriver.forget()
            self.summary.setText(self.tr("Choose File > Compare with, and another result of this take."))
        else:
            compare, take = partial(compare_results, project, other), partial(self._take, project, other)
            self.deriver.derive(compare, take, lambda error: self.summary.setText(str(error)))

    def _take(self, project: Project, other: Project, found: Comparison) -> None:
        self.summary.setText(".\n".join(comparison_sentences(other, found)) + ".")
        names, others = project.trajectories.names, other.trajectories.names
        for match in sorted(found.joints, key=lambda match: -math.inf if math.isnan(match.median) else -match.median):
            ends = self.tr("{0} – {1}").format(
                *(limb_words(project, limb) for limb in project.topology.edges[match.joint].tolist())
            )
            if match.other < 0:
                words = self.tr("{0}: no such joint in the other result").format(ends)
            elif math.isnan(match.median):
                continue
            else:
                words = self.tr("{0}: {1} mm apart, {2} mm at most, turned by {3}°").format(
                    ends, digits(match.median), digits(match.largest), digits(math.degrees(match.angle))
                )
            self._add(words, Selection(joint=match.joint))
        for one in sorted(found.markers, key=lambda one: one.share):
            if one.other < 0:
                self._add(self.tr("{0}: not in the other result").format(names[one.marker]), _of(one.marker))
            elif one.share < 1.0 or names[one.marker] != others[one.other]:
                words = self.tr("{0}: {1} there, the same in {2} of the frames")
                text = words.format(names[one.marker], others[one.other], whole_percent(one.share))
                self._add(text, _of(one.marker))

    def _add(self, words: str, selection: Selection) -> None:
        item = QListWidgetItem(words, self.lines)
        item.setData(_SELECTION, selection)

    def _select(self, item: QListWidgetItem | None) -> None:
        if item is not None:
            self._session.select(item.data(_SELECTION))


def _of(marker: int) -> Selection:
    return Selection(frozenset({marker}))
