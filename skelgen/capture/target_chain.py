"""Targets that joints hold together as a tree: where they are by the root's pose and the joints' rotations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from skelgen.capture.error_propagation import HINGE
from skelgen.geometry.rotations import (
    cross_matrix,
    matrix_from_vector,
    nearest_rotation,
    transform_from,
    vector_from_matrix,
)
from skelgen.model.arrays import Floats
from skelgen.model.rig import TargetJoint

N_POSE = 6
"""Freedoms of a pose: a small rotation about the world's axes [rad], then a shift [mm]."""


@dataclass(frozen=True, eq=False)
class ChainState:
    """Where a chain of targets is, and how it moves.

    Attributes
    ----------
    root : ndarray, shape (4, 4), mm
        World from the root.
    turns : tuple of ndarray, shape (3, 3)
        Rotation of each joint, in its frame in the parent.
    rates : ndarray, shape (2, n)
        Velocities and accelerations of the n freedoms: the root's rotation and shift, then the joints' angles.
    covariance : ndarray, shape (3n, 3n)
        Of the freedoms, their velocities and their accelerations.
    """

    root: Floats
    turns: tuple[Floats, ...]
    rates: Floats
    covariance: Floats


class TargetChain:
    """A tree of targets and joints.

    Attributes
    ----------
    joints : tuple of TargetJoint
        Each one's parent before it.
    names : tuple of str
        The targets, the root first, then each joint's child.
    of_joint : list of slice
        Which freedoms each joint has: one a hinge, three a ball.
    n : int
        Number of all freedoms.
    paths : dict of str to list of int
        The joints between the root and each target.

    Parameters
    ----------
    joints : sequence of TargetJoint
        Of one tree, each one's parent before it.
    """

    def __init__(self, joints: Sequence[TargetJoint]) -> None:
        self.joints = tuple(joints)
        self.names = (joints[0].parent, *(joint.child for joint in joints))
        ends = np.cumsum([N_POSE, *(1 if joint.kind == HINGE else 3 for joint in joints)]).tolist()
        self.of_joint = [slice(*pair) for pair in pairwise(ends)]
        self.n: int = ends[-1]
        self.paths: dict[str, list[int]] = {self.names[0]: []}
        for number, joint in enumerate(joints):
            self.paths[joint.child] = [*self.paths[joint.parent], number]

    def moved(self, state: ChainState, step: Floats) -> ChainState:
        """Return the chain after small motions of its freedoms, rates and covariance as they are.

        Parameters
        ----------
        state : ChainState
            Before.
        step : ndarray, shape (n,)
            Rotations [rad] and the root's shift [mm].
        """
        root = state.root.copy()
        root[:3, :3] = nearest_rotation(matrix_from_vector(step[:3]) @ root[:3, :3])
        root[:3, 3] += step[3:N_POSE]
        turns = [
            nearest_rotation(matrix_from_vector(vector_of_joint(joint, step[own])) @ turn)
            for joint, turn, own in zip(self.joints, state.turns, self.of_joint, strict=True)
        ]
        return replace(state, root=root, turns=tuple(turns))

    def poses(self, state: ChainState) -> dict[str, Floats]:
        """Return where all targets are, world from body, by name."""
        poses = {self.names[0]: state.root}
        for joint, turn in zip(self.joints, state.turns, strict=True):
            frame = poses[joint.parent] @ joint.parent_from_joint
            frame[:3, :3] = frame[:3, :3] @ turn
            poses[joint.child] = frame @ np.linalg.inv(joint.child_from_joint)
        return poses

    def slope(self, poses: Mapping[str, Floats], name: str) -> Floats:
        """Return how a target's pose follows all freedoms, shape (6, n): rotated about the world's axes, and shifted.

        Parameters
        ----------
        poses : mapping of str to ndarray, shape (4, 4), mm
            Where all targets are.
        name : str
            Of the target.
        """
        slope, place = np.zeros((N_POSE, self.n)), poses[name][:3, 3]
        slope[:, :N_POSE] = np.eye(N_POSE)
        slope[3:, :3] = -cross_matrix(place - poses[self.names[0]][:3, 3])
        for number in self.paths[name]:
            joint, own = self.joints[number], self.of_joint[number]
            frame = poses[joint.parent] @ joint.parent_from_joint
            axes = frame[:3, 2:3] if joint.kind == HINGE else frame[:3, :3]
            slope[:3, own], slope[3:, own] = axes, -cross_matrix(place - frame[:3, 3]) @ axes
        return slope


def vector_of_joint(joint: TargetJoint, step: Floats) -> Floats:
    """Return the rotation vector of a joint's small motion [rad], in its frame in the parent.

    Parameters
    ----------
    joint : TargetJoint
        A hinge, about z, or a ball.
    step : ndarray, shape (1,) or (3,), rad
        Of its freedoms.
    """
    return np.array([0.0, 0.0, step[0]]) if joint.kind == HINGE else step


def pose_error(pose: Floats, found: Floats) -> Floats:
    """Return the rotation about the world's axes and the shift from one pose to another, shape (6,).

    Parameters
    ----------
    pose, found : ndarray, shape (4, 4), mm
        World from body, before and after.
    """
    return np.concatenate([vector_from_matrix(found[:3, :3] @ pose[:3, :3].T), found[:3, 3] - pose[:3, 3]])


def turned_and_shifted(pose: Floats, step: Floats) -> Floats:
    """Return a pose after a small motion.

    Parameters
    ----------
    pose : ndarray, shape (4, 4), mm
        World from body.
    step : ndarray, shape (6,)
        Rotation about the world's axes [rad] and shift [mm].
    """
    return transform_from(matrix_from_vector(step[:3]) @ pose[:3, :3], pose[:3, 3] + step[3:])
