"""What the motion of a joint tells of its place, in plain sentences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import nearest_rotation, vector_from_matrix
from skelgen.model.arrays import Floats

DETERMINED_PART = 0.1
"""Of a limb's size: places known less well than this are called not determined."""

STILL = np.deg2rad(2.0)
"""rad; limbs that turn less than this against each other do not turn."""


@dataclass(frozen=True, eq=False)
class RangeOfMotion:
    """How far a joint turns, by direction.

    Attributes
    ----------
    directions : ndarray, shape (3, 3)
        Unit axes in the parent as rows, that about which it turns most first.
    ranges : ndarray, shape (3,), rad
        From one end to the other, of the turn about each.
    """

    directions: Floats
    ranges: Floats


def range_of_motion(relative: Floats) -> RangeOfMotion:
    """Return how far a joint turns about its three principal directions.

    Parameters
    ----------
    relative : ndarray, shape (n_frames, 3, 3)
        Rotations child against parent.
    """
    middle = nearest_rotation(relative.mean(axis=0))
    turns = vector_from_matrix(relative @ middle.T)
    _, vectors = np.linalg.eigh(turns.T @ turns)
    directions = vectors[:, ::-1].T
    along = turns @ directions.T
    ranges = np.ptp(along, axis=0) if len(along) else np.zeros(3)
    order = np.argsort(-ranges, kind="stable")
    return RangeOfMotion(directions[order], ranges[order])


def undetermined_place(
    limbs: tuple[int, int], kind: str, motion: RangeOfMotion, covariance: Floats, size: float
) -> str:
    """Say in a sentence which direction of a joint's place is not determined; empty if all are.

    Parameters
    ----------
    limbs : tuple of int
        Parent and child.
    kind : str
        Of the joint.
    motion : RangeOfMotion
        How it turns.
    covariance : ndarray, shape (3, 3), mm^2
        Of its place in the parent.
    size : float, mm
        Of the limb.
    """
    values, vectors = np.linalg.eigh(covariance)
    worst = float(np.sqrt(max(values[-1], 0.0)))
    if worst <= DETERMINED_PART * size:
        return ""
    joint = f"the joint between limb {limbs[0]} and {limbs[1]}"
    if motion.ranges[0] < STILL:
        return f"{joint} does not turn: its place is not determined, +-{worst:.0f} mm"
    if kind == "hinge":
        return f"{joint} turns about one axis only: its place along that axis is not determined, +-{worst:.0f} mm"
    turns = ", ".join(f"{np.rad2deg(one):.0f}" for one in motion.ranges)
    way = ", ".join(f"{one:.2f}" for one in vectors[:, -1])
    return (
        f"{joint} turns too little (by {turns} deg about its three directions): along ({way}) of limb {limbs[0]} its "
        f"place is known to +-{worst:.0f} mm only"
    )
