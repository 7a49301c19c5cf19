"""Elimination limb by limb: the same steps and covariances as the whole normal matrix gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.evaluation.bound import true_chain
from skelgen.geometry.frames_last import inverse_of_symmetric, orthonormal, rotation_by
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.calibration.uncertainty import joint_slopes, weak_prior
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import residuals, seen_weights
from skelgen.kinematics.chain.elimination import Tree, eliminate, frames_last
from skelgen.kinematics.chain.normal_equations import constant_gradient, normal_equations
from skelgen.kinematics.inverse.poses import UNKNOWN_TURN, fit_poses, pose_covariances
from skelgen.simulation import simulate

NOISE = 0.5  # mm
SAME = 1e-7  # of the largest number: the whole matrix is known no better after its inversion


@pytest.fixture(scope="module", params=["free", "held"])
def case(request):
    """A tree of balls, hinges, universal and one rigid joint in 8 frames, seen from not quite the true poses."""
    simulated = simulate("tree:30", n_frames=8, noise=NOISE, dropouts=0.2)
    chain, articulation, poses = true_chain(simulated.truth)
    kinds = ("ball", "rigid", *articulation.kinds[2:])
    articulation = replace(articulation, kinds=kinds).at_rest(chain.parents, poses.rotations)
    if request.param == "free":
        articulation = Articulation.free(chain.n_limbs)
    else:
        assert set(kinds) == {"ball", "hinge", "universal", "rigid"}
        poses = replace(poses, rotations=articulation.projected(chain.parents, poses.rotations))
    return chain, articulation, poses, simulated.take.positions


def normal_matrix(chain, articulation, poses, positions):
    """Whole normal matrix and slopes of the freedoms, and how the limbs' turns follow them."""
    hessian, gradient = normal_equations(chain, chain.arms(), poses, positions)
    turns, _ = articulation.bases(chain.parents, poses.rotations)
    return turns.swapaxes(1, 2) @ hessian @ turns, np.einsum("fdq,fd->fq", turns, gradient), turns


def test_root_moves_as_the_whole_normal_matrix_says(case):
    chain, articulation, poses, positions = case
    tree, level = Tree(chain, articulation, positions, seen_weights(positions)), 1e-3
    view = tree.view(*frames_last(poses))
    solved = eliminate(tree, view, tree.forms(view), np.full(8, level), np.full(8, level))
    matrix, slopes, _ = normal_matrix(*case)
    wanted = np.linalg.solve(matrix + level * np.eye(len(matrix[0])), slopes[..., np.newaxis])[:, :3, 0]
    np.testing.assert_allclose(solved.root_shift.T, wanted, rtol=SAME, atol=SAME)


def test_one_step_of_the_fit_is_that_of_the_whole_normal_matrix(case):
    chain, articulation, poses, positions = case
    matrix, slopes, turns = normal_matrix(*case)
    step = np.linalg.solve(matrix + 1e-6 * np.eye(len(matrix[0])), slopes[..., np.newaxis])
    wanted = poses.stepped((turns @ step)[..., 0])
    fitted = fit_poses(chain, poses, positions, articulation, max_steps=1)
    moved = np.abs(wanted.rotations - poses.rotations).max()
    assert moved > 1e-3
    assert np.abs(fitted.rotations - wanted.rotations).max() < 0.02 * moved  # turns of that size do not commute
    np.testing.assert_allclose(fitted.root, wanted.root, atol=1e-3)


def test_joints_stay_what_they_are_when_poses_are_fitted(case):
    chain, articulation, poses, positions = case
    fitted = fit_poses(chain, poses, positions, articulation)
    assert (residuals(chain, fitted, positions) ** 2).sum() < (residuals(chain, poses, positions) ** 2).sum()
    np.testing.assert_allclose(
        articulation.projected(chain.parents, fitted.rotations), fitted.rotations, rtol=0, atol=1e-7
    )


