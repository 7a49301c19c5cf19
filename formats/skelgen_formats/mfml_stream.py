"""mfml: unlabelled points per frame as an optical tracker records them (Schönauer 2007, 4.11).

Layout, little-endian, written field by field without padding: frame after frame a header, then its markers.

======  ======  ==========================  =====================================================
offset  type    frame header, 12 bytes
======  ======  ==========================  =====================================================
0       u32     number of markers
4       u64     time stamp                  microseconds by default
======  ======  ==========================  =====================================================

======  ======  ==========================  =====================================================
offset  type    marker, 20 bytes + id
======  ======  ==========================  =====================================================
0       3 f32   centre                      mm
12      f32     mean reprojection error     mm
16      u32     number of blobs used
20      id      unique id                   4, 8 or 16 bytes; left open in the thesis
======  ======  ==========================  =====================================================

The reader takes the id width with which the whole file parses and no time stamp falls; where several do (files of
empty frames), 8. Large files: `iterate_mfml` yields frame after frame, `write_frames` writes what an iterator yields.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError, WriteError
from skelgen.files import open_regular, replacing
from skelgen.progress import counted

FRAME_HEADER = np.dtype({"names": ["n_markers", "time"], "formats": ["<u4", "<u8"], "offsets": [0, 4], "itemsize": 12})
"""Layout of a frame's header."""

MARKER_DTYPES = {
    width: np.dtype(
        {
            "names": ["center", "reprojection_error", "n_blobs", "id"],
            "formats": [("<f4", 3), "<f4", "<u4", id_format],
            "offsets": [0, 12, 16, 20],
            "itemsize": 20 + width,
        }
    )
    for width, id_format in ((8, "<u8"), (4, "<u4"), (16, ("<u8", 2)))
}
"""Layout of a marker by the width of its id in bytes, the most likely first."""

SECONDS_PER_UNIT = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "ns": 1e-9}
"""Units that time stamps may have."""

Markers = NDArray[Any]
"""Structured array with the fields of `MARKER_DTYPES`."""

_HEADER = struct.Struct("<IQ")
_U64 = 2**64
_CHUNK_FRAMES = 1024  # written at once: some 100 kB


def iterate_mfml(path: Path, id_width: str = "auto", timestamp_unit: str = "us") -> Iterator[tuple[float, Markers]]:
    """Yield the time [s] and the markers of each frame; memory does not grow with the file.

    Parameters
    ----------
    path : Path
        The file.
    id_width : str
        Bytes of a unique id: ``4``, ``8``, ``16``, or ``auto`` to find out.
    timestamp_unit : str
        ``us``, ``ms``, ``s`` or ``ns``.

    Yields
    ------
    time : float, s
        Time stamp of the frame.
    markers : structured ndarray, shape (n_markers,)
        With the fields of `MARKER_DTYPES`.

    Raises
    ------
    FormatError
        Before the first frame, if the file does not parse.
    """
    with Content(path) as content:
        width, _ = find_id_width(path, content.view, id_width)
        dtype = MARKER_DTYPES[width]
        for start, count, stamp in frame_headers(content.view, width):
            frame = content.view[start : start + count * dtype.itemsize]
            yield stamp * SECONDS_PER_UNIT[timestamp_unit], np.frombuffer(frame, dtype)


def write_frames(
    path: Path, frames: Iterable[tuple[float, Markers]], id_width: str = "8", timestamp_unit: str = "us"
) -> int:
    """Write frames as they come, e.g. from a running tracker; return how many there were.

    Parameters
    ----------
    path : Path
        The file, which appears when the last frame is written.
    frames : iterable of (time [s], structured ndarray)
        Markers with the fields of `MARKER_DTYPES`.
    id_width : str
        Bytes of a unique id.
    timestamp_unit : str
        Unit in which time stamps are written.

    Raises
    ------
    WriteError
        If a time stamp is negative or does not fit, or the file cannot be written.
    """
    dtype = MARKER_DTYPES[int(id_width)]
    chunk: list[bytes] = []
    n_frames = 0
    with replacing(path) as temporary, temporary.open("wb") as stream:
        for time, markers in frames:
            chunk.append(frame_bytes(path, time, markers.astype(dtype, copy=False), timestamp_unit))
            n_frames += 1
            if n_frames % _CHUNK_FRAMES == 0:
                stream.write(b"".join(chunk))
                chunk.clear()
        stream.write(b"".join(chunk))
    return n_frames


