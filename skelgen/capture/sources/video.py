"""Pairs from two video files that were recorded together."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np

from skelgen.capture.images import opencv
from skelgen.capture.sources.pairs import check_same_size
from skelgen.capture.sources.table import VideoOptions
from skelgen.capture.values import FramePair, Image
from skelgen.errors import CaptureError, FormatError

_SAME_RATE = 0.001  # part by which the rates of two files may differ: containers round 59.94
_COUNT_SLACK = 1  # frames: some containers know their number of frames only from the duration


class VideoPairs:
    """A frame source of two video files, frame by frame.

    Parameters
    ----------
    left, right : Path
        The files.
    options : VideoOptions
        Rate and number of pairs.

    Raises
    ------
    FormatError
        If a file cannot be opened as a video.
    CaptureError
        If the files have different sizes or rates, or OpenCV is not installed.
    """

    def __init__(self, left: Path, right: Path, options: VideoOptions) -> None:
        self.name = f"{left.name} and {right.name}"
        self.n_dropped = 0
        self._paths = (left, right)
        self._limit = options.frames
        self._videos: list[Any] = []
        with self:
            cv2 = opencv()
            width, height, count = cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FRAME_COUNT
            sizes = [(int(video.get(width)), int(video.get(height))) for video in self._videos]
            self.size = check_same_size(sizes[0], sizes[1], (str(left), str(right)))
            self._counts = [int(video.get(count)) for video in self._videos]
            self.rate = options.rate or self._common_rate()

    @property
    def n_frames(self) -> int | None:
        """Number of pairs that the files promise; None if they do not know."""
        known = min(self._counts)
        promised = known if known > 0 else None
        if not self._limit:
            return promised
        return self._limit if promised is None else min(promised, self._limit)

    def __enter__(self) -> Self:
        """Open both files from their beginnings."""
        try:
            for path in self._paths:
                if not path.is_file():
                    raise FormatError(path, "", "no such file")
                video = opencv().VideoCapture(str(path))
                if not video.isOpened():
                    raise FormatError(path, "", "is no video that can be read")
                self._videos.append(video)
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        """Close both files."""
        self._close()

    def __iter__(self) -> Iterator[FramePair]:
        """Read frame by frame; a file that ends before the other is an error, after all pairs were delivered."""
        index = 0
        while not self._limit or index < self._limit:
            images = [next_image(video) for video in self._videos]
            left, right = images
            if left is None or right is None:
                self._check_end(index, left is None, right is None)
                return
            yield FramePair(left, right, index / self.rate if self.rate else float(index), index)
            index += 1

    def _check_end(self, n_read: int, left_ended: bool, right_ended: bool) -> None:
        for ended, other, path in zip((left_ended, right_ended), (right_ended, left_ended), self._paths, strict=True):
            if ended and not other:
                raise FormatError(
                    path,
                    f"frame {n_read}",
                    f"ends after {n_read} frames, before the other video; if those belong together, take them "
                    f"with ?frames={n_read}",
                )
        if n_read + _COUNT_SLACK < min(self._counts):
            raise FormatError(
                self._paths[0], f"frame {n_read}", f"cannot be read on, though {min(self._counts)} frames are promised"
            )

    def _common_rate(self) -> float | None:
        cv2 = opencv()
        left, right = (float(video.get(cv2.CAP_PROP_FPS)) for video in self._videos)
        if abs(left - right) > _SAME_RATE * max(left, right):
            raise CaptureError(
                f"{self._paths[0]} has {left:g} and {self._paths[1]} {right:g} frames a second; "
                "videos of one recording have the same, or give the true one with ?rate=..."
            )
        return left if left > 0 else None

    def _close(self) -> None:
        for video in self._videos:
            video.release()
        self._videos = []


def next_image(video: Any) -> Image | None:
    """Return the next frame of an open video as a grey image; None at its end."""
    there, frame = video.read()
    if not there:
        return None
    grey = frame if frame.ndim == 2 else opencv().cvtColor(frame, opencv().COLOR_BGR2GRAY)
    grey.flags.writeable = False
    return np.asarray(grey, np.uint8)
