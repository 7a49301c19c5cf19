"""A video that was filmed beside a recording, picture by picture, in any order."""

from pathlib import Path
from typing import Any

import numpy as np

from skelgen.capture.images import opencv
from skelgen.capture.values import Image
from skelgen.errors import FormatError

_NEAR = 30  # pictures ahead up to which skipping is quicker than a jump to the key picture before


class ReferenceVideo:
    """One video file. Not to be used by two threads at once.

    Parameters
    ----------
    path : Path
        The file.

    Attributes
    ----------
    rate : float, Hz
        Pictures per second, as the file says; 25 if it does not.
    n_frames : int
        Number of pictures, as the file says; 0 if it does not.

    Raises
    ------
    FormatError
        If the file cannot be opened as a video.
    CaptureError
        If OpenCV is not installed.
    """

    def __init__(self, path: Path) -> None:
        cv2 = opencv()
        self.path = path
        if not path.is_file():
            raise FormatError(path, "", "no such file")
        self._video: Any = cv2.VideoCapture(str(path))
        if not self._video.isOpened():
            raise FormatError(path, "", "is no video that can be read")
        self.rate = float(self._video.get(cv2.CAP_PROP_FPS)) or 25.0
        self.n_frames = max(int(self._video.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
        self._next = 0

    def picture(self, index: int) -> Image | None:
        """Return a picture as red, green and blue, shape (height, width, 3); None before the first and after the last.

        Parameters
        ----------
        index : int
            From 0.
        """
        cv2 = opencv()
        if index < 0 or (self.n_frames and index >= self.n_frames):
            return None
        if not self._next <= index <= self._next + _NEAR:
            self._video.set(cv2.CAP_PROP_POS_FRAMES, index)
            self._next = index
        while self._next < index and self._video.grab():
            self._next += 1
        there, picture = self._video.read()
        self._next += 1
        return np.ascontiguousarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)) if there else None

    def close(self) -> None:
        """Close the file."""
        self._video.release()
