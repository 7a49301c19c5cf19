"""The motion of a subject: its poses in a take with residuals, deviations of the joints, and angles."""

from dataclasses import replace

import numpy as np

from skelgen.kinematics.inverse.inverse_kinematics import posture_of
from skelgen.kinematics.inverse.motion import MotionAngles
from skelgen.model import Motion, Skeleton
from skelgen.model.arrays import Floats
from skelgen.stages.labels import SkeletonPoses

BLOCK_FRAMES = 8_192
"""Frames whose deviations are found at once: a take of forty markers needs some 10 KB for each."""


def subject_motion(skeleton: Skeleton, poses: SkeletonPoses, measured: Floats, rate: float) -> Motion:
    """Return poses as a motion, with residuals of the measured markers and deviations of the joints.

    Parameters
    ----------
    skeleton : Skeleton
        What is posed.
    poses : SkeletonPoses
        Its poses.
    measured : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    rate : float, Hz
        Frame rate.
    """
    children = [joint.child for joint in skeleton.joints]
    markers = poses.markers(skeleton)
    motion = Motion(
        world_from_limb=poses.world_from_limb,
        joint_positions=poses.world_from_limb[:, children][..., :3, 3],
        marker_positions=markers,
        residuals=np.linalg.norm(measured - markers, axis=2),
        limb_seen=poses.seen,
        rate=rate,
        compute_angles=MotionAngles(skeleton, measured),
    )
    starts = range(0, len(measured), BLOCK_FRAMES)
    blocks = [np.arange(first, min(first + BLOCK_FRAMES, len(measured))) for first in starts]
    stds = [posture_of(skeleton, motion, poses.inliers, block).joint_std for block in blocks]
    return replace(motion, joint_std=np.concatenate(stds))
