"""The angles of one joint over a take, with their deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.kinematics.angles import angle_names, joint_angles
from skelgen.kinematics.inverse import posture_of
from skelgen.model import Project
from skelgen.model.arrays import Floats

MOST_POSTURES = 20_000
"""Frames of which deviations are computed, which takes about 20 µs each; of longer takes, evenly spaced ones."""


@dataclass(frozen=True, eq=False)
class JointCurve:
    """How a joint turns.

    Attributes
    ----------
    names : tuple of str
        Of the angles, as `skelgen.kinematics.angles` has them.
    angles : ndarray, shape (n_frames, n_angles), rad
        Those about axes without jumps of a full turn.
    std : ndarray, shape (n_frames, n_angles), rad
        Their standard deviations.
    step : int
        Deviations were computed for every how manieth frame, and hold until the next one.
    """

    names: tuple[str, ...]
    angles: Floats
    std: Floats
    step: int


def joint_curve(project: Project, joint: int) -> JointCurve:
    """Return the angles of a joint of a project with a skeleton."""
    one, motion = project.skeleton.joints[joint], project.motion
    relative = motion.rotations[:, one.parent].swapaxes(1, 2) @ motion.rotations[:, one.child]
    angles = joint_angles(one, relative)
    if one.axis is not None:
        angles = np.unwrap(angles, axis=0)
    step = -(-motion.n_frames // MOST_POSTURES) if motion.n_frames else 1
    frames = np.arange(0, motion.n_frames, step)
    posture = posture_of(project.skeleton, motion, project.trajectories.positions, frames)
    std = np.repeat(posture.angle_std[joint], step, axis=0)[: motion.n_frames]
    return JointCurve(angle_names(one), angles, std, step)
