"""Ball joints in closed form: exact on exact poses, honest about what was never turned."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.kinematics.joints.closed_form import fit_fixed_point

AT_FIRST, AT_SECOND = np.array([120.0, -40.0, 300.0]), np.array([-80.0, 15.0, 200.0])
AXIS = np.array([0.6, 0.0, 0.8])
NOWHERE = np.zeros(3)
RIDGE_BIAS = 1e-3  # mm: what the weak pull of nearness may cost (RELATIVE_RIDGE)


@pytest.fixture
def turns():
    """Turns of some 30 degrees about all axes."""
    return np.random.default_rng(7).normal(size=(100, 3)) * 0.5


def test_shared_point_of_exact_bodies_is_found(joined_bodies, turns):
    fit = fit_fixed_point(*joined_bodies(turns, AT_FIRST, AT_SECOND), NOWHERE, NOWHERE)
    np.testing.assert_allclose(fit.in_first, AT_FIRST, atol=RIDGE_BIAS)
    np.testing.assert_allclose(fit.in_second, AT_SECOND, atol=RIDGE_BIAS)
    assert fit.gap < RIDGE_BIAS
    assert (fit.determinacy > 0.05).all()
    assert (np.diff(fit.determinacy) >= 0).all()


def test_direction_of_a_hinge_is_found_in_both_bodies(joined_bodies):
    turns = np.linspace(-0.8, 0.9, 60)[:, None] * AXIS
    fit = fit_fixed_point(*joined_bodies(turns, AT_FIRST, AT_SECOND), NOWHERE, NOWHERE)
    for axis in (fit.axis_in_first, fit.axis_in_second):
        np.testing.assert_allclose(np.abs(axis @ AXIS), 1, atol=1e-9)
    assert fit.determinacy[0] < 1e-9
    assert fit.determinacy[1] > 0.1


def test_hinge_is_exact_across_its_axis(joined_bodies):
    turns = np.linspace(-0.8, 0.9, 60)[:, None] * AXIS
    fit = fit_fixed_point(*joined_bodies(turns, AT_FIRST, AT_SECOND), NOWHERE, NOWHERE)
    for found, true in ((fit.in_first, AT_FIRST), (fit.in_second, AT_SECOND)):
        error = found - true
        assert np.linalg.norm(error - error @ AXIS * AXIS) < RIDGE_BIAS


def test_hinge_settles_near_both_bodies_along_its_axis(joined_bodies):
    turns = np.linspace(-0.8, 0.9, 60)[:, None] * AXIS
    near_first, near_second = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    fit = fit_fixed_point(*joined_bodies(turns, AT_FIRST, AT_SECOND), near_first, near_second)
    assert (fit.in_first - near_first + fit.in_second - near_second) @ AXIS == pytest.approx(0, abs=1e-3)


def test_frames_without_a_pose_are_ignored(joined_bodies, turns):
    first, second = joined_bodies(turns, AT_FIRST, AT_SECOND)
    first[:10], second[5:30] = np.nan, np.nan
    fit = fit_fixed_point(first, second, NOWHERE, NOWHERE)
    assert fit.n_frames == 70
    np.testing.assert_allclose(fit.in_first, AT_FIRST, atol=RIDGE_BIAS)


def test_too_few_common_frames_give_no_joint(joined_bodies, turns):
    first, second = joined_bodies(turns, AT_FIRST, AT_SECOND)
    first[2:] = np.nan
    assert fit_fixed_point(first, second, NOWHERE, NOWHERE) is None


def test_exchanged_bodies_give_the_exchanged_joint(joined_bodies, turns):
    first, second = joined_bodies(turns, AT_FIRST, AT_SECOND)
    one, other = fit_fixed_point(first, second, NOWHERE, NOWHERE), fit_fixed_point(second, first, NOWHERE, NOWHERE)
    np.testing.assert_allclose(one.in_first, other.in_second, atol=1e-6)
    assert one.gap == pytest.approx(other.gap, abs=1e-6)


def test_gap_is_the_mean_square_distance_of_the_images(joined_bodies, turns):
    first, second = joined_bodies(turns, AT_FIRST, AT_SECOND)
    second[:, :3, 3] += np.random.default_rng(1).normal(size=(100, 3)) * 5
    fit = fit_fixed_point(first, second, NOWHERE, NOWHERE)
    images = [body[:, :3, :3] @ at + body[:, :3, 3] for body, at in ((first, fit.in_first), (second, fit.in_second))]
    assert fit.gap == pytest.approx(((images[0] - images[1]) ** 2).sum(axis=1).mean(), rel=1e-6)
