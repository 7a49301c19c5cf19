"""The 3-D view alone, or beside views from the front, the side and above, which show and select the same."""

from dataclasses import replace

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QGridLayout, QWidget

from skelgen_gui.model.view_state import Shown
from skelgen_gui.project.session import Session
from skelgen_gui.view3d.view import View3D

_GAP = 2  # px between views


class FourViews(QWidget):
    """One view, or four.

    Parameters
    ----------
    session : Session
        What is shown.
    main : View3D
        The view that is always there; what it shows, the others show.
    """

    def __init__(self, session: Session, main: View3D) -> None:
        super().__init__()
        self._session, self._main = session, main
        self.others: tuple[View3D, ...] = ()
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(_GAP)
        self._grid.addWidget(main, 1, 1)
        main.shown_changed.connect(self._follow)
        session.take_changed.connect(self._follow_take)

    def _follow(self, shown: Shown) -> None:
        """Show one view or four, and in all of them the same."""
        is_new = shown.four and not self.others
        if is_new:
            self._make()
        was_shown = bool(self.others) and not self.others[0].isHidden()
        for view in self.others:
            view.set_shown(replace(shown, follow=False))
            view.setVisible(shown.four)
        if shown.four and (is_new or not was_shown):
            QTimer.singleShot(0, self, self._stand)  # once the views have their sizes

    def _follow_take(self) -> None:
        if self.others:
            QTimer.singleShot(0, self, self._stand)

    def _make(self) -> None:
        """Build the views that are beside the main one: their keys and buttons are those of the main one."""
        names = (self.tr("View from above"), self.tr("View from the front"), self.tr("View from the side"))
        self.others = tuple(View3D(self._session, is_main=False) for _ in names)
        for view, name, place in zip(self.others, names, ((0, 0), (1, 0), (0, 1)), strict=True):
            view.setAccessibleName(name)
            self._grid.addWidget(view, *place)
            view.context_requested.connect(self._main.context_requested)
            view.clicked.connect(self._main.clicked)

    def _stand(self) -> None:
        """Put each viewer where its name says."""
        looks = View3D.look_from_top, View3D.look_from_front, View3D.look_from_side
        for view, look in zip(self.others, looks, strict=True):
            look(view)
            view.fit_take()
        self._main.fit_take()
