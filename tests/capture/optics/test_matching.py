"""Pairs of balls to points: exact, with noise, ambiguous, and none."""

import numpy as np
import pytest

from skelgen.capture.optics.matching import match_and_triangulate
from skelgen.capture.optics.projection import in_image, project, undistort
from skelgen.capture.optics.triangulation import essential_matrix, triangulate
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.values import Balls
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import Camera, StereoRig

ROUNDING_MM = 1e-8
"""Of a point a metre away, through the undistortion and back."""


def balls(centres: np.ndarray, std: float = 0.02) -> Balls:
    n = len(centres)
    return Balls(centres, np.full(n, 20.0), np.full(n, 10.0), np.full(n, std), np.zeros(n, dtype=bool))


def visible_points(rig: StereoRig, rng: np.random.Generator, n: int) -> np.ndarray:
    """Points half a metre to two metres away that both cameras see."""
    points = rng.uniform([-300.0, -400.0, 700.0], [700.0, 400.0, 2000.0], (20 * n, 3))
    seen = in_image(rig.left, project(rig.left, points)) & in_image(rig.right, project(rig.right, points))
    return points[seen][:n]


def test_exact_projections_give_their_points(rng):
    rig = reference_rig()
    points = visible_points(rig, rng, 200)
    found = triangulate(rig, project(rig.left, points), project(rig.right, points))
    assert np.abs(found.points - points).max() < ROUNDING_MM


def homogeneous(rays: np.ndarray) -> np.ndarray:
    return np.concatenate([rays, np.ones((*rays.shape[:-1], 1))], axis=-1)


def test_rays_to_one_point_lie_in_one_plane_with_both_cameras(rng):
    rig = reference_rig()
    points = visible_points(rig, rng, 50)
    left, right = (undistort(eye, project(eye, points)) for eye in (rig.left, rig.right))
    residuals = (homogeneous(right) * (homogeneous(left) @ essential_matrix(rig).T)).sum(axis=1)
    assert np.abs(residuals).max() < 1e-9 * rig.baseline


def test_scatter_of_noisy_points_is_the_predicted_covariance(rng):
    rig = reference_rig()
    points = visible_points(rig, rng, 2000)
    noise = rig.noise * rng.normal(size=(2, len(points), 2))
    found = triangulate(rig, project(rig.left, points) + noise[0], project(rig.right, points) + noise[1])
    error = found.points - points
    squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)
    assert squares.mean() == pytest.approx(3.0, rel=4 * np.sqrt(2 / 3 / len(points)))  # chi-square, 3 of them


def test_corrected_rays_meet_and_no_other_pair_of_rays_that_meet_is_nearer(rng):
    rig = reference_rig()
    points = visible_points(rig, rng, 100)
    noise = 2.0 * rng.normal(size=(2, len(points), 2))
    found = triangulate(rig, project(rig.left, points) + noise[0], project(rig.right, points) + noise[1])
    meets = (homogeneous(found.rays[:, 1]) * (homogeneous(found.rays[:, 0]) @ essential_matrix(rig).T)).sum(axis=1)
    assert np.abs(meets).max() < 1e-9 * rig.baseline
    cost = (found.shifts**2).sum(axis=1)
    for move in 0.3 * rng.normal(size=(20, 1, 3)):  # rays of points near by meet as well
        near = found.points + move
        other = [project(rig.left, near) - project(rig.left, points) - noise[0]]
        other += [project(rig.right, near) - project(rig.right, points) - noise[1]]
        squares = (np.concatenate(other, axis=1) ** 2).sum(axis=1) / rig.noise**2
        assert (squares > 0.99 * cost).all()  # the lens bends a shift of 2 px by less than a hundredth of it


def test_optimum_next_to_the_epipole_is_the_best_of_all_lines_through_it(rng):
    """One camera behind the other: both epipoles are in the middle of the image."""
    matrix = np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]])
    behind = Camera(640, 480, matrix, camera_from_world=transform_from(np.eye(3), np.array([3.0, 2.0, 500.0])))
    rig = StereoRig(Camera(640, 480, matrix), behind, noise=1.0)
    points = np.column_stack([rng.uniform(-30, 30, (200, 2)), np.full(200, 1500.0)])
    left, right = (project(side, points) + rng.normal(size=(200, 2)) for side in (rig.left, rig.right))
    found = triangulate(rig, left, right)
    angles = np.linspace(0, np.pi, 5000)
    across = np.stack([-np.sin(angles), np.cos(angles)])
    epipole = np.array([320.0, 240.0]) + 800.0 * np.array([3.0, 2.0]) / 500.0  # of both: they look the same way
    every = ((left - epipole) @ across) ** 2 + ((right - epipole) @ across) ** 2
    assert np.allclose((found.shifts**2).sum(axis=1), every.min(axis=1), atol=1e-3)  # of 5000 lines


