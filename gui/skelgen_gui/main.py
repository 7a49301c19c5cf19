"""Starts the desktop window: ``skelgen-gui [FILE]`` and ``skelgen gui [FILE]``.

Python collects cyclic garbage in whichever thread happens to allocate. Widgets and what refers to them form cycles, and
Qt's objects must end on the thread that they live on: one that ends on a worker's thread ends the program. So only the
window's thread collects garbage.
"""

import contextlib
import gc
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QObject, QSettings, QTimer
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QApplication

from skelgen._kernels import sources_digest
from skelgen_gui.project.recovery import find_recovery_entries
from skelgen_gui.widgets.painting import Theme, prepare_high_dpi
from skelgen_gui.widgets.preferences import Preferences
from skelgen_gui.window import Window

_ORGANISATION = APPLICATION = "skelgen"
ICON = Path(__file__).with_name("skelgen.svg")

# Ctrl+C in the terminal, and the shutdown of the system: the window ends without a question
_ENDING = (signal.SIGINT, signal.SIGTERM)
_PATIENCE = 5.0  # s for a process to end that is told to


_INTERVAL = 200  # ms between two looks: so little grows in between that a collection of the young takes a few ms

# s, after which work beside the window gives way to it. A call into numpy gives the lock away and waits for it
# anew: with Python's own 0.005 s, ten such calls amid work on other threads would use up half of what a window may
# wait
SWITCH_INTERVAL = 0.001


def main(arguments: Sequence[str] | None = None) -> int:
    """Show the window until it is closed.

    Parameters
    ----------
    arguments : sequence of str, optional
        A recording or a project to open; by default those of the command line.

    Returns
    -------
    int
        Exit code.
    """
    files = list(sys.argv[1:] if arguments is None else arguments)
    prepare_high_dpi()
    sys.setswitchinterval(SWITCH_INTERVAL)
    app = QApplication([APPLICATION])
    app.setOrganizationName(_ORGANISATION)
    app.setApplicationName(APPLICATION)
    app.setDesktopFileName(APPLICATION)  # so that Wayland's taskbar finds the installed entry
    app.setWindowIcon(QIcon(str(ICON)))
    preferences = Preferences(QSettings())
    Theme(app, preferences)
    window = Window(preferences)
    window.errors.install()
    collector = GarbageCollector(window)
    window.preloading.ended.connect(collector.freeze_existing)
    window.show()
    window.preloading.begin()
    compiling = compile_in_background(preferences)
    QTimer.singleShot(0, lambda: _begin(window, files))
    _heed_signals(app, window)
    code = int(app.exec())
    collector.end()
    if compiling is not None:
        if compiling.poll() == 0:
            preferences.compiled = sources_digest()
        compiling.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            compiling.wait(_PATIENCE)
    return code


def compile_in_background(preferences: Preferences) -> subprocess.Popen[bytes] | None:
    """Compile what the first run needs in a process of its own, unless an earlier window has done so.

    Parameters
    ----------
    preferences : Preferences
        Know what was compiled.

    Returns
    -------
    subprocess.Popen or None
        The process; it ends by itself.
    """
    if preferences.compiled == sources_digest():
        return None
    with contextlib.suppress(OSError):  # the first run then compiles what it needs
        return subprocess.Popen([sys.executable, "-m", "skelgen.app.samples"], stderr=subprocess.DEVNULL)
    return None


def _heed_signals(app: QApplication, window: Window) -> None:
    """End on a signal of the system; Python handles it as soon as any of the window's timers runs."""

    def end() -> None:
        window.end_without_asking()
        app.exit(0)  # quit() would let the window ask

    for number in _ENDING:
        signal.signal(number, lambda *_: QTimer.singleShot(0, end))


def _begin(window: Window, files: Sequence[str]) -> None:
    for entry in find_recovery_entries():
        if not window.jobs.is_busy:  # one of them is being restored: the others are offered next time
            window.offer(entry)
    if files and not window.jobs.is_busy:
        window.open(Path(files[0]))


class GarbageCollector(QObject):
    """Takes over collecting from Python, until it ends.

    Parameters
    ----------
    parent : QObject, optional
        Owner.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        gc.disable()
        self._timer = QTimer(self, interval=_INTERVAL)
        self._timer.timeout.connect(collect_due_garbage)
        self._timer.start()

    def freeze_existing(self) -> None:
        """Exempt existing objects from collection: the many modules would make full collections slow."""
        gc.freeze()

    def end(self) -> None:
        """Leave collecting to Python again."""
        self._timer.stop()
        gc.unfreeze()
        gc.enable()


def collect_due_garbage() -> None:
    """Collect the oldest generation that Python would collect by now, and all younger ones."""
    due = [count > threshold > 0 for count, threshold in zip(gc.get_count(), gc.get_threshold(), strict=True)]
    if any(due):
        gc.collect(max(generation for generation, is_due in enumerate(due) if is_due))
