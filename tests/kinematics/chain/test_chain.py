"""The whole chain: gradients that are slopes, poses that come back to the truth."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.kinematics.chain.chain import ChainPoses, residuals, seen_weights
from skelgen.kinematics.chain.normal_equations import normal_equations
from skelgen.kinematics.inverse.poses import fit_poses

STEP = 1e-6
EXACT = 1e-6  # mm


def disturbed(poses, size, seed=0):
    """Poses moved by some `size` rad and 100 `size` mm."""
    random = np.random.default_rng(seed)
    step = random.normal(size=(len(poses.root), 3 + 3 * poses.rotations.shape[1])) * size
    step[:, :3] *= 100
    return poses.stepped(step)


def central_differences(function, n):
    unit = np.eye(n) * STEP
    return np.stack([(function(unit[i]) - function(-unit[i])) / (2 * STEP) for i in range(n)], axis=-1)


@pytest.fixture(scope="module")
def case(true_chain):
    return true_chain("tree:8", n_frames=6, noise=2.0, dropouts=0.2)


def test_chain_of_the_truth_puts_markers_where_they_are(true_chain):
    case = true_chain("human", n_frames=20)
    np.testing.assert_allclose(case.poses.markers(case.chain), case.truth.marker_positions, atol=EXACT)


def test_gradient_is_the_slope_of_half_the_sum_of_squares(case):
    poses, n = disturbed(case.poses, 0.1), 3 + 3 * case.chain.n_limbs
    _, gradient = normal_equations(case.chain, poses, case.positions, seen_weights(case.positions))

    def half_squares(step):
        moved = poses.stepped(np.tile(step, (6, 1)))
        return (residuals(case.chain, moved, case.positions) ** 2).sum(axis=(1, 2)) / 2

    np.testing.assert_allclose(-gradient, central_differences(half_squares, n), rtol=1e-4, atol=0.05)


def test_normal_matrix_is_that_of_the_numerical_jacobian(case):
    poses, n = disturbed(case.poses, 0.1), 3 + 3 * case.chain.n_limbs
    hessian, _ = normal_equations(case.chain, poses, case.positions, seen_weights(case.positions))

    def errors(step):
        return residuals(case.chain, poses.stepped(np.tile(step, (6, 1))), case.positions).reshape(6, -1)

    jacobian = central_differences(errors, n)
    np.testing.assert_allclose(hessian, jacobian.swapaxes(1, 2) @ jacobian, rtol=1e-4, atol=0.5)


@pytest.mark.parametrize("name", ["rods", "human", "classic-human"])
def test_poses_of_exact_markers_come_back_to_the_truth(true_chain, name):
    case = true_chain(name, n_frames=40)
    fitted = fit_poses(case.chain, disturbed(case.poses, 0.2), case.positions)
    np.testing.assert_allclose(fitted.markers(case.chain), case.truth.marker_positions, atol=1e-4)
    np.testing.assert_allclose(fitted.origins(case.chain), case.poses.origins(case.chain), atol=1e-3)


def test_more_frames_than_are_solved_together_are_all_fitted(true_chain):
    case = true_chain("rods", n_frames=1100)
    fitted = fit_poses(case.chain, disturbed(case.poses, 0.1), case.positions)
    np.testing.assert_allclose(fitted.markers(case.chain), case.truth.marker_positions, atol=1e-4)


def test_every_frame_ends_in_a_minimum_however_far_off_it_starts(true_chain):
    case = true_chain("tree:12", n_frames=60, noise=1.0, dropouts=0.4)
    fitted = fit_poses(case.chain, disturbed(case.poses, 1.0), case.positions)
    again = fit_poses(case.chain, fitted, case.positions)
    squares = [(residuals(case.chain, one, case.positions) ** 2).sum(axis=(1, 2)) for one in (fitted, again)]
    np.testing.assert_allclose(*squares, rtol=1e-3)


def test_fitted_poses_are_better_than_any_near_them(true_chain):
    case = true_chain("rods", n_frames=30, noise=1.0, dropouts=0.1)
    fitted = fit_poses(case.chain, case.poses, case.positions)
    best = (residuals(case.chain, fitted, case.positions) ** 2).sum(axis=(1, 2))
    for seed in range(5):
        near = disturbed(fitted, 1e-3, seed)
        assert (best <= (residuals(case.chain, near, case.positions) ** 2).sum(axis=(1, 2)) + EXACT).all()


def test_rotations_that_are_fitted_are_proper(true_chain):
    case = true_chain("human", n_frames=20, noise=5.0, dropouts=0.3)
    turns = fit_poses(case.chain, disturbed(case.poses, 0.3), case.positions).rotations
    np.testing.assert_allclose(turns @ turns.swapaxes(2, 3), np.broadcast_to(np.eye(3), turns.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-12)


def test_frame_without_markers_stays_where_it_starts(true_chain):
    case = true_chain("rods", n_frames=10)
    positions = case.positions.copy()
    positions[4] = np.nan
    start = disturbed(case.poses, 0.1)
    fitted = fit_poses(case.chain, start, positions)
    np.testing.assert_allclose(fitted.root[4], start.root[4], atol=1e-9)
    np.testing.assert_allclose(fitted.rotations[4], start.rotations[4], atol=1e-9)


def test_limb_without_markers_keeps_its_rotation(true_chain):
    case = true_chain("rods", n_frames=10)
    positions = case.positions.copy()
    positions[:, case.chain.limb_of_marker == 2] = np.nan
    start = disturbed(case.poses, 0.05)
    fitted = fit_poses(case.chain, start, positions)
    np.testing.assert_allclose(fitted.rotations[:, 2], start.rotations[:, 2], atol=1e-9)
    np.testing.assert_allclose(fitted.rotations[:, :2], case.poses.rotations[:, :2], atol=1e-6)


def test_start_is_left_alone(true_chain):
    case = true_chain("rods", n_frames=10)
    start = disturbed(case.poses, 0.1)
    copy = ChainPoses(start.root.copy(), start.rotations.copy())
    fit_poses(case.chain, start, case.positions)
    np.testing.assert_array_equal(start.root, copy.root)
    np.testing.assert_array_equal(start.rotations, copy.rotations)


def test_arms_reach_from_the_root_to_the_markers(true_chain):
    chain = true_chain("human", n_frames=1).chain
    still = ChainPoses(np.zeros((1, 3)), np.tile(np.eye(3), (1, chain.n_limbs, 1, 1)))
    np.testing.assert_allclose(chain.arms().sum(axis=1), still.markers(chain)[0], atol=EXACT)


def test_ancestry_holds_every_limb_on_the_way_to_the_root(true_chain):
    chain = true_chain("human", n_frames=1).chain
    for limb in range(chain.n_limbs):
        way, beyond = [], limb
        while beyond >= 0:
            way.append(beyond)
            beyond = int(chain.parents[beyond])
        assert np.flatnonzero(chain.ancestry()[:, limb]).tolist() == sorted(way)
