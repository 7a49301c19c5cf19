"""The panel that says how the open result differs from the one that is overlaid, marker by marker, joint by joint."""

import math
from functools import partial

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QListWidget, QListWidgetItem, QSizePolicy, QWidget

from skelgen.app.comparison import Comparison, compare_results, comparison_sentences
from skelgen.app.drawing.wording import digits, whole_percent
from skelgen.model import Project
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.wording import limb_words
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import column, put_texts, wrap

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
        self.summary.setText(".\n".join(comparison_sentences(project, other, found)) + ".")
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
