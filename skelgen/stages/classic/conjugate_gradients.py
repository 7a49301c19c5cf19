"""Nonlinear conjugate gradients: Polak-Ribière or Fletcher-Reeves (Schönauer 2007, 3.6 and 4.5; Shewchuk 1994).

The gradient may be scaled (preconditioned; Shewchuk 1994, B5): then the direction is reset now and then, and the
scaling with it.

Two searches find the least value along a line. `brent_step` brackets the minimum and closes in by Brent's method with
derivatives (Brent 1973, chapter 5; Press et al. 1992, 10.3; Schönauer 2007, 4.5). `secant_step` looks at the derivative
alone and is content with less.

What can be set of them, where they place joints, stands in `DescentParameters` (Schönauer 2007, table 4.16).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from skelgen.model.arrays import Floats
from skelgen.parameters import StageParameters, declare

_NLCG = "JointFinder/NLCG"


@dataclass(frozen=True)
class DescentParameters(StageParameters):
    """The nonlinear conjugate gradient method (Schönauer 2007, table 4.16)."""

    stage: ClassVar[str] = "descent"
    config_section: ClassVar[str] = _NLCG
    retired: ClassVar[Mapping[str, str]] = {"line_zero": f"{_NLCG}/ZEPS", "smallest": f"{_NLCG}/EPS"}
    acts_with: ClassVar[str] = "solver=conjugate-gradient or limbs=small"

    method: str = declare(
        "polak-ribiere",
        "classic method: how the next search direction is made conjugate",
        choices=("fletcher-reeves", "polak-ribiere"),
        config_name="METHOD",
        config_codes=("fletcher-reeves", "polak-ribiere"),
    )
    tolerance: float = declare(
        1e-6,
        "classic method: stop when a step lowers the cost by less than this part",
        within=(0.0, 0.1),
        config_name="FTOL",
    )
    absolute_tolerance: float = declare(
        1e-10,
        "classic method: stop when a step lowers the cost by less than this",
        unit="mm^2",
        within=(0.0, 1e6),
        config_name="EPSBREAK",
    )
    max_iterations: int = declare(
        200, "classic method: stop after so many iterations", within=(1, 100000), config_name="ITMAX"
    )
    step_limit: float = declare(
        100.0, "classic method: a bracket grows at most by this factor at once", within=(1.1, 1e6), config_name="GLIMIT"
    )
    line_iterations: int = declare(
        100, "classic method: iterations of a line search", within=(1, 100000), config_name="ITMAXDBRENT"
    )
    line_tolerance: float = declare(
        1e-3, "classic method: relative width at which a line search stops", within=(1e-15, 0.5), config_name="TOLBRENT"
    )
    anneal: bool = declare(
        False, "classic method: shake the joint while it is optimised, less and less", config_name="ADDRANDOM"
    )
    max_jitter: float = declare(
        1.0,
        "classic method: largest shake in the first iteration",
        unit="mm",
        within=(0.0, 1e3),
        config_name="MAXJITTER",
        acts_with="solver=conjugate-gradient and anneal=yes or limbs=small and anneal=yes",
    )


Scaling = Callable[[Floats], Floats]
"""Turns a gradient into a step uphill of about the right length."""

Precondition = Callable[[Floats], Scaling]
"""The scaling at a point."""

SMALLEST = 1e-20
"""A denominator below this counts as zero."""

LEAST_STEP = 1e-12
"""Steps along a line below this count as zero."""

GROWTH = 2.0
"""A bracket of the secant search at least doubles while the slope stays downhill."""

GOLDEN = (1 + math.sqrt(5)) / 2
"""By this Brent's bracket grows where no parabola says better."""


class LineSample(NamedTuple):
    """Value and slope at one step along a line."""

    step: float
    value: float
    slope: float


@dataclass(frozen=True, eq=False)
class Line:
    """A function of many variables along one direction.

    Attributes
    ----------
    objective : callable
        Value and gradient at a point.
    point, direction : ndarray
        Where the line starts and leads.
    start : LineSample
        At step 0.
    """

    objective: Objective
    point: Floats
    direction: Floats
    start: LineSample

    def at(self, step: float) -> LineSample:
        """Value and slope at a step."""
        value, gradient = self.objective(self.point + step * self.direction)
        return LineSample(step, value, float((gradient * self.direction).sum()))


LineSearch = Callable[[Line, float, DescentParameters], float]
"""Takes a line that leads downhill, a first step and the limits; returns the step to its minimum."""


