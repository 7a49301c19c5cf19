"""OpenCV, imported when it is first needed: it is an extra, and importing it costs a fifth of a second."""

from __future__ import annotations

import importlib
from types import ModuleType

from skelgen.errors import CaptureError


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


__all__ = ["extra_module", "opencv"]
