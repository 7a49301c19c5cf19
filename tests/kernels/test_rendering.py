"""Drawing a ball and exposing its light: areas, centres and noise that follow from geometry."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from skelgen._kernels.rendering import N_NORMALS, PADDING, SAMPLES, DrawnBall, NearerBalls, Sensor, draw_ball, expose

FOCAL, SIZE = 500.0, 24
NORMALS = ndtri((np.arange(N_NORMALS) + 0.5) / N_NORMALS).astype(np.float32)
NOBODY = NearerBalls(np.empty((0, 3)), np.empty(0))


def rays():
    """Through the corners of the pixels of a small image, the axis in its middle."""
    corners = (np.arange(-PADDING, SIZE + PADDING + 1) - 0.5 - (SIZE - 1) / 2) / FOCAL
    return np.stack(np.meshgrid(corners, corners), axis=-1)


def blur(deviation=0.7, reach=4):
    offsets = (np.arange((2 * reach + 1) * SAMPLES) + 0.5) / SAMPLES - reach - 0.5
    received = ndtr((offsets + 0.5) / deviation) - ndtr((offsets - 0.5) / deviation)
    return received / received.sum() * 1.0


def ball(x, y, z=1000.0, radius=10.0, darkening=0.0):
    """A ball whose radius is 5 px at 1 m."""
    column, row, reach = FOCAL * x / z + (SIZE - 1) / 2, FOCAL * y / z + (SIZE - 1) / 2, FOCAL * radius / z + 1
    bounds = [column - reach + 0.5, column + reach + 1.5, row - reach + 0.5, row + reach + 1.5]
    window = np.clip(np.floor(bounds), -PADDING, SIZE + PADDING).astype(np.intp)
    return DrawnBall(window, np.array([x, y, z]), radius, FOCAL / z, 100.0, darkening)


def test_the_light_of_a_ball_is_its_area_and_lies_about_its_centre():
    light = np.zeros((SIZE, SIZE), dtype=np.float32)
    visible = draw_ball(light, rays(), ball(2.6, -1.8), NOBODY, blur())
    assert visible == pytest.approx(np.pi * 25.0, rel=5e-3)
    assert light.sum() == pytest.approx(100.0 * visible, rel=1e-3)
    y, x = np.indices(light.shape)
    centre = np.array([(x * light).sum(), (y * light).sum()]) / light.sum() - (SIZE - 1) / 2
    assert centre == pytest.approx([1.3, -0.9], abs=5e-3)


def test_a_ball_behind_another_of_which_it_lies_one_radius_aside_is_seen_in_part():
    light = np.zeros((SIZE, SIZE), dtype=np.float32)
    nearer = NearerBalls(np.array([[10.0, 0.0, 999.9]]), np.array([FOCAL / 1000.0]))
    visible = draw_ball(light, rays(), ball(0.0, 0.0), nearer, blur())
    assert visible == pytest.approx((1 - 0.391) * np.pi * 25.0, rel=0.01)  # a lens of 0.391 of the area is hidden


def test_the_rim_is_darker():
    lights = [np.zeros((SIZE, SIZE), dtype=np.float32) for _ in range(2)]
    for light, darkening in zip(lights, (0.0, 0.4), strict=True):
        draw_ball(light, rays(), ball(0.0, 0.0, darkening=darkening), NOBODY, blur())
    assert lights[1].sum() == pytest.approx(lights[0].sum() * (1 - 0.4 + 0.4 * 2 / 3), rel=5e-3)  # mean of the cosine


@np.errstate(over="ignore")  # whole numbers of 64 bits wrap around
def test_a_sensor_without_noise_rounds_and_saturates():
    light, image = np.array([[0.2, 99.6, 400.0, 254.4]], dtype=np.float32), np.empty((1, 4), dtype=np.uint8)
    expose(light, NORMALS, Sensor(np.uint64(7), 0.0, 0.0), image)
    assert image.tolist() == [[0, 100, 255, 254]]


@np.errstate(over="ignore")
def test_noise_has_its_deviation_and_follows_from_its_key():
    light, images = np.full((60, 70), 100.0, dtype=np.float32), []
    for key in (7, 7, 8):
        images.append(np.empty(light.shape, dtype=np.uint8))
        expose(light, NORMALS, Sensor(np.uint64(key), 2.0, 0.05), images[-1])
    assert images[0].astype(float).std() == pytest.approx(np.sqrt(2.0**2 + 0.05 * 100.0 + 1 / 12), rel=0.05)
    assert (images[0] == images[1]).all()
    assert np.abs(np.corrcoef(images[0].ravel(), images[2].ravel())[0, 1]) < 0.05
