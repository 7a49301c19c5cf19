"""Joints that turn in more ways than the calibrated take showed: a neck that only nodded there is no hinge here.

Both takes are posed with all joints free. How far a joint then leaves the turns that its kind allows is noise and skin
in the calibrated take; in the new one it may be more. The root mean squares of this angle in equal spans of both takes
are compared by Welch's test, on their logarithms, one-sided, the level shared by all joints (Bonferroni).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import ttest_ind

from skelgen.geometry.rotations import vector_from_matrix
from skelgen.kinematics.articulation import FREEDOMS
from skelgen.kinematics.known_tree import KnownTree
from skelgen.model import Joint, Skeleton
from skelgen.model.arrays import Bools, Floats
from skelgen.stages.known.moved import LEAST_SEEN, LEAST_SPANS, LEVEL, N_SPANS
from skelgen.stages.known.posing import KnownPoses

_LEAST_ANGLE = 1e-6  # rad: exact takes have none


def with_free_joints(skeleton: Skeleton, which: tuple[int, ...] | None = None) -> Skeleton:
    """Return a skeleton some of whose joints, or all, are balls."""
    chosen = range(skeleton.n_joints) if which is None else which
    joints = tuple(_ball(joint) if index in chosen else joint for index, joint in enumerate(skeleton.joints))
    return replace(skeleton, joints=joints)


def _ball(joint: Joint) -> Joint:
    if joint.kind in {"ball", "undetermined"}:
        return joint
    return replace(joint, kind="ball", axis=None, second_axis=None, axis_std=None, second_axis_std=None)


def looser_joints(skeleton: Skeleton, before: KnownPoses, after: KnownPoses) -> tuple[int, ...]:
    """Find joints whose kind does not hold in a new take.

    Parameters
    ----------
    skeleton : Skeleton
        With the kinds.
    before, after : KnownPoses
        The calibrated and the new take, posed with all joints free.

    Returns
    -------
    tuple of int
        Indices of joints.
    """
    bound = [index for index, joint in enumerate(skeleton.joints) if FREEDOMS[joint.kind] < FREEDOMS["ball"]]
    wobbles = [_wobbles(skeleton, poses) for poses in (before, after)]
    found = []
    for index in bound:
        child = skeleton.joints[index].child
        samples = [
            log_spans(wobble[:, child], poses.seen[:, child])
            for wobble, poses in zip(wobbles, (before, after), strict=True)
        ]
        if min(map(len, samples)) >= LEAST_SPANS:
            p_value = float(ttest_ind(samples[1], samples[0], equal_var=False, alternative="greater").pvalue)
            if p_value < LEVEL / len(bound):
                found.append(index)
    return tuple(found)


def _wobbles(skeleton: Skeleton, poses: KnownPoses) -> Floats:
    """Angles [rad] by which limbs leave what the joints above allow, shape (n_frames, n_limbs)."""
    angles = np.zeros(poses.seen.shape)
    for root in skeleton.roots:
        tree = KnownTree(skeleton, int(root), None)
        free = poses.world_from_limb[:, tree.limbs][..., :3, :3]
        held = tree.articulation.projected(tree.chain.parents, free)
        above = np.maximum(tree.chain.parents, 0)
        turns = [rotations[:, above].swapaxes(-1, -2) @ rotations for rotations in (held, free)]
        off = np.linalg.norm(vector_from_matrix(turns[0].swapaxes(-1, -2) @ turns[1]), axis=-1)
        angles[:, tree.limbs[1:]] = off[:, 1:]
    return angles


def log_spans(angles: Floats, seen: Bools) -> Floats:
    """Return logarithms of the root mean square in each span of a take that shows enough."""
    spans = zip(np.array_split(angles, N_SPANS), np.array_split(seen, N_SPANS), strict=True)
    shown = [part[known] for part, known in spans if known.sum() >= LEAST_SEEN]
    return np.array([np.log(np.sqrt((part**2).mean()) + _LEAST_ANGLE) for part in shown])
