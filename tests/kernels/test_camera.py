"""The lens both ways, and the outline of a ball against the exact geometry of a sphere."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.camera import distort, outline_offsets, undistort

FOCAL = 800.0
STRONG = np.array([FOCAL, 810.0, 320.0, 240.0, 0.0, -0.4, 0.25, 0.002, -0.003, -0.06, 0.9])
PLAIN = np.array([FOCAL, FOCAL, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.inf])


def test_undistorted_rays_are_those_that_were_distorted():
    rays = np.random.default_rng(0).uniform(-0.5, 0.5, size=(50, 2))
    np.testing.assert_allclose(undistort(distort(rays, STRONG)[0], STRONG), rays, atol=1e-12)


def test_the_slope_of_the_lens_is_that_of_differences():
    rays, step = np.random.default_rng(1).uniform(-0.5, 0.5, size=(20, 2)), 1e-6
    _, slope = distort(rays, STRONG)
    for axis in range(2):
        moved = [distort(rays + sign * step * np.eye(2)[axis], STRONG)[0] for sign in (1, -1)]
        np.testing.assert_allclose((moved[0] - moved[1]) / (2 * step), slope[:, :, axis], atol=1e-8)


def test_places_that_no_ray_reaches_have_no_ray():
    folds = PLAIN.copy()
    folds[5], folds[10] = -0.5, 1 / 1.5  # beyond this radius r (1 - r^2 / 2) falls again
    rays = undistort(np.array([[0.1, 0.0], [5.0, 0.0], [np.nan, 0.0]]), folds)
    assert np.isfinite(rays[0]).all()
    assert np.isnan(rays[1:]).all()


@pytest.mark.parametrize("place", [(0.0, 0.0, 1000.0), (300.0, 0.0, 900.0), (-200.0, 250.0, 700.0)])
def test_outlines_of_balls_lie_farther_out_by_their_perspective(place):
    x, y, z = place
    radius = 10.0
    stretch = z * z / (z * z - radius * radius)  # of the ellipse's middle from the axis
    middle = np.array([[320.0 + FOCAL * x / z * stretch, 240.0 + FOCAL * y / z * stretch]])
    square = x * x + y * y + z * z
    area = np.pi * (FOCAL * radius) ** 2 * np.sqrt(square - radius**2) / (z * z - radius * radius) ** 1.5
    offset = outline_offsets(middle, np.array([area]), PLAIN)[0]
    exact = middle[0] - [320.0 + FOCAL * x / z, 240.0 + FOCAL * y / z]
    np.testing.assert_allclose(offset, exact, rtol=0.03, atol=1e-9)  # a polygon of 16 corners
