"""The menu of corrections: what the selection allows, with questions where something must be asked."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QObject
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QInputDialog, QMenu, QWidget

from skelgen.errors import SkelgenError
from skelgen.model.corrections import Correction
from skelgen_gui.correct.frames import ask_frames
from skelgen_gui.correct.offers import Offer, new_name, offers
from skelgen_gui.document import Document
from skelgen_gui.runner import Runner
from skelgen_gui.session import Selection
from skelgen_gui.tips import rich

_MENUS = ("move", "kind")
"""Kinds of which there are many: each has a menu of its own."""


class CorrectionActions(QObject):
    """Fills menus with what can be corrected, and does it.

    Parameters
    ----------
    document : Document
        What is corrected.
    runner : Runner
        Computes again what a correction made invalid.
    tell_error : callable (error)
        Shows what went wrong.
    window : QWidget
        Parent of questions.
    """

    def __init__(
        self, document: Document, runner: Runner, tell_error: Callable[[Exception], None], window: QWidget
    ) -> None:
        super().__init__(window)
        self._document, self._runner, self._tell_error, self._window = document, runner, tell_error, window

    def fill(self, menu: QMenu, selection: Selection | None = None) -> None:
        """Fill a menu with what the selection allows."""
        menu.clear()
        session = self._document.session
        submenus: dict[str, QMenu] = {}
        for offer in offers(session.project, selection or session.selection):
            target = menu
            if offer.kind in _MENUS:
                if offer.kind not in submenus:
                    submenus[offer.kind] = menu.addMenu(_title(offer.kind))
                    submenus[offer.kind].setToolTipsVisible(True)
                target = submenus[offer.kind]
            target.addAction(self._action(offer, target))
        if menu.isEmpty():
            nothing = menu.addAction(self.tr("Select markers, a joint or a limb first"))
            nothing.setEnabled(False)

    def apply(self, correction: Correction) -> None:
        """Correct, and compute again what was there."""
        before = self._document.session.project
        if before is None:
            return
        try:
            self._document.correct(correction)
        except SkelgenError as error:
            self._tell_error(error)
            return
        self._runner.run_again(before)

    def take_back(self, index: int) -> None:
        """Take one correction back, and compute again what was there."""
        before = self._document.session.project
        if before is not None:
            self._document.take_back(index)
            self._runner.run_again(before)

    def _action(self, offer: Offer, parent: QObject) -> QAction:
        action = QAction(_text(offer).replace("&", "&&"), parent)  # a single one would mark a key
        action.setToolTip(rich(_text(offer)))
        action.triggered.connect(lambda _=False, offer=offer: self._ask_and_apply(offer))
        return action

    def _ask_and_apply(self, offer: Offer) -> None:
        correction = self._asked(offer)
        if correction is not None:
            self.apply(correction)

    def _asked(self, offer: Offer) -> Correction | None:
        session = self._document.session
        if offer.kind in {"swap", "split", "delete"}:
            proposed = (session.frame, session.n_frames - 1) if offer.kind != "delete" else (0, session.n_frames - 1)
            frames = ask_frames(self._window, _text(offer), proposed, session.n_frames)
            if frames is None:
                return None
            value = self._asked_name(offer) if offer.kind == "split" else ""
            return None if value is None else offer.correction(value, *frames)
        if offer.kind == "rename":
            value = self._asked_name(offer)
            return offer.correction(value) if value else None
        return offer.correction()

    def _asked_name(self, offer: Offer) -> str | None:
        project = self._document.session.project
        old = offer.names[0]
        proposed = new_name(project, old) if project is not None and offer.kind == "split" else old
        name, is_said = QInputDialog.getText(self._window, _text(offer), self.tr("Name:"), text=proposed)
        return name.strip() if is_said and name.strip() else None


def _title(kind: str) -> str:
    return {"move": _tr("Move to the limb of"), "kind": _tr("Kind of the joint")}[kind]


def _text(offer: Offer) -> str:
    if offer.kind == "move":
        return offer.names[1]
    if offer.kind == "kind":
        return offer.value
    names = ", ".join(offer.names)
    return {
        "merge": _tr("Merge {0}"),
        "swap": _tr("Exchange {0}…"),
        "split": _tr("Split {0}…"),
        "rename": _tr("Rename {0}…"),
        "delete": _tr("Delete {0}…"),
        "together": _tr("On one limb: {0}"),
        "apart": _tr("On different limbs: {0}"),
        "join": _tr("Joint between the limbs of {0}"),
        "part": _tr("No joint between the limbs of {0}"),
        "root": _tr("Root: the limb of {0}"),
    }[offer.kind].format(names)


def _tr(text: str) -> str:
    return QCoreApplication.translate("CorrectionActions", text)
