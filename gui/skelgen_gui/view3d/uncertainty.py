"""How well joints are known, frame by frame."""

from __future__ import annotations

import numpy as np

from skelgen.kinematics.inverse import posture_of
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints
from skelgen.model.skeleton import Joint

BLOCK = 64
"""Frames whose covariances are derived at once: takes hardly longer than one, some ms."""

_MOST_BLOCKS = 4  # that are kept: what is shown, and what is played into


class JointCovariances:
    """The covariances of a project's joints in the frames that are shown.

    Parameters
    ----------
    project : Project
        A project with a skeleton, or without: then there are none.
    """

    def __init__(self, project: Project) -> None:
        self._project = project
        self._blocks: dict[int, Floats] = {}

    def at(self, frame: int) -> Floats:
        """Return those of a frame, shape (n_joints, 3, 3), mm^2."""
        number = frame // BLOCK
        if number not in self._blocks:
            if len(self._blocks) >= _MOST_BLOCKS:
                del self._blocks[next(iter(self._blocks))]
            frames = np.arange(number * BLOCK, min((number + 1) * BLOCK, self._project.take.n_frames))
            self._blocks[number] = joint_covariances(self._project, frames)
        return np.asarray(self._blocks[number][frame % BLOCK])


def joint_covariances(project: Project, frames: Ints) -> Floats:
    """Return the covariances of the joints' places along the world's axes.

    Parameters
    ----------
    project : Project
        A project with a skeleton, or without: then there are none.
    frames : ndarray of intp, shape (n,)
        From 0.

    Returns
    -------
    ndarray, shape (n, n_joints, 3, 3), mm^2
        With the variances of the motion where it has them, otherwise from the skeleton, turned with the parents.
    """
    if not project.has("skeleton"):
        return np.zeros((len(frames), 0, 3, 3))
    motion = project.motion
    if motion.joint_std is None:
        turns = motion.world_from_limb[frames][:, [joint.parent for joint in project.skeleton.joints], :3, :3]
        own = np.reshape([_own_covariance(joint) for joint in project.skeleton.joints], (-1, 3, 3))
        return np.asarray(turns @ own @ turns.swapaxes(2, 3))
    posture = posture_of(project.skeleton, motion, project.trajectories.positions, frames)
    std = motion.joint_std[frames] / np.maximum(posture.joint_std, np.finfo(float).tiny)
    return np.asarray(std[..., np.newaxis] * posture.joint_covariances * std[..., np.newaxis, :])


def _own_covariance(joint: Joint) -> Floats:
    return np.diag(joint.std**2) if joint.covariance is None else joint.covariance
