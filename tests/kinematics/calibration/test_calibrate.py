"""Calibration of a whole chain: exact constants, an honest noise, freedoms that are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.kinematics.calibration.calibrate import calibrate
from skelgen.kinematics.calibration.limb_errors import HingeShifts, limb_errors
from skelgen.kinematics.chain.chain import residuals
from skelgen.kinematics.chain.normal_equations import constant_gradient, total_information

NOISE_TOLERANCE = 0.04  # relative; of some 5000 freedoms the standard deviation is known to 1 %


def rough(chain, seed=0):
    """The chain with joints and offsets wrong by some 5 mm."""
    random = np.random.default_rng(seed)
    joints = chain.joints + random.normal(size=chain.joints.shape) * 5
    joints[0] = 0.0
    return chain.moved(joints, chain.offsets + random.normal(size=chain.offsets.shape) * 5)


def distances(points):
    return np.linalg.norm(points[:, None] - points, axis=2)


@pytest.mark.parametrize("name", ["rods", "tree:8"])
def test_exact_markers_calibrate_a_rough_chain_exactly(true_chain, name):
    case = true_chain(name, n_frames=150)
    found = calibrate(rough(case.chain), case.poses, case.positions, n_rounds=40)
    assert np.abs(residuals(found.chain, found.poses, case.positions)).max() < 0.01  # mm
    for limb in range(case.chain.n_limbs):
        own = case.chain.limb_of_marker == limb
        np.testing.assert_allclose(distances(found.chain.offsets[own]), distances(case.chain.offsets[own]), atol=0.01)


@pytest.mark.parametrize("noise", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("dropouts", [0.0, 0.1])
def test_noise_estimate_is_the_simulated_noise(true_chain, noise, dropouts):
    case = true_chain("rods", n_frames=400, noise=noise, dropouts=dropouts)
    found = calibrate(case.chain, case.poses, case.positions)
    assert found.noise == pytest.approx(noise, rel=NOISE_TOLERANCE)


def test_noise_estimate_holds_for_two_marker_limbs(true_chain):
    case = true_chain("classic-human", n_frames=300, noise=0.5)
    assert calibrate(case.chain, case.poses, case.positions).noise == pytest.approx(0.5, rel=0.1)


def test_rounds_never_raise_the_sum_of_squares(true_chain):
    case = true_chain("tree:8", n_frames=100, noise=1.0)
    squares = []
    for n_rounds in (0, 1, 3, 12):
        found = calibrate(rough(case.chain), case.poses, case.positions, n_rounds=n_rounds)
        squares.append((residuals(found.chain, found.poses, case.positions) ** 2).sum())
    assert (np.diff(squares) <= 1e-9).all()
    assert squares[-1] < squares[0]


def test_no_rounds_keep_the_chain(true_chain):
    case = true_chain("rods", n_frames=50, noise=1.0)
    chain = rough(case.chain)
    found = calibrate(chain, case.poses, case.positions, n_rounds=0)
    np.testing.assert_array_equal(found.chain.offsets, chain.offsets)
    np.testing.assert_array_equal(found.chain.joints, chain.joints)


def test_information_lacks_the_free_choice_of_the_limbs_frames_only(true_chain):
    case = true_chain("rods", n_frames=200, noise=0.5)
    found = calibrate(case.chain, case.poses, case.positions)
    values = np.linalg.eigvalsh(found.information)
    n_free = 3 * case.chain.n_limbs + 3  # three turns of each limb's frame, three shifts of the root's
    assert (values[:n_free] < 1e-5 * values[-1]).all()
    assert (values[n_free:] > 1e-4 * values[-1]).all()


def test_information_and_gradient_of_frames_add_up(true_chain):
    case = true_chain("rods", n_frames=1500, noise=0.5)
    whole = calibrate(case.chain, case.poses, case.positions, 0)
    parts = [whole.at(slice(0, 400)), whole.at(slice(400, 1500))]
    for total in (total_information, constant_gradient):
        np.testing.assert_allclose(sum(total(part) for part in parts), total(whole), rtol=1e-9, atol=1e-6)


def test_constants_that_are_all_determined_have_errors_of_the_size_of_the_noise(true_chain):
    case = true_chain("rods", n_frames=20, noise=0.5)
    found = calibrate(case.chain, case.poses, case.positions, n_rounds=0)
    known = replace(found, known_information=100.0 * np.eye(len(found.information)))  # each seen in a hundred frames
    n_limbs, n_places = case.chain.n_limbs, case.chain.offsets.size + case.chain.joints[1:].size
    unshifted = HingeShifts(np.zeros((2, n_limbs, 3)), np.zeros(n_limbs), np.zeros((n_places, 0)))
    errors = limb_errors(known, unshifted, growth=1.0)
    for limb in range(n_limbs):
        assert np.sqrt((errors.offsets(limb) ** 2).sum(axis=2)).max() < 1.01 * found.noise / 10
