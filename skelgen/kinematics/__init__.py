"""Joint models fitted on limb poses; each kind is usable alone on `Poses`."""

from skelgen.kinematics.angles import angle_names, joint_angles
from skelgen.kinematics.choose import KindChoice, choose_kind
from skelgen.kinematics.hierarchy import Hierarchy, Length, find_hierarchy, without_residual
from skelgen.kinematics.inverse import Posture, posture_of, solve
from skelgen.kinematics.joint_fit import JointFit, fit_ball, fit_hinge, fit_rigid, fit_universal
from skelgen.kinematics.kind import KindLimits
from skelgen.kinematics.live import LiveSkeleton
from skelgen.kinematics.relative import pose_covariance
from skelgen.kinematics.rigid_body import RigidBody, calibrate_rigid_body, limb_bodies

__all__ = [
    "Hierarchy",
    "JointFit",
    "KindChoice",
    "KindLimits",
    "Length",
    "LiveSkeleton",
    "Posture",
    "RigidBody",
    "angle_names",
    "calibrate_rigid_body",
    "choose_kind",
    "find_hierarchy",
    "fit_ball",
    "fit_hinge",
    "fit_rigid",
    "fit_universal",
    "joint_angles",
    "limb_bodies",
    "pose_covariance",
    "posture_of",
    "solve",
    "without_residual",
]
