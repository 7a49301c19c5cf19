"""Chains frame by frame: steps, covariances, information and gradients are those of the whole normal matrix."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen._kernels.chain import markers_of, origins_of, turned_back, variances_across
from skelgen._kernels.information import add_frames
from skelgen._kernels.posing import solve_frames
from skelgen.evaluation.joints import true_chain
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.calibration.uncertainty import joint_slopes
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import ChainPoses, observed, residuals, seen_weights
from skelgen.kinematics.chain.normal_equations import (
    constant_gradient,
    frame_blocks,
    frame_information,
    normal_equations,
    reduced_information,
    total_information,
)
from skelgen.kinematics.inverse.poses import UNKNOWN_TURN, fit_poses, pose_covariances, weak_prior
from skelgen.kinematics.soft_tissue.model import rigid_displacements
from skelgen.simulation import simulate

NOISE = 0.5  # mm
N_FRAMES = 8
ABOUT = 0.2  # of the largest number, where rounding counts beside what little the markers tell
SAME = 1e-7  # of the largest number: the whole matrix is known no better after its inversion


@pytest.fixture(scope="module", params=["free", "held"])
def case(request):
    """A tree of balls, hinges, universal and one rigid joint, seen from not quite the true poses."""
    simulated = simulate("tree:30", n_frames=N_FRAMES, noise=NOISE, dropouts=0.2)
    chain, articulation, poses = true_chain(simulated.truth)
    types = ("ball", "rigid", *articulation.types[2:])
    articulation = replace(articulation, types=types).at_rest(chain.parents, poses.rotations)
    if request.param == "free":
        articulation = Articulation.free(chain.n_limbs)
    else:
        assert set(types) == {"ball", "hinge", "universal", "rigid"}
        poses = replace(poses, rotations=articulation.projected(chain.parents, poses.rotations))
    return chain, articulation, poses, simulated.take.positions


def normal_matrix(chain, articulation, poses, positions):
    """Whole normal matrix and slopes of the freedoms, and how the limbs' turns follow them."""
    hessian, gradient = normal_equations(chain, poses, positions, seen_weights(positions))
    turns, _ = articulation.bases(chain.parents, poses.rotations)
    return turns.swapaxes(1, 2) @ hessian @ turns, np.einsum("fdq,fd->fq", turns, gradient), turns


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


def test_poses_settle_where_no_marker_pulls_any_more(case):
    chain, articulation, poses, positions = case
    fitted = fit_poses(chain, poses, positions, articulation)
    assert (residuals(chain, fitted, positions) ** 2).sum() < (residuals(chain, poses, positions) ** 2).sum()
    _, before, _ = normal_matrix(*case)
    _, after, _ = normal_matrix(chain, articulation, fitted, positions)
    assert np.abs(after).max() < 0.01 * np.abs(before).max()


def test_joints_stay_what_they_are_when_poses_are_fitted(case):
    chain, articulation, poses, positions = case
    fitted = fit_poses(chain, poses, positions, articulation)
    projected = articulation.projected(chain.parents, fitted.rotations)
    np.testing.assert_allclose(projected, fitted.rotations, rtol=0, atol=1e-7)


@pytest.mark.parametrize(("noise", "n_markers", "same"), [(NOISE, 3, SAME), (0.01, 1, ABOUT)])
def test_covariances_are_those_of_the_inverse_normal_matrix(case, noise, n_markers, same):
    chain, articulation, poses, positions = case
    firsts = [np.flatnonzero(chain.limb_of_marker == limb)[:n_markers] for limb in range(chain.n_limbs)]
    seen = np.isin(np.arange(chain.n_markers), np.concatenate(firsts))
    positions = np.where(seen[:, np.newaxis], positions, np.nan)  # a limb that shows one marker may turn about it
    matrix, _, turns = normal_matrix(chain, articulation, poses, positions)
    inverse = noise**2 * np.linalg.inv(matrix + weak_prior(articulation, noise))
    found = pose_covariances(observed(chain, articulation, poses, positions), noise)
    places = (joint_slopes(chain, poses)[0] @ turns).reshape(N_FRAMES, chain.n_limbs, 3, -1)
    wanted = np.einsum("flip,fpq,fljq->flij", places, inverse, places)
    np.testing.assert_allclose(found.origins, wanted, rtol=0, atol=same * wanted.max())
    limbs, above = turns[:, 3:].reshape(N_FRAMES, chain.n_limbs, 3, -1), chain.parents[1:]
    relative = poses.rotations[:, above].swapaxes(2, 3) @ (limbs[:, 1:] - limbs[:, above])
    wanted = np.einsum("flip,fpq,fljq->flij", relative, inverse, relative)
    np.testing.assert_allclose(found.turns[:, 1:], wanted, rtol=0, atol=same * max(wanted.max(), UNKNOWN_TURN**2))


def test_covariances_stay_finite_in_exact_frames_that_show_nothing(case):
    chain, articulation, poses, positions = case
    found = pose_covariances(observed(chain, articulation, poses, np.full_like(positions, np.nan)), noise=0.0)
    assert np.isfinite(found.origins).all()
    assert np.isfinite(found.turns).all()


def test_information_is_that_of_the_whole_normal_matrix_without_the_poses(case):
    chain, articulation, poses, positions = case
    seen = observed(chain, articulation, poses, positions)
    found, wanted = total_information(seen), reduced_information(frame_blocks(seen))
    np.testing.assert_allclose(found, (wanted + wanted.T) / 2, rtol=0, atol=1e-9 * np.abs(wanted).max())
    np.testing.assert_array_equal(found, found.T)


