"""A picture of an array as a PNG inside a data URI (ISO/IEC 15948), small and the same bytes every time."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOUR_TYPES = {1: 0, 4: 6}  # channels: grey, and colour with alpha
_BIT_DEPTH = 8
_COMPRESSION_LEVEL = 9


def png_uri(pixels: NDArray[np.uint8]) -> str:
    """Return a ``data:`` URI with a picture.

    Parameters
    ----------
    pixels : ndarray of uint8, shape (height, width) or (height, width, 4)
        Grey levels, or red, green, blue and alpha.
    """
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    height, width = pixels.shape[:2]
    rows = pixels.reshape(height, width * channels)
    unfiltered = np.hstack([np.zeros((height, 1), dtype=np.uint8), rows])  # every row begins with its filter, 0 = none
    header = struct.pack(">IIBBBBB", width, height, _BIT_DEPTH, _COLOUR_TYPES[channels], 0, 0, 0)
    data = zlib.compress(unfiltered.tobytes(), _COMPRESSION_LEVEL)
    png = _SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
