"""A window with both cameras' pictures beside ``skelgen motion-capture``, which runs the loop and shows one by one."""

import time
from collections.abc import Sequence
from typing import Self

from PySide6.QtWidgets import QApplication

from skelgen.app.capture_jobs.messages import CameraImage
from skelgen.capture.live import Captured
from skelgen_gui.capture.pictures import Pictures

INTERVAL = 0.04
"""s between two pictures: more would only delay the capture."""


class LivePictures:
    """The newest pictures with what was found in them; a context manager, whose window closes at its end.

    Parameters
    ----------
    names : sequence of str
        All targets, in the order of their colours.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._app = QApplication.instance() or QApplication(["skelgen"])
        self._names, self._shown_at = tuple(names), -INTERVAL
        self.view = Pictures()
        self.view.setWindowTitle(self.view.tr("Cameras"))

    def __enter__(self) -> Self:
        """Open the window."""
        self.view.show()
        self._app.processEvents()
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the window."""
        self.view.close()
        self._app.processEvents()

    def show(self, captured: Captured) -> None:
        """Show both pictures of a pair, unless others are shown since a moment; nothing once the window is closed."""
        now = time.monotonic()
        if now - self._shown_at < INTERVAL or not self.view.isVisible():
            return
        self._shown_at = now
        pair, points, found = captured.pair, captured.points, captured.bodies
        bodies = {group: found[name] for group, name in enumerate(self._names) if name in found}
        self.view.show_pair(
            CameraImage.of_balls(pair.left.copy(), captured.left, bodies, points.left),
            CameraImage.of_balls(pair.right.copy(), captured.right, bodies, points.right),
        )
        self._app.processEvents()
