"""Moments, best rotations, and points of two bodies, against their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.absolute_orientation import fast_rotations, means_in_body, moments_about, moments_of
from skelgen._kernels.ball_joint import (
    both_images,
    fixed_point_sums,
    mean_distances,
    move_to_centre,
    multilaterated,
    spread_of_directions,
)
from skelgen._kernels.distance_statistics import pair_sums
from skelgen.geometry.orientation import rotation_by_svd
from skelgen.geometry.rotations import matrix_from_vector, transform_from

N_FRAMES = 20
ROUNDING = {"rtol": 1e-11, "atol": 1e-9}  # mm, of places a metre away


@pytest.fixture
def points():
    """Points of a body, where they are in some frames, and which are seen: none in the first frame."""
    random = np.random.default_rng(3)
    source = random.normal(scale=50.0, size=(4, 3))
    turns = matrix_from_vector(random.normal(size=(N_FRAMES, 3)))
    target = source @ turns.swapaxes(1, 2) + random.normal(scale=500.0, size=(N_FRAMES, 1, 3))
    target += random.normal(size=target.shape)
    seen = random.uniform(size=target.shape[:2]) > 0.2
    seen[0] = False
    target[~seen] = np.nan
    return source, target, seen


def test_moments_are_sums_over_the_seen_points_about_their_centres(points):
    source, target, seen = points
    with np.errstate(invalid="ignore", divide="ignore"):
        moments, before, after, count = moments_of(source[np.newaxis], target, seen)
    assert count.tolist() == seen.sum(axis=1).tolist()
    assert np.isnan(before[0]).all()
    for frame in range(1, N_FRAMES):
        inner, outer = source[seen[frame]], target[frame][seen[frame]]
        np.testing.assert_allclose(before[frame], inner.mean(axis=0), **ROUNDING)
        np.testing.assert_allclose(after[frame], outer.mean(axis=0), **ROUNDING)
        wanted = (outer - outer.mean(axis=0)).T @ (inner - inner.mean(axis=0))
        np.testing.assert_allclose(moments[frame], wanted, **ROUNDING)


def test_moments_about_given_centres(points):
    source, target, seen = points
    centres = np.random.default_rng(5).normal(scale=500.0, size=(N_FRAMES, 3))
    found = moments_about(source, target, centres, seen)
    away = np.where(seen[..., np.newaxis], target - centres[:, np.newaxis], 0.0)
    np.testing.assert_allclose(found, np.einsum("fni,nj->fij", away, source), **ROUNDING)


def test_fast_rotations_are_those_of_the_singular_values(points):
    source, target, seen = points
    with np.errstate(invalid="ignore", divide="ignore"):
        moments = moments_of(source[np.newaxis], target, seen)[0]
    moments[1] = np.outer([1.0, 2.0, 3.0], [3.0, -1.0, 2.0])  # points on one line: many rotations are as good
    found, sure = fast_rotations(moments)
    assert not sure[:2].any()
    enough = sure & (seen.sum(axis=1) > 2)
    assert enough.sum() > 10
    np.testing.assert_allclose(found[enough], rotation_by_svd(moments[enough]), atol=1e-9)


def test_means_in_the_body_are_nan_for_points_never_seen(points):
    _, target, seen = points
    seen[:, 3] = False
    poses = np.tile(np.eye(4), (N_FRAMES, 1, 1))
    poses[:, :3, :3] = matrix_from_vector(np.random.default_rng(4).normal(size=(N_FRAMES, 3)))
    with np.errstate(invalid="ignore", divide="ignore"):
        found = means_in_body(poses, target, seen)
    assert np.isnan(found[3]).all()
    local = np.einsum("fji,fnj->fni", poses[:, :3, :3], target)
    np.testing.assert_allclose(found[:3], np.nanmean(local[:, :3], axis=0), **ROUNDING)


@pytest.fixture
def bodies():
    """Poses of two bodies, each unknown in some frames."""
    random = np.random.default_rng(8)
    first, second = (
        transform_from(
            matrix_from_vector(random.normal(size=(N_FRAMES, 3))), random.normal(scale=500.0, size=(N_FRAMES, 3))
        )
        for _ in range(2)
    )
    first[3:7], second[5:9] = np.nan, np.nan
    return first, second


def test_sums_of_a_fixed_point_are_weighted_means_over_frames_that_show_both(bodies):
    weights = np.random.default_rng(10).uniform(size=N_FRAMES)
    relative, from_first, from_second, square, n_frames = fixed_point_sums(*bodies, weights)
    both = np.r_[0:3, 9:N_FRAMES]
    share, (first, second) = weights[both] / weights[both].sum(), (body[both] for body in bodies)
    between = second[:, :3, 3] - first[:, :3, 3]
    assert n_frames == len(both)
    np.testing.assert_allclose(
        relative, np.einsum("f,fki,fkj->ij", share, first[:, :3, :3], second[:, :3, :3]), **ROUNDING
    )
    np.testing.assert_allclose(from_first, np.einsum("f,fki,fk->i", share, first[:, :3, :3], between), **ROUNDING)
    np.testing.assert_allclose(from_second, np.einsum("f,fki,fk->i", share, second[:, :3, :3], between), **ROUNDING)
    assert square == pytest.approx(share @ (between**2).sum(axis=1))


def test_images_of_a_point_are_the_middle_or_the_one_that_is_known(bodies):
    in_first, in_second = np.array([10.0, -200.0, 30.0]), np.array([-5.0, 60.0, 7.0])
    middles, gaps = both_images(*bodies, in_first, in_second)
    one, other = (
        body[:, :3, :3] @ point + body[:, :3, 3] for body, point in zip(bodies, (in_first, in_second), strict=True)
    )
    np.testing.assert_allclose(middles[0], (one[0] + other[0]) / 2, **ROUNDING)
    np.testing.assert_allclose(middles[3], other[3], **ROUNDING)
    np.testing.assert_allclose(middles[8], one[8], **ROUNDING)
    assert np.isnan(middles[5:7]).all()
    np.testing.assert_allclose(gaps, ((one - other) ** 2).sum(axis=1), **ROUNDING)


def test_distances_to_a_joint_have_mean_and_deviation_of_the_frames_that_show_them():
    random = np.random.default_rng(11)
    joint, markers = random.normal(size=(N_FRAMES, 3)), random.normal(scale=100.0, size=(N_FRAMES, 4, 3))
    markers[random.uniform(size=(N_FRAMES, 4)) < 0.2] = np.nan
    markers[:, 3] = np.nan
    means, spreads = mean_distances(joint, markers)
    distances = np.linalg.norm(markers[:, :3] - joint[:, np.newaxis], axis=2)
    np.testing.assert_allclose(means, [*np.nanmean(distances, axis=0), 0.0], **ROUNDING)
    np.testing.assert_allclose(spreads, [*np.nanstd(distances, axis=0), 0.0], **ROUNDING)


def test_sums_of_distances_leave_out_few_that_are_far():
    random = np.random.default_rng(2)
    positions = np.array([[0.0, 0, 0], [100.0, 0, 0], [0, 50.0, 0]]) + random.normal(scale=0.1, size=(60, 3, 3))
    positions[7, 1] += 40.0
    positions[20:25, 2] = np.nan
    shift = np.full((3, 3), np.nan)
    plain, steady = pair_sums(positions, shift)
    distances = np.linalg.norm(positions[:, 0] - positions[:, 1], axis=1)
    assert shift[0, 1] == pytest.approx(distances[0])
    np.testing.assert_allclose(
        plain[:, 0, 1], [60, (distances - shift[0, 1]).sum(), ((distances - shift[0, 1]) ** 2).sum()], rtol=1e-9
    )
    assert steady[0, 0, 1] == 59
    assert plain[0, 0, 2] == 55


def test_a_pair_that_is_never_seen_together_has_no_sums():
    positions = np.zeros((10, 2, 3))
    positions[:5, 0], positions[5:, 1] = np.nan, np.nan
    shift = np.full((2, 2), np.nan)
    assert not pair_sums(positions, shift)[0].any()
    assert np.isnan(shift).all()


def test_multilaterated_points_have_their_distances():
    random = np.random.default_rng(7)
    markers = random.normal(scale=200.0, size=(N_FRAMES, 5, 3))
    markers[3, 1:] = np.nan
    markers[4] = np.nan
    place = np.array([10.0, 20.0, 30.0])
    markers += place - markers[:, :1] + [100.0, 0, 0]  # the first is 100 mm away
    radii = np.linalg.norm(markers[0] - place, axis=1)
    markers[1:3] = markers[0]
    joint = np.tile(place, (N_FRAMES, 1)) + random.normal(scale=5.0, size=(N_FRAMES, 3))
    before = joint.copy()
    errors = multilaterated(joint, markers, radii, 30)
    np.testing.assert_allclose(joint[:3], np.tile(place, (3, 1)), atol=1e-6)
    assert errors[:4].max() < 1e-9 and errors[4] in {0.0, np.inf}
    np.testing.assert_array_equal(joint[4], before[4])


def test_a_point_moves_to_the_common_centre_of_spheres():
    centre, random = np.array([20.0, -50.0, 10.0]), np.random.default_rng(7)
    around = random.normal(size=(20, 3))
    around *= np.repeat([80.0, 200.0], [8, 12])[:, np.newaxis] / np.linalg.norm(around, axis=1, keepdims=True)
    found, rows = np.zeros(3), np.empty((20, 4))
    n_steps = move_to_centre(centre + around, np.array([8, 20]), found, rows, 20)
    np.testing.assert_allclose(found, centre, atol=1e-6)
    assert n_steps < 10
    again = found.copy()
    assert move_to_centre(centre + around, np.array([8, 20]), again, rows, 20) == 1


def test_directions_spread_by_what_the_square_of_their_mean_lacks_of_one(bodies):
    first, _ = bodies
    random = np.random.default_rng(8)
    points, centre = random.normal(scale=300.0, size=(len(first), 3, 3)), np.array([10.0, -20.0, 5.0])
    points[2, 1] = np.nan
    local = np.einsum("fji,fnj->fni", first[:, :3, :3], points - first[:, np.newaxis, :3, 3]) - centre
    means = np.nanmean(local / np.linalg.norm(local, axis=2, keepdims=True), axis=0)
    wanted = np.mean(1 - (means**2).sum(axis=1))
    assert spread_of_directions(first, points, centre) == pytest.approx(wanted, rel=1e-12)
