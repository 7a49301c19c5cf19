"""Spots that are several balls: discs inscribed and fitted where they were drawn, and nothing where there are none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from skelgen._kernels.ball_discs import RADIUS
from skelgen._kernels.bright_spots import FULL
from skelgen._kernels.touching_balls import find_discs, inscribed_discs, light_of_spot

NO_BORDER = (False, False, False, False)


def drawn(discs, shape):
    """Opaque bright discs with blurred edges."""
    rows, columns = np.indices(shape)
    parts = [ndtr((radius - np.hypot(columns - x, rows - y)) / 0.6) for x, y, radius in discs]
    return 1.0 - np.prod([1.0 - part for part in parts], axis=0)


@pytest.mark.parametrize(
    "discs",
    [
        [(8.3, 8.1, 5.0)],
        [(7.6, 8.1, 4.6), (14.2, 9.0, 4.4)],
        [(7.2, 7.4, 4.2), (14.1, 7.9, 4.3), (10.9, 13.8, 4.4)],
        [(7.0, 7.2, 4.2), (14.0, 7.5, 4.3), (21.0, 7.1, 4.2)],
    ],
)
def test_balls_are_found_where_they_were_drawn(discs):
    found, _, rms = find_discs(drawn(discs, (20, 29)), 0.01, NO_BORDER)
    assert np.isfinite(rms)
    assert len(found) == len(discs)
    for x, y, radius in discs:
        away = np.abs(found[:, : RADIUS + 1] - [x, y, radius]).max(axis=1)
        assert away.min() < 0.05  # px


def test_a_ball_that_the_border_cuts_has_the_centre_of_its_whole_outline():
    found, _, rms = find_discs(drawn([(1.4, 8.0, 5.0)], (17, 12)), 0.01, (True, False, False, False))
    assert np.isfinite(rms)
    assert found[0, : RADIUS + 1] == pytest.approx([1.4, 8.0, 5.0], abs=0.05)


def test_a_cable_of_light_is_no_ball():
    rows, columns = np.indices((40, 44))
    cable = (np.abs(columns - rows - 2) <= 1.0).astype(float)
    cable[:2] = cable[-2:] = 0.0
    assert np.isinf(find_discs(cable, 0.01, NO_BORDER)[2])


def test_a_triangle_is_no_ball():
    rows, columns = np.indices((24, 24))
    triangle = ((columns >= 2) & (rows < 22) & (columns <= rows - 2)).astype(float)
    assert np.isinf(find_discs(triangle, 0.001, NO_BORDER)[2])


def test_discs_are_inscribed_where_circles_were_drawn():
    y, x = np.mgrid[:30, :40]
    inside = (np.hypot(x - 12, y - 14) <= 9) | (np.hypot(x - 25, y - 15) <= 7)
    found = inscribed_discs(inside, NO_BORDER)
    assert found == pytest.approx(np.array([[12, 14, 9], [25, 15, 7]]), abs=1)


def test_a_shape_goes_on_beyond_the_border():
    y, x = np.mgrid[:19, :8]
    ((middle, level, radius),) = inscribed_discs(np.hypot(x - 0, y - 9) <= 7, (True, False, False, False))
    assert (middle, level, radius) == pytest.approx((0, 9, 7), abs=1)


def test_light_of_other_spots_is_left_out():
    weights = np.zeros((8, 12), dtype=np.int64)
    weights[2:6, 1:5] = FULL
    weights[1:3, 8:10] = FULL // 2
    window = light_of_spot(weights)
    assert np.isnan(window[1:3, 8:10]).all()
    assert (window[2:6, 1:5] == 1.0).all()
    assert np.isnan(window).sum() == 4
