"""How fluently the window plays: ``QT_QPA_PLATFORM=offscreen python tests/benchmarks/window.py [minutes]``.

Rates are updates per second of processor time on software rendering, so that other work on the machine does not count.
"""

from __future__ import annotations

import os
import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from shown import show, show_machine, verdict
from skelgen_gui.model.scene import Scene
from skelgen_gui.model.view_state import Shown
from skelgen_gui.project.session import Session
from skelgen_gui.view3d.view import View3D
from window_pauses import pause_rows
from window_timeline import timeline_rows

import skelgen
from skelgen.simulation import simulate

STRUCTURE, N_FRAMES = "human:4", 2000
N_MARKERS, N_BONES = 50, 20  # what the targets are stated for; the take has at least as many
SIZES = {(900, 700): 60.0, (1600, 1000): 40.0}  # wanted updates per second
TWO_RESULTS = "two results"
SHOWN = {
    "trails off": Shown(trails=False),
    "trails of 0.25 s": Shown(),
    "trails of 2 s, names": Shown(trail_seconds=2.0, names=True),
    "the viewer follows": Shown(follow=True),
    TWO_RESULTS: Shown(),
}
WARM_UP = 200  # updates: sprites and texts are made in the first
UPDATES = 600
MINUTES = 1.0
FLAT = 5.0  # MiB: what a garbage collector may still hold
STATM = Path("/proc/self/statm")  # Linux: pages, the second number those in memory
PEAK_UNITS = 1024 if sys.platform != "darwin" else 1024**2  # per MiB: getrusage counts in KiB on Linux

Row = tuple[str, str, str, str]


def main() -> None:
    """Print what is wanted and what is reached, part by part of the window."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else MINUTES
    app = QApplication([])
    show_machine()
    project = skelgen.reconstruct(simulate(STRUCTURE, n_frames=N_FRAMES, noise=0.5, dropouts=0.05).take)
    for title, rows in PARTS.items():
        show(title, ("figure", "wanted", "reached", ""), rows(app, project, minutes))


def view3d_rows(app: QApplication, project: skelgen.Project, minutes: float) -> Iterator[Row]:
    """Rates of the 3-D view while it plays and turns, and by how much its memory grows."""
    n_markers, n_bones = project.trajectories.n_markers, len(Scene(project).bones.limb)
    assert n_markers >= N_MARKERS
    assert n_bones >= N_BONES
    session = Session()
    view = View3D(session)
    session.open(project)
    view.show()
    what = f"{N_FRAMES} frames x {n_markers} markers + {n_bones} bones"
    for size, wanted in SIZES.items():
        view.resize(*size)
        app.processEvents()
        for name, shown in SHOWN.items():
            view.set_shown(shown)
            session.compare_with(project if name == TWO_RESULTS else None)
            yield rate_row(f"{what}, {size[0]}x{size[1]}, {name}", wanted, rate(playing(view, session)))
        yield rate_row(f"{what}, {size[0]}x{size[1]}, the view turns", wanted, rate(turning(view)))
    yield memory_row("memory of the 3-D view", playing(view, session), minutes)


def playing(view: View3D, session: Session) -> Callable[[], None]:
    """Return what shows the next frame."""

    def update() -> None:
        session.show_frame((session.frame + 1) % session.n_frames)
        view.repaint()

    return update


def turning(view: View3D) -> Callable[[], None]:
    """Return what turns the view a little."""

    def update() -> None:
        QTest.keyClick(view, Qt.Key.Key_Left, Qt.KeyboardModifier.ControlModifier)
        view.repaint()

    return update


def rate(update: Callable[[], None]) -> float:
    """Updates per second of processor time."""
    for _ in range(WARM_UP):
        update()
    start = time.process_time()
    for _ in range(UPDATES):
        update()
    return UPDATES / (time.process_time() - start)


def rate_row(figure: str, wanted: float, reached: float) -> Row:
    """Return a row for updates per second."""
    return f"{figure} [1/s]", f">= {wanted:g}", f"{reached:.0f}", verdict(reached >= wanted)


def memory_row(figure: str, update: Callable[[], None], minutes: float) -> Row:
    """Return a row for what the memory grows by while something is updated for some minutes."""
    for _ in range(WARM_UP):
        update()
    before, end, count = memory(), time.monotonic() + 60 * minutes, 0
    while time.monotonic() < end:
        update()
        count += 1
    grown = memory() - before
    title = f"{figure}, {minutes:g} min of playing, {count} updates: grown by [MiB]"
    return title, f"< {FLAT:g}", f"{grown:.1f}", verdict(grown < FLAT)


def memory() -> float:
    """Memory that this process holds [MiB]; the most that it has held where the system does not say."""
    if STATM.exists():
        return int(STATM.read_text().split()[1]) * resource.getpagesize() / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / PEAK_UNITS


PARTS: dict[str, Callable[[QApplication, skelgen.Project, float], Iterator[Row]]] = {
    "3-D view": view3d_rows,
    "Timeline and curves": timeline_rows,
    "The whole window": pause_rows,
}

if __name__ == "__main__":
    main()
