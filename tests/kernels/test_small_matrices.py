"""Small matrices inside kernels are those of NumPy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen._kernels import kernel
from skelgen._kernels.least_squares import factorise, solve, turn_to_axes, write_inverse_root
from skelgen._kernels.rotations import proper, rotation_by
from skelgen._kernels.small_matrices import (
    added,
    cross_matrix,
    inverse,
    matrix,
    negative,
    outer,
    product,
    set_matrix,
    set_symmetric,
    symmetric,
    taken,
    vector,
    whole,
)

FIRST, SECOND = np.intp(0), np.intp(1)


@kernel
def _write_inverse(upper, level, out):
    set_symmetric(out, FIRST, FIRST, inverse(symmetric(upper, FIRST, FIRST), level))


@kernel
def _write_product(matrices, out):
    set_matrix(out, FIRST, FIRST, product(matrix(matrices, FIRST, FIRST), matrix(matrices, SECOND, FIRST)))


@kernel
def _write_rotation(vectors, out):
    set_matrix(out, FIRST, FIRST, rotation_by(vector(vectors, FIRST, FIRST)))


@kernel
def _write_proper(matrices, out):
    set_matrix(out, FIRST, FIRST, proper(matrix(matrices, FIRST, FIRST)))


@kernel
def _write_carried(matrices, lever, out):
    """S - S [v]x - v v^T, by the upper half of S."""
    way, whole_one = vector(lever, FIRST, FIRST), whole(symmetric(matrices, FIRST, FIRST))
    carried = added(whole_one, negative(product(whole_one, cross_matrix(way))))
    set_matrix(out, FIRST, FIRST, taken(carried, outer(way, way)))


@kernel
def _solved(matrix, right):
    if factorise(matrix):
        solve(matrix, right)
        return True
    return False


@kernel
def _write_axes(matrix, vectors):
    turn_to_axes(matrix, vectors, len(matrix))


@kernel
def _write_root(matrix, out):
    write_inverse_root(matrix, out)


def positive(size, seed=0):
    root = np.random.default_rng(seed).normal(size=(size, 2 * size))
    return root @ root.T


def test_inverse_of_a_symmetric_matrix_of_three():
    whole, out = positive(3), np.empty((1, 6))
    _write_inverse(whole[np.triu_indices(3)][np.newaxis], 0.5, out)
    np.testing.assert_allclose(out[0], np.linalg.inv(whole + 0.5 * np.eye(3))[np.triu_indices(3)], rtol=1e-9)


def test_product_of_matrices_of_three():
    given, out = np.random.default_rng(1).normal(size=(2, 9)), np.empty((1, 9))
    _write_product(given, out)
    np.testing.assert_allclose(out.reshape(3, 3), given[0].reshape(3, 3) @ given[1].reshape(3, 3), rtol=1e-12)


@pytest.mark.parametrize("length", [1e-3, 0.3, 3.0])
def test_turns_by_a_vector_are_proper_and_about_it(length):
    given, out = length * np.array([[0.6, 0.0, 0.8]]), np.empty((1, 9))
    _write_rotation(given, out)
    angle = 2 * np.arctan(length / 2)  # which is the length, for small ones
    np.testing.assert_allclose(
        out.reshape(3, 3), Rotation.from_rotvec(given[0] / length * angle).as_matrix(), atol=1e-12
    )


def test_a_rotation_that_drifted_is_made_proper():
    drifted, out = Rotation.from_rotvec([0.3, 1.0, -2.0]).as_matrix() + 1e-7, np.empty((1, 9))
    _write_proper(drifted.reshape(1, 9), out)
    found = out.reshape(3, 3)
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)


def test_equations_of_a_positive_matrix_are_solved():
    whole, right = positive(5), np.arange(5.0)
    wanted = np.linalg.solve(whole, right)
    assert _solved(whole, right)
    np.testing.assert_allclose(right, wanted, rtol=1e-9)


def test_a_matrix_that_is_not_positive_is_told():
    assert not _solved(np.diag([1.0, -1.0]), np.zeros(2))


def test_axes_of_a_symmetric_matrix_are_its_eigenvectors():
    whole, vectors = positive(6), np.empty((6, 6))
    turned = whole.copy()
    _write_axes(turned, vectors)
    np.testing.assert_allclose(np.sort(np.diag(turned)), np.linalg.eigvalsh(whole), rtol=1e-9)
    np.testing.assert_allclose(vectors @ np.diag(np.diag(turned)) @ vectors.T, whole, atol=1e-9)


def test_inverse_root_whitens():
    whole, out = positive(4), np.empty((4, 4))
    _write_root(whole.copy(), out)
    np.testing.assert_allclose(out @ whole @ out.T, np.eye(4), atol=1e-9)


def test_covariances_are_carried_along_a_lever():
    upper, lever, out = np.array([[4.0, 1.0, -2.0, 5.0, 0.5, 6.0]]), np.array([[1.0, -2.0, 3.0]]), np.empty((1, 9))
    _write_carried(upper, lever, out)
    whole_one = np.array([[4.0, 1.0, -2.0], [1.0, 5.0, 0.5], [-2.0, 0.5, 6.0]])
    crossed = np.cross(lever[0], np.eye(3)).T  # its columns are v x e
    expected = whole_one - whole_one @ crossed - np.outer(lever, lever)
    assert out.reshape(3, 3) == pytest.approx(expected, abs=1e-12)


def test_root_of_a_matrix_that_rounding_makes_negative_is_no_infinite_weight():
    matrix = np.array(
        [[1.3889342, -0.3848448, -14.6733148], [-0.3848448, 0.1066325, 4.0656713], [-14.6733141, 4.0656709, 155.015]]
    )
    assert np.linalg.eigvalsh(matrix)[0] < 0
    out = np.empty((3, 3))
    _write_root(matrix, out)
    assert np.abs(out).max() < 1e8
