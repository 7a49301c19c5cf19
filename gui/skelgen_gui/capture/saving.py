"""Writes what was calibrated into the settings of a capture; not on the window's thread, as it reads them first."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from skelgen_formats.capture_settings import write_settings

from skelgen.app.capture import read_capture_settings
from skelgen.errors import InputError
from skelgen.model.rig import CaptureSettings, StereoRig


def add_to_settings(
    path: Path, seen_with: CaptureSettings, change: Callable[[CaptureSettings], CaptureSettings]
) -> CaptureSettings:
    """Change settings as they are in a file by now; return them.

    Parameters
    ----------
    path : Path
        The file; if it is not there, it is written with the settings that were used.
    seen_with : CaptureSettings
        Those that were used.
    change : callable (settings) -> settings
        What is to be changed.

    Raises
    ------
    SkelgenError
        If the file cannot be read or written, its cameras are others than those that were used, or the change fails.
    """
    there = read_capture_settings(path) if path.exists() else seen_with
    if not _is_same(there.rig, seen_with.rig):
        raise InputError(
            f"the cameras of {path} are others than those that this was measured with; choose these settings above, "
            "and take it again"
        )
    settings = change(there)
    write_settings(settings, path)
    return settings


def _is_same(one: StereoRig, two: StereoRig) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for a, b in ((one.left, two.left), (one.right, two.right))
        for name in ("size", "matrix", "distortion", "camera_from_world")
    )
