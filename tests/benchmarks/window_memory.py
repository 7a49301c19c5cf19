"""By how much the whole window's memory grows while it plays: ``python tests/benchmarks/window_memory.py [updates]``.

Every update shows the next frame in the 3-D view, as fast as the machine can; timeline and curves follow. By default as
many as ten minutes at 60 a second have. Once a minute another marker and another joint are selected.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtWidgets import QApplication, QDockWidget
from shown import show, show_machine, verdict
from skelgen_gui.model.selection import Selection
from skelgen_gui.window import Window
from window import FLAT, memory
from window_pauses import is_idle, until, window_in

import skelgen
from skelgen.simulation import simulate

RATE, MINUTES = 60, 10
A_MINUTE = 60 * RATE  # updates
SIZE = (1280, 800)
STRUCTURE, N_FRAMES = "human", 600
CHANGES = 4  # of what is selected
SHOWN_ONCE = 100  # updates before it is measured, for each


def main() -> None:
    """Print what the memory grows by."""
    n_updates = int(sys.argv[1]) if len(sys.argv) > 1 else MINUTES * A_MINUTE
    app = QApplication([])
    show_machine()
    with tempfile.TemporaryDirectory() as folder:
        window, collector = window_in(Path(folder))
        window.resize(*SIZE)
        window.show()
        project = skelgen.reconstruct(simulate(STRUCTURE, n_frames=N_FRAMES, noise=0.5, dropouts=0.05).take)
        window.document.open(project, Path(folder) / "human.skelgen")  # as if it were saved: nobody is asked at the end
        until(app, lambda: is_idle(window))
        rows = list(play(app, window, n_updates))
        grown = rows[-1] - rows[0]
        told = ", ".join(f"{minute - rows[0]:+.1f}" for minute in rows[1:])
        title = f"{n_updates} updates of the whole window: grown by [MiB]"
        row = (title, f"< {FLAT:g}", f"{grown:.1f}", verdict(grown < FLAT))
        show("Memory", ("figure", "wanted", "reached", ""), [row])
        print(f"after each minute: {told}")
        collector.end()
        window.files.close(window._close)
        os._exit(0)


def play(app: QApplication, window: Window, n_updates: int):
    """Memory [MiB] at first, when all that is shown has been shown once, and after each minute."""
    session, docks = window.session, {dock.objectName(): dock for dock in window.findChildren(QDockWidget)}
    for update in range(-CHANGES * SHOWN_ONCE, n_updates):
        turn, since = divmod(update, A_MINUTE if update >= 0 else SHOWN_ONCE)
        if since == 0:
            session.select(Selection(frozenset({turn % CHANGES}), joint=turn % CHANGES))
            docks[("timeline", "curves")[turn % 2]].raise_()
            until(app, lambda: is_idle(window))
            if update >= 0:
                yield memory()
        session.show_frame((session.frame + 1) % session.n_frames)
        window.view3d.repaint()
        app.processEvents()
    yield memory()


if __name__ == "__main__":
    main()
