"""The reference rig: the two cameras of Gaschler 2011 and the arm that is moved before them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera, StereoRig

if TYPE_CHECKING:
    from skelgen.simulation.articulated import LimbModel, Structure


def reference_rig() -> StereoRig:
    """Return the two cameras of Gaschler 2011, Table 4.1: 640 x 480 px, 477 mm apart, turned 13 degrees inwards."""
    turn, shift = matrix_from_vector(np.array([0.021, 0.227, -0.013])), np.array([-474.36, -1.49, 51.03])
    left = np.array([[832.79, 0.0, 316.69], [0.0, 833.76, 240.22], [0.0, 0.0, 1.0]])
    right = np.array([[836.32, 0.0, 318.77], [0.0, 836.27, 257.80], [0.0, 0.0, 1.0]])
    return StereoRig(
        Camera(640, 480, left, np.array([-0.236, 0.304, 0.0, 0.0, 0.0]), name="left"),
        Camera(640, 480, right, np.array([-0.223, 0.201, 0.0, 0.0, 0.0]), transform_from(turn, shift), "right"),
    )


_ROD = 6.0  # mm: the balls stand on thin rods that hide nearly nothing
# mm; five balls within 105 mm, about as in Gaschler (2011), figure 6.2. The ten distances within a target differ by
# 3.9 mm and more, all thirty by 1.2 mm, so that no target is taken for another or for itself turned.
_TORSO = ((-32, -19, 31), (55, -11, -15), (-27, -28, -6), (31, 34, -31), (-25, 24, 20))
_UPPER = ((-19, -33, 4), (27, 52, 8), (-24, -7, 26), (23, -20, -13), (-8, 7, -26))
_LOWER = ((18, 20, 11), (30, 1, 39), (-63, 9, 20), (-6, -2, -44), (19, -28, -25))
_HALF_WAY = np.array([0.0, 0.0, -100.0])  # mm: from a joint to the middle of the target on its limb


def reference_arm() -> Structure:
    """Return the test arm of Gaschler (2011, 5.3): a shoulder that is a ball joint, an elbow that is a hinge.

    The torso hardly moves; the arm is moved by hand before the cameras, 0.6 m of it in all.
    """
    from skelgen.simulation.articulated import Structure  # noqa: PLC0415 - SciPy, which the rig alone does not need

    axes = np.eye(3)
    elbow = np.array([[0.1, -1.0, 0.05]]) / np.sqrt(0.01 + 1.0 + 0.0025)
    return Structure(
        "arm",
        (
            _limb(("torso", ""), "free", (0, 0, 1200), np.array(_TORSO), axes[::-1], ((8, 5, 5), (0, 0, 0))),
            _limb(
                ("upper arm", "torso"), "ball", (0, 110, -40), _HALF_WAY + _UPPER, axes, ((30, 30, 25), (10, -15, 0))
            ),
            _limb(("lower arm", "upper arm"), "hinge", (5, 5, -190), _HALF_WAY + _LOWER, elbow, ((45,), (55,))),
        ),
    )


def _limb(
    names: tuple[str, str],
    kind: str,
    joint: tuple[float, ...],
    balls: Floats,
    axes: Floats,
    swings: tuple[tuple[float, ...], tuple[float, ...]],
) -> LimbModel:
    """A limb and its parent, its joint [mm] with amplitudes and offsets [degrees] of each axis, its balls [mm]."""
    from skelgen.simulation.articulated import LimbModel  # noqa: PLC0415

    balls = balls.astype(np.float64)
    segment = np.stack([balls.mean(axis=0), balls.mean(axis=0)])
    amplitudes, offsets = (np.array(part, dtype=np.float64) for part in swings)
    place = np.array(joint, dtype=np.float64)
    return LimbModel(*names, kind, place, segment, _ROD, balls, axes, amplitudes, offsets)
