"""Bright spots: sums against SciPy's labels, and centres of drawn discs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.special import ndtr

from skelgen._kernels.bright_spots import (
    AREA,
    BOTTOM,
    EDGE,
    EDGE_X,
    EDGE_YY,
    FULL,
    LEFT,
    M00,
    M01,
    M02,
    M10,
    M11,
    M20,
    N_COLUMNS,
    RIGHT,
    TOP,
    edge_centres,
    find_spots,
    histogram,
)

ABOVE_100 = np.where(np.arange(256) > 100, FULL, 0)


def sums_by_scipy(image, low, weights):
    """The table of spots from SciPy's labels, the columns that are tested filled."""
    labels, n_spots = ndimage.label(image > low)
    y, x = np.indices(image.shape)
    weight = weights[image]
    is_edge = (weight < FULL).astype(np.int64)
    terms = {AREA: np.ones_like(weight), M00: weight, M10: weight * x, M01: weight * y, M20: weight * x * x}
    terms |= {M11: weight * x * y, M02: weight * y * y, EDGE: is_edge, EDGE_X: is_edge * x, EDGE_YY: is_edge * y * y}
    table = np.zeros((n_spots, N_COLUMNS), dtype=np.int64)
    for column, term in terms.items():
        table[:, column] = ndimage.sum_labels(term, labels, np.arange(1, n_spots + 1))
    for spot, (rows, columns) in enumerate(ndimage.find_objects(labels)):
        table[spot, [LEFT, RIGHT, TOP, BOTTOM]] = columns.start, columns.stop - 1, rows.start, rows.stop - 1
    return table, [*terms, LEFT, RIGHT, TOP, BOTTOM]


@pytest.mark.parametrize("seed", range(3))
def test_spots_of_random_shapes_are_those_of_scipys_labels(seed):
    image = np.random.default_rng(seed).integers(0, 256, size=(30, 41)).astype(np.uint8)
    weights = np.clip((np.arange(256) - 120) * 60, 0, FULL)
    found, is_noise = find_spots(image, 120, weights, 1)
    expected, columns = sums_by_scipy(image, 120, weights)
    assert not is_noise
    for table in (found, expected):
        table[:] = table[np.lexsort(table[:, columns].T)]
    np.testing.assert_array_equal(found[:, columns], expected[:, columns])


def test_the_histogram_counts_every_third_row():
    image = np.random.default_rng(0).integers(0, 256, size=(20, 31)).astype(np.uint8)
    np.testing.assert_array_equal(histogram(image, 3), np.bincount(image[::3].ravel(), minlength=256))


def test_a_spot_in_the_shape_of_a_u_is_one_spot():
    image = np.zeros((20, 20), dtype=np.uint8)
    image[3:12, 4] = image[3:12, 12] = image[11, 4:13] = 200
    spots, _ = find_spots(image, 100, ABOVE_100, 1)
    assert spots[:, AREA].tolist() == [9 + 9 + 7]


def test_pixels_that_meet_at_a_corner_are_two_spots():
    image = np.zeros((9, 9), dtype=np.uint8)
    image[2:4, 2:4] = image[4:6, 4:6] = 200
    assert len(find_spots(image, 100, ABOVE_100, 1)[0]) == 2


def test_small_spots_are_left_out():
    image = np.zeros((9, 9), dtype=np.uint8)
    image[2, 2:5] = image[6, 6] = 200
    assert find_spots(image, 100, ABOVE_100, 2)[0][:, AREA].tolist() == [3]


def drawn_disc(x, y, radius, shape=(24, 26), blur=0.7):
    """A blurred disc on a dark background."""
    rows, columns = np.indices(shape)
    return np.rint(8 + 240 * ndtr((radius - np.hypot(columns - x, rows - y)) / blur)).astype(np.uint8)


@pytest.mark.parametrize("x, y", [(12.3, 11.8), (12.0, 11.5), (11.71, 12.42)])
def test_the_centre_of_a_disc_is_found_from_its_edge(x, y):
    image = drawn_disc(x, y, 5.0)
    weights = np.clip((np.arange(256) - 60) * 30, 0, FULL)
    spots, _ = find_spots(image, 60, weights, 1)
    ((found_x, found_y, std),) = edge_centres(image, spots, 8.0)
    assert (found_x, found_y) == pytest.approx((x, y), abs=5e-3)  # px; grey levels are rounded
    assert 0.0 < std < 0.01


def test_a_ring_that_leaves_the_image_or_touches_another_spot_gives_no_centre():
    weights = np.clip((np.arange(256) - 60) * 30, 0, FULL)
    for image in (drawn_disc(5.0, 11.0, 5.0), np.maximum(drawn_disc(7.0, 11.0, 4.5), drawn_disc(18.5, 11.0, 4.5))):
        spots, _ = find_spots(image, 60, weights, 1)
        assert np.isnan(edge_centres(image, spots, 8.0)).all()
