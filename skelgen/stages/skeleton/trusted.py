"""Positions that can be right, and the poses from the root outward that rest on them."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.orientation import Rotator
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.model.arrays import Bools, Floats
from skelgen.stages.skeleton.assemble import Body
from skelgen.stages.skeleton.outliers import out_of_place, out_of_reach
from skelgen.stages.skeleton.outward import pose_outward
from skelgen.stages.skeleton.parameters import SkeletonParameters


def without_outliers(
    body: Body, chain: Chain, parameters: SkeletonParameters, rotator: Rotator
) -> tuple[Floats, ChainPoses, Bools]:
    """Return positions without those that cannot be right, poses, and which rotations rest on points of the frame.

    Parameters
    ----------
    body : Body
        What is measured.
    chain : Chain
        Its limbs.
    parameters : SkeletonParameters
        Their `outlier_limit` and `flatness`.
    rotator : callable
        Closed form of absolute orientation.
    """
    trusted = body.positions
    poses, posed = pose_outward(chain, trusted, body.raw_joints, rotator, parameters.flatness)
    for find in (out_of_reach, out_of_place):
        outliers = find(chain, poses, posed, trusted, parameters.outlier_limit)
        if outliers.any():
            trusted = np.where(outliers[..., np.newaxis], np.nan, trusted)
            poses, posed = pose_outward(chain, trusted, body.raw_joints, rotator, parameters.flatness)
    return trusted, poses, posed
