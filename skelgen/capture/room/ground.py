"""Ground plane and origin from an L-frame: three balls on the floor, one in the corner and one on each arm.

The arms differ in length, so that the distances between the balls say which is which. x runs along the long arm, z up.
"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from skelgen.capture.room.points import PointMatcher
from skelgen.capture.room.values import Views
from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from
from skelgen.model.arrays import Floats
from skelgen.model.rig import CameraRig

TOLERANCE = 0.02
"""Relative error of the three distances up to which three balls are the frame."""

ALIKE = 0.1
"""Relative difference of the arms below which they cannot be told apart."""

FEWEST_CAMERAS = 2


def find_ground(frames: Sequence[Views], rig: CameraRig, arms: tuple[float, float]) -> Floats:
    """Return where an L-frame on the floor is: world_from_ground, shape (4, 4), mm.

    Parameters
    ----------
    frames : sequence of views
        What all cameras see while it lies still.
    rig : CameraRig
        The cameras.
    arms : tuple of float, mm
        From the ball in the corner to those on the long and on the short arm; x runs along the first one.

    Raises
    ------
    InputError
        If it is not seen, or the cameras would be below the floor.
    """
    along, aside = arms
    if not (along > 0 and aside > 0 and abs(along - aside) > ALIKE * max(arms)):
        raise InputError(f"the arms of the L-frame are {along:g} and {aside:g} mm; they must differ by a tenth or more")
    matcher, found = PointMatcher(rig), []
    for views in frames:
        points = matcher.find(views)
        corner = _corner(points.points[points.n_cameras >= FEWEST_CAMERAS], along, aside)
        if corner is not None:
            found.append(corner)
    if not found:
        raise InputError(
            f"no three balls {along:g}, {aside:g} and {np.hypot(along, aside):.0f} mm apart are seen by two cameras: "
            "lay the L-frame on the floor in the middle of the room, and give its arms; if they are right, the wand's "
            "distances are not"
        )
    origin, first, second = np.median(found, axis=0)
    x = (first - origin) / np.linalg.norm(first - origin)
    z = np.cross(x, second - origin)
    z /= np.linalg.norm(z)
    world_from_ground = transform_from(np.column_stack([x, np.cross(z, x), z]), origin)
    heights = (rig.places - origin) @ z
    if np.median(heights) < 0:
        raise InputError(
            "the cameras would be below the floor: the frame's short arm must point to the left of its long arm, seen "
            "from above; exchange the arms, or the order in which they are given"
        )
    return world_from_ground


def _corner(points: Floats, along: float, aside: float) -> Floats | None:
    """Corner, end of the long arm and end of the short one among points; None if no three have their distances."""
    if not 3 <= len(points) <= 12:
        return None
    chosen = np.array(list(permutations(range(len(points)), 3)))
    corner, first, second = (points[chosen[:, index]] for index in range(3))
    wanted = np.array([along, aside, np.hypot(along, aside)])
    gaps = [np.linalg.norm(a - b, axis=1) for a, b in ((first, corner), (second, corner), (first, second))]
    off = np.abs(np.stack(gaps, axis=1) / wanted - 1.0).max(axis=1)
    best = int(off.argmin())
    return points[chosen[best]] if off[best] <= TOLERANCE else None
