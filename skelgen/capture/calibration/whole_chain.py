r"""All joints of a kinematic chain together, by maximum likelihood (Gaschler 2011, 5.3).

The error of a body between two joints affects both joints, so that all joints are fitted together. The poses of all
frames follow from the root's pose, the angles, and the constants of the joints, :math:`S_c = S_p\,P\,A\,C^{-1}`. These
unknowns minimise the distance of measured and modelled poses, weighted with the covariance of every pose. A pose with
its covariance holds all information of its balls, so that this equals Gaschler's sum over balls with their covariances.
Derivatives are differences; the unknowns of the frames are eliminated one frame after the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import N_POSE, matrix_from_vector, moved_pose, transform_from, vector_from_matrix
from skelgen.kinematics.chain.schur_complement import LinearisedProblem, Minimum, gauss_newton
from skelgen.kinematics.joints.closed_form import hinge_angles
from skelgen.model.arrays import Floats
from skelgen.model.rig import TargetJoint

MAX_STEPS = 15
LEAST_GAIN = 1e-12
"""Part of the sum of squares below which steps change nothing that anyone could measure."""

SLOPE_STEP = 1e-4
"""mm and rad; for differences: errors of the second order stay below 1e-7 of a slope."""

N_CONSTANTS = {"ball": 6, "hinge": 9}
"""A ball's place in both bodies; a hinge's place across its axis in the parent, its place in the child, and two tilts
in each."""
N_ANGLES = {"ball": 3, "hinge": 1}


@dataclass(frozen=True, eq=False)
class WholeChain:
    """Joints that were fitted together.

    Attributes
    ----------
    joints : tuple of TargetJoint
        With their standard deviations.
    noise : float
        Root mean square residual in stated standard deviations, freedoms taken off.
    """

    joints: tuple[TargetJoint, ...]
    noise: float


@dataclass(frozen=True, eq=False)
class _State:
    """Root poses and turns of all frames, shapes (n, 4, 4) and one (n, 3, 3) per joint, and the joints' frames."""

    roots: Floats
    turns: tuple[Floats, ...]
    parents: tuple[Floats, ...]
    children: tuple[Floats, ...]


def fit_whole_chain(
    joints: Sequence[TargetJoint], poses: dict[str, Floats], covariances: dict[str, Floats]
) -> WholeChain:
    """Fit all joints of one tree together.

    Parameters
    ----------
    joints : sequence of TargetJoint
        First guesses, each one's parent before it: the first joint's parent is the root.
    poses : dict of str to ndarray, shape (n_frames, 4, 4)
        World from body of every body, known in all frames.
    covariances : dict of str to ndarray, shape (n_frames, 6, 6)
        Of small rotations about the world's axes [rad] and shifts [mm].
    """
    fit = _Fit(joints, poses, covariances)
    return fit.result(gauss_newton(fit.start(), fit.linearised, fit.moved, MAX_STEPS, LEAST_GAIN))


