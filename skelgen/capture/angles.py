r"""Joint angles from the poses of two targets, with their errors (Gaschler 2011, 5.1.3 and 5.2.4).

The joint's frames in both bodies, carried into the world by their poses, differ by a turn and a shift. For a ball the
turn that best lays six points on the axes of one frame on those of the other (Procrustes, by singular value
decomposition) is the angle, as a rotation vector; for a hinge it is the turn about z, by least squares in the plane.
What is left of the distance between those points is the residual.

A small turn of either body turns the joint by as much: both covariances add, and go through the slope of the angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from skelgen.capture.blobs import FoundBody
from skelgen.geometry.rotations import matrix_from_vector, nearest_rotation
from skelgen.kinematics.angles import angle_deviations, joint_angles
from skelgen.model import Joint
from skelgen.model.arrays import Floats
from skelgen.model.rig import JointModel

SIZE = 100.0
"""mm from the joint to the points that stand for its frames: the size of marker targets."""

_POINTS = SIZE * np.concatenate([np.eye(3), -np.eye(3)])
_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class JointAngle:
    """The angles of one joint in one frame.

    Attributes
    ----------
    name : str
        Of the joint.
    angles : ndarray, shape (3,) for a ball or (1,) for a hinge, rad
        Rotation vector of the child against the parent, or the turn about the axis.
    std : ndarray, of the same shape, rad
        Standard deviations, from the covariances of both poses.
    residual : float, mm
        Mean distance between the joint's frames, as the bodies have them, once they are turned onto each other.
    """

    name: str
    angles: Floats
    std: Floats
    residual: float


def angle_names(joint: JointModel) -> tuple[str, ...]:
    """Return the names of a joint's angles: its own for a hinge, that with .x, .y and .z for a ball."""
    return (joint.name,) if joint.kind == "hinge" else tuple(f"{joint.name}.{axis}" for axis in "xyz")


def find_angles(joint: JointModel, bodies: Mapping[str, FoundBody]) -> JointAngle | None:
    """Return the angles of a joint, or None if one of its bodies was not found."""
    if joint.parent not in bodies or joint.child not in bodies:
        return None
    parent, child = bodies[joint.parent], bodies[joint.child]
    in_parent = parent.world_from_body @ joint.parent_from_joint
    in_child = child.world_from_body @ joint.child_from_joint
    back = in_parent[:3, :3].T
    turn = nearest_rotation(back @ in_child[:3, :3])
    shift = back @ (in_child[:3, 3] - in_parent[:3, 3])
    spread = back @ (parent.covariance[:3, :3] + child.covariance[:3, :3]) @ back.T
    kind = _kinematic(joint)
    angles = joint_angles(kind, turn[np.newaxis])[0]
    std = angle_deviations(kind, turn[np.newaxis], spread[np.newaxis])[0]
    allowed = matrix_from_vector(angles if joint.kind == "ball" else angles * _Z)
    away = _POINTS @ (turn - allowed).T + shift
    return JointAngle(joint.name, angles, std, float(np.linalg.norm(away, axis=1).mean()))


def _kinematic(joint: JointModel) -> Joint:
    """The joint as `skelgen.kinematics` knows it, in its own frame."""
    origin = np.zeros(3)
    axis = _Z if joint.kind == "hinge" else None
    return Joint(0, 1, origin, origin, joint.kind, axis, origin)
