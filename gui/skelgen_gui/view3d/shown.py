"""What of a project the 3-D view shows."""

from __future__ import annotations

from dataclasses import dataclass

TRAIL_SECONDS = (0.25, 0.5, 1.0, 2.0)
"""Lengths of trails to choose from [s]."""

MAGNIFICATIONS = (1, 5, 20, 100)
"""How many times the ellipsoids of joints are drawn larger than one standard deviation; most are below 1 mm."""


@dataclass(frozen=True)
class Shown:
    """What is drawn; every part is a switch.

    Attributes
    ----------
    markers, filled, names, trails : bool
        Measured markers; markers that are unseen, where the skeleton places them; names beside markers; ways that
        markers came.
    bones, joints, uncertainty, axes : bool
        Bones; joints; ellipsoids of the joints' uncertainty; axes of hinges and of universal joints.
    floor, cameras, other : bool
        Floor grid and shadows; frustums of cameras; the second project.
    trail_seconds : float, s
        Length of trails.
    magnification : int
        Half axes of the ellipsoids in standard deviations.
    up : int or None
        Coordinate axis that points up, 0 .. 2; None leaves it to the data.
    """

    markers: bool = True
    filled: bool = True
    names: bool = False
    trails: bool = True
    bones: bool = True
    joints: bool = True
    uncertainty: bool = True
    axes: bool = True
    floor: bool = True
    cameras: bool = True
    other: bool = True
    trail_seconds: float = TRAIL_SECONDS[0]
    magnification: int = MAGNIFICATIONS[2]
    up: int | None = None
