"""The frames of a C3D file that ezc3d has begun: header, parameters and the first frame are its own.

ezc3d 1.7 keeps a copy of every array that it is given until the process ends (its pull request 404 mends that), which a
program that writes thousands of files cannot bear. What comes out is byte for byte what ezc3d writes. The fourth word
of a point holds its residual, and 256 times the mask of the cameras that saw it; below 0 the point is unseen.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import Source
from skelgen_formats.c3d.layout import BLOCK, MOST_HEADER_FRAMES

_FRAMES_AT_ONCE = 4096
_MEASURED, _UNSEEN = 257.0, -1.0  # residual 1 by the first camera
_WORDS = 4  # of a point
_LAST_FRAME, _DATA_BLOCK = 8, 16  # bytes of the header
_NUMBER = struct.pack("<hbB", 7, 2, 0)  # of a parameter: bytes to the next one, i16, no dimension
_COUNTS = 2**16


def write_frames(path: Path, positions: Floats, source: Ints | None) -> None:
    """Give a C3D file of one frame all its frames.

    Parameters
    ----------
    path : Path
        As ezc3d wrote it, little-endian, without analogue data and rotations.
    positions : ndarray, shape (n_frames, n_points, 3)
        In the file's unit.
    source : ndarray of intp, shape (n_frames, n_points), optional
        A `Source` of each.

    Raises
    ------
    ValueError
        If the file is no such file.
    OSError
        If it cannot be written.
    """
    n_frames, n_points = positions.shape[:2]
    n_bytes = n_frames * n_points * _WORDS * np.float32().itemsize
    padding = -n_bytes % BLOCK or BLOCK
    with path.open("r+b") as stream:
        head = bytearray(stream.read(BLOCK))
        start = (struct.unpack_from("<H", head.ljust(BLOCK, b"\0"), _DATA_BLOCK)[0] - 1) * BLOCK
        head += stream.read(max(start - BLOCK, 0))
        if len(head) != start:
            raise ValueError("header and parameters are cut off")
        stated = min(n_frames, MOST_HEADER_FRAMES)
        struct.pack_into("<H", head, _LAST_FRAME, stated)
        _set(head, b"FRAMES", stated)
        _set(head, b"DATA_START", (start + n_bytes + padding) // BLOCK + 1)  # of the rotations, which would come next
        stream.seek(0)
        stream.write(head)
        for first in range(0, n_frames, _FRAMES_AT_ONCE):
            chosen = slice(first, first + _FRAMES_AT_ONCE)
            stream.write(_words(positions[chosen], None if source is None else source[chosen]).tobytes())
        stream.write(bytes(padding))
        stream.truncate()


def _words(positions: Floats, source: Ints | None) -> NDArray[np.float32]:
    """Return x, y, z and the fourth word of points, shape (n_frames, n_points, 4)."""
    words = np.zeros((*positions.shape[:2], _WORDS), dtype="<f4")
    words[..., :3] = positions
    if source is not None:
        unseen = source == Source.NONE
        words[unseen, :3] = 0.0
        words[..., 3] = np.where(source == Source.MEASURED, _MEASURED, np.where(unseen, _UNSEEN, 0.0))
    return words


def _set(head: bytearray, name: bytes, value: int) -> None:
    """Write the value of the last parameter of a name."""
    place = head.rindex(name + _NUMBER) + len(name) + len(_NUMBER)
    struct.pack_into("<H", head, place, value % _COUNTS)
