"""The numbers of a calibration of two cameras as rows of texts, for the command line and the window alike."""

from __future__ import annotations

import math

from skelgen.capture.calibration.stereo import StereoCalibration
from skelgen.model.rig import Camera

INTRINSIC = ("fx [px]", "fy [px]", "cx [px]", "cy [px]", "k1", "k2", "p1", "p2", "k3")
"""What the numbers of one camera are called, in the order of `intrinsic` and of the calibration's deviations."""


def camera_rows(found: StereoCalibration) -> list[tuple[str, str, str]]:
    """Return what is measured of both cameras: its name, the left and the right value, each with its deviation."""
    left, right = (
        [with_std(*pair) for pair in zip(intrinsic(eye), std.tolist(), strict=True)]
        for eye, std in ((found.rig.left, found.left_std), (found.rig.right, found.right_std))
    )
    rows = list(zip(INTRINSIC, left, right, strict=True))
    shifts = zip("xyz", found.rig.right_from_left[:3, 3].tolist(), found.translation_std.tolist(), strict=True)
    rows += [(f"translation {axis} [mm]", "", with_std(*rest)) for axis, *rest in shifts]
    return [*rows, ("baseline [mm]", "", with_std(found.rig.baseline, found.baseline_std))]


def intrinsic(eye: Camera) -> list[float]:
    """Return the numbers of one camera in the order of `INTRINSIC`."""
    return [*eye.matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), *eye.distortion.tolist()]


def with_std(value: float, std: float) -> str:
    """Return a value with two digits of its standard deviation; what was held has none."""
    if std == 0:
        return f"{value:g}"
    digits = max(0, 1 - math.floor(math.log10(std)))
    return f"{value:.{digits}f} ± {std:.{digits}f}"
