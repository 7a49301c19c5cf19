"""The numbers of calibrations as rows of texts, for the command line and the window alike."""

import math
from collections.abc import Mapping

import numpy as np

from skelgen.capture.calibration.joints import JointCalibration
from skelgen.capture.calibration.stereo import StereoCalibration
from skelgen.geometry.rotations import vector_from_matrix
from skelgen.model.rig import BodyTarget, Camera, TargetJoint

Row = Mapping[str, str | int | float]
"""Texts and numbers by the titles of columns."""

INTRINSIC = ("fx [px]", "fy [px]", "cx [px]", "cy [px]", "k1", "k2", "p1", "p2", "k3")
"""What the numbers of one camera are called, in the order of `intrinsic` and of the calibration's deviations."""


def camera_rows(found: StereoCalibration) -> list[tuple[str, str, str]]:
    """Return what is measured of both cameras: its name, the left and the right value, each with its deviation."""
    left, right = (
        [_with_std(*pair) for pair in zip(intrinsic(eye), std.tolist(), strict=True)]
        for eye, std in ((found.rig.left, found.left_std), (found.rig.right, found.right_std))
    )
    rows = list(zip(INTRINSIC, left, right, strict=True))
    turn = vector_from_matrix(found.rig.right_from_left[:3, :3])
    turns = zip("xyz", np.degrees(turn).tolist(), np.degrees(found.rotation_std).tolist(), strict=True)
    rows += [(f"rotation {axis} [degrees]", "", _with_std(*rest)) for axis, *rest in turns]
    angle = float(np.degrees(np.linalg.norm(turn)))
    rows.append(("angle between the cameras [degrees]", "", _with_std(angle, math.degrees(found.turn_std))))
    shifts = zip("xyz", found.rig.right_from_left[:3, 3].tolist(), found.translation_std.tolist(), strict=True)
    rows += [(f"translation {axis} [mm]", "", _with_std(*rest)) for axis, *rest in shifts]
    return [*rows, ("baseline [mm]", "", _with_std(found.rig.baseline, found.baseline_std))]


def intrinsic(eye: Camera) -> list[float]:
    """Return the numbers of one camera in the order of `INTRINSIC`."""
    return [*eye.matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), *eye.distortion.tolist()]


def ball_rows(target: BodyTarget) -> list[Row]:
    """Return where the balls of a target are [mm], by the titles of columns."""
    balls = zip(target.points.tolist(), np.asarray(target.std).tolist(), strict=True)
    return [
        {"ball": number} | {f"{axis} [mm]": _hundredths(*pair) for axis, *pair in zip("xyz", place, std, strict=True)}
        for number, (place, std) in enumerate(balls, start=1)
    ]


def joint_rows(done: JointCalibration) -> list[Row]:
    """Return where joints are in both targets [mm], by the titles of columns."""
    return [
        {
            "joint": joint.name,
            "kind": joint.kind,
            "parent": joint.parent,
            "child": joint.child,
            "in parent [mm]": " ".join(place_texts(joint)[0]),
            "in child [mm]": " ".join(place_texts(joint)[1]),
            "gap [mm]": round(fit.gap, 2),
            "frames": len(fit.frames),
        }
        for joint, fit in zip(done.joints, done.fits, strict=True)
    ]


def place_texts(joint: TargetJoint) -> tuple[list[str], list[str]]:
    """Return x, y and z [mm] of a joint in its parent, then in its child."""
    in_parent, in_child = (
        [_hundredths(*pair) for pair in zip(place.tolist(), std.tolist(), strict=True)]
        for place, std in zip((joint.parent_from_joint[:3, 3], joint.child_from_joint[:3, 3]), joint.std, strict=True)
    )
    return in_parent, in_child


def _hundredths(value: float, std: float) -> str:
    return f"{value:.2f} ± {std:.2f}" if std > 0 else f"{value:.2f}"


def _with_std(value: float, std: float) -> str:
    """Return a value with two digits of its standard deviation, as a text.

    Parameters
    ----------
    value : float
        In any unit.
    std : float
        In the same unit; 0 for a value that was not estimated, which is shown alone.
    """
    if std == 0:
        return f"{value:g}"
    digits = max(0, 1 - math.floor(math.log10(std)))
    return f"{value:.{digits}f} ± {std:.{digits}f}"