def brent_step(line: Line, step: float, parameters: DescentParameters) -> float:
    """Bracket the minimum of a line, then close in by Brent's method with derivatives.

    Parameters
    ----------
    line : Line
        It leads downhill.
    step : float
        First step.
    parameters : DescentParameters
        Its `step_limit`, `line_iterations` and `line_tolerance`.
    """
    one, best, other = _bracket_by_values(line, step, parameters)
    low, high = min(one.step, other.step), max(one.step, other.step)
    second = third = best
    last = before = 0.0
    for _ in range(parameters.line_iterations):
        middle = (low + high) / 2
        least = parameters.line_tolerance * abs(best.step) + LEAST_STEP
        if abs(best.step - middle) <= 2 * least - (high - low) / 2:
            break
        before, last = last, _brent_move(best, (second, third), (low, high), before if abs(before) > least else 0.0)
        is_least = abs(last) < least
        tried = line.at(best.step + (math.copysign(least, last) if is_least else last))
        if tried.value <= best.value:
            low, high = (best.step, high) if tried.step >= best.step else (low, best.step)
            best, second, third = tried, best, second
        elif is_least:
            break
        else:
            low, high = (tried.step, high) if tried.step < best.step else (low, tried.step)
            if tried.value <= second.value or second is best:
                second, third = tried, second
            elif tried.value < third.value or third in (best, second):
                third = tried
    return best.step


def _brent_move(
    best: LineSample, others: tuple[LineSample, LineSample], bounds: tuple[float, float], before: float
) -> float:
    """The shorter secant step that stays within the bounds and shrinks fast enough, else half of the downhill part."""
    low, high = bounds
    secants = [
        (other.step - best.step) * best.slope / (best.slope - other.slope)
        for other in others
        if other.slope != best.slope
    ]
    downhill = [move for move in secants if low < best.step + move < high and best.slope * move <= 0]
    shortest = min(downhill, key=abs, default=math.inf)
    if abs(shortest) <= abs(before) / 2:
        return shortest
    return ((low if best.slope >= 0 else high) - best.step) / 2


def _bracket_by_values(
    line: Line, step: float, parameters: DescentParameters
) -> tuple[LineSample, LineSample, LineSample]:
    """Three samples of which the middle one is lowest: by parabolas, within the limits (Press et al. 1992, 10.1)."""
    low, middle = line.start, line.at(step)
    if middle.value > low.value or not math.isfinite(middle.value):
        low, middle = middle, low
    high = line.at(middle.step + GOLDEN * (middle.step - low.step))
    for _ in range(parameters.line_iterations):
        if middle.value <= high.value:
            break
        reach = high.step - middle.step
        at = _parabola(low, middle, high)
        between = (at - middle.step) * (high.step - at) > 0
        longest = middle.step + parameters.step_limit * reach
        if (at - middle.step) * reach <= 0 or not math.isfinite(at):
            at = high.step + GOLDEN * reach
        elif abs(at - middle.step) > abs(longest - middle.step):
            at = longest
        tried = line.at(at)
        if between and tried.value < high.value:
            return middle, tried, high
        if between and tried.value > middle.value:
            return low, middle, tried
        if between:
            tried = line.at(high.step + GOLDEN * reach)
        low, middle, high = middle, high, tried
    return low, middle, high


def _parabola(low: LineSample, middle: LineSample, high: LineSample) -> float:
    """The step at which the parabola through three samples has its extremum; infinite for a straight line."""
    one = (middle.step - low.step) * (middle.value - high.value)
    two = (middle.step - high.step) * (middle.value - low.value)
    if one == two:
        return math.inf
    return middle.step - ((middle.step - high.step) * two - (middle.step - low.step) * one) / (2 * (two - one))


def secant_step(line: Line, step: float, parameters: DescentParameters) -> float:
    """Find the zero of the slope along a line: bracket it, then close in by secants.

    Parameters
    ----------
    line : Line
        It leads downhill.
    step : float
        First step.
    parameters : DescentParameters
        Its `step_limit`, `line_iterations` and `line_tolerance`.
    """
    low, high = line.start, line.at(step)
    for _ in range(parameters.line_iterations):
        if high.slope >= 0 or not math.isfinite(high.slope):
            break
        bend = high.slope - low.slope
        predicted = high.step - high.slope * (high.step - low.step) / bend if bend > 0 else math.inf
        longest = high.step * parameters.step_limit
        low, high = high, line.at(min(max(predicted, GROWTH * high.step), longest))
    if high.slope < 0:
        return high.step
    for _ in range(parameters.line_iterations):
        width = high.step - low.step
        if width <= parameters.line_tolerance * high.step + LEAST_STEP:
            break
        middle = low.step - low.slope * width / max(high.slope - low.slope, SMALLEST)
        margin = 0.05 * width
        tried = line.at(min(max(middle, low.step + margin), high.step - margin))
        if abs(tried.slope) <= parameters.line_tolerance * min(-low.slope, high.slope):
            return tried.step
        low, high = (tried, high) if tried.slope < 0 else (low, tried)
    return low.step if -low.slope < high.slope else high.step


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
    unshaken = replace(parameters, anneal=False)
    plain = _descend(objective, start, unshaken, search, precondition)
    if not parameters.anneal:
        return plain
    shaken = _descend(objective, start, parameters, search, precondition, np.random.default_rng(seed))
    descended = _descend(objective, shaken.point, unshaken, search, precondition)
    best = min(plain, descended, key=lambda minimum: minimum.value)
    return replace(best, n_iterations=plain.n_iterations + shaken.n_iterations + descended.n_iterations)


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
        line = Line(objective, point, direction, LineSample(0.0, value, slope))
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


Objective = Callable[[Floats], tuple[float, Floats]]
"""Value and gradient at a point; the gradient has the point's shape."""
