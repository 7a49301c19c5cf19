"""How long a window takes until it is seen, and a recording in it: ``python tests/benchmarks/window_start.py``.

Each start is a process of its own. Processor time is judged, as other work on the machine does not count in it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from shown import show, show_machine, verdict

import skelgen
from skelgen.simulation import simulate

WANTED = 2.0  # s
STARTS = 3
CODE = """
import sys, time
from pathlib import Path
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication
from skelgen_gui.widgets.preferences import Preferences
from skelgen_gui.widgets.painting import Theme
from skelgen_gui.window import Window

folder = Path(sys.argv[1])
app = QApplication([])
preferences = Preferences(QSettings(str(folder / "settings.ini"), QSettings.Format.IniFormat))
Theme(app, preferences)
window = Window(preferences, recovery=folder / "recovery")

def seen():
    app.processEvents()
    window.grab()
    print(time.process_time())

window.show()
seen()
window.files.opened.connect(lambda _: (seen(), app.quit()))
window.open(folder / "walk.c3d")
app.exec()
"""


def main() -> None:
    """Print what is wanted and what is reached, the best of some starts."""
    show_machine()
    with tempfile.TemporaryDirectory() as folder:
        skelgen.write(simulate("human", n_frames=900, motion="walk").take, Path(folder) / "walk.c3d")
        environment = os.environ | {"QT_QPA_PLATFORM": "offscreen"}
        command = [sys.executable, "-c", CODE, folder]
        runs = [subprocess.run(command, check=True, capture_output=True, env=environment) for _ in range(STARTS)]
    seconds = [
        min(times) for times in zip(*([float(text) for text in run.stdout.split()] for run in runs), strict=True)
    ]
    names = ("until the window is seen [s]", "until the recording is seen [s]")
    rows = [(name, f"< {WANTED:g}", f"{s:.2f}", verdict(s < WANTED)) for name, s in zip(names, seconds, strict=True)]
    show("start", ("figure", "wanted", "reached", ""), rows)


if __name__ == "__main__":
    main()
