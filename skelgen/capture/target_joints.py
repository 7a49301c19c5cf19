r"""Joints between targets: their angles with their errors, and targets that joints hold together as a tree.

An angle comes from the poses of two targets (Gaschler 2011, 5.1.3 and 5.2.4). The joint's frames in both bodies,
carried into the world by their poses, differ by a rotation and a shift. Gaschler takes the rotation that best lays
points on the axes of one frame on those of the other, and does not use the shift. Here both poses have covariances, and
the joint holds the bodies together: at its centre, a hinge along its axis as well. The measured poses violate these
constraints by r. The most likely errors of the poses that explain this are

.. math::
    e = \Sigma H^T (H \Sigma H^T + P)^{-1} r ,

with the gap and tilt r, their derivative H by the errors, the covariance :math:`\Sigma` of both poses, and P of the
joint's own calibration. The rotation without these errors is the angle: a rotation vector for a ball, the rotation
about z for a hinge. Its covariance is that of the errors given r.

A constraint that is violated by more than noise explains shows play of the joint. Then P grows until the violation is
likely. With much play the constraint no longer counts, and the angle is Gaschler's.

In a chain, targets are where the root's pose and the rotations of all joints place them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.rotations import move_pose, write_pose_error
from skelgen.capture.error_propagation import HINGE, block_diagonal, constraint_slope, rotation_slope
from skelgen.capture.values import FoundBody
from skelgen.geometry import rotations
from skelgen.kinematics.joints.angles import angle_deviations, joint_angles
from skelgen.model import Joint
from skelgen.model.arrays import Floats
from skelgen.model.rig import TargetJoint

SIZE = 100.0
"""mm from the joint to the points that stand for its frames: the size of marker targets."""

LIKELY = {3: 7.81, 5: 11.07}
"""Squared deviation of gap and tilt below which 95 % of joints without play stay (chi-squared, by freedoms)."""

EXACT = 1e-6
"""mm; the least deviation of a gap, so that poses without errors can be weighted."""

_STEPS = 20
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
        Mean distance between points on the joint's frames of both bodies, after one frame is rotated onto the other.
    """

    name: str
    angles: Floats
    std: Floats
    residual: float


def angle_names(joint: TargetJoint) -> tuple[str, ...]:
    """Return the names of a joint's angles: its own for a hinge, that with .x, .y and .z for a ball."""
    return (joint.name,) if joint.kind == "hinge" else tuple(f"{joint.name}.{axis}" for axis in "xyz")


def find_angles(joint: TargetJoint, bodies: Mapping[str, FoundBody]) -> JointAngle | None:
    """Return the angles of a joint in one frame.

    Parameters
    ----------
    joint : TargetJoint
        With its frames in both bodies.
    bodies : mapping of str to FoundBody
        What was found in the frame, by name.

    Returns
    -------
    JointAngle or None
        None if one of its bodies was not found.
    """
    if joint.parent not in bodies or joint.child not in bodies:
        return None
    parent, child = bodies[joint.parent], bodies[joint.child]
    poses = parent.world_from_body, child.world_from_body
    in_parent, in_child = poses[0] @ joint.parent_from_joint, poses[1] @ joint.child_from_joint
    turn = in_parent[:3, :3].T @ in_child[:3, :3]
    kind, violation = _kinematic(joint.kind), violation_of(joint, poses)
    error, spread = _most_likely(joint, poses, block_diagonal(parent.covariance, child.covariance), violation)
    held = (rotations.matrix_from_vector(-error) @ turn)[np.newaxis]
    angles, std = joint_angles(kind, held)[0], angle_deviations(kind, held, spread[np.newaxis])[0]
    return JointAngle(joint.name, angles, std, _residual(turn, in_parent[:3, :3].T @ violation[:3], violation[3:]))


def violation_of(joint: TargetJoint, poses: tuple[Floats, Floats]) -> Floats:
    """Return how far poses are from what a joint allows: the gap [mm], and of a hinge the tilt [rad] about x and y.

    Parameters
    ----------
    joint : TargetJoint
        With its frames in both bodies.
    poses : tuple of ndarray, shape (4, 4), mm
        world_from_body of the parent and of the child.
    """
    in_parent, in_child = poses[0] @ joint.parent_from_joint, poses[1] @ joint.child_from_joint
    gap = in_child[:3, 3] - in_parent[:3, 3]
    if joint.kind != "hinge":
        return np.asarray(gap)
    turn = in_parent[:3, :3].T @ in_child[:3, :3]  # of which the least squares angle leaves the tilt
    left = turn @ rotations.matrix_from_vector(-joint_angles(_kinematic(joint.kind), turn[np.newaxis])[0] * _Z)
    return np.concatenate([gap, rotations.vector_from_matrix(left)[:2]])


