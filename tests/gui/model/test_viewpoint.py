"""The viewer of the 3-D view: what is fitted is seen, what is zoomed at stays, and up is up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from skelgen_gui.model.viewpoint import (
    BORDER,
    DOWN,
    FIT_MARGIN,
    ShownCamera,
    Viewpoint,
    cameras_of,
    frustum,
    sign_of,
    up_axis,
)

from skelgen.capture.reference_rig import reference_rig
from skelgen.errors import InputError
from skelgen.model.rig import StereoRig

SIZE = (900, 700)
PIXEL = 1e-6  # px: rounding of doubles


@pytest.fixture(params=[0, 1, 2, DOWN, DOWN + 1, DOWN + 2])
def oblique(request):
    """A viewer to the left, above, with each axis up, and down, in turn."""
    return Viewpoint((10.0, -20.0, 30.0), azimuth=0.7, elevation=0.4, distance=2500.0, up=request.param)


def test_the_target_is_in_the_middle(oblique):
    places, depths = oblique.project(np.array([oblique.target]), *SIZE)
    assert places[0] == pytest.approx([450, 350])
    assert depths[0] == pytest.approx(oblique.distance)


def test_the_basis_is_right_handed_and_orthonormal(oblique):
    assert oblique.basis @ oblique.basis.T == pytest.approx(np.eye(3))
    assert np.linalg.det(oblique.basis) == pytest.approx(1.0)


def test_what_is_higher_is_drawn_higher(oblique):
    low, high = (
        np.array(oblique.target),
        np.array(oblique.target) + 100 * sign_of(oblique.up) * np.eye(3)[oblique.up % 3],
    )
    places, _ = oblique.project(np.stack([low, high]), *SIZE)
    assert places[1, 1] < places[0, 1]
    assert places[1, 0] == pytest.approx(places[0, 0])


def test_what_is_twice_as_near_looks_twice_as_large():
    viewpoint = Viewpoint(distance=1000.0)  # looks along -x, with y to the right
    places, depths = viewpoint.project(np.array([[0.0, 10.0, 0.0], [500.0, 10.0, 0.0]]), *SIZE)
    assert depths.tolist() == [1000.0, 500.0]
    assert places[1, 0] - 450 == pytest.approx(2 * (places[0, 0] - 450))


def test_what_lies_behind_the_viewer_or_is_unknown_has_no_place(oblique):
    behind = np.array(oblique.target) + 2 * oblique.distance * oblique.basis[2]
    places, depths = oblique.project(np.stack([behind, np.full(3, np.nan)]), *SIZE)
    assert np.isnan(places).all()
    assert np.isnan(depths).all()


@pytest.mark.parametrize("size", [(900, 700), (300, 900), (2000, 200)])
def test_what_is_fitted_touches_the_margin_and_stays_within(oblique, size):
    points = np.random.default_rng(0).normal(0, [800, 300, 1000], (200, 3))
    places, _ = oblique.fitted(points, *size).project(points, *size)
    border = min(BORDER, 0.1 * size[1])  # above and below, where buttons are
    room = FIT_MARGIN * (np.array(size) - [0, 2 * border])
    part = np.abs((places - np.array(size) / 2) / (room / 2)).max()
    assert 0.98 < part <= 1 + 1e-9


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.full((3, 3), 5.0)])
def test_a_single_point_is_fitted_from_a_finite_distance(oblique, points):
    fitted = oblique.fitted(points, *SIZE)
    assert fitted.target == pytest.approx(points[0])
    assert 100 < fitted.distance < 10_000


def test_nothing_to_fit_leaves_the_viewer_where_he_is(oblique):
    assert oblique.fitted(np.full((4, 3), np.nan), *SIZE) == oblique


def test_zooming_keeps_the_place_under_the_pointer(oblique):
    point = np.array(oblique.target) + 300 * oblique.basis[0] - 200 * oblique.basis[1]
    before, _ = oblique.project(point[np.newaxis], *SIZE)
    right, down = before[0] - np.array(SIZE) / 2
    nearer = oblique.zoomed(1.7, right, down, SIZE[1])
    after, _ = nearer.project(point[np.newaxis], *SIZE)
    assert nearer.distance == pytest.approx(oblique.distance / 1.7)
    assert after == pytest.approx(before, abs=PIXEL)


def test_panning_moves_what_is_as_deep_as_the_target_with_the_pointer(oblique):
    target = np.array([oblique.target])
    places, _ = oblique.panned(40, -25, SIZE[1]).project(target, *SIZE)
    assert places[0] == pytest.approx([490, 325])


def test_the_viewer_stops_straight_above_and_below(oblique):
    assert oblique.orbited(0, 10).elevation == pytest.approx(math.pi / 2)
    assert oblique.orbited(0, -10).elevation == pytest.approx(-math.pi / 2)
    assert np.isfinite(oblique.orbited(0, 10).basis).all()


def test_a_frustum_holds_what_its_image_shows():
    """A camera at the origin that looks along z; the corner of its image is the corner of the far rectangle."""
    lines = frustum(np.eye(4), (640, 480), (500.0, 500.0), depth=1000.0)
    assert lines.shape == (9, 2, 3)
    assert lines[:, :, 0].max() == pytest.approx(640)
    assert lines[4:8, :, 1].max() == pytest.approx(480)
    assert (lines[:4, 0] == 0).all()


def test_a_frustum_moves_with_its_camera():
    world_from_camera = np.array([[0.0, 0, 1, 5], [1, 0, 0, 6], [0, 1, 0, 7], [0, 0, 0, 1]])
    lines = frustum(world_from_camera, (640, 480), (500.0, 500.0), depth=100.0)
    assert lines[0, 0].tolist() == [5.0, 6.0, 7.0]
    assert (lines[4:8, :, 0] == 105.0).all()


def test_frustums_are_a_third_as_long_as_what_they_see_is_far():
    left, _ = cameras_of(reference_rig())
    near, far = (left.lines_to(np.array([[0.0, 0.0, distance], [np.nan] * 3])) for distance in (900.0, 1800.0))
    assert near[0, 1, 2] == pytest.approx(300.0)
    assert far[0, 1, 2] == pytest.approx(600.0)


@pytest.mark.parametrize("points", [None, np.zeros((0, 3)), np.full((2, 3), np.nan)])
def test_frustums_are_shown_without_anything_to_see(points):
    left, _ = cameras_of(reference_rig())
    assert np.isfinite(left.lines_to(points)).all()


def test_cameras_that_stand_upright_determine_the_axis_that_points_up():
    assert up_axis(()) is None
    rig = reference_rig()  # whose world is the left camera's, with y down in its image
    assert up_axis(cameras_of(rig)) == DOWN + 1
    standing = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # world with z up
    turned = (
        replace(camera, camera_from_world=camera.camera_from_world @ standing) for camera in (rig.left, rig.right)
    )
    assert up_axis(cameras_of(StereoRig(*turned))) == 2


def test_a_camera_without_size_is_refused():
    with pytest.raises(InputError, match="above 0"):
        ShownCamera(np.eye(4), (640.0, 0.0), (800.0, 800.0))
