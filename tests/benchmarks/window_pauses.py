"""Longest pauses of the whole window's event loop; a part of ``window.py``.

A heart beats in the event loop. Between two beats the window does not answer: because its own thread works, or because
work beside it holds Python's lock. The first is measured as processor time, which other work on the machine hardly
changes; the whole pause as the median of some runs.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, QSettings, Qt, QTimer
from PySide6.QtWidgets import QApplication
from shown import verdict
from skelgen_gui.main import SWITCH_INTERVAL, GarbageCollector
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.widgets.preferences import Preferences
from skelgen_gui.window import Window

import skelgen
from skelgen.model import Project
from skelgen.model.corrections import Correction
from skelgen.simulation import simulate

STRUCTURE, N_FRAMES = "human", 10_000
WANTED = 100.0  # ms, in which the window must answer
BEAT = 2  # ms
RUNS = 3
LEAST_SECONDS = 0.5  # that are watched: what an action leaves for later counts as well
MOST_SECONDS = 1200.0

Row = tuple[str, str, str, str]


class Heart(QObject):
    """Beats in the event loop, and knows its longest pauses."""

    def __init__(self) -> None:
        super().__init__()
        self._timer = QTimer(self, interval=BEAT, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._beat)
        self.start()
        self._timer.start()

    def start(self) -> None:
        """Forget what was."""
        self.longest = self.own = 0.0  # ms: of all, and of the window's own work
        self._last, self._worked = time.monotonic(), time.thread_time()

    def _beat(self) -> None:
        now, worked = time.monotonic(), time.thread_time()
        self.longest = max(self.longest, 1000 * (now - self._last) - BEAT)
        self.own = max(self.own, 1000 * (worked - self._worked))
        self._last, self._worked = now, worked


def pause_rows(app: QApplication, project: Project, minutes: float) -> Iterator[Row]:
    """Pauses while a long take is opened, computed, looked at, saved and opened again."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        take = folder / "long.c3d"
        skelgen.write(simulate(STRUCTURE, n_frames=N_FRAMES, noise=0.5, dropouts=0.02).take, take)
        runs = [dict(_pauses(app, take, folder / f"{number}")) for number in range(RUNS)]
    for what in runs[0]:
        own, longest = (statistics.median(run[what][index] for run in runs) for index in (0, 1))
        yield f"{what}: own work [ms]", f"< {WANTED:g}", f"{own:.0f}", verdict(own < WANTED)
        yield f"{what}: longest pause [ms]", f"< {WANTED:g}", f"{longest:.0f}", verdict(longest < WANTED)


def _pauses(app: QApplication, take: Path, folder: Path) -> Iterator[tuple[str, tuple[float, float]]]:
    """Own work and longest pause [ms] of what a person does with a window, one after the other."""
    (window, collector), heart = window_in(folder), Heart()
    window.preloading.ended.connect(collector.freeze_existing)

    def pause(act: Callable[[], object], is_done: Callable[[], bool] = lambda: True) -> tuple[float, float]:
        heart.start()
        act()
        until(app, lambda: is_done() and is_idle(window))
        return heart.own, heart.longest

    window.show()
    yield "starting", pause(window.preloading.begin, lambda: not window.preloading.is_busy)
    what = f"{N_FRAMES} frames"
    yield f"opening a C3D of {what}", pause(lambda: window.open(take))
    yield "running all stages", pause(window.actions_by_id["run_all"].trigger)
    project = window.session.project
    assert project is not None and project.has("skeleton")
    yield "looking at every page", pause(lambda: [window.pages.page(entry.key) for entry in window.pages.entries])
    yield "looking at every view", pause(lambda: [window.tabs.setCurrentIndex(index) for index in range(3)])
    yield from _corrections(window, pause)
    saved = folder / "long.skelgen"
    yield "saving", pause(lambda: window.files._write(saved, None))
    yield "opening what was saved", pause(lambda: window.open(saved))
    yield "playing for 5 s", pause(window.timeline.player.play, after(5.0))
    window.timeline.player.pause()
    window.files.close(window._close)
    until(app, lambda: not window.isVisible())
    collector.end()
    window.deleteLater()


def _corrections(
    window: Window, pause: Callable[[Callable[[], object]], tuple[float, float]]
) -> Iterator[tuple[str, tuple[float, float]]]:
    """Own work and longest pause [ms] of what changes the project."""
    assert window.session.project is not None
    window.runner.computes_at_once = False
    first, second, *_ = window.session.project.trajectories.names
    for what, stated in (
        ("naming a marker", Correction("rename", (first,), value="LKNE")),
        ("exchanging markers in a span", Correction("swap", ("LKNE", second), 100, 200)),
        ("filling gaps of a marker", Correction("fill", ("LKNE",), value="spline")),
        ("smoothing a marker", Correction("smooth", ("LKNE",), value="6")),
    ):
        yield what, pause(partial(window.corrections.apply, stated))
    yield "undoing all that", pause(lambda: [window.document.undo_stack.undo() for _ in range(4)])
    window.runner.computes_at_once = True


def is_idle(window: Window) -> bool:
    """Whether nothing is computed, and nothing derived."""
    return not window.jobs.is_busy and not any(deriver.is_busy for deriver in window.findChildren(Deriver))


def after(seconds: float) -> Callable[[], bool]:
    """Return what says whether so much time has gone by."""
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def window_in(folder: Path) -> tuple[Window, GarbageCollector]:
    """Return a window that keeps its preferences in a folder, and what collects its garbage."""
    preferences = Preferences(QSettings(str(folder / "settings.ini"), QSettings.Format.IniFormat))
    window = Window(preferences, recovery=folder / "recovery")
    return window, GarbageCollector(window)


def until(app: QApplication, is_done: Callable[[], bool]) -> None:
    """Let the event loop run until something holds."""
    least, most = after(LEAST_SECONDS), after(MOST_SECONDS)
    look = QTimer(interval=20)
    look.timeout.connect(lambda: app.exit() if (least() and is_done()) or most() else None)
    look.start()
    app.exec()
    if not is_done():
        sys.exit("the window did not get done")
