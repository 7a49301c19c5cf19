"""Joint errors of a simulated take beside its Cramer-Rao bound and beside the deviations that the result predicts."""

import dataclasses

import numpy as np

from skelgen.evaluation.joints import JointScore, joint_distances, joint_errors
from skelgen.kinematics.calibration.uncertainty import Bound, cramer_rao_bound
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed
from skelgen.model import Project, Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.model.topology import outward_order
from skelgen.simulation.truth import Truth

MOST_FRAMES = 2000
"""Frames from which the bound is computed at most, evenly spread: more would hardly make it smaller."""

SIGMAS_OF_95 = 1.96
"""Half the width of the interval that holds 95 % of normal numbers, in standard deviations."""

DISTANCE_OF_STD = np.sqrt(8 / np.pi) / np.sqrt(3)
"""Mean length of normal vectors whose deviation is 1 / sqrt 3 along each of three axes."""


def _bound_of_take(trajectories: Trajectories, true_of_marker: Ints, truth: Truth) -> tuple[Bound, float, Ints] | None:
    """Return the bound of a take's joints, in the order of the truth's.

    Parameters
    ----------
    trajectories : Trajectories
        What was measured.
    true_of_marker : ndarray of intp, shape (n_markers,)
        True marker of each marker, -1 where there is none.
    truth : Truth
        The truth.

    Returns
    -------
    tuple of Bound, float [mm] and ndarray of intp, or None
        The bound, without the root; the noise of a coordinate, which is all that sets measured positions apart from
        rigid limbs; and the frames. None for several trees, or where markers are missing.
    """
    if truth.n_limbs < 2 or (truth.parents < 0).sum() != 1:
        return None
    frames = spread_frames(truth.n_frames, MOST_FRAMES)
    measured = np.full((len(frames), truth.n_markers, 3), np.nan)
    known = true_of_marker >= 0
    measured[:, true_of_marker[known]] = trajectories.positions[frames][:, known]
    errors = measured - truth.marker_positions[frames]
    if np.isnan(errors).all(axis=(0, 2)).any():
        return None
    noise = float(np.sqrt(np.nanmean(errors**2)))
    if noise == 0.0:
        return None
    chain, articulation, poses = true_chain(truth)
    return cramer_rao_bound(observed(chain, articulation, poses[frames], measured), noise), noise, frames


def true_chain(truth: Truth) -> tuple[Chain, Articulation, ChainPoses]:
    """Return the truth of one tree as a chain; limb k is the child of joint k - 1."""
    order = outward_order(truth.parents)
    place = np.empty(len(order), dtype=np.intp)
    place[order] = np.arange(len(order))
    parents = np.where(truth.parents[order] >= 0, place[truth.parents[order]], -1)
    rotations = truth.world_from_limb[:, order, :3, :3]
    origins = np.concatenate([truth.world_from_limb[0, order[:1], :3, 3], truth.joint_positions[0]])
    ways = origins - origins[np.maximum(parents, 0)]
    joints = np.einsum("lji,lj->li", rotations[0, np.maximum(parents, 0)], ways)
    limb_of_marker = place[truth.limb_of_marker]
    arms = truth.marker_positions[0] - origins[limb_of_marker]
    offsets = np.einsum("mji,mj->mi", rotations[0, limb_of_marker], arms)
    chain = Chain(parents, limb_of_marker, joints, offsets)
    poses = ChainPoses(truth.world_from_limb[:, order[0], :3, 3], rotations)
    return chain, _articulation(truth, chain, rotations), poses


def _articulation(truth: Truth, chain: Chain, rotations: Floats) -> Articulation:
    free = Articulation.free(chain.n_limbs)
    types = ("ball", *truth.joint_kinds)
    in_parent, in_child, between = free.in_parent.copy(), free.in_child.copy(), np.zeros(chain.n_limbs)
    for limb in range(1, chain.n_limbs):
        if types[limb] not in {"hinge", "universal"}:
            continue
        parent = rotations[:, chain.parents[limb]]
        relative = parent.swapaxes(1, 2) @ rotations[:, limb]
        in_parent[limb] = parent[0].T @ truth.joint_axes[0, limb - 1]
        in_child[limb] = relative[0].T @ in_parent[limb]
        if types[limb] == "universal":
            # The axis in the child about which the first one goes round in a cone.
            seen = np.einsum("fji,j->fi", relative, in_parent[limb])
            in_child[limb] = np.linalg.svd(seen - seen.mean(axis=0), full_matrices=False)[2][2]
            between[limb] = np.arccos(np.clip(in_parent[limb] @ relative[0] @ in_child[limb], -1.0, 1.0))
    return Articulation(types, in_parent, in_child, between)


def with_limits(
    scores: tuple[JointScore, ...], project: Project, true_of_joint: Ints, true_of_marker: Ints, truth: Truth
) -> tuple[JointScore, ...]:
    """Return joint scores with the bound, the predicted deviation, and the coverage of predicted intervals.

    Parameters
    ----------
    scores : tuple of JointScore
        In the order of the truth.
    project : Project
        With a skeleton.
    true_of_joint, true_of_marker : ndarray of intp
        True joint and marker of each, -1 where there is none.
    truth : Truth
        The truth.
    """
    motion = project.motion
    shared = [int(joint) for joint in np.argsort(true_of_joint, kind="stable") if true_of_joint[joint] >= 0]
    true_joints = true_of_joint[shared]
    limit = _bound_of_take(project.trajectories, true_of_marker, truth)
    result = []
    for score, joint, true_joint in zip(scores, shared, true_joints, strict=True):
        full, found = score, motion.joint_positions[:, [joint]]
        if limit is not None:
            bound, _, frames = limit
            use = bound.determined[:, true_joint + 1]
            smallest = float(bound.distance[use, true_joint + 1].mean())
            error = joint_distances(found, np.array([true_joint]), truth)[frames, 0][use]
            full = dataclasses.replace(full, bound=smallest, times_bound=float(error.mean()) / smallest)
        if motion.joint_std is not None:
            std = motion.joint_std[:, joint]
            gap = np.abs(joint_errors(found, np.array([true_joint]), truth)[:, 0])
            held = gap <= SIGMAS_OF_95 * std + np.finfo(np.float32).eps * np.abs(found[:, 0])
            predicted = DISTANCE_OF_STD * np.linalg.norm(std, axis=1).mean()
            full = dataclasses.replace(full, predicted=float(predicted), coverage=float(held.mean()))
        result.append(full)
    return tuple(result)
