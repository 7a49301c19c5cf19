"""How Python behaves beside a window: when threads give way to each other, and where garbage is collected.

Python collects cyclic garbage in whichever thread happens to allocate. Widgets and what refers to them form cycles, and
Qt's objects must end on the thread that they live on: one that ends on a worker's thread ends the program.
"""

from __future__ import annotations

import gc
import sys

from PySide6.QtCore import QObject, QTimer

INTERVAL = 200
"""ms between two looks: so little grows in between that a collection of the young takes a few ms."""


SWITCH_INTERVAL = 0.001
"""s, after which work beside the window gives way to it. A call into numpy gives the lock away and waits for it anew:
with Python's own 0.005 s, ten such calls amid work on other threads would use up half of what a window may wait."""


def give_way_soon() -> None:
    """Let threads give way to each other as soon as a window needs."""
    sys.setswitchinterval(SWITCH_INTERVAL)


class Collector(QObject):
    """Takes over collecting from Python, until it ends.

    Parameters
    ----------
    parent : QObject, optional
        Owner.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        gc.disable()
        self._timer = QTimer(self, interval=INTERVAL)
        self._timer.timeout.connect(collect_what_is_due)
        self._timer.start()

    def spare_what_is_there(self) -> None:
        """Look no more at what exists by now: modules stay, and are many enough to make full collections slow."""
        gc.freeze()

    def end(self) -> None:
        """Leave collecting to Python again."""
        self._timer.stop()
        gc.unfreeze()
        gc.enable()


def collect_what_is_due() -> None:
    """Collect the oldest generation of which Python would collect by now, and those that are younger."""
    due = [count > threshold > 0 for count, threshold in zip(gc.get_count(), gc.get_threshold(), strict=True)]
    if any(due):
        gc.collect(max(generation for generation, is_due in enumerate(due) if is_due))
