"""Grey images from files, and OpenCV, which is imported when it is first needed: it is an optional extra."""

import contextlib
import importlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np

from skelgen.capture.values import Image
from skelgen.errors import CaptureError, FormatError
from skelgen.files import read_content

MOST_PIXELS = 1 << 27
"""Of an image that is read: 134 megapixels, more than the sensor of any camera that films."""

_OPENCV_SETTINGS = {
    "OPENCV_IO_MAX_IMAGE_PIXELS": str(MOST_PIXELS),
    "OPENCV_LOG_LEVEL": "OFF",
    "OPENCV_FFMPEG_LOGLEVEL": "-8",
}


def opencv() -> ModuleType:
    """Return the module ``cv2``.

    Raises
    ------
    CaptureError
        If it is not installed; the sentence says how to install it.
    """
    for name, value in _OPENCV_SETTINGS.items():  # which it reads when it is loaded
        os.environ.setdefault(name, value)
    return extra_module("cv2", "OpenCV", "capture")


def extra_module(module: str, name: str, extra: str) -> ModuleType:
    """Import a module that belongs to one of skelgen's extras.

    Parameters
    ----------
    module : str
        What to import.
    name : str
        What people call it.
    extra : str
        The extra that brings it.

    Raises
    ------
    CaptureError
        If it cannot be imported.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise CaptureError(f"needs {name}: pip install 'skelgen-mocap[{extra}]' ({error})") from error


IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
"""What is taken for an image in a folder."""

_STDERR = threading.Lock()
_JPEG = b"\xff\xd8"
_JPEG_SCAN, _JPEG_END = b"\xff\xda", b"\xff\xd9"
_PNG, _PNG_END = b"\x89PNG", b"IEND"


def read_image(path: Path) -> Image:
    """Read a grey image of 8 bits, in the geometry of the sensor; colours become grey, 16 bits are scaled.

    Raises
    ------
    FormatError
        If it cannot be read, is no image, or is cut off (which OpenCV fills with grey).
    CaptureError
        If OpenCV is not installed.
    """
    cv2 = opencv()
    data = read_content(path)
    if _is_cut_off(data):
        raise FormatError(path, "", "the image is cut off; copy the file again")
    width, height = _png_size(data)
    if width * height > MOST_PIXELS:
        what = f"announces {width} x {height} pixels; at most {MOST_PIXELS // 10**6} megapixels are read"
        raise FormatError(path, "", what)
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        with _without_warnings():
            image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except cv2.error:
        image = None
    if image is None:
        raise FormatError(path, "", "is no image that can be read, or a damaged one")
    image.flags.writeable = False
    return np.asarray(image, np.uint8)


def _png_size(data: bytes) -> tuple[int, int]:
    """Width and height that a PNG announces; zeros for another file."""
    if not data.startswith(_PNG):
        return 0, 0
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


@contextlib.contextmanager
def _without_warnings() -> Iterator[None]:
    """Keep off the terminal what libpng and others write past Python; what is wrong is said by our own error."""
    with _STDERR, contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # a program without a terminal has nothing to keep clean
            kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, kept)
            stack.callback(os.dup2, kept, 2)
            os.dup2(nowhere, 2)
            os.close(nowhere)
        yield


def _is_cut_off(data: bytes) -> bool:
    if data.startswith(_JPEG):  # a thumbnail in the head has an end of its own, before the scan
        return data.rfind(_JPEG_END) < data.rfind(_JPEG_SCAN)
    return data.startswith(_PNG) and _PNG_END not in data[-32:]