def test_forty_balls_all_find_their_partner_and_ambiguous_pairs_are_told(rng):
    rig = reference_rig()
    points = visible_points(rig, rng, 40)
    order = rng.permutation(40)
    noise = rig.noise * rng.normal(size=(2, 40, 2))
    left, right = project(rig.left, points) + noise[0], (project(rig.right, points) + noise[1])[order]
    found = match_and_triangulate(balls(left), balls(right), rig)
    is_true = order[found.right] == found.left
    assert is_true.sum() == 40
    counts = np.bincount(found.left, minlength=40)[found.left], np.bincount(found.right, minlength=40)[found.right]
    assert (found.ambiguous == (np.maximum(*counts) > 1)).all()
    assert np.abs(found.points[is_true] - points[found.left[is_true]]).max() < 10.0  # 10 sigma of depth at 2 m


def test_epipolar_distance_is_the_shift_in_pixels():
    rig = reference_rig()
    point = np.array([[230.0, 0.0, 1000.0]])
    left, right = project(rig.left, point), project(rig.right, point)
    found = match_and_triangulate(balls(left + np.array([0.0, 0.2])), balls(right - np.array([0.0, 0.2])), rig)
    assert found.epipolar_distance[0] == pytest.approx(0.4 / np.sqrt(2), rel=0.02)  # lines here are nearly level


def test_a_ball_that_is_known_better_moves_less():
    rig = reference_rig()
    point = np.array([[230.0, 0.0, 1000.0]])
    left, right = project(rig.left, point), project(rig.right, point)
    found = match_and_triangulate(balls(left + np.array([0.0, 1.0]), std=1.0), balls(right), rig)
    seen = project(rig.right, found.points)
    assert np.abs(seen - right).max() < 0.05
    assert np.abs(project(rig.left, found.points) - left - [0.0, 1.0]).max() > 0.9


def test_points_behind_the_cameras_are_no_candidates():
    rig = reference_rig()
    point = np.array([[230.0, 0.0, 1000.0]])
    swapped = match_and_triangulate(balls(project(rig.right, point)), balls(project(rig.left, point)), rig, gate=1e6)
    assert len(swapped) == 0


def test_no_balls_give_no_points():
    empty = balls(np.empty((0, 2)))
    assert len(match_and_triangulate(empty, balls(np.array([[10.0, 10.0]])), reference_rig())) == 0
    assert match_and_triangulate(empty, empty, reference_rig()).covariance.shape == (0, 3, 3)


def test_points_turn_with_the_world(rng):
    rig = reference_rig()
    world = transform_from(matrix_from_vector(np.array([0.3, 1.0, -0.4])), np.array([100.0, 900.0, -300.0]))
    moved = StereoRig(
        *(Camera(e.width, e.height, e.matrix, e.distortion, e.camera_from_world @ world) for e in (rig.left, rig.right))
    )
    points = visible_points(rig, rng, 10)
    pixels = project(rig.left, points), project(rig.right, points)
    before, after = triangulate(rig, *pixels), triangulate(moved, *pixels)
    back = np.linalg.inv(world)
    assert np.abs(before.points @ back[:3, :3].T + back[:3, 3] - after.points).max() < ROUNDING_MM
    assert np.allclose(back[:3, :3] @ before.covariance @ back[:3, :3].T, after.covariance, rtol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_skewed_cameras_with_strong_lenses_find_their_points_beside_pixels_that_no_ray_reaches(seed):
    rng = np.random.default_rng(seed)
    rig = reference_rig()
    lens = np.array([-0.3, 0.1, 0.002, -0.001, 0.02])
    skewed = rig.left.matrix + np.array([[0, 3.0, 0], [0, 0, 0], [0, 0, 0]])
    pose = transform_from(matrix_from_vector(rng.normal(size=3)), rng.normal(size=3) * 100)
    rig = StereoRig(
        Camera(640, 480, skewed, lens, pose),
        Camera(640, 480, rig.right.matrix, lens, rig.right.camera_from_world @ pose),
    )
    points = visible_points(reference_rig(), rng, 60) @ pose[:3, :3] - pose[:3, 3] @ pose[:3, :3]
    left, right = (project(eye, points) for eye in (rig.left, rig.right))
    left[3], right[5] = 1e5, np.nan  # a pixel that no ray reaches, and none at all
    order = rng.permutation(60)
    found = match_and_triangulate(balls(left), balls(right[order]), rig)
    is_true = order[found.right] == found.left
    assert set(found.left[is_true]) == set(range(60)) - {3, 5}
    assert np.abs(found.points[is_true] - points[found.left[is_true]]).max() < 10 * ROUNDING_MM


def test_matching_finds_the_points_next_to_the_epipoles(rng):
    matrix = np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]])
    behind = Camera(640, 480, matrix, camera_from_world=transform_from(np.eye(3), np.array([3.0, 2.0, 500.0])))
    rig = StereoRig(Camera(640, 480, matrix), behind, noise=1.0)
    points = np.column_stack([rng.uniform(-30, 30, (20, 2)), np.full(20, 1500.0)])
    found = match_and_triangulate(*(balls(project(eye, points)) for eye in (rig.left, rig.right)), rig)
    is_true = found.left == found.right
    assert is_true.sum() == 20
    assert np.abs(found.points[is_true] - points).max() < 1e-5  # mm: depth is hardly seen here
