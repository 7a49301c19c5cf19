"""The angles of one joint over a take, with their deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.kinematics.inverse import joint_angles
from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats


@dataclass(frozen=True, eq=False)
class JointCurve:
    """How a joint turns.

    Attributes
    ----------
    names : tuple of str
        Of the angles, as `skelgen.kinematics.inverse.Posture` describes them.
    angles : ndarray, shape (n_frames, n_angles), rad
        Without jumps of a full turn.
    std : ndarray, shape (n_frames, n_angles), rad, or None
        Standard deviations, where they are known.
    """

    names: tuple[str, ...]
    angles: Floats
    std: Floats | None


def joint_curve(project: Project, joint: int) -> JointCurve:
    """Return the angles of a joint of a project with a skeleton."""
    one = project.skeleton.joints[joint]
    rotations = project.motion.rotations
    relative = rotations[:, one.parent].swapaxes(1, 2) @ rotations[:, one.child]
    angles = joint_angles(one, relative)
    return JointCurve(_names(one), np.unwrap(angles, axis=0) if one.kind == "hinge" else angles, None)


def _names(joint: Joint) -> tuple[str, ...]:
    if joint.kind == "rigid":
        return ()
    if joint.kind == "hinge" and joint.axis is not None:
        return ("turn",)
    if joint.kind == "universal" and joint.second_axis is not None:
        return ("first axis", "second axis")
    return ("x", "y", "z")