def frame_bytes(path: Path, time: float, markers: Markers, timestamp_unit: str = "us") -> bytes:
    """Return one frame as it stands in a file: its header, then its markers, which have the file's layout.

    Parameters
    ----------
    path : Path
        The file, for errors.
    time : float, s
        Time stamp.
    markers : structured ndarray, shape (n_markers,)
        One of `MARKER_DTYPES`.
    timestamp_unit : str
        Unit in which the time stamp is written.

    Raises
    ------
    WriteError
        If the time stamp [s] is negative or does not fit; the error begins with `path`.
    """
    stamp = round(time / SECONDS_PER_UNIT[timestamp_unit])
    if not 0 <= stamp < _U64:
        raise WriteError(f"{path}: the time {time:g} s does not fit; mfml holds times from 0 up")
    return _HEADER.pack(len(markers), stamp) + markers.tobytes()


class Content:
    """The bytes of a file, mapped rather than read, so that only what is touched costs memory.

    Attributes
    ----------
    view : mmap
        The bytes, while the context lasts.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> Content:
        try:
            with open_regular(self.path) as stream:
                self.view = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
        except ValueError as error:  # an empty file cannot be mapped
            raise FormatError(self.path, "", "the file is empty") from error
        return self

    def __exit__(self, *_: object) -> None:
        self.view.close()


def find_id_width(path: Path, view: mmap.mmap, id_width: str) -> tuple[int, int]:
    """Return the bytes of a unique id with which the whole file parses, and how many frames it has then.

    Parameters
    ----------
    path : Path
        The file, for errors.
    view : mmap
        Its bytes.
    id_width : str
        Bytes of a unique id, or ``auto``.

    Raises
    ------
    FormatError
        If there is none (or the given one does not do); the error says where the most promising one failed.
    """
    failures: list[tuple[int, UnparsableError]] = []
    for width in MARKER_DTYPES if id_width == "auto" else [int(id_width)]:
        try:
            return width, sum(1 for _ in frame_headers(view, width))
        except UnparsableError as error:
            failures.append((width, error))
    width, failure = max(failures, key=lambda pair: pair[1].n_markers)
    raise FormatError(path, f"byte {failure.position}", f"{failure.problem} (read with ids of {width} bytes)")


class UnparsableError(Exception):
    """A frame does not parse with the id width at hand.

    Attributes
    ----------
    position : int
        Byte of the frame's header.
    n_markers : int
        Markers in the frames before it.
    problem : str
        What is wrong.
    """

    def __init__(self, position: int, n_markers: int, problem: str) -> None:
        super().__init__(problem)
        self.position = position
        self.n_markers = n_markers
        self.problem = problem


def frame_headers(view: mmap.mmap | bytes, width: int) -> Iterator[tuple[int, int, int]]:
    """Yield, frame by frame, the byte of the first marker, the number of markers and the time stamp.

    Parameters
    ----------
    view : mmap or bytes
        The file, or its beginning.
    width : int
        Bytes of a unique id.

    Raises
    ------
    UnparsableError
        At the first frame that does not fit into the file or goes back in time.
    """
    size = len(view)
    marker_size = MARKER_DTYPES[width].itemsize
    position, number, n_markers, last_stamp = 0, 0, 0, 0
    while position < size:
        number += 1
        if position + _HEADER.size > size:
            raise UnparsableError(position, n_markers, f"the file ends in the header of frame {number}; it is cut off")
        count, stamp = _HEADER.unpack_from(view, position)
        start = position + _HEADER.size
        if start + count * marker_size > size:
            problem = f"frame {number} announces {counted(count, 'marker')} and is cut off"
            raise UnparsableError(position, n_markers, problem)
        if stamp < last_stamp:
            problem = f"the time stamp of frame {number} goes back from {last_stamp} to {stamp}"
            raise UnparsableError(position, n_markers, problem)
        yield start, count, stamp
        position, last_stamp = start + count * marker_size, stamp
        n_markers += count
