"""Recordings that grow while a capture runs: mfml for points without names, C3D for named markers.

A recording is whole up to its last second at any time, whatever stops the capture: mfml frames simply follow each
other, and the counts in a C3D header are put right once a second and when the recording is closed. Layouts are told in
`mfml_stream` and `c3d_layout`. A file that is there is never overwritten: what was captured cannot be captured again.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

import numpy as np

from skelgen.errors import WriteError
from skelgen.model.arrays import Floats, check_names
from skelgen_formats.c3d.layout import BLOCK, MAGIC, MOST_HEADER_FRAMES
from skelgen_formats.mfml_stream import MARKER_DTYPES, frame_bytes

SYNC_FRAMES = 60
"""Frames after which what was recorded is handed to the disk: a second of the seed's cameras."""

N_BLOBS = 2
"""A point of a stereo capture is seen by two cameras."""

ANY_RATE = 60.0
"""Hz, of a recording of a single frame whose source knows none."""

_MOST_TEXTS = 255  # per parameter of a C3D file; more go on in LABELS2 and so forth
_INTEL, _FLOATS, _INTS, _TEXT = 84, 4, 2, -1
_LAST_FRAME_AT, _RATE_AT = 8, 20  # bytes of the header


class Recorder:
    """A file that grows; a context manager.

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
        with self._telling():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream: BinaryIO = path.open("xb")

    def __enter__(self) -> Self:
        """Return itself: the file is open."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file, whatever happened; a file without frames is removed."""
        self.close()

    def close(self) -> None:
        """Make the file whole and close it; once is enough."""
        if self._stream.closed:
            return
        try:
            with self._telling():
                self._finish()
        finally:
            self._stream.close()
            if self.n_frames == 0:
                self.path.unlink(missing_ok=True)

    def _append(self, content: bytes) -> None:
        with self._telling():
            self._stream.write(content)
            self.n_frames += 1
            if self.n_frames % SYNC_FRAMES == 0:
                self._finish()

    def _finish(self) -> None:
        """Hand everything to the disk, counts included."""
        self._stream.flush()

    @contextmanager
    def _telling(self) -> Iterator[None]:
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
        self._append(frame_bytes(self.path, time, markers))


class C3dRecorder(Recorder):
    """Named markers at a constant rate.

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
        self._names, self._rate = check_names(names, len(names), "marker"), rate
        self._times: list[float] = []  # of the first frame and of the last one
        super().__init__(path)
        with self._telling():
            head, self._frames_at, self._end_at, self._point_rate_at = _c3d_head(self._names, rate or ANY_RATE)
            self._stream.write(head)

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
        unseen = np.full_like(positions, np.nan)
        for frame in (*[unseen] * dropped, positions):
            seen = ~np.isnan(frame[:, :1])
            rows = np.where(seen, np.concatenate([frame, np.zeros_like(seen)], axis=1), [0.0, 0.0, 0.0, -1.0])
            self._append(rows.astype("<f4").tobytes())
        self._times = [*self._times[:1], time]

    def _finish(self) -> None:
        if self.n_frames == 0:
            return
        last = min(self.n_frames, MOST_HEADER_FRAMES)
        rate = struct.pack("<f", self._measured_rate())
        self._patch(_LAST_FRAME_AT, struct.pack("<H", last))
        self._patch(self._frames_at, struct.pack("<H", last))
        self._patch(self._end_at, struct.pack("<HH", *reversed(divmod(self.n_frames, MOST_HEADER_FRAMES + 1))))
        self._patch(_RATE_AT, rate)
        self._patch(self._point_rate_at, rate)
        self._stream.seek(0, 2)
        self._stream.flush()

    def _patch(self, position: int, content: bytes) -> None:
        self._stream.seek(position)
        self._stream.write(content)

    def _measured_rate(self) -> float:
        if self._rate is not None:
            return self._rate
        lasted = self._times[-1] - self._times[0] if len(self._times) > 1 else 0.0
        return (self.n_frames - 1) / lasted if lasted > 0 else ANY_RATE


def _c3d_head(names: Sequence[str], rate: float) -> tuple[bytes, int, int, int]:
    """Header and parameters, and the places of the numbers of frames, of the last frame, and of the rate in them."""
    records = _Records()
    records.group("POINT")
    records.parameter("USED", _INTS, struct.pack("<H", len(names)))
    records.parameter("SCALE", _FLOATS, struct.pack("<f", -1.0))
    point_rate = records.parameter("RATE", _FLOATS, struct.pack("<f", rate))
    start = records.parameter("DATA_START", _INTS, bytes(2))
    frames = records.parameter("FRAMES", _INTS, bytes(2))
    records.texts("UNITS", ["mm"])
    for number, first in enumerate(range(0, len(names), _MOST_TEXTS), start=1):
        records.texts("LABELS" if number == 1 else f"LABELS{number}", names[first : first + _MOST_TEXTS])
    records.group("ANALOG")
    records.parameter("USED", _INTS, bytes(2))
    records.group("TRIAL")
    records.parameter("ACTUAL_START_FIELD", _INTS, struct.pack("<HH", 1, 0), 2)
    end = records.parameter("ACTUAL_END_FIELD", _INTS, bytes(4), 2)
    parameters = bytearray(records.content + bytes(4))
    n_blocks = -(-(4 + len(parameters)) // BLOCK)
    parameters[start : start + 2] = struct.pack("<H", 2 + n_blocks)
    header = struct.pack("<BBHHHHHfHHf", 2, MAGIC, len(names), 0, 1, 0, 10, -1.0, 2 + n_blocks, 0, rate)
    body = bytes([1, MAGIC, n_blocks, _INTEL]) + bytes(parameters)
    before = BLOCK + 4
    places = (before + frames, before + end, before + point_rate)
    return header.ljust(BLOCK, b"\0") + body.ljust(n_blocks * BLOCK, b"\0"), *places


class _Records:
    """The chain of groups and parameters; an empty record ends it."""

    def __init__(self) -> None:
        self.content, self._group = b"", 0

    def group(self, name: str) -> None:
        self._group += 1
        self._record(name, -self._group, b"")

    def parameter(self, name: str, kind: int, values: bytes, *dimensions: int) -> int:
        """Append a parameter; return where its values are."""
        head = struct.pack("<bB", kind, len(dimensions)) + bytes(dimensions)
        begin = len(self.content) + 2 + len(name) + 2 + len(head)
        self._record(name, self._group, head + values)
        return begin

    def texts(self, name: str, texts: Sequence[str]) -> None:
        coded = [text.encode() for text in texts]
        width = max(map(len, coded), default=0)
        self.parameter(name, _TEXT, b"".join(text.ljust(width) for text in coded), width, len(coded))

    def _record(self, name: str, number: int, content: bytes) -> None:
        rest = content + b"\0"  # no description
        self.content += struct.pack("<bb", len(name), number) + name.encode() + struct.pack("<H", 2 + len(rest)) + rest
