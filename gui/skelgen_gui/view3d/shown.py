"""What of a project the 3-D view shows."""

from __future__ import annotations

from dataclasses import dataclass

TRAIL_SECONDS = (0.25, 0.5, 1.0, 2.0)
"""Lengths of trails to choose from [s]."""

MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100)
"""How many times larger than one standard deviation ellipsoids can be drawn: of good takes these are below 1 mm."""


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
    follow : bool
        Whether the viewer goes along with what moves.
    trail_seconds : float, s
        Length of trails.
    magnification : int or None
        Half axes of the ellipsoids in standard deviations; None chooses what can be seen and does not hide the rest.
    up : int or None
        Coordinate axis that points up, 0 .. 2, or down, 3 .. 5; None leaves it to the data.
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
    follow: bool = False
    trail_seconds: float = TRAIL_SECONDS[0]
    magnification: int | None = None
    up: int | None = None
