"""Long work off the window's thread: one job at a time, with progress and cancelling, its result back on that thread.

The work is a plain function of a `Monitor`. What it returns or raises reaches the window's thread through a queued
signal, so that callbacks may touch widgets. The line at the foot of the window shows what runs, and how much of the
whole is done: one share that never runs back, from parts whose number nobody knows ahead.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from PySide6.QtCore import QCoreApplication, QObject, QThread, Signal, Slot
from PySide6.QtWidgets import QProgressBar, QPushButton, QStatusBar, QWidget

from skelgen.errors import Cancelled, SkelgenError
from skelgen.progress import Monitor
from skelgen_gui.widgets.layouts import put_texts

T = TypeVar("T")

PROGRESS_INTERVAL = 0.05
"""Progress is reported no more often than that, so that the window stays free for other things."""

# How long closing waits for work that was cancelled; stages look at their monitor many times a second
_WAIT_SECONDS = 30.0


class _JobMonitor:
    """The monitor of a job: emits progress as signals, and raises `Cancelled` once the job is to stop."""

    def __init__(self, jobs: Jobs, plan: Mapping[str, float] | None) -> None:
        self._jobs = jobs
        self._name = ""
        self._reported_at = 0.0
        self._whole = WholeProgress(plan)
        self.stop = threading.Event()

    def begin(self, name: str) -> None:
        """Begin a part of the work."""
        self._look()
        self._name = name
        self._jobs.progressed.emit(name, self._whole.begin(name))

    def advance(self, done: float, total: float) -> None:
        """Report how much of the part is done."""
        self._look()
        share, now = self._whole.advance(done / total if total else 1.0), time.monotonic()
        if now - self._reported_at >= PROGRESS_INTERVAL or done >= total:
            self._reported_at = now
            self._jobs.progressed.emit(self._name, share)

    def notice(self, sentence: str) -> None:
        """Pass a sentence on."""
        self._jobs.noticed.emit(sentence)

    def _look(self) -> None:
        if self.stop.is_set():
            raise Cancelled


class _Thread(QThread):
    """A thread that does one job and keeps how it ended."""

    def __init__(self, work: Callable[[Monitor], Any], monitor: _JobMonitor, parent: QObject) -> None:
        super().__init__(parent)
        self._work, self._monitor = work, monitor
        self.result: Any = None
        self.error: Exception | None = None

    def run(self) -> None:
        """Do the job; whatever it raises is kept for the window's thread."""
        try:
            self.result = self._work(self._monitor)
        except Exception as error:  # all: a bug must reach the window's error dialog, and not end the thread silently
            self.error = error

    def let_go(self) -> None:
        """Forget the work: it may hold the last reference to the `Jobs` that own this thread."""
        del self._work, self._monitor


