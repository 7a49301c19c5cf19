"""The cameras' pictures in windows of their own, with the balls that were found."""

from __future__ import annotations

import os
import sys
from typing import Any, Self

from skelgen.capture.live import Captured

_MARK = (0, 255, 0)  # green, in OpenCV's order
_MARK_SIZE = 9  # px
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


class Pictures:
    """Two windows; a context manager, which closes them.

    Attributes
    ----------
    notice : str
        Why nothing can be shown; empty if pictures are shown.
    """

    def __init__(self) -> None:
        self.notice, self._cv2 = _opened()

    def __enter__(self) -> Self:
        """Windows open with the first pictures."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the windows."""
        if self._cv2 is not None:
            self._cv2.destroyAllWindows()

    def show(self, captured: Captured) -> None:
        """Show both pictures of a pair."""
        if self._cv2 is None:
            return
        pair = captured.pair
        for side, image, balls in (("left", pair.left, captured.left), ("right", pair.right, captured.right)):
            coloured = self._cv2.cvtColor(image, self._cv2.COLOR_GRAY2BGR)
            for x, y in balls.centres.round().astype(int).tolist():
                self._cv2.drawMarker(coloured, (x, y), _MARK, self._cv2.MARKER_CROSS, _MARK_SIZE)
            self._cv2.imshow(side, coloured)
        self._cv2.waitKey(1)


def _opened() -> tuple[str, Any]:
    """Why there are no windows, and OpenCV if there can be some."""
    if sys.platform == "linux" and not any(os.environ.get(name) for name in _DISPLAYS):
        return "there is no display, so that no pictures are shown (-n says so)", None
    try:
        import cv2  # noqa: PLC0415 - only here
    except ImportError:
        return "pictures need OpenCV: pip install 'skelgen[capture]' (-n captures without them)", None
    try:
        cv2.namedWindow("left")
    except cv2.error:
        return "this OpenCV shows no windows (it is the headless one), so that no pictures are shown (-n says so)", None
    return "", cv2