def test_covariances_are_those_of_the_inverse_normal_matrix(case):
    chain, articulation, poses, positions = case
    matrix, _, turns = normal_matrix(*case)
    inverse = NOISE**2 * np.linalg.inv(matrix + weak_prior(articulation, NOISE))
    found = pose_covariances(chain, articulation, poses, positions, NOISE)
    places = (joint_slopes(chain, poses)[0] @ turns).reshape(8, chain.n_limbs, 3, -1)
    wanted = np.einsum("flip,fpq,fljq->flij", places, inverse, places)
    np.testing.assert_allclose(found.origins, wanted, rtol=0, atol=SAME * wanted.max())
    limbs, above = turns[:, 3:].reshape(8, chain.n_limbs, 3, -1), chain.parents[1:]
    relative = poses.rotations[:, above].swapaxes(2, 3) @ (limbs[:, 1:] - limbs[:, above])
    wanted = np.einsum("flip,fpq,fljq->flij", relative, inverse, relative)
    np.testing.assert_allclose(found.turns[:, 1:], wanted, rtol=0, atol=SAME * max(wanted.max(), UNKNOWN_TURN**2))


def test_covariances_stay_finite_in_exact_frames_that_show_nothing(case):
    chain, articulation, poses, positions = case
    found = pose_covariances(chain, articulation, poses, np.full_like(positions, np.nan), noise=0.0)
    assert np.isfinite(found.origins).all()
    assert np.isfinite(found.turns).all()


def test_pull_of_the_constants_is_the_slope_of_half_the_sum_of_squares(case):
    chain, articulation, poses, positions = case
    weights = seen_weights(positions)
    pull = constant_gradient(chain, articulation, poses, positions, weights)
    random = np.random.default_rng(0)
    for _ in range(5):
        change = 1e-5 * random.normal(size=len(pull))
        half = [half_squares(case, sign * change) for sign in (-1, 1)]
        assert half[0] - half[1] == pytest.approx(2 * change @ pull, rel=1e-4)


def half_squares(case, change):
    """Half the sum of squares where constants are changed and poses stay."""
    chain, articulation, poses, positions = case
    n_offsets, n_places = 3 * chain.n_markers, 3 * (chain.n_markers + chain.n_limbs - 1)
    offsets = chain.offsets + change[:n_offsets].reshape(-1, 3)
    joints = chain.joints + np.concatenate([np.zeros((1, 3)), change[n_offsets:n_places].reshape(-1, 3)])
    _, rotations = articulation.tilted(chain.parents, poses.rotations, change[n_places:])
    return (residuals(chain.moved(joints, offsets), replace(poses, rotations=rotations), positions) ** 2).sum() / 2


def test_inverse_of_small_matrices_is_that_of_numpy():
    random = np.random.default_rng(0)
    root = random.normal(size=(20, 3, 3))
    matrix = root @ root.swapaxes(1, 2)
    level = random.uniform(0.1, 1, 20)
    wanted = np.linalg.inv(matrix + level[:, np.newaxis, np.newaxis] * np.eye(3))
    found = inverse_of_symmetric(np.moveaxis(matrix, 0, -1), level)
    np.testing.assert_allclose(np.moveaxis(found, -1, 0), wanted, rtol=1e-9, atol=1e-12)


def test_turns_by_small_vectors_are_those_of_rodrigues():
    vectors = np.random.default_rng(0).normal(size=(20, 3)) * 1e-3
    found = np.moveaxis(rotation_by(vectors.T), -1, 0)
    np.testing.assert_allclose(found, matrix_from_vector(vectors), atol=1e-8)


def test_large_turns_are_proper_rotations_about_their_vectors():
    vectors = np.random.default_rng(0).normal(size=(20, 3)) * 3
    found = np.moveaxis(rotation_by(vectors.T), -1, 0)
    np.testing.assert_allclose(found @ found.swapaxes(1, 2), np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.einsum("fij,fj->fi", found, vectors), vectors, atol=1e-12)
    assert (np.linalg.det(found) > 0).all()


def test_rotations_that_drifted_are_made_proper():
    exact = np.moveaxis(matrix_from_vector(np.random.default_rng(0).normal(size=(20, 3))), 0, -1)[np.newaxis]
    drifted = exact + 1e-7
    square = np.einsum("ljif,ljkf->fik", orthonormal(drifted), orthonormal(drifted))
    np.testing.assert_allclose(square, np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