class Jobs(QObject):
    """Runs one job after the other.

    Signals
    -------
    begun(str)
        A job has begun; its title.
    progressed(str, float)
        What is being done, and the share of the whole job that is done, which never falls.
    noticed(str)
        Something the user should know.
    ended()
        No job is running any more.
    cancelled()
        What runs is to stop, and what waits for it is not to begin.
    """

    begun = Signal(str)
    progressed = Signal(str, float)
    noticed = Signal(str)
    ended = Signal()
    cancelled = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._thread: _Thread | None = None
        self._monitor: _JobMonitor | None = None
        self._ending: tuple[Callable[[Any], None], Callable[[Exception], None] | None] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a job is running."""
        return self._thread is not None

    def start(
        self,
        title: str,
        work: Callable[[Monitor], T],
        done: Callable[[T], None],
        failed: Callable[[Exception], None] | None = None,
        plan: Mapping[str, float] | None = None,
    ) -> bool:
        """Start a job, unless one is running.

        Parameters
        ----------
        title : str
            Title of the job for the user.
        work : callable (monitor) -> result
            Runs on another thread; must not touch widgets.
        done : callable (result)
            Called on the window's thread.
        failed : callable (error), optional
            Called on the window's thread; not when the job was cancelled.
        plan : mapping of str to float, optional
            Names of the parts with which the work begins, and how long each takes in proportion.

        Returns
        -------
        bool
            Whether it was started.
        """
        if self.is_busy:
            return False
        self._monitor = _JobMonitor(self, plan)
        self._ending = done, failed
        self._thread = _Thread(work, self._monitor, self)
        self._thread.finished.connect(self._finish)
        self.begun.emit(title)
        self._thread.start()
        return True

    def cancel(self) -> None:
        """Ask the job to stop at the next chance."""
        self.cancelled.emit()
        if self._monitor is not None:
            self._monitor.stop.set()

    def stop(self) -> bool:
        """Cancel, and wait until nothing runs; return whether it ended in time."""
        self.cancel()
        end = time.monotonic() + _WAIT_SECONDS
        while self.is_busy and time.monotonic() < end:
            QCoreApplication.processEvents()
            if self._thread is not None:
                self._thread.wait(10)
        return not self.is_busy

    @Slot()
    def _finish(self) -> None:
        thread, ending = self._thread, self._ending
        self._thread = self._monitor = self._ending = None
        self.ended.emit()
        if thread is None or ending is None:
            return
        thread.wait()
        done, failed = ending
        error, result = thread.error, thread.result
        thread.let_go()
        thread.deleteLater()
        if error is None:
            done(result)
        elif not isinstance(error, Cancelled) and failed is not None:
            failed(error)
        elif not isinstance(error, Cancelled | SkelgenError):
            raise error


_PERCENT = 100
_NOTICE_MS = 8000
_MINUTE, _FEW = 60, 10  # s


class StatusLine(QStatusBar):
    """Follows jobs.

    Parameters
    ----------
    jobs : Jobs
        What runs.
    parent : QWidget, optional
        The window.
    """

    def __init__(self, jobs: Jobs, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.progress, self.cancel = QProgressBar(self), QPushButton(self.tr("Cancel"), self)
        self.progress.setMaximumWidth(240)
        self.progress.setRange(0, _PERCENT)
        put_texts(self)
        for widget in (self.progress, self.cancel):
            self.addPermanentWidget(widget)
            widget.hide()
        self._title, self._began = "", 0.0
        self.cancel.clicked.connect(jobs.cancel)
        jobs.begun.connect(self._begin)
        jobs.progressed.connect(self._advance)
        jobs.noticed.connect(self.notice)
        jobs.ended.connect(self._end)

    def _begin(self, title: str) -> None:
        self._title, self._began = title, time.monotonic()
        self.progress.setValue(0)
        self.progress.show()
        self.cancel.show()
        self.showMessage(title)

    def _advance(self, name: str, share: float) -> None:
        self.progress.setValue(round(_PERCENT * share))
        left = seconds_left(share, time.monotonic() - self._began)
        words = [self._title, name] if name not in {"", self._title} else [self._title]
        if left is not None:
            words.append(self.tr("about {0} left").format(_rough(left)))
        self.showMessage(" · ".join(words))

    def notice(self, sentence: str) -> None:
        """Show a sentence for a while."""
        self.showMessage(sentence, _NOTICE_MS)

    def _end(self) -> None:
        self.progress.hide()
        self.cancel.hide()
        self.clearMessage()


def _rough(seconds: float) -> str:
    """A time as people say it: no false digits."""
    if seconds < _MINUTE:
        step = 1 if seconds < _FEW else 5
        return f"{max(step * round(seconds / step), 1)} s"
    return f"{round(seconds / _MINUTE)} min"


_PART = 0.5  # of what is left of a step: so much is given to a part of it when that begins
_LEAST = 1e-9
_SOON = 0.03  # share that must be done before the time left can be told
_EARLY = 2.0  # s, before which it is not told either


class WholeProgress:
    """The share of a job that is done.

    A step of the plan has a room in proportion to its weight. Parts that begin within a step take half of what is left
    of its room each, since more of them may follow.

    Parameters
    ----------
    plan : mapping of str to float
        Names of the steps in their order, with weights, e.g. in seconds; without any, the job is one step.

    Examples
    --------
    >>> whole = WholeProgress({"labels": 3.0, "limbs": 1.0})
    >>> whole.begin("labels"), whole.advance(1.0), whole.begin("limbs"), whole.advance(0.0)
    (0.0, 0.375, 0.75, 0.75)
    """

    def __init__(self, plan: Mapping[str, float] | None = None) -> None:
        weights = {name: max(weight, _LEAST) for name, weight in (plan or {"": 1.0}).items()}
        total = sum(weights.values())
        self._rooms: dict[str, tuple[float, float]] = {}
        first = 0.0
        for name, weight in weights.items():
            self._rooms[name] = first, first + weight / total
            first += weight / total
        self._is_planned = bool(plan)
        self._end = 1.0 if not plan else self._rooms[next(iter(weights))][1]
        self._part = 0.0, 0.0 if plan else 1.0
        self._n_parts = 0
        self._in_part = 0.0
        self.share = 0.0

    def begin(self, name: str) -> float:
        """Note that a step of the plan, or a part of the current one, begins; return the share."""
        if name in self._rooms:
            first, self._end = self._rooms[name]
            self.share = max(self.share, first)
        self._take_room()
        return self.share

    def advance(self, done: float) -> float:
        """Note which part of the current work is done, 0 .. 1; return the share."""
        if done < self._in_part:  # something else has begun, without a name
            self._take_room()
        self._in_part = done
        first, end = self._part
        self.share = max(self.share, first + (end - first) * min(max(done, 0.0), 1.0))
        return self.share

    def _take_room(self) -> None:
        self._n_parts += 1
        is_all = not self._is_planned and self._n_parts <= 1
        self._part = self.share, self.share + (self._end - self.share) * (1.0 if is_all else _PART)
        self._in_part = 0.0


def seconds_left(share: float, elapsed: float) -> float | None:
    """Return how long a job will take yet [s], as it went so far; None while that cannot be told.

    Parameters
    ----------
    share : float
        What is done of it, 0 .. 1.
    elapsed : float, s
        Since it began.

    Examples
    --------
    >>> seconds_left(0.25, 10.0), seconds_left(0.01, 10.0)
    (30.0, None)
    """
    if share < _SOON or elapsed < _EARLY:
        return None
    return elapsed * (1.0 - share) / share
