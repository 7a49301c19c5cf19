"""Writes what was calibrated into a settings file, beside what stands there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from skelgen_formats.capture_settings import write_settings

from skelgen.app.capture import outdated, read_capture_settings, with_body, with_joints
from skelgen.capture.calibration.joints import JointCalibration
from skelgen.errors import InputError
from skelgen.model.rig import BodyTarget, CaptureSettings, StereoRig

_CAMERAS = ("firewire:", "gige:", "gentl:")
"""Sources that are cameras: the next capture comes from them too."""


def save_cameras(rig: StereoRig, path: Path, before: Path | None, source: str) -> int:
    """Write a calibrated rig into a settings file; return how many bodies and joints were kept.

    Parameters
    ----------
    rig : StereoRig
        The calibrated cameras.
    path : Path
        The file.
    before : Path or None
        A settings file whose bodies, joints and other settings are kept, if it is there.
    source : str
        Where the images came from; it is kept if that is cameras.
    """
    settings = CaptureSettings(rig, source=source if source.startswith(_CAMERAS) else "")
    if before is not None and before.exists():
        settings = replace(read_capture_settings(before), rig=rig)
    write_settings(settings, path)
    return len(settings.bodies) + len(settings.joints)


def add_body(path: Path, used: CaptureSettings, target: BodyTarget) -> tuple[str, ...]:
    """Add a target to a settings file, in place of one of the same name; return what the user should know.

    Parameters
    ----------
    path : Path
        The file; if it is not there, it is written with the settings that were used.
    used : CaptureSettings
        The settings that were used for the calibration.
    target : BodyTarget
        What was calibrated.

    Raises
    ------
    SkelgenError
        If the file cannot be read or written, its cameras are others than those that were used, or the target can be
        taken for another one.
    """
    settings = _stored(path, used)
    write_settings(with_body(settings, target), path)
    return outdated(settings, target.name)


def add_joints(path: Path, used: CaptureSettings, calibration: JointCalibration) -> None:
    """Add joints to a settings file, in place of those of the same names.

    Parameters
    ----------
    path, used
        As of `add_body`.
    calibration : JointCalibration
        What was calibrated.

    Raises
    ------
    SkelgenError
        If the file cannot be read or written, its cameras are others than those that were used, or no joint was found.
    """
    write_settings(with_joints(_stored(path, used), calibration), path)


def _stored(path: Path, used: CaptureSettings) -> CaptureSettings:
    """Settings as they are in a file by now; those that were used if there is none."""
    stored = read_capture_settings(path) if path.exists() else used
    if not _is_same(stored.rig, used.rig):
        raise InputError(
            f"the cameras of {path} are others than those that this was measured with; choose these settings above, "
            "and take it again"
        )
    return stored


def _is_same(one: StereoRig, two: StereoRig) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for a, b in ((one.left, two.left), (one.right, two.right))
        for name in ("size", "matrix", "distortion", "camera_from_world")
    )
