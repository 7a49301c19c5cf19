"""A window with the pictures of all cameras beside ``skelgen motion-capture``, which runs the loop."""

import time
from collections.abc import Sequence
from typing import Self

from PySide6.QtWidgets import QApplication

from skelgen.app.capture_jobs.camera_images import camera_images_of
from skelgen.capture.live import Captured
from skelgen.capture.room.live import RoomCaptured
from skelgen_gui.capture.pictures import Pictures

INTERVAL = 0.04
"""s between two pictures: more would only delay the capture."""


LEISURE = 3.0
"""Pause after a picture, as a multiple of the time that it took: many large images must not hold the capture up."""


class LivePictures:
    """The newest pictures with what was found in them; a context manager, whose window closes at its end.

    Parameters
    ----------
    names : sequence of str
        All targets, in the order of their colours.
    cameras : sequence of str
        Those of a room; none are the left and the right one.
    """

    def __init__(self, names: Sequence[str], cameras: Sequence[str] = ()) -> None:
        self._app = QApplication.instance() or QApplication(["skelgen"])
        self._names, self._cameras = tuple(names), tuple(cameras)
        self._shown_at, self._pause = -INTERVAL, INTERVAL
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

    def show(self, captured: Captured | RoomCaptured) -> None:
        """Show the pictures of one moment, unless others are just shown; nothing once the window is closed."""
        now = time.monotonic()
        if now - self._shown_at < self._pause or not self.view.isVisible():
            return
        self._shown_at = now
        found = captured.bodies
        bodies = {group: found[name] for group, name in enumerate(self._names) if name in found}
        images = camera_images_of(captured, bodies)
        if self._cameras:
            self.view.show_all(images, self._cameras)
        else:
            self.view.show_pair(*images)
        self._app.processEvents()
        self._pause = max(INTERVAL, LEISURE * (time.monotonic() - now))
