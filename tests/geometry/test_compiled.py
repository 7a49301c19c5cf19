"""The compiled loops over frames do what their NumPy twins do."""

import numpy as np
import pytest

from skelgen.geometry import plain
from skelgen.geometry.rotations import matrix_from_vector

ROUNDING = 1e-11  # mm, of points a metre away


@pytest.fixture(scope="module")
def compiled():
    return pytest.importorskip("skelgen.geometry.compiled", reason="numba is not installed")


@pytest.fixture
def points():
    """Points of a body, where they are in 200 frames, and which are seen: none in the first frame."""
    random = np.random.default_rng(3)
    source = random.normal(scale=50.0, size=(4, 3))
    turns = matrix_from_vector(random.normal(size=(200, 3)))
    target = source @ turns.swapaxes(1, 2) + random.normal(scale=500.0, size=(200, 1, 3))
    target += random.normal(size=target.shape)
    seen = random.uniform(size=target.shape[:2]) > 0.2
    seen[0] = False
    target[~seen] = np.nan
    return source[np.newaxis], target, seen


def test_moments_are_those_of_the_plain_twin(compiled, points):
    for one, other in zip(compiled.moments_of(*points), plain.moments_of(*points), strict=True):
        np.testing.assert_allclose(one, other, atol=ROUNDING, rtol=1e-12)


def test_each_frame_may_have_its_own_source(compiled, points):
    source, target, seen = points
    own = np.ascontiguousarray(np.broadcast_to(source, target.shape))
    for one, other in zip(compiled.moments_of(own, target, seen), plain.moments_of(*points), strict=True):
        np.testing.assert_allclose(one, other, atol=ROUNDING, rtol=1e-12)


def test_moments_about_a_joint_are_those_of_the_plain_twin(compiled, points):
    source, target, seen = points
    centres = np.random.default_rng(5).normal(scale=500.0, size=(len(target), 3))
    one, other = (twin.moments_about(source[0], target, centres, seen) for twin in (compiled, plain))
    np.testing.assert_allclose(one, other, atol=ROUNDING, rtol=1e-12)


def test_rotations_are_those_of_the_plain_twin(compiled, points):
    moments = plain.moments_of(*points)[0]
    moments[1] = np.outer([1.0, 2.0, 3.0], [3.0, -1.0, 2.0])  # points on one line: many rotations are as good
    (one, sure), (other, plainly_sure) = (twin.fast_rotations(moments) for twin in (compiled, plain))
    assert np.array_equal(sure, plainly_sure)
    assert not sure[:2].any()
    np.testing.assert_allclose(one[sure], other[sure], atol=1e-13)


def test_means_in_the_body_are_those_of_the_plain_twin(compiled, points):
    _, target, seen = points
    seen[:, 3] = False
    poses = np.tile(np.eye(4), (len(target), 1, 1))
    poses[:, :3, :3] = matrix_from_vector(np.random.default_rng(4).normal(size=(len(target), 3)))
    one, other = (twin.means_in_body(poses, target, seen) for twin in (compiled, plain))
    assert np.isnan(one[3]).all()
    np.testing.assert_allclose(one, other, atol=ROUNDING)
