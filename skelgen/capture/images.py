"""Grey images from files, and OpenCV, which is imported when it is first needed: it is an optional extra."""

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np

from skelgen.capture.values import Image
from skelgen.errors import CaptureError, FormatError


def opencv() -> ModuleType:
    """Return the module ``cv2``.

    Raises
    ------
    CaptureError
        If it is not installed; the sentence says how to install it.
    """
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
        raise CaptureError(f"needs {name}: pip install 'skelgen[{extra}]' ({error})") from error


IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
"""What is taken for an image in a folder."""

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
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FormatError(path, "", f"cannot be read: {error.strerror or error}") from error
    if _is_cut_off(data):
        raise FormatError(path, "", "the image is cut off; copy the file again")
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except cv2.error:
        image = None
    if image is None:
        raise FormatError(path, "", "is no image that can be read, or a damaged one")
    image.flags.writeable = False
    return np.asarray(image, np.uint8)


def _is_cut_off(data: bytes) -> bool:
    if data.startswith(_JPEG):  # a thumbnail in the head has an end of its own, before the scan
        return data.rfind(_JPEG_END) < data.rfind(_JPEG_SCAN)
    return data.startswith(_PNG) and _PNG_END not in data[-32:]
