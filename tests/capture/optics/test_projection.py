"""The camera model against OpenCV, against itself, and at the limits of the lens."""

import numpy as np
import pytest

from skelgen.capture.optics.projection import (
    folding_radius,
    in_image,
    pixels_from_normalised,
    project,
    projection_jacobian,
    undistort,
)
from skelgen.capture.reference_rig import reference_rig
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import Camera

EXACT_PX = 1e-9
"""Rounding of a thousand pixels, with room."""

MATRIX = np.array([[832.79, 0.0, 316.69], [0.0, 833.76, 240.22], [0.0, 0.0, 1.0]])
SEED_LENS = np.array([-0.236, 0.304, 0.0, 0.0, 0.0])
STRONG_LENS = np.array([-0.4, 0.25, 0.002, -0.003, -0.06])


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
