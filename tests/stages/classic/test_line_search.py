"""Line searches: Brent's method with derivatives finds the least value, from first steps of any length."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skelgen.stages.classic.line_search import Line, Sample, brent_step, secant_step
from skelgen.stages.classic.parameters import DescentParameters

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

    return Line(objective, np.zeros(1), np.ones(1), Sample(0.0, value(0.0), slope(0.0))), least


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
