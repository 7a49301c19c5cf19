"""Starts the desktop window: ``skelgen-gui [FILE]`` and ``skelgen gui [FILE]``."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QSettings, QTimer
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QApplication

from skelgen_gui.interpreter import Collector, give_way_soon
from skelgen_gui.preferences import Preferences
from skelgen_gui.recovery import find_remains
from skelgen_gui.theme import Theme, prepare_high_dpi
from skelgen_gui.window import Window

ORGANISATION = APPLICATION = "skelgen"
ICON = Path(__file__).with_name("skelgen.svg")

_ENDING = (signal.SIGINT, signal.SIGTERM)
"""Ctrl+C in the terminal, and the system that shuts down: there is nobody to ask then."""


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
    give_way_soon()
    app = QApplication([APPLICATION])
    app.setOrganizationName(ORGANISATION)
    app.setApplicationName(APPLICATION)
    app.setDesktopFileName(APPLICATION)  # so that Wayland's taskbar finds the installed entry
    app.setWindowIcon(QIcon(str(ICON)))
    preferences = Preferences(QSettings())
    theme = Theme(app, preferences)
    theme.apply()
    window = Window(preferences)
    window.errors.install()
    collector = Collector(window)
    window.warming.ended.connect(collector.spare_what_is_there)
    window.show()
    window.warming.begin()
    QTimer.singleShot(0, lambda: _begin(window, files))
    _heed_signals(app, window)
    code = int(app.exec())
    collector.end()
    return code


def _heed_signals(app: QApplication, window: Window) -> None:
    """End when the system asks for it; Python hears of that as soon as any of the window's timers runs."""

    def end() -> None:
        window.end_without_asking()
        app.exit(0)  # quit() would have the window ask

    for number in _ENDING:
        signal.signal(number, lambda *_: QTimer.singleShot(0, end))


def _begin(window: Window, files: Sequence[str]) -> None:
    for remains in find_remains():
        if not window.jobs.is_busy:  # one of them is being restored: the others are offered next time
            window.offer(remains)
    if files and not window.jobs.is_busy:
        window.open(Path(files[0]))
