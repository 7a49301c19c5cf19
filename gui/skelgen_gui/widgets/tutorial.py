"""The first steps, as a text in the window whose links do what they say."""

from pathlib import Path

from PySide6.QtCore import QUrl, Signal
from PySide6.QtWidgets import QTextBrowser, QWidget

_TEXT = Path(__file__).parents[1] / "tutorial.md"


class Tutorial(QTextBrowser):
    """Shows the text.

    Parameters
    ----------
    parent : QWidget, optional
        Qt's parent.

    Signals
    -------
    asked(str, str)
        A link was followed: what kind it is, ``do`` or ``sample``, and the command or sample that it names.
    """

    asked = Signal(str, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setOpenLinks(False)
        self.setMarkdown(_TEXT.read_text(encoding="utf-8"))
        self.setAccessibleName(self.tr("First steps"))
        self.setToolTip(self.tr("Links do what they say; Tab goes from one to the next"))
        self.anchorClicked.connect(self._follow)

    def _follow(self, address: QUrl) -> None:
        self.asked.emit(address.scheme(), address.path())