def _residual(turn: Floats, gap: Floats, tilt: Floats) -> float:
    """Mean distance [mm] between the points of both frames after one frame is rotated onto the other."""
    if not len(tilt):
        return float(np.linalg.norm(gap))
    tilted = rotations.matrix_from_vector(np.array([*tilt, 0.0]))
    return float(np.linalg.norm(_POINTS @ (turn - tilted.T @ turn).T + gap, axis=1).mean())


def _most_likely(
    joint: TargetJoint, poses: tuple[Floats, Floats], covariance: Floats, violation: Floats
) -> tuple[Floats, Floats]:
    """Most likely error [rad] of the joint's rotation, in its frame in the parent, and the covariance that remains."""
    rotation, constraint = rotation_slope(joint, poses), constraint_slope(joint, poses)
    gain = covariance @ constraint.T
    spread = constraint @ gain + _calibrated(joint, poses)
    if violation @ np.linalg.solve(spread, violation) > LIKELY[len(violation)]:
        spread = _with_play(spread, violation)
    gain = rotation @ np.linalg.solve(spread, gain.T).T
    return gain @ violation, rotation @ covariance @ rotation.T - gain @ constraint @ covariance @ rotation.T


def _calibrated(joint: TargetJoint, poses: tuple[Floats, Floats]) -> Floats:
    """Covariance of the gap, and of the tilts of a hinge, by the joint's calibration."""
    n = 5 if joint.kind == "hinge" else 3
    out = ((joint.axis_std**2).sum() + (EXACT / SIZE) ** 2) * np.eye(n)
    out[:3, :3] = EXACT**2 * np.eye(3)
    for pose, std in zip(poses, joint.std, strict=True):
        out[:3, :3] += (pose[:3, :3] * std**2) @ pose[:3, :3].T
    return np.asarray(out)


def _with_play(spread: Floats, violation: Floats) -> Floats:
    """Covariance of gap and tilt, with so much play added that they are likely."""
    scale = np.where(np.arange(len(violation)) < 3, 1.0, SIZE)
    values, axes = np.linalg.eigh(spread * scale[:, np.newaxis] * scale)
    squares, limit, play = (axes.T @ (scale * violation)) ** 2, LIKELY[len(violation)], 0.0
    for _ in range(_STEPS):  # Newton's method; it never overshoots, as the deviation falls ever slower with the play
        ratios = squares / (values + play)
        excess = ratios.sum() - limit
        if excess <= 1e-3 * limit:
            break
        play += excess / (ratios / (values + play)).sum()
    return spread + np.diag(play / scale**2)


@cache
def _kinematic(kind: str) -> Joint:
    """A joint as `skelgen.kinematics` knows it, in its own frame."""
    origin = np.zeros(3)
    return Joint(0, 1, origin, origin, kind, _Z if kind == "hinge" else None, origin)


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
        ends = np.cumsum([rotations.N_POSE, *(1 if joint.kind == HINGE else 3 for joint in joints)]).tolist()
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
        turns = [
            rotations.nearest_rotation(rotations.matrix_from_vector(vector_of_joint(joint, step[own])) @ turn)
            for joint, turn, own in zip(self.joints, state.turns, self.of_joint, strict=True)
        ]
        return replace(state, root=rotations.moved_pose(state.root, step[: rotations.N_POSE]), turns=tuple(turns))

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
        slope, place = np.zeros((rotations.N_POSE, self.n)), poses[name][:3, 3]
        slope[:, : rotations.N_POSE] = np.eye(rotations.N_POSE)
        slope[3:, :3] = -rotations.cross_matrix(place - poses[self.names[0]][:3, 3])
        for number in self.paths[name]:
            joint, own = self.joints[number], self.of_joint[number]
            frame = poses[joint.parent] @ joint.parent_from_joint
            axes = frame[:3, 2:3] if joint.kind == HINGE else frame[:3, :3]
            slope[:3, own], slope[3:, own] = axes, -rotations.cross_matrix(place - frame[:3, 3]) @ axes
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
    error = np.empty(rotations.N_POSE)
    write_pose_error(*contiguous(pose, found, error))
    return error


def turned_and_shifted(pose: Floats, step: Floats) -> Floats:
    """Return a pose after a small motion.

    Parameters
    ----------
    pose : ndarray, shape (4, 4), mm
        World from body.
    step : ndarray, shape (6,)
        Rotation about the world's axes [rad] and shift [mm].
    """
    moved = np.array(pose, order="C")
    move_pose(moved, *contiguous(step))
    return moved