class _Fit:
    """What is fitted to, and the steps towards it."""

    def __init__(self, joints: Sequence[TargetJoint], poses: dict[str, Floats], covariances: dict[str, Floats]) -> None:
        self.joints, self.poses, self.root = tuple(joints), poses, joints[0].parent
        self.n_frames = len(poses[self.root])
        self.whiten = {name: np.linalg.inv(np.linalg.cholesky(covariance)) for name, covariance in covariances.items()}
        self.n_local = N_POSE + sum(N_ANGLES[joint.kind] for joint in joints)
        self.n_constants = sum(N_CONSTANTS[joint.kind] for joint in joints)

    def start(self) -> _State:
        turns = []
        for joint in self.joints:
            parent, child = self.poses[joint.parent][:, :3, :3], self.poses[joint.child][:, :3, :3]
            between = joint.parent_from_joint[:3, :3].T @ parent.swapaxes(1, 2) @ child @ joint.child_from_joint[:3, :3]
            if joint.kind == "hinge":
                angles = hinge_angles(between, np.eye(3), np.eye(3))
                between = matrix_from_vector(angles[:, np.newaxis] * [0.0, 0.0, 1.0])
            turns.append(between)
        parents = tuple(np.array(joint.parent_from_joint) for joint in self.joints)
        children = tuple(np.array(joint.child_from_joint) for joint in self.joints)
        return _State(np.array(self.poses[self.root]), tuple(turns), parents, children)

    def moved(self, state: _State, constant: Floats, local: Floats) -> _State:
        """The state after a step of the constants, and of the frames, one row each."""
        roots = moved_pose(state.roots, local[:, :N_POSE])
        turns, parents, children, at, of = [], [], [], N_POSE, 0
        for number, joint in enumerate(self.joints):
            own = local[:, at : at + N_ANGLES[joint.kind]]
            vector = own if joint.kind == "ball" else own * [0.0, 0.0, 1.0]
            turns.append(matrix_from_vector(vector) @ state.turns[number])
            change = constant[of : of + N_CONSTANTS[joint.kind]]
            in_parent, in_child = _changes(joint.kind, change)
            parents.append(state.parents[number] @ in_parent)
            children.append(state.children[number] @ in_child)
            at, of = at + N_ANGLES[joint.kind], of + N_CONSTANTS[joint.kind]
        return _State(roots, tuple(turns), tuple(parents), tuple(children))

    def residuals(self, state: _State) -> Floats:
        """Whitened distances of measured and modelled poses, shape (n_frames, 6 n_bodies)."""
        modelled = {self.root: state.roots}
        for number, joint in enumerate(self.joints):
            turned = transform_from(state.turns[number], np.zeros((self.n_frames, 3)))
            back = np.linalg.inv(state.children[number])
            modelled[joint.child] = modelled[joint.parent] @ state.parents[number] @ turned @ back
        errors = []
        for name, pose in modelled.items():
            measured = self.poses[name]
            turn = vector_from_matrix(measured[:, :3, :3] @ pose[:, :3, :3].swapaxes(1, 2))
            error = np.concatenate([turn, measured[:, :3, 3] - pose[:, :3, 3]], axis=1)
            errors.append(np.einsum("fij,fj->fi", self.whiten[name], error))
        return np.concatenate(errors, axis=1)

    def linearised(self, state: _State) -> LinearisedProblem:
        """Residuals, and how the model follows the constants and the unknowns of the frames, by central differences."""
        nothing, still = np.zeros((self.n_frames, self.n_local)), np.zeros(self.n_constants)
        of_frames, of_constants = [], []
        for column in range(self.n_local):
            step = nothing.copy()
            step[:, column] = SLOPE_STEP
            of_frames.append(self._difference(self.moved(state, still, step), self.moved(state, still, -step)))
        for column in range(self.n_constants):
            change = still.copy()
            change[column] = SLOPE_STEP
            of_constants.append(
                self._difference(self.moved(state, change, nothing), self.moved(state, -change, nothing))
            )
        return LinearisedProblem(self.residuals(state), np.stack(of_constants, axis=2), np.stack(of_frames, axis=2))

    def _difference(self, ahead: _State, behind: _State) -> Floats:
        return (self.residuals(behind) - self.residuals(ahead)) / (2 * SLOPE_STEP)

    def result(self, found: Minimum[_State]) -> WholeChain:
        """The joints with their deviations."""
        state, solution = found.state, found.solution
        freedoms = solution.residuals.size - self.n_frames * self.n_local - self.n_constants
        noise = float(np.sqrt(found.squares / max(freedoms, 1)))
        covariance = max(noise, 1.0) ** 2 * solution.covariance
        joints, of = [], 0
        for number, joint in enumerate(self.joints):
            own = slice(of, of + N_CONSTANTS[joint.kind])
            parent, child = state.parents[number], state.children[number]
            std, axis_std = _deviations(joint.kind, covariance[own, own], parent, child)
            joints.append(replace(joint, parent_from_joint=parent, child_from_joint=child, std=std, axis_std=axis_std))
            of = own.stop
        return WholeChain(tuple(joints), noise)


def _changes(kind: str, change: Floats) -> tuple[Floats, Floats]:
    """Small motions of a joint's frame in parent and child, in the joint's own axes."""
    if kind == "ball":
        return transform_from(np.eye(3), change[:3]), transform_from(np.eye(3), change[3:])
    tilts = [matrix_from_vector(np.array([*change[at : at + 2], 0.0])) for at in (5, 7)]
    return transform_from(tilts[0], np.array([*change[:2], 0.0])), transform_from(tilts[1], change[2:5])


def _deviations(kind: str, covariance: Floats, parent: Floats, child: Floats) -> tuple[Floats, Floats]:
    """Standard deviations of the places in both bodies, shape (2, 3), and of tilts of the axis, shape (2,)."""
    if kind == "ball":
        places, tilts = (covariance[:3, :3], covariance[3:, 3:]), np.zeros(2)
    else:
        across = np.zeros((3, 3))
        across[:2, :2] = covariance[:2, :2]
        places = across, covariance[2:5, 2:5]
        tilts = np.sqrt([np.trace(covariance[at : at + 2, at : at + 2]) / 2 for at in (5, 7)])
    turned = [frame[:3, :3] @ place @ frame[:3, :3].T for frame, place in zip((parent, child), places, strict=True)]
    return np.sqrt(np.maximum([np.diag(place) for place in turned], 0.0)), tilts