def test_gradient_of_the_constants_is_the_slope_of_half_the_sum_of_squares(case):
    chain, articulation, poses, positions = case
    gradient = constant_gradient(observed(chain, articulation, poses, positions))
    random = np.random.default_rng(0)
    for _ in range(5):
        change = 1e-5 * random.normal(size=len(gradient))
        half = [half_squares(case, sign * change) for sign in (-1, 1)]
        assert half[0] - half[1] == pytest.approx(2 * change @ gradient, rel=1e-4)


def half_squares(case, change):
    """Half the sum of squares where constants are changed and poses stay."""
    chain, articulation, poses, positions = case
    n_offsets, n_places = 3 * chain.n_markers, 3 * (chain.n_markers + chain.n_limbs - 1)
    offsets = chain.offsets + change[:n_offsets].reshape(-1, 3)
    joints = chain.joints + np.concatenate([np.zeros((1, 3)), change[n_offsets:n_places].reshape(-1, 3)])
    _, rotations = articulation.tilted(chain.parents, poses.rotations, change[n_places:])
    return (residuals(chain.moved(joints, offsets), replace(poses, rotations=rotations), positions) ** 2).sum() / 2


def test_displacements_tell_of_each_frame_what_the_offsets_that_they_move_tell(case):
    chain, articulation, start, positions = case
    here = observed(chain, articulation, start, positions)
    rigid, full = rigid_displacements(chain), total_information(here)
    products, among = frame_information(here, rigid.basis, rigid.limbs)
    n_offsets, n_before = 3 * chain.n_markers, len(among)
    by_offsets = np.zeros((len(full), n_before + len(rigid.limbs)))
    by_offsets[n_offsets:, :n_before] = np.eye(n_before)
    by_offsets[:n_offsets, n_before:] = rigid.basis.reshape(n_offsets, -1)
    wanted = by_offsets.T @ full @ by_offsets
    same = 1e-6 * np.abs(wanted).max()
    np.testing.assert_allclose(among, wanted[:n_before, :n_before], atol=same)
    np.testing.assert_allclose(products.sum(axis=0), wanted[:, n_before:], atol=same)
    np.testing.assert_allclose(
        products[3], frame_information(here.at([3]), rigid.basis, rigid.limbs)[0][0], atol=same / len(products)
    )


def test_arrays_that_may_not_be_written_to_are_left_alone_and_compile_nothing_anew(case):
    chain, articulation, start, positions = case
    fit_poses(chain, start, positions, articulation)
    total_information(observed(chain, articulation, start, positions))
    kernels = [getattr(one, "compiled", one) for one in (solve_frames, add_frames)]
    before = [len(getattr(one, "signatures", ())) for one in kernels]
    frozen = [np.asfortranarray(one) for one in (start.root, start.rotations, positions)]
    for one in frozen:
        one.flags.writeable = False
    poses = ChainPoses(frozen[0], frozen[1])
    fit_poses(chain, poses, frozen[2], articulation)
    total_information(observed(chain, articulation, poses, frozen[2]))
    assert [len(getattr(one, "signatures", ())) for one in kernels] == before


@pytest.fixture
def limbs():
    """Origins of three limbs in a row, rotations, and two markers on each."""
    random = np.random.default_rng(9)
    rotations = matrix_from_vector(random.normal(size=(20, 3, 3)))
    parents, joints = np.array([-1, 0, 1]), random.normal(scale=300.0, size=(3, 3))
    root = random.normal(scale=500.0, size=(20, 3))
    return parents, joints, root, rotations, np.array([0, 0, 1, 1, 2, 2]), random.normal(scale=50.0, size=(6, 3))


def test_limbs_and_markers_are_where_forward_kinematics_puts_them(limbs):
    parents, joints, root, rotations, owner, offsets = limbs
    origins = origins_of(parents, joints, root, rotations)
    elbow = root + rotations[:, 0] @ joints[1]
    np.testing.assert_allclose(origins[:, 1], elbow, rtol=1e-12)
    np.testing.assert_allclose(origins[:, 2], elbow + rotations[:, 1] @ joints[2], rtol=1e-12)
    markers = markers_of(origins, rotations, owner, offsets)
    np.testing.assert_allclose(markers[:, 5], origins[:, 2] + rotations[:, 2] @ offsets[5], rtol=1e-12)


def test_vectors_turn_back_into_limbs(limbs):
    _, _, _, rotations, owner, offsets = limbs
    local = np.tile(offsets, (20, 1, 1))
    vectors = np.einsum("fmij,fmj->fmi", rotations[:, owner], local)
    np.testing.assert_allclose(turned_back(rotations, owner, vectors), local, atol=1e-12)


def test_variances_leave_out_what_lies_along_an_axis(limbs):
    parents, _, _, rotations, _, _ = limbs
    random = np.random.default_rng(13)
    roots = random.normal(size=(21, 3, 3, 3))
    covariances = roots @ roots.swapaxes(2, 3)
    axes = rotations[..., 0].copy()
    axes[:, 0] = 0.0
    found = variances_across(covariances[:-1], rotations, parents, covariances[-1], axes)
    turn = rotations[:, np.maximum(parents, 0)]
    total = covariances[:-1] + turn @ covariances[-1] @ turn.swapaxes(2, 3)
    across = np.eye(3) - axes[..., np.newaxis] * axes[..., np.newaxis, :]
    wanted = np.diagonal(across @ total @ across.swapaxes(2, 3), axis1=2, axis2=3)
    np.testing.assert_allclose(found, wanted, atol=1e-12)
