"""Models of a joint: whitening, slopes, elimination and descent, against their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen._kernels.joint_models import alternated, linearised, relative_vectors
from skelgen._kernels.least_squares import eliminate, whitened
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.chain.schur_complement import LinearisedProblem, gauss_newton
from skelgen.kinematics.joints.rotations import ConstrainedRotation

N_FRAMES = 25
FIRST, SECOND = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])


@pytest.fixture
def turns():
    """Rotations about two axes, some by nearly half a turn, with some noise."""
    random = np.random.default_rng(5)
    first, second = random.uniform(-3.1, 3.1, size=(2, N_FRAMES, 1))
    noise = matrix_from_vector(random.normal(scale=0.01, size=(N_FRAMES, 3)))
    return matrix_from_vector(first * FIRST) @ matrix_from_vector(second * SECOND) @ noise


@pytest.fixture
def weights():
    roots = np.random.default_rng(6).normal(size=(N_FRAMES, 3, 5))
    return whitened(roots @ roots.swapaxes(1, 2))


def parts(n_angles):
    """Frames in both limbs, angle between the axes, and angles of a joint."""
    random = np.random.default_rng(n_angles)
    in_parent, in_child = matrix_from_vector(random.normal(size=(2, 3)))
    angles = random.normal(size=(N_FRAMES, n_angles))
    return in_parent, np.eye(3) if n_angles == 0 else in_child, 1.2 if n_angles == 2 else 0.0, angles


def rotations_of(in_parent, in_child, between, angles):
    """R = C_p Rz(a) Rx(b) Rz(c) C_c^T, with as many angles as there are."""
    result = np.tile(in_parent, (N_FRAMES, 1, 1))
    if angles.shape[1] > 0:
        result = result @ matrix_from_vector(angles[:, :1] * [0.0, 0.0, 1.0])
    if angles.shape[1] == 2:
        result = result @ matrix_from_vector(np.array([between, 0.0, 0.0]))
        result = result @ matrix_from_vector(angles[:, 1:] * [0.0, 0.0, 1.0])
    return result @ in_child.T


def tilted(frame, about_x, about_y):
    return frame @ matrix_from_vector(np.array([about_x, about_y, 0.0]))


def moved(joint, constants, own):
    """The joint after small changes of its constants and angles."""
    in_parent, in_child, between, angles = joint
    if angles.shape[1] == 0:
        return matrix_from_vector(constants) @ in_parent, in_child, between, angles
    last = constants[4] if angles.shape[1] == 2 else 0.0
    return tilted(in_parent, *constants[:2]), tilted(in_child, *constants[2:4]), between + last, angles + own


@pytest.mark.parametrize("size", [3, 6])
def test_whitened_covariances_are_one(size):
    roots = np.random.default_rng(7).normal(size=(10, size, 2 * size))
    covariances = roots @ roots.swapaxes(1, 2)
    found = whitened(covariances)
    np.testing.assert_allclose(found @ covariances @ found.swapaxes(1, 2), np.tile(np.eye(size), (10, 1, 1)), atol=1e-9)


def test_vectors_between_rotations_are_scipys(turns):
    before = turns[:5]
    wanted = Rotation.from_matrix(np.tile(before.swapaxes(1, 2), (5, 1, 1)) @ turns).as_rotvec()
    np.testing.assert_allclose(relative_vectors(before, turns), wanted, atol=1e-9)


@pytest.mark.parametrize("n_angles", [0, 1, 2])
def test_residuals_are_whitened_vectors_from_the_model_to_what_is_measured(turns, weights, n_angles):
    joint = parts(n_angles)
    residuals, _, _ = linearised(joint, turns, weights)
    between = Rotation.from_matrix(turns @ rotations_of(*joint).swapaxes(1, 2)).as_rotvec()
    np.testing.assert_allclose(residuals, np.einsum("fij,fj->fi", weights, between), atol=1e-9)


@pytest.mark.parametrize("n_angles", [0, 1, 2])
def test_slopes_are_how_the_model_turns_with_its_unknowns(turns, n_angles):
    joint, step, one = parts(n_angles), 1e-6, np.tile(np.eye(3), (N_FRAMES, 1, 1))
    _, constants, own = linearised(joint, turns, one)
    here = rotations_of(*joint)
    unknowns = [*np.eye(3 + n_angles), *np.eye(n_angles)]
    for index, unit in enumerate(unknowns):
        is_own = index >= 3 + n_angles
        change = moved(joint, np.zeros(3 + n_angles), step * unit) if is_own else moved(joint, step * unit, 0.0)
        turned = Rotation.from_matrix(rotations_of(*change) @ here.swapaxes(1, 2)).as_rotvec() / step
        slopes = own[:, :, index - 3 - n_angles] if is_own else constants[:, :, index]
        np.testing.assert_allclose(slopes, turned, atol=1e-5)


@pytest.mark.parametrize("n_angles", [1, 2])
def test_what_is_left_after_elimination_is_what_no_unknown_of_a_frame_explains(n_angles):
    random = np.random.default_rng(3)
    residuals, constants = random.normal(size=(6, 3)), random.normal(size=(6, 3, 5))
    own = random.normal(size=(6, 3, n_angles))
    inverse, follow, alone, reduced, left, normal, gradient = eliminate(residuals, constants, own)
    for frame in range(6):
        pseudo = np.linalg.pinv(own[frame])
        np.testing.assert_allclose(inverse[frame], np.linalg.inv(own[frame].T @ own[frame]), rtol=1e-8)
        np.testing.assert_allclose(follow[frame], pseudo @ constants[frame], atol=1e-9)
        np.testing.assert_allclose(alone[frame], pseudo @ residuals[frame], atol=1e-9)
        np.testing.assert_allclose(reduced[frame], constants[frame] - own[frame] @ pseudo @ constants[frame], atol=1e-9)
        np.testing.assert_allclose(left[frame], residuals[frame] - own[frame] @ pseudo @ residuals[frame], atol=1e-9)
    np.testing.assert_allclose(normal, np.einsum("frc,frd->cd", reduced, reduced), atol=1e-12)
    np.testing.assert_allclose(gradient, np.einsum("frc,fr->c", reduced, left), atol=1e-12)


@pytest.mark.parametrize("n_angles", [0, 1, 2])
def test_a_joint_descends_to_the_one_that_made_the_rotations(weights, n_angles):
    truth = parts(n_angles)
    measured = rotations_of(*truth)
    constants = 0.1 * np.random.default_rng(1).normal(size=3 + n_angles)
    start = moved(truth, constants, 0.1)
    joint = ConstrainedRotation(*start)
    found = gauss_newton(
        joint,
        lambda joint: LinearisedProblem(
            *linearised(held(joint.in_parent, joint.in_child, joint.between, joint.angles), measured, weights)
        ),
        lambda joint, constants, angles: joint.stepped(constants, angles),
        least_gain=1e-12,
    )
    np.testing.assert_allclose(found.state.rotations(), measured, atol=1e-6)


def held(*parts):
    return tuple(np.ascontiguousarray(one) if isinstance(one, np.ndarray) else float(one) for one in parts)


def test_axes_that_alternate_keep_their_angle_best(turns):
    mean = turns.mean(axis=0)
    flat = (turns - mean).reshape(N_FRAMES, 9)
    axes, variances = alternated(flat.T @ flat / N_FRAMES, mean.ravel(), np.eye(3), 4)
    best = int(np.argmin(variances))
    assert abs(axes[best] @ SECOND) > 0.999
    assert variances[best] < 1e-3
