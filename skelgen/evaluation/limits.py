"""Joint errors beside what is possible and what the result itself predicts."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from skelgen.evaluation.joints import JointScore, joint_distances, joint_gaps
from skelgen.evaluation.physical_limit import bound_of_take
from skelgen.model import Project
from skelgen.model.arrays import Ints
from skelgen.simulation.truth import Truth

SIGMAS_OF_95 = 1.96
"""Half the width of the interval that holds 95 % of normal numbers, in standard deviations."""

DISTANCE_OF_STD = np.sqrt(8 / np.pi) / np.sqrt(3)
"""Mean length of normal vectors whose deviation is 1 / sqrt 3 along each of three axes."""


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
    limit = bound_of_take(project.trajectories, true_of_marker, truth)
    result = []
    for score, joint, true_joint in zip(scores, shared, true_joints, strict=True):
        found = motion.joint_positions[:, [joint]]
        more: dict[str, Any] = {}
        if limit is not None:
            bound, _, frames = limit
            use = bound.determined[:, true_joint + 1]
            smallest = float(bound.distance[use, true_joint + 1].mean())
            error = joint_distances(found, np.array([true_joint]), truth)[frames, 0][use]
            more |= {"bound": smallest, "times_bound": float(error.mean()) / smallest}
        if motion.joint_std is not None:
            std = motion.joint_std[:, joint]
            gap = np.abs(joint_gaps(found, np.array([true_joint]), truth)[:, 0])
            held = gap <= SIGMAS_OF_95 * std + np.finfo(np.float32).eps * np.abs(found[:, 0])
            predicted = DISTANCE_OF_STD * np.linalg.norm(std, axis=1).mean()
            more |= {"predicted": float(predicted), "coverage": float(held.mean())}
        result.append(dataclasses.replace(score, **more))
    return tuple(result)
