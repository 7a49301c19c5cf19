"""Arrays of colours as pictures that Qt can paint."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage, QPixmap


def image_of(pixels: NDArray[np.uint8]) -> QImage:
    """Return the picture of an array (height, width, 4) of red, green, blue and opacity; it holds a copy."""
    height, width, _ = pixels.shape
    pixels = np.ascontiguousarray(pixels)
    return QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGBA8888).copy()


def pixmap_of(pixels: NDArray[np.uint8], ratio: float) -> QPixmap:
    """Return the same as a pixmap for a screen with `ratio` pixels per point."""
    pixmap = QPixmap.fromImage(image_of(pixels))
    pixmap.setDevicePixelRatio(ratio)
    return pixmap
