"""One body from mean limbs to a calibrated chain with its poses in all frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import Rotator
from skelgen.kinematics.calibration import calibrate
from skelgen.kinematics.chain import Chain, ChainPoses, fit_poses
from skelgen.kinematics.kind import JointKind
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.skeleton.assemble import Body, assemble
from skelgen.stages.skeleton.joints import (
    find_kinds,
    joint_covariances,
    relative_rotation_noise,
    settle_along_axes,
)
from skelgen.stages.skeleton.outward import pose_outward
from skelgen.stages.skeleton.parameters import SkeletonParameters


@dataclass(frozen=True, eq=False)
class FittedBody:
    """A body with everything that is known of it.

    Attributes
    ----------
    body : Body
        What was fitted.
    chain : Chain
        Rigid limbs; their frames have the world's orientation in the reference frame.
    poses : ChainPoses
        All frames.
    seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether rotations rest on markers of the frame.
    kinds : list of JointKind
        Of the joints above limbs 1, 2, ...
    covariances : ndarray, shape (n_limbs, 3, 3), mm^2
        Of the joints in their parents' frames.
    reference : int
        Reference frame.
    """

    body: Body
    chain: Chain
    poses: ChainPoses
    seen: Bools
    kinds: list[JointKind]
    covariances: Floats
    reference: int


def fit_body(body: Body, parameters: SkeletonParameters, rotator: Rotator) -> FittedBody:
    """Fit one tree of limbs to its markers."""
    frames = _well_seen_frames(body, parameters.samples)
    chain, reference = assemble(body, parameters, rotator, frames)
    sampled = body.positions[frames]
    start, _ = pose_outward(chain, sampled, body.raw_joints[frames], rotator, parameters.flatness)
    refine = parameters.fit == "whole-chain"
    calibration = calibrate(chain, start, sampled, n_rounds=None if refine else 0)
    chain = calibration.chain
    covariances = joint_covariances(calibration, parameters.rank_tolerance)
    noise = relative_rotation_noise(chain, calibration.poses, sampled, calibration.noise)
    chain = settle_along_axes(chain, find_kinds(chain, calibration.poses, noise, parameters))
    poses, seen = pose_outward(chain, body.positions, body.raw_joints, rotator, parameters.flatness)
    if refine:
        poses = fit_poses(chain, poses, body.positions)
    chain, poses, turn = _with_reference_axes(chain, poses, reference)
    kinds = find_kinds(chain, poses[frames], noise, parameters)
    return FittedBody(
        body=body,
        chain=chain,
        poses=poses,
        seen=seen,
        kinds=kinds,
        covariances=turn[np.maximum(chain.parents, 0)]
        @ covariances
        @ turn[np.maximum(chain.parents, 0)].swapaxes(1, 2),
        reference=reference,
    )


def _well_seen_frames(body: Body, samples: int) -> Ints:
    """Evenly spread frames among those that show at least as many markers as half of all frames do."""
    count = (~np.isnan(body.positions[:, :, 0])).sum(axis=1)
    good = np.flatnonzero(count >= max(np.median(count), 1))
    return good[np.unique(np.linspace(0, len(good) - 1, min(samples, len(good))).astype(np.intp))]


def _with_reference_axes(chain: Chain, poses: ChainPoses, reference: int) -> tuple[Chain, ChainPoses, Floats]:
    """Turn every limb's frame so that it has the world's axes in the reference frame; also return the turns."""
    turn = poses.rotations[reference].copy()
    offsets = np.einsum("mij,mj->mi", turn[chain.limb_of_marker], chain.offsets)
    joints = np.einsum("lij,lj->li", turn[np.maximum(chain.parents, 0)], chain.joints)
    return chain.moved(joints, offsets), ChainPoses(poses.root, poses.rotations @ turn.swapaxes(1, 2)), turn
