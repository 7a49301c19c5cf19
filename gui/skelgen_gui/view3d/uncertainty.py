"""How well joints are known, frame by frame."""

from __future__ import annotations

import numpy as np

from skelgen.model import Project
from skelgen.model.arrays import Floats


def joint_covariances(project: Project, frame: int) -> Floats:
    """Return the covariances of the joints' places in a frame along the world's axes.

    Parameters
    ----------
    project : Project
        A project with a skeleton, or without: then there are none.
    frame : int
        From 0.

    Returns
    -------
    ndarray, shape (n_joints, 3, 3), mm^2
        From the motion where it was estimated for every frame, otherwise from the skeleton, turned with the parents.
    """
    if not project.has("skeleton"):
        return np.zeros((0, 3, 3))
    motion, joints = project.motion, project.skeleton.joints
    if motion.joint_std is not None:
        return np.asarray(motion.joint_std[frame][:, :, np.newaxis] ** 2 * np.eye(3))
    turns = motion.world_from_limb[frame][[joint.parent for joint in joints], :3, :3]
    variances = np.reshape([joint.std**2 for joint in joints], (-1, 1, 3))
    return np.asarray((turns * variances) @ turns.swapaxes(1, 2))
