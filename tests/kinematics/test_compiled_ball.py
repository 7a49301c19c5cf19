"""Two bodies and a point of both, chains and their markers: the compiled loops do what their NumPy twins do."""

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.kinematics import plain_ball, plain_chain

N_FRAMES = 150
ROUNDING = {"rtol": 1e-12, "atol": 1e-9}  # mm, of places a metre away


@pytest.fixture(scope="module")
def ball():
    return pytest.importorskip("skelgen.kinematics.compiled_ball", reason="numba is not installed")


@pytest.fixture(scope="module")
def chain():
    return pytest.importorskip("skelgen.kinematics.compiled_chain", reason="numba is not installed")


@pytest.fixture
def bodies():
    """Poses of two bodies, each unknown in some frames."""
    random = np.random.default_rng(8)
    poses = [
        transform_from(
            matrix_from_vector(random.normal(size=(N_FRAMES, 3))), random.normal(scale=500.0, size=(N_FRAMES, 3))
        )
        for _ in range(2)
    ]
    poses[0][3:7] = np.nan
    poses[1][5:9] = np.nan
    return poses


@pytest.fixture
def limbs():
    """Origins of three limbs in a row, rotations, and two markers on each."""
    random = np.random.default_rng(9)
    rotations = matrix_from_vector(random.normal(size=(N_FRAMES, 3, 3)))
    parents, joints = np.array([-1, 0, 1]), random.normal(scale=300.0, size=(3, 3))
    root = random.normal(scale=500.0, size=(N_FRAMES, 3))
    return parents, joints, root, rotations, np.array([0, 0, 1, 1, 2, 2]), random.normal(scale=50.0, size=(6, 3))


def test_sums_over_frames_are_those_of_the_plain_twin(ball, bodies):
    weights = np.random.default_rng(10).uniform(size=N_FRAMES)
    one, other = (twin.fixed_point_sums(*bodies, weights) for twin in (ball, plain_ball))
    for left, right in zip(one, other, strict=True):
        np.testing.assert_allclose(left, right, **ROUNDING)
    assert one[-1] == N_FRAMES - 6


def test_images_of_a_point_are_those_of_the_plain_twin(ball, bodies):
    points = np.array([10.0, -200.0, 30.0]), np.array([-5.0, 60.0, 7.0])
    one, other = (twin.both_images(*bodies, *points) for twin in (ball, plain_ball))
    for left, right in zip(one, other, strict=True):
        np.testing.assert_allclose(left, right, **ROUNDING)
    assert np.isnan(one[0][5:7]).all()
    assert not np.isnan(one[0][3:5]).any()  # one body tells


def test_distances_of_markers_are_those_of_the_plain_twin(ball, bodies):
    random = np.random.default_rng(11)
    joint, markers = random.normal(size=(N_FRAMES, 3)), random.normal(scale=100.0, size=(N_FRAMES, 4, 3))
    markers[random.uniform(size=(N_FRAMES, 4)) < 0.2] = np.nan
    markers[:, 3] = np.nan
    for left, right in zip(*(twin.mean_distances(joint, markers) for twin in (ball, plain_ball)), strict=True):
        np.testing.assert_allclose(left, right, **ROUNDING)


def test_places_and_errors_of_a_chain_are_those_of_the_plain_twin(chain, limbs):
    parents, joints, root, rotations, owner, offsets = limbs
    origins = plain_chain.origins_of(parents, joints, root, rotations)
    np.testing.assert_allclose(chain.origins_of(parents, joints, root, rotations), origins, **ROUNDING)
    markers = plain_chain.markers_of(origins, rotations, owner, offsets)
    np.testing.assert_allclose(chain.markers_of(origins, rotations, owner, offsets), markers, **ROUNDING)
    measured = markers + np.random.default_rng(12).normal(size=markers.shape)
    measured[::7, 2] = np.nan
    errors = plain_chain.errors_of(measured, markers)
    np.testing.assert_array_equal(chain.errors_of(measured, markers), errors)
    np.testing.assert_allclose(
        chain.turned_back(rotations, owner, errors), plain_chain.turned_back(rotations, owner, errors), **ROUNDING
    )


def test_variances_across_axes_are_those_of_the_plain_twin(chain, limbs):
    parents, _, _, rotations, _, _ = limbs
    random = np.random.default_rng(13)
    roots = random.normal(size=(N_FRAMES + 1, 3, 3, 3))
    covariances = roots @ roots.swapaxes(2, 3)
    axes = rotations[..., 0].copy()
    axes[:, 0] = 0.0
    given = covariances[:-1], rotations, parents, covariances[-1], axes
    np.testing.assert_allclose(chain.variances_across(*given), plain_chain.variances_across(*given), atol=1e-12)
