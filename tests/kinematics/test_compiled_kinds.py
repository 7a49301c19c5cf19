"""What the kind of a joint is told by: the compiled loops do what their NumPy twins do."""

import numpy as np
import pytest

from skelgen.compiling import loops
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics import plain_kinds as plain
from skelgen.kinematics.joints.closed_form import nearest_hinge, nearest_universal
from skelgen.kinematics.joints.joint_type import find_kind
from skelgen.kinematics.joints.rotations import RigidRotation

N_FRAMES = 120


@pytest.fixture(scope="module")
def compiled():
    return pytest.importorskip("skelgen.kinematics.compiled_kinds", reason="numba is not installed")


@pytest.fixture
def turns():
    """Rotations about two axes, some by nearly half a turn, with some noise."""
    random = np.random.default_rng(5)
    first, second = random.uniform(-3.1, 3.1, size=(2, N_FRAMES, 1))
    noise = matrix_from_vector(random.normal(scale=0.01, size=(N_FRAMES, 3)))
    return matrix_from_vector(first * [0.0, 0.6, 0.8]) @ matrix_from_vector(second * [1.0, 0.0, 0.0]) @ noise


@pytest.fixture
def weights():
    roots = np.random.default_rng(6).normal(size=(N_FRAMES, 3, 5))
    return plain.whitened(roots @ roots.swapaxes(1, 2))


@pytest.mark.parametrize("size", [3, 6])
def test_whitening_is_that_of_the_plain_twin(compiled, size):
    roots = np.random.default_rng(7).normal(size=(20, size, 2 * size))
    covariances = roots @ roots.swapaxes(1, 2)
    np.testing.assert_allclose(compiled.whitened(covariances), plain.whitened(covariances), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("kind", ["rigid", "hinge", "universal"])
def test_each_kind_is_linearised_and_eliminated_as_by_the_plain_twin(compiled, turns, weights, kind):
    starts = {
        "rigid": lambda: RigidRotation(turns[0], N_FRAMES),
        "hinge": lambda: nearest_hinge(turns),
        "universal": lambda: nearest_universal(turns),
    }
    parts = starts[kind]().parts()
    ordered = *(np.ascontiguousarray(one) for one in parts[:2]), parts[2], np.ascontiguousarray(parts[3])
    one, other = (twin.linearised(*ordered, turns, weights) for twin in (compiled, plain))
    for left, right in zip(one, other, strict=True):
        np.testing.assert_allclose(left, right, rtol=1e-9, atol=1e-11)
    for left, right in zip(compiled.eliminate(*one), plain.eliminate(*one), strict=True):
        np.testing.assert_allclose(left, right, rtol=1e-9, atol=1e-9 * max(1.0, float(np.abs(right).max(initial=0.0))))


def test_vectors_between_rotations_are_those_of_the_plain_twin(compiled, turns):
    for first in (turns[:3], turns):
        one, other = (twin.relative_vectors(first, turns) for twin in (compiled, plain))
        np.testing.assert_allclose(one, other, atol=1e-12)


@pytest.mark.parametrize("kind", ["rigid", "hinge", "universal"])
def test_each_kind_descends_to_where_the_plain_twin_does(compiled, turns, weights, kind):
    starts = {"rigid": RigidRotation(turns[0], N_FRAMES), "hinge": nearest_hinge(turns)}
    parts = (starts.get(kind) or nearest_universal(turns)).parts()
    ordered = *(np.ascontiguousarray(one) for one in parts[:2]), parts[2], np.ascontiguousarray(parts[3])
    one, other = (twin.descended(*ordered, turns, weights, 8, 1e-4) for twin in (compiled, plain))
    for left, right in zip(one, other, strict=True):
        np.testing.assert_allclose(left, right, atol=1e-9)


def test_axes_alternate_as_in_the_plain_twin(compiled, turns):
    mean = turns.mean(axis=0)
    flat = (turns - mean).reshape(N_FRAMES, 9)
    moments = (flat.T @ flat / N_FRAMES).reshape(3, 3, 3, 3)
    starts = np.eye(3)
    (axes, variances), (plain_axes, plain_variances) = (
        twin.alternated(moments, mean, starts, 4) for twin in (compiled, plain)
    )
    np.testing.assert_allclose(np.abs((axes * plain_axes).sum(axis=1)), 1.0, atol=1e-9)  # either way round
    np.testing.assert_allclose(variances, plain_variances, atol=1e-12)


def test_kind_is_the_same_where_numba_keeps_nothing(turns, monkeypatch):
    covariances = np.tile(1e-4 * np.eye(3), (N_FRAMES, 1, 1))
    found = find_kind(turns, covariances, 30.0)
    loops.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "skelgen.kinematics.compiled_kinds", None)
    plainly = find_kind(turns, covariances, 30.0)
    loops.cache_clear()
    assert found.kind == plainly.kind == "universal"
    np.testing.assert_allclose(found.axis_in_parent, plainly.axis_in_parent, atol=1e-8)
    assert found.type_fits["hinge"].ratio == pytest.approx(plainly.type_fits["hinge"].ratio)
