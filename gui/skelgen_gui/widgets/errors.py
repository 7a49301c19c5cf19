"""The dialog of errors: one sentence, with details to copy; also for faults of the program."""

import importlib.metadata
import platform
import sys
import threading
import traceback
from types import TracebackType

import PySide6
from PySide6.QtCore import QCoreApplication, QObject, Qt, Signal, qVersion
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QLabel, QPlainTextEdit, QStyle, QWidget

import skelgen
from skelgen.errors import SkelgenError, out_of_memory
from skelgen_gui.widgets.layouts import column, put_texts, row_of, wrap

translate = QCoreApplication.translate

_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba")

_WIDTH = 460  # px: about twelve words to a line
_DETAILS_HEIGHT = 260


def sentence_of(error: BaseException) -> str:
    """Return the sentence of an error that the user can act on, or say that the program has a fault."""
    if isinstance(error, SkelgenError):
        return str(error)
    if isinstance(error, MemoryError):
        return out_of_memory(error)
    kind = type(error).__name__
    reason = " ".join(f"{kind}: {error}".split()) if str(error) else kind
    sentence = translate("Errors", "The program has a fault ({0}). What is open stays open; please report the details.")
    return sentence.format(reason)


def details_of(error: BaseException) -> str:
    """Return where an error came from, and the versions of everything that took part."""
    lines = "".join(traceback.format_exception(error))
    return f"{sentence_of(error)}\n\n{lines}\n{versions()}\n"


def versions() -> str:
    """Return a line per program that takes part, with its version."""
    known = {
        "skelgen": skelgen.__version__,
        "Python": platform.python_version(),
        "PySide6": PySide6.__version__,
        "Qt": qVersion(),
        **{name: _installed(name) for name in _PACKAGES},
        "system": platform.platform(),
    }
    return "\n".join(f"{name} {version}" for name, version in known.items())


def _installed(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return translate("Errors", "is not installed")


class ErrorDialog(QDialog):
    """One sentence; the details are behind a button and can be copied.

    Parameters
    ----------
    error : Exception
        What happened.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, error: BaseException, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(self.tr("skelgen"))
        self._n_more = 0
        self.sentence = QLabel(sentence_of(error), self)
        self.more = QLabel(self)
        self.details = QPlainTextEdit(details_of(error), self)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, parent=self)
        self.toggle = buttons.addButton(self.tr("Details"), QDialogButtonBox.ButtonRole.ActionRole)
        self.copy = buttons.addButton(self.tr("Copy"), QDialogButtonBox.ButtonRole.ActionRole)
        self._lay_out(buttons)
        self._describe()
        buttons.rejected.connect(self.reject)
        self.toggle.toggled.connect(self._show_details)
        self.copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(self.details.toPlainText()))

    def count_another(self) -> None:
        """Count another error that happened while this dialog was open."""
        self._n_more += 1
        self.more.setText(self.tr("More errors since then: {0}").format(self._n_more))
        self.more.show()

    def _lay_out(self, buttons: QDialogButtonBox) -> None:
        icon = QLabel(self)
        icon.setPixmap(self.style().standardIcon(QStyle.StandardPixmap.SP_MessageBoxWarning).pixmap(40, 40))
        icon.setAlignment(Qt.AlignmentFlag.AlignTop)
        head = row_of(icon, self.sentence)
        head.setStretchFactor(self.sentence, 1)
        column(self, (head, self.more, self.details, buttons))
        self.more.hide()
        self.details.hide()

    def _describe(self) -> None:
        wrap(self.sentence)
        self.sentence.setMinimumWidth(_WIDTH)
        self.sentence.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.details.setReadOnly(True)
        self.details.setMinimumHeight(_DETAILS_HEIGHT)
        self.details.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.toggle.setCheckable(True)
        put_texts(self)

    def _show_details(self, shown: bool) -> None:
        self.details.setVisible(shown)
        self.adjustSize()


def show_error(parent: QWidget | None, error: BaseException) -> ErrorDialog:
    """Open a dialog on an error over `parent`, without waiting for its answer.

    Parameters
    ----------
    parent : QWidget or None
        The window.
    error : BaseException
        What happened.
    """
    dialog = ErrorDialog(error, parent)
    dialog.open()
    return dialog


class ErrorReporter(QObject):
    """Shows uncaught exceptions of any thread, and still prints them.

    One dialog is open at a time: errors until it is closed are only counted.

    Parameters
    ----------
    window : QWidget
        Owns the dialogs.
    """

    _happened = Signal(object)

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._dialog: ErrorDialog | None = None
        self._happened.connect(self.report, Qt.ConnectionType.QueuedConnection)  # not amid a painting, nor a thread
        self._before = sys.excepthook, threading.excepthook

    def install(self) -> None:
        """Take over how Python handles uncaught exceptions."""
        sys.excepthook = self._main_hook
        threading.excepthook = self._thread_hook

    def uninstall(self) -> None:
        """Give back what `install` took over."""
        sys.excepthook, threading.excepthook = self._before

    def report(self, error: BaseException) -> None:
        """Show an error; count it if another one is still shown."""
        if self._dialog is not None:
            self._dialog.count_another()
            return
        self._dialog = show_error(self._window, error)
        self._dialog.finished.connect(self._forget)

    def _main_hook(self, kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        self._before[0](kind, error, trace)
        if isinstance(error, Exception):  # not on Ctrl+C
            self._happened.emit(error)

    def _thread_hook(self, args: threading.ExceptHookArgs) -> None:
        self._before[1](args)
        if isinstance(args.exc_value, Exception):
            self._happened.emit(args.exc_value)

    def _forget(self) -> None:
        self._dialog = None
