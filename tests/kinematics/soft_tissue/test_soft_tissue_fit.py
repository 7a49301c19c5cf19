"""Slides of soft tissue, estimated with the chain."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.evaluation.joints import joint_distances
from skelgen.kinematics.calibration.calibrate import calibrate
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import observed
from skelgen.kinematics.chain.normal_equations import frame_blocks, reduced_information
from skelgen.kinematics.soft_tissue.cluster_deformation import ClusterDeformation, ObservedDeformations
from skelgen.kinematics.soft_tissue.fit import calibrate_soft_tissue, fit_soft_tissue
from skelgen.kinematics.soft_tissue.model import soft_tissue_at_rest, soft_tissue_equations

TISSUE = 3.0  # mm, per coordinate; half of its variance follows the flexions
N_FRAMES = 600
SEEDS = (0, 1, 2)


@pytest.fixture(scope="module")
def tissue(true_chain):
    """Trees of 8 limbs with 3 mm of soft tissue, and their chains fitted to markers that do not slide."""
    cases = [true_chain("tree:8", seed, n_frames=N_FRAMES, noise=0.3, soft_tissue=TISSUE) for seed in SEEDS]
    return [(case, calibrate(case.chain, case.poses, case.positions)) for case in cases]


def joint_errors(case, last):
    found = last.poses.origins(last.chain)[:, case.truth.edges[:, 1]]
    return joint_distances(found, np.arange(case.truth.n_joints), case.truth)


def test_size_of_the_displacements_is_that_of_the_tissue_that_follows_flexions(tissue):
    """The variance of a limb that follows a joint, shared by the flexions of that joint."""
    sums = [fit_soft_tissue(last).variances[1:].sum(axis=1) for _, last in tissue]
    np.testing.assert_allclose(np.sqrt(np.median(np.concatenate(sums))), TISSUE / np.sqrt(2), rtol=0.25)


def test_limbs_follow_the_joint_that_they_are_simulated_to_follow(tissue):
    """That above them: what is told of other joints is small."""
    for case, last in tissue:
        found = fit_soft_tissue(last)
        own = found.tissue.joints == np.arange(case.chain.n_limbs)[:, np.newaxis]
        assert found.variances[~own].sum() < 0.2 * found.variances[own].sum()


def test_joints_are_nearer_to_the_truth_without_the_displacements(tissue):
    before, after = [], []
    for case, last in tissue:
        settled = calibrate_soft_tissue(fit_soft_tissue(last), last.poses, case.positions).calibration
        before.append(joint_errors(case, last).mean())
        after.append(joint_errors(case, settled).mean())
    assert np.mean(after) < 0.9 * np.mean(before)  # six seconds, joints of all types free


def test_few_frames_show_no_soft_tissue(tissue):
    case, _ = tissue[0]
    few = np.arange(0, N_FRAMES, N_FRAMES // 10)
    assert fit_soft_tissue(calibrate(case.chain, case.poses[few], case.positions[few])) is None


def test_information_of_joints_is_less_where_markers_may_slide(tissue):
    case, last = tissue[0]
    settled = calibrate_soft_tissue(fit_soft_tissue(last), last.poses, case.positions).calibration
    joints = slice(3 * case.chain.n_markers, None)
    lost = last.information[joints, joints] - settled.information[joints, joints]
    assert np.trace(lost) > 0.2 * np.trace(last.information[joints, joints])
    assert np.linalg.eigvalsh(settled.information)[0] > -1e-6 * np.abs(settled.information).max()


@pytest.mark.parametrize("seed", range(5))
def test_white_noise_shows_no_displacements(true_chain, seed):
    case = true_chain("tree:8", seed, n_frames=200, noise=1.0)
    assert fit_soft_tissue(calibrate(case.chain, case.poses, case.positions)) is None


def test_exact_markers_show_no_displacements(true_chain):
    case = true_chain("rods", n_frames=60)
    assert fit_soft_tissue(calibrate(case.chain, case.poses, case.positions)) is None


def test_a_joint_that_never_turned_tells_nothing(true_chain):
    case = true_chain("rods", n_frames=20)
    tissue = soft_tissue_at_rest(case.chain, case.poses)
    flexions = np.arange(len(tissue.joints))
    squares, moments = np.zeros((3, len(flexions), len(flexions))), np.ones((9, len(flexions)))
    still = ClusterDeformation(np.arange(3), flexions, squares, moments, np.eye(9)[6:])
    with np.errstate(all="raise"):
        assert not ObservedDeformations((still,), 1.0).likely_variances(tissue).any()


def test_tissue_that_only_wanders_shows_no_displacements_to_speak_of(true_chain):
    """Smooth curves without any bend in them: what is found of displacements is chance."""
    case = true_chain("tree:8", n_frames=N_FRAMES, noise=0.3)
    times, random = np.arange(N_FRAMES) / 100, np.random.default_rng(0)
    frequency, phase = random.uniform(0.2, 2, case.chain.n_markers * 3), random.uniform(0, 6, case.chain.n_markers * 3)
    wander = 3 * np.sin(2 * np.pi * np.outer(times, frequency) + phase).reshape(case.positions.shape)
    positions = case.positions + np.einsum("fmij,fmj->fmi", case.poses.rotations[:, case.chain.limb_of_marker], wander)
    found = fit_soft_tissue(calibrate(case.chain, case.poses, positions))
    assert found is None or np.sqrt(found.variances.max()) < 1.0


@pytest.mark.parametrize("dropouts", [0.0, 0.2])
def test_rigid_displacements_tell_all_that_markers_tell(true_chain, dropouts):
    """With all markers seen, the few numbers of each limb lose nothing; else but what flexions clusters."""
    case = true_chain("tree:8", n_frames=30, noise=0.3, dropouts=dropouts)
    chain, free = case.chain, Articulation.free(case.chain.n_limbs)
    tissue = soft_tissue_at_rest(chain, case.poses)
    here = observed(chain, free, case.poses, case.positions)
    system = soft_tissue_equations(here, tissue, tissue.reach(chain))
    full = reduced_information(frame_blocks(here))
    basis = system.clusters.basis.reshape(3 * chain.n_markers, -1)
    n = system.n_joints
    spread = np.zeros((len(full), system.n_constants))
    spread[3 * chain.n_markers :, :n], spread[: 3 * chain.n_markers, n:] = np.eye(n), basis
    wanted = spread.T @ full @ spread
    found = system.matrix[: system.n_constants, : system.n_constants]
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())


def test_gradient_is_the_slope_of_the_squares(true_chain):
    """Slides against finite differences: poses are at their best for no slide, so only the residuals change."""
    case = true_chain("rods", n_frames=40, noise=1.0)
    last = calibrate(case.chain, case.poses, case.positions, 0)
    tissue = soft_tissue_at_rest(last.chain, last.poses)
    reach = tissue.reach(last.chain)
    system = soft_tissue_equations(last, tissue, reach)
    n_displacements, step = len(system.rigid), 1e-4
    for index in (0, n_displacements // 2, n_displacements - 1):
        displacements = np.zeros(n_displacements)
        displacements[index] = step
        slopes = system.slopes(displacements, len(tissue.joints))
        squares = [
            ((case.positions - moved.displacements(last.chain, last.poses) - last.poses.markers(last.chain)) ** 2).sum()
            for moved in (tissue.with_slopes(sign * slopes) for sign in (1, -1))
        ]
        slope = (squares[1] - squares[0]) / (4 * step)
        assert system.gradient[system.n_constants + index] == pytest.approx(slope, rel=1e-3, abs=0.05)


def test_limbs_of_one_and_two_markers_take_part(true_chain):
    case = true_chain("classic-human", n_frames=300, noise=0.3, soft_tissue=TISSUE)
    last = calibrate(case.chain, case.poses, case.positions)
    found = fit_soft_tissue(last)
    assert found is not None
    settled = calibrate_soft_tissue(found, last.poses, case.positions)
    assert np.isfinite(settled.calibration.information).all()
    assert np.isfinite(settled.tissue.slopes).all()


def test_same_input_gives_the_same_displacements(tissue):
    _, last = tissue[1]
    first, second = (fit_soft_tissue(dataclasses.replace(last)) for _ in range(2))
    np.testing.assert_array_equal(first.tissue.slopes, second.tissue.slopes)
