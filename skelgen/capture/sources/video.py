"""Videos: pairs from two files that were recorded together, and a reference video beside a recording, in any order."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import numpy as np

from skelgen.capture.images import opencv
from skelgen.capture.sources.options import VideoOptions
from skelgen.capture.sources.pairs import check_same_size
from skelgen.capture.values import SIDES, FrameSet, Image
from skelgen.errors import CaptureError, FormatError
from skelgen.progress import counted

_SAME_RATE = 0.001  # part by which the rates of two files may differ: containers round 59.94
_COUNT_SLACK = 1  # frames: some containers know their number of frames only from the duration


class OpenVideos:
    """Video files that are read together, frame by frame; a context manager that opens them from their beginnings.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    options : VideoOptions
        Rate and number of frames.
    """

    def __init__(self, paths: Sequence[Path], options: VideoOptions) -> None:
        self._paths, self._limit, self._stack = tuple(paths), options.frames, ExitStack()
        self._videos: list[Any] = []
        self.rate: float | None = options.rate or None
        self._promised = 0

    @property
    def n_frames(self) -> int | None:
        """Number of frames that the files promise; None if they do not know."""
        return min((count for count in (self._promised, self._limit) if count > 0), default=None)

    def __enter__(self) -> Self:
        self._videos = open_videos(self._paths, self._stack)
        return self

    def __exit__(self, *exception: object) -> None:
        self._videos = []
        self._stack.close()

    def _facts(self, name: str) -> list[float]:
        """What each open file says of itself, by the name of OpenCV's property."""
        return [float(video.get(getattr(opencv(), f"CAP_PROP_{name}"))) for video in self._videos]

    def _frames(self) -> Iterator[tuple[int, float, tuple[Image | None, ...]]]:
        """Number, time [s] and images of one frame after the other, None of files that have ended."""
        index = 0
        while not self._limit or index < self._limit:
            yield index, index / self.rate if self.rate else float(index), tuple(map(next_image, self._videos))
            index += 1


class VideoPairs(OpenVideos):
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
        super().__init__((left, right), options)
        self.name, self.cameras, self.n_dropped = f"{left.name} and {right.name}", SIDES, 0
        with self:
            widths, heights, counts = (map(int, self._facts(f"FRAME_{name}")) for name in ("WIDTH", "HEIGHT", "COUNT"))
            sizes = list(zip(widths, heights, strict=True))
            self.size = check_same_size(sizes[0], sizes[1], (str(left), str(right)))
            self._promised = min(counts)
            self.rate = self.rate or self._common_rate()

    def __iter__(self) -> Iterator[FrameSet]:
        """Read frame by frame; a file that ends before the other is an error, after all pairs were delivered."""
        for index, time, (left, right) in self._frames():
            if left is None or right is None:
                self._check_end(index, left is None, right is None)
                return
            yield FrameSet((left, right), time, index)

    def _check_end(self, n_read: int, left_ended: bool, right_ended: bool) -> None:
        for ended, other, path in zip((left_ended, right_ended), (right_ended, left_ended), self._paths, strict=True):
            if ended and not other:
                raise FormatError(
                    path,
                    f"frame {n_read}",
                    f"ends after {counted(n_read, 'frame')}, before the other video; if those belong together, "
                    f"take them with ?frames={n_read}",
                )
        if n_read + _COUNT_SLACK < self._promised:
            raise FormatError(
                self._paths[0], f"frame {n_read}", f"cannot be read on, though {self._promised} frames are promised"
            )

    def _common_rate(self) -> float | None:
        left, right = self._facts("FPS")
        if abs(left - right) > _SAME_RATE * max(left, right):
            raise CaptureError(
                f"{self._paths[0]} has {left:g} and {self._paths[1]} {right:g} frames a second; "
                "videos of one recording have the same, or give the true one with ?rate=..."
            )
        return left if left > 0 else None


def open_videos(paths: Iterable[Path], stack: ExitStack) -> list[Any]:
    """Open videos with OpenCV.

    Parameters
    ----------
    paths : iterable of Path
        The files.
    stack : ExitStack
        Closes them.

    Raises
    ------
    FormatError
        If a file is not there or is no video; then all are closed.
    """
    with ExitStack() as opened:
        videos = []
        for path in paths:
            if not path.is_file():
                raise FormatError(path, "", "no such file")
            video = opencv().VideoCapture(str(path))
            opened.callback(video.release)
            if not video.isOpened():
                raise FormatError(path, "", "is no video that can be read")
            videos.append(video)
        stack.push(opened.pop_all())
    return videos


def next_image(video: Any) -> Image | None:
    """Return the next frame of an open video as a grey image; None at its end."""
    there, frame = video.read()
    if not there:
        return None
    grey = frame if frame.ndim == 2 else opencv().cvtColor(frame, opencv().COLOR_BGR2GRAY)
    grey.flags.writeable = False
    return np.asarray(grey, np.uint8)


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
        self._stack = ExitStack()
        (self._video,) = open_videos([path], self._stack)
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
        self._stack.close()
