"""Ground plane and origin from an L-frame or any three balls on the floor, one in the corner and one on each arm.

The arms differ in length, so that the distances between the balls say which is which. x runs along the first arm, z up.
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
N_ARMS = 2


def find_ground(frames: Sequence[Views], rig: CameraRig, arms: Sequence[float]) -> Floats:
    """Return where an L-frame on the floor is: world_from_ground, shape (4, 4), mm.

    Parameters
    ----------
    frames : sequence of views
        What all cameras see while it lies still.
    rig : CameraRig
        The cameras.
    arms : sequence of float, mm
        From the ball in the corner to the two others; x runs along the first arm. Where these do not stand at right
        angles, the distance between the two others is the third number.

    Raises
    ------
    InputError
        If it is not seen, or the cameras would be below the floor.
    """
    wanted = _distances(arms)
    matcher, found = PointMatcher(rig), []
    for views in frames:
        points = matcher.find(views)
        corner = _corner(points.points[points.n_cameras >= FEWEST_CAMERAS], wanted)
        if corner is not None:
            found.append(corner)
    if not found:
        raise InputError(
            f"no three balls {wanted[0]:g}, {wanted[1]:g} and {wanted[2]:.0f} mm apart are seen by two cameras: "
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


def _distances(arms: Sequence[float]) -> Floats:
    """From the corner to both ends and between these, shape (3,), mm; which ball is which must show."""
    along, aside = arms[:2]
    between = arms[2] if len(arms) > N_ARMS else float(np.hypot(along, aside))
    if not (along > 0 and aside > 0 and abs(along - aside) > ALIKE * max(along, aside)):
        raise InputError(f"the arms of the L-frame are {along:g} and {aside:g} mm; they must differ by a tenth or more")
    if not abs(along - aside) < between < along + aside:
        raise InputError(f"no three balls are {along:g}, {aside:g} and {between:g} mm apart; measure their distances")
    wanted = np.array([along, aside, between])
    if len(arms) > N_ARMS and (np.abs(wanted[:2] - between) <= ALIKE * between).any():
        raise InputError(
            f"the three balls are {along:g}, {aside:g} and {between:g} mm apart; each two must differ by a tenth or "
            "more, to tell the balls from each other"
        )
    return wanted


def _corner(points: Floats, wanted: Floats) -> Floats | None:
    """Corner, end of the first arm and end of the second one among points; None if no three have their distances."""
    if not 3 <= len(points) <= 12:
        return None
    chosen = np.array(list(permutations(range(len(points)), 3)))
    corner, first, second = (points[chosen[:, index]] for index in range(3))
    gaps = [np.linalg.norm(a - b, axis=1) for a, b in ((first, corner), (second, corner), (first, second))]
    off = np.abs(np.stack(gaps, axis=1) / wanted - 1.0).max(axis=1)
    best = int(off.argmin())
    return points[chosen[best]] if off[best] <= TOLERANCE else None
