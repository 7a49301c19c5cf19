"""Recordings that grow while a capture runs: mfml for points without names, C3D for named markers.

A recording is whole up to its last second at any time, whatever stops the capture: mfml frames simply follow each
other, and the counts in a C3D header are put right with the first frame, once a second, and when the recording is
closed. There is no file before the first frame. A file that is there is never overwritten: what was captured cannot be
captured again.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Self

import numpy as np

from skelgen.errors import WriteError
from skelgen.model.arrays import Floats
from skelgen_formats.c3d.writer import C3dStream, check_point_names, point_words
from skelgen_formats.mfml_stream import MARKER_DTYPES, frame_bytes

_SYNC_FRAMES = 60
"""Frames after which what was recorded is handed to the disk: a second of cameras at 60 Hz."""

N_BLOBS = 2
"""A point of a stereo capture is seen by two cameras."""

ANY_RATE = 60.0
"""Hz, of a recording of a single frame whose source knows none."""


class Recorder:
    """A file that grows from its first frame on; a context manager.

    Parameters
    ----------
    path : Path
        The file; it must not be there.

    Raises
    ------
    WriteError
        If it is there, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.n_frames = path, 0
        self._stream: BinaryIO | None = None
        with self._explained():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.open("xb").close()  # to know now whether it can be written
            path.unlink()

    def __enter__(self) -> Self:
        """Return itself: frames can be added."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the file, whatever happened; there is none without frames."""
        self.close()

    def close(self) -> None:
        """Make the file whole and close it; once is enough."""
        if self._stream is None or self._stream.closed:
            return
        try:
            with self._explained():
                self._finish(self._stream)
        finally:
            self._stream.close()
            if self.n_frames == 0:
                self.path.unlink(missing_ok=True)

    def _opened(self) -> BinaryIO:
        """Return the file, which the first frame makes."""
        if self._stream is None:
            with self._explained():
                self._stream = self.path.open("xb")
        return self._stream

    def _count(self) -> None:
        self.n_frames += 1
        if self.n_frames % _SYNC_FRAMES == 1:
            with self._explained():
                self._finish(self._opened())

    def _finish(self, stream: BinaryIO) -> None:
        """Hand everything to the disk, counts included."""
        stream.flush()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except FileExistsError as error:
            raise WriteError(f"{self.path}: there is such a recording already; choose another name") from error
        except OSError as error:
            raise WriteError(f"{self.path}: cannot be recorded: {error.strerror or error}") from error


class MfmlRecorder(Recorder):
    """Points without names, with the time of each frame."""

    def add(self, time: float, points: Floats, errors: Floats) -> None:
        """Append a frame.

        Parameters
        ----------
        time : float, s
            Of the frame, not before that of the frame before.
        points : ndarray, shape (n_points, 3), mm
            Any number.
        errors : ndarray, shape (n_points,), mm
            What the file calls the mean reprojection error.
        """
        markers = np.zeros(len(points), MARKER_DTYPES[8])
        markers["center"], markers["reprojection_error"] = points, errors
        markers["n_blobs"], markers["id"] = N_BLOBS, np.arange(len(points))
        stream = self._opened()
        with self._explained():
            stream.write(frame_bytes(self.path, time, markers))
        self._count()


class C3dRecorder(Recorder):
    """Named markers at a constant rate, in mm.

    Parameters
    ----------
    path : Path
        The file; it must not be there.
    names : sequence of str
        Of the markers.
    rate : float, Hz, optional
        Frames a second; measured from the frames' times if nobody knows.
    """

    def __init__(self, path: Path, names: Sequence[str], rate: float | None = None) -> None:
        self._names, self._rate = check_point_names(path, names), rate
        self._times: list[float] = []  # of the first frame and of the last one
        self._points: C3dStream | None = None
        super().__init__(path)

    def add(self, time: float, positions: Floats, dropped: int = 0) -> None:
        """Append a frame, and before it one without markers for each that was lost.

        Parameters
        ----------
        time : float, s
            Of the frame.
        positions : ndarray, shape (n_markers, 3), mm
            NaN where unseen.
        dropped : int
            Frames lost since the one before.
        """
        frames = np.full((dropped + 1, *positions.shape), np.nan)
        frames[-1] = positions
        self._times = [*self._times[:1], time]
        stream = self._opened()
        with self._explained():
            points = self._points = self._points or C3dStream(stream, self._names, self._rate or ANY_RATE, "mm")
        for words in point_words(frames):
            with self._explained():
                points.append(words[np.newaxis])
            self._count()

    def _finish(self, stream: BinaryIO) -> None:
        if self.n_frames and self._points is not None:
            self._points.complete_header(self._measured_rate())
        stream.flush()

    def _measured_rate(self) -> float:
        if self._rate is not None:
            return self._rate
        lasted = self._times[-1] - self._times[0] if len(self._times) > 1 else 0.0
        return (self.n_frames - 1) / lasted if lasted > 0 else ANY_RATE
