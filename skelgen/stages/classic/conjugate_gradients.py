"""Nonlinear conjugate gradients: Polak-Ribière or Fletcher-Reeves (Schönauer 2007, 3.6 and 4.5; Shewchuk 1994).

The gradient may be scaled (preconditioned; Shewchuk 1994, B5): then the direction is reset now and then, and the
scaling with it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Floats
from skelgen.stages.classic.line_search import LEAST_STEP, SMALLEST, Line, LineSearch, Objective, Sample, secant_step
from skelgen.stages.classic.parameters import DescentParameters

Scaling = Callable[[Floats], Floats]
"""Turns a gradient into a step uphill of about the right length."""

Precondition = Callable[[Floats], Scaling]
"""The scaling at a point."""

RESET = 20
"""Iterations after which a scaled descent starts anew from its steepest direction."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a descent ended.

    Attributes
    ----------
    point : ndarray
        The minimiser, of the start's shape.
    value : float
        The objective there.
    n_iterations : int
        Iterations taken.
    """

    point: Floats
    value: float
    n_iterations: int


class _Uphill(NamedTuple):
    """A gradient as it is, and scaled."""

    gradient: Floats
    scaled: Floats


def minimise(
    objective: Objective,
    start: Floats,
    parameters: DescentParameters,
    seed: int = 0,
    *,
    search: LineSearch = secant_step,
    precondition: Precondition | None = None,
) -> Minimum:
    """Minimise a smooth function of many variables; with annealing the best of a plain and a shaken descent.

    Parameters
    ----------
    objective : callable
        Returns value and gradient.
    start : ndarray
        First guess, of any shape.
    parameters : DescentParameters
        Direction update, tolerances and limits.
    seed : int
        Seed of the annealing jitter, where that is asked for.
    search : callable
        How the minimum along a direction is found.
    precondition : callable, optional
        Scales gradients.
    """
    calm = replace(parameters, anneal=False)
    plain = _descend(objective, start, calm, search, precondition)
    if not parameters.anneal:
        return plain
    shaken = _descend(objective, start, parameters, search, precondition, np.random.default_rng(seed))
    settled = _descend(objective, shaken.point, calm, search, precondition)
    best = min(plain, settled, key=lambda minimum: minimum.value)
    return replace(best, n_iterations=plain.n_iterations + shaken.n_iterations + settled.n_iterations)


def _descend(
    objective: Objective,
    start: Floats,
    parameters: DescentParameters,
    search: LineSearch,
    precondition: Precondition | None,
    random: np.random.Generator | None = None,
) -> Minimum:
    point = np.array(start, dtype=np.float64)
    value, gradient = objective(point)
    scaling = precondition(point) if precondition else np.asarray
    uphill = _Uphill(gradient, scaling(gradient))
    squares = float((gradient**2).sum())
    # Unscaled, a step that would halve the value of a linear function
    step = 1.0 if precondition else (0.5 * abs(value) / squares if squares > 0 else 1.0)
    direction = -uphill.scaled
    best = Minimum(point, value, 0)
    for iteration in range(1, parameters.max_iterations + 1):
        slope = float((uphill.gradient * direction).sum())
        line = Line(objective, point, direction, Sample(0.0, value, slope))
        step = search(line, max(step, LEAST_STEP), parameters) if slope < 0 else 0.0
        moved = point + step * direction
        if random is not None:
            left = parameters.max_jitter * (1 - iteration / parameters.max_iterations)
            moved = moved + random.uniform(-left, left, moved.shape)
        new_value, gradient = objective(moved)
        drop, point, value = value - new_value, moved, new_value
        if value <= best.value:
            best = Minimum(point, value, iteration)
        if abs(drop) <= parameters.tolerance * abs(value) + parameters.absolute_tolerance and random is None:
            break
        is_reset = precondition is not None and iteration % RESET == 0
        if precondition is not None and is_reset:
            scaling = precondition(point)
        new = _Uphill(gradient, scaling(gradient))
        direction = -new.scaled if is_reset else _next_direction(direction, uphill, new, parameters)
        uphill = new
    return Minimum(best.point, best.value, iteration)


def _next_direction(direction: Floats, old: _Uphill, new: _Uphill, parameters: DescentParameters) -> Floats:
    """Fletcher-Reeves or Polak-Ribiere; back to steepest descent where the direction would not lead downhill."""
    denominator = max(float((old.gradient * old.scaled).sum()), SMALLEST)
    if parameters.method == "fletcher-reeves":
        beta = float((new.gradient * new.scaled).sum()) / denominator
    else:
        beta = max(float((new.scaled * (new.gradient - old.gradient)).sum()) / denominator, 0.0)
    conjugate = -new.scaled + beta * direction
    return conjugate if float((conjugate * new.gradient).sum()) < 0 else -new.scaled
