"""The camera model against OpenCV, against itself and at the limits of the lens; pairs of balls to points: exact, with
noise, ambiguous, and none.
"""

import numpy as np
import pytest

from skelgen.capture.optics import (
    folding_radius,
    geometry_of,
    in_image,
    match_and_triangulate,
    pixels_from_normalised,
    project,
    projection_jacobian,
    triangulate,
    undistort,
)
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.values import Balls
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import Camera, StereoRig

EXACT_PX = 1e-9
"""Rounding of a thousand pixels, with room."""

MATRIX = np.array([[832.79, 0.0, 316.69], [0.0, 833.76, 240.22], [0.0, 0.0, 1.0]])
SEED_LENS = np.array([-0.236, 0.304, 0.0, 0.0, 0.0])
STRONG_LENS = np.array([-0.4, 0.25, 0.002, -0.003, -0.06])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(6)


def camera(distortion=STRONG_LENS) -> Camera:
    """The left camera of the reference rig (Table 4.1), turned and shifted, with a lens."""
    pose = transform_from(matrix_from_vector(np.array([0.1, -0.2, 0.3])), np.array([30.0, -20.0, 100.0]))
    return Camera(640, 480, MATRIX, distortion, pose)


def seen_points(eye: Camera, rng: np.random.Generator) -> np.ndarray:
    """A hundred points in front of the camera, 0.5 to 3 m away."""
    inside = rng.uniform([-0.4, -0.3, 1.0], [0.4, 0.3, 1.0], (100, 3)) * rng.uniform(500.0, 3000.0, (100, 1))
    return (inside - eye.camera_from_world[:3, 3]) @ eye.camera_from_world[:3, :3]


def test_projection_is_opencvs(rng):
    cv2 = pytest.importorskip("cv2")
    eye = camera()
    points = seen_points(eye, rng)
    turn, _ = cv2.Rodrigues(eye.camera_from_world[:3, :3].copy())
    expected, _ = cv2.projectPoints(points, turn, eye.camera_from_world[:3, 3].copy(), MATRIX, STRONG_LENS)
    assert np.abs(project(eye, points) - expected[:, 0]).max() < EXACT_PX


@pytest.mark.parametrize("lens", [np.zeros(5), SEED_LENS, STRONG_LENS])
def test_undistorted_pixels_look_along_the_ray_of_their_point(lens, rng):
    eye = camera(lens)
    points = seen_points(eye, rng)
    inside = points @ eye.camera_from_world[:3, :3].T + eye.camera_from_world[:3, 3]
    rays = undistort(eye, project(eye, points))
    assert np.abs(rays - inside[:, :2] / inside[:, 2:]).max() * 1000.0 < EXACT_PX


def test_jacobian_is_the_slope_of_the_projection(rng):
    eye = camera()
    points = seen_points(eye, rng)
    step = 1e-3  # mm: curvature and rounding both stay below 1e-8 px/mm
    numeric = np.stack([project(eye, points + s) - project(eye, points - s) for s in step * np.eye(3)], -1) / (2 * step)
    assert np.abs(projection_jacobian(eye, points) - numeric).max() < 1e-7


def test_points_behind_the_camera_are_nowhere():
    eye = camera()
    behind = -eye.camera_from_world[:3, :3].T @ (eye.camera_from_world[:3, 3] + [0.0, 0.0, 500.0])
    assert np.isnan(project(eye, behind)).all()


def test_a_point_beyond_the_fold_of_the_lens_is_nowhere_instead_of_in_the_image():
    eye = Camera(640, 480, MATRIX, np.array([-0.5, 0.0, 0.0, 0.0, 0.0]))
    assert folding_radius(eye) == pytest.approx(np.sqrt(1 / 1.5))
    side = np.array([1.2, 0.0])  # bent, it would come to lie 280 px right of the middle
    assert in_image(eye, pixels_from_normalised(eye, side * (1 - 0.5 * 1.44)))
    assert np.isnan(project(eye, np.array([1200.0, 0.0, 1000.0]))).all()


def test_a_pixel_that_no_ray_reaches_is_unseen_and_the_others_are_not_touched():
    eye = Camera(640, 480, MATRIX, np.array([-0.5, 0.0, 0.0, 0.0, 0.0]))
    rays = undistort(eye, np.array([[320.0, 240.0], [5000.0, 240.0], [np.nan, 0.0]]))
    assert np.isfinite(rays[0]).all()
    assert np.isnan(rays[1:]).all()


def test_images_end_at_the_outer_edges_of_their_pixels():
    corners = np.array([[-0.5, -0.5], [639.5, 479.5], [-0.51, 0.0], [0.0, 479.6], [np.nan, 0.0]])
    assert in_image(camera(), corners).tolist() == [True, True, False, False, False]


def test_both_cameras_of_the_seed_see_what_stands_a_metre_before_their_middle():
    rig = reference_rig()
    middle = np.array([230.0, 0.0, 1000.0])
    for eye in (rig.left, rig.right):
        assert in_image(eye, project(eye, middle))
    assert rig.baseline == pytest.approx(477.10, abs=0.01)


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
    residuals = (homogeneous(right) * (homogeneous(left) @ geometry_of(rig).essential.T)).sum(axis=1)
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
    meets = (homogeneous(found.rays[:, 1]) * (homogeneous(found.rays[:, 0]) @ geometry_of(rig).essential.T)).sum(axis=1)
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
