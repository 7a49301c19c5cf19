"""What the angles of a motion's joints come to: from where to where they turn, and how surely they are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.kinematics.angles import angle_names
from skelgen.kinematics.inverse import Posture, posture_of
from skelgen.model import Motion, Skeleton
from skelgen.model.arrays import Floats, Ints

MOST_FRAMES = 5000
"""Frames on which tables rest, evenly spread."""


@dataclass(frozen=True)
class AngleRange:
    """One angle of a joint.

    Attributes
    ----------
    name : str
        Which, see `skelgen.kinematics.angles`.
    low, mean, high : float, rad
        Smallest, mean and largest value, from frames that show both limbs; NaN if there are none.
    std : float, rad
        Median of the standard deviations.
    """

    name: str
    low: float
    mean: float
    high: float
    std: float


def told_frames(n_frames: int, most: int = MOST_FRAMES) -> Ints:
    """Return at most so many frames, evenly spread."""
    return np.unique(np.linspace(0, n_frames - 1, min(n_frames, most)).astype(np.intp))


def angle_ranges(skeleton: Skeleton, motion: Motion, positions: Floats) -> tuple[tuple[AngleRange, ...], ...]:
    """Return the range of every angle of every joint, in the order of the skeleton's joints.

    Parameters
    ----------
    skeleton, motion
        The skeleton and its motion.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    """
    posture = posture_of(skeleton, motion, positions, told_frames(motion.n_frames))
    return tuple(_ranges(skeleton, posture, index) for index in range(skeleton.n_joints))


def _ranges(skeleton: Skeleton, posture: Posture, index: int) -> tuple[AngleRange, ...]:
    joint = skeleton.joints[index]
    shown = posture.limb_seen[:, [joint.parent, joint.child]].all(axis=1)
    angles, stds = posture.angles[index][shown], posture.angle_std[index][shown]
    if not len(angles):
        return tuple(AngleRange(name, np.nan, np.nan, np.nan, np.nan) for name in angle_names(joint))
    return tuple(
        AngleRange(name, float(angle.min()), float(angle.mean()), float(angle.max()), float(np.median(std)))
        for name, angle, std in zip(angle_names(joint), angles.T, stds.T, strict=True)
    )
