"""Conjugate gradients: true minima, tolerances that are kept, annealing that repeats."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skelgen.stages.classic.conjugate_gradients import (
    DescentParameters,
    Line,
    LineSample,
    brent_step,
    minimise,
    secant_step,
)

METHODS = ("polak-ribiere", "fletcher-reeves")
THOROUGH = {"tolerance": 0.0, "absolute_tolerance": 1e-24, "max_iterations": 2000, "line_tolerance": 1e-6}


def rosenbrock(point):
    x, y = point
    gradient = np.array([-2 * (1 - x) - 400 * x * (y - x**2), 200 * (y - x**2)])
    return float((1 - x) ** 2 + 100 * (y - x**2) ** 2), gradient


def quartic(point):
    """A bowl whose slope along a line is no straight line: a secant does not hit its zero at once."""
    return float((point**4).sum() + ((point - 1) ** 2).sum()), 4 * point**3 + 2 * (point - 1)


@pytest.fixture
def quadratic():
    """A quadratic with condition 100 in 12 unknowns of shape (4, 3), and its minimiser."""
    random = np.random.default_rng(2)
    basis = np.linalg.qr(random.normal(size=(12, 12)))[0]
    matrix = basis * np.geomspace(1, 100, 12) @ basis.T
    solution = random.normal(size=(4, 3)) * 10

    def objective(point):
        slope = matrix @ (point - solution).ravel()
        return float((point - solution).ravel() @ slope / 2), slope.reshape(4, 3)

    return objective, solution


@pytest.mark.parametrize("method", METHODS)
def test_quadratic_is_minimised_in_about_as_many_iterations_as_unknowns(quadratic, method):
    objective, solution = quadratic
    found = minimise(objective, np.zeros((4, 3)), DescentParameters(method=method, **THOROUGH))
    np.testing.assert_allclose(found.point, solution, atol=1e-8)
    assert found.n_iterations <= 3 * solution.size


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("start", [(-1.2, 1.0), (2.0, -2.0)])
def test_rosenbrock_valley_is_followed_to_its_end(method, start):
    found = minimise(rosenbrock, np.array(start), DescentParameters(method=method, **THOROUGH))
    np.testing.assert_allclose(found.point, 1, atol=1e-5)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_line_search_ends_within_its_tolerance(tolerance):
    start = np.array([3.0, -2.0, 1.5])
    value, gradient = quartic(start)
    one_line = DescentParameters(max_iterations=1, line_tolerance=tolerance)
    found = minimise(quartic, start, one_line)
    slope = (quartic(found.point)[1] * gradient).sum() / (gradient**2).sum()
    assert found.value < value
    assert abs(slope) <= 3 * tolerance  # relative to the slope at the start, or to the step's width


def test_looser_tolerance_stops_earlier():
    start = np.array([3.0, -2.0, 1.5])
    loose, tight = (minimise(quartic, start, DescentParameters(tolerance=tolerance)) for tolerance in (0.1, 1e-9))
    assert loose.n_iterations < tight.n_iterations
    assert tight.value <= loose.value


def test_iteration_limit_is_obeyed():
    found = minimise(rosenbrock, np.array([-1.2, 1.0]), DescentParameters(**THOROUGH | {"max_iterations": 4}))
    assert found.n_iterations == 4


def test_value_belongs_to_the_point(quadratic):
    objective, _ = quadratic
    found = minimise(objective, np.ones((4, 3)), DescentParameters(max_iterations=3))
    assert found.value == objective(found.point)[0]


@pytest.mark.parametrize("anneal", [False, True])
def test_start_at_the_minimum_stays_there(quadratic, anneal):
    objective, solution = quadratic
    found = minimise(objective, solution, DescentParameters(anneal=anneal, max_iterations=20))
    np.testing.assert_array_equal(found.point, solution)


def test_start_is_left_alone():
    start = np.array([-1.2, 1.0])
    start.flags.writeable = False
    minimise(rosenbrock, start, DescentParameters())
    np.testing.assert_array_equal(start, [-1.2, 1.0])


def test_annealing_is_decided_by_its_seed():
    shaken = DescentParameters(anneal=True, max_iterations=15, max_jitter=0.1)
    first, again, other = (minimise(rosenbrock, np.array([-1.2, 1.0]), shaken, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.point, again.point)
    assert not np.array_equal(first.point, other.point)


def test_annealing_never_ends_above_its_start():
    wild = DescentParameters(anneal=True, max_iterations=10, max_jitter=50.0)
    assert minimise(rosenbrock, np.array([0.9, 0.8]), wild).value <= rosenbrock((0.9, 0.8))[0]


CURVES = {
    "parabola": (lambda x: (x - 2) ** 2, lambda x: 2 * (x - 2), 2.0),
    "quartic": (lambda x: (x - 2) ** 4 + x, lambda x: 4 * (x - 2) ** 3 + 1, 2 - 0.25 ** (1 / 3)),
    "steep on one side": (lambda x: math.exp(-x) + 0.1 * x, lambda x: 0.1 - math.exp(-x), math.log(10)),
    "waves": (lambda x: x**2 / 50 - math.cos(x - 1), lambda x: x / 25 + math.sin(x - 1), None),
}


def line_of(name):
    value, slope, least = CURVES[name]

    def objective(point):
        return value(float(point[0])), np.array([slope(float(point[0]))])

    return Line(objective, np.zeros(1), np.ones(1), LineSample(0.0, value(0.0), slope(0.0))), least


@pytest.mark.parametrize("name", ["parabola", "quartic", "steep on one side"])
@pytest.mark.parametrize("step", [1e-6, 0.3, 50.0])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-8])
def test_brent_finds_the_minimum_to_its_tolerance(name, step, tolerance):
    line, least = line_of(name)
    found = brent_step(line, step, DescentParameters(line_tolerance=tolerance))
    assert found == pytest.approx(least, rel=4 * tolerance, abs=1e-8)


@pytest.mark.parametrize("search", [brent_step, secant_step])
@pytest.mark.parametrize("step", [1e-6, 0.3, 2.0])
def test_searches_lead_downhill_over_waves(search, step):
    line, _ = line_of("waves")
    assert line.at(search(line, step, DescentParameters())).value < line.start.value


def test_limit_of_iterations_is_obeyed():
    calls = []
    line, _ = line_of("quartic")
    counted = Line(
        lambda point: (calls.append(point), line.objective(point))[1], line.point, line.direction, line.start
    )
    brent_step(counted, 1e-9, DescentParameters(line_iterations=3, line_tolerance=1e-12))
    assert len(calls) <= 2 + 2 * 3 + 3  # the first two, two for each growth of the bracket, one for each step within it
