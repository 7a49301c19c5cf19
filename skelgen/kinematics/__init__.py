"""Kinematics: the articulated chain, rigid bodies, joints, inverse kinematics, calibration, soft tissue, gap filling.

What is exported here can be used alone, on bodies with orientation (`Poses`) or on a calibrated skeleton; unlike what
scripts import from `skelgen`, it may change with every version. Its rooms are `rigid_bodies`, `chain`, `joints`,
`inverse`, `calibration`, `soft_tissue`, `gap_filling` and `hierarchy`; each imports only those before it.
"""

from skelgen.kinematics.hierarchy import Hierarchy, Length, find_hierarchy, without_residual
from skelgen.kinematics.inverse.inverse_kinematics import LiveSkeleton, Posture
from skelgen.kinematics.joints.angles import angle_names
from skelgen.kinematics.joints.fit import JointFit, TypeChoice, choose_joint_type, fit_joint
from skelgen.kinematics.joints.joint_type import TypeLimits
from skelgen.kinematics.joints.relative_poses import pose_covariance
from skelgen.kinematics.rigid_bodies import RigidBody, calibrate_rigid_body, limb_bodies

__all__ = [
    "Hierarchy",
    "JointFit",
    "Length",
    "LiveSkeleton",
    "Posture",
    "RigidBody",
    "TypeChoice",
    "TypeLimits",
    "angle_names",
    "calibrate_rigid_body",
    "choose_joint_type",
    "find_hierarchy",
    "fit_joint",
    "limb_bodies",
    "pose_covariance",
    "without_residual",
]
