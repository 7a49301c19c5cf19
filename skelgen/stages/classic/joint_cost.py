r"""The joint cost: how constant the distances from a joint to the markers of its two limbs are (Schönauer 2007, 3.5).

.. math::
    jc = \frac1n \sum_m \left[ \frac1{|F_m|} \sum_{f \in F_m} (d_{mf} - \bar d_m)^2 + \alpha\, \bar d_m \right],
    \qquad d_{mf} = |c_f - x_{mf}|

with one joint position :math:`c_f` per frame, the n markers of both limbs, and the frames :math:`F_m` that show
marker m.

Its minimum over all frames is found by nonlinear conjugate gradients with a bracketing line search on derivatives
(Schönauer 2007, 3.6; Shewchuk 1994).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.ball_joint import mean_distances
from skelgen.model.arrays import Floats
from skelgen.parameters import StageParameters, declare

TINY = 1e-12
"""mm; keeps the gradient finite for a joint that sits on a marker."""

LOCAL_STEPS = 30
LOCAL_DAMPING = 1e-3
DAMPING_RANGE = (1e-9, 1e9)
LOCAL_TOLERANCE = 1e-7
"""mm; a frame is settled when its joint moves less."""
Objective = Callable[[Floats], tuple[float, Floats]]
"""Value and gradient at a point; the gradient has the point's shape."""

SMALLEST = 1e-20
"""A denominator below this counts as zero."""

LEAST_STEP = 1e-12
"""Steps along a line below this count as zero."""

GROWTH = 2.0
"""A bracket at least doubles while the slope stays downhill."""

_NLCG = "JointFinder/NLCG"


def joint_cost(markers: Floats, alpha: float) -> Objective:
    """Return the joint cost as a function of the joint's positions.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    alpha : float
        Weight of the mean distance [mm].

    Returns
    -------
    callable
        Takes positions [mm], shape (n_frames, 3); returns cost [mm^2] and gradient [mm], shape (n_frames, 3).
    """
    seen = ~np.isnan(markers[:, :, 0])
    filled = np.where(seen[..., np.newaxis], markers, 0.0)
    weight = seen / np.maximum(seen.sum(axis=0), 1)
    n_markers = max(int(seen.any(axis=0).sum()), 1)

    def cost(joint: Floats) -> tuple[float, Floats]:
        offset = joint[:, np.newaxis] - filled
        distance = np.sqrt(np.einsum("fmi,fmi->fm", offset, offset)) + TINY
        mean = (distance * weight).sum(axis=0)
        deviation = distance - mean
        value = ((deviation**2 * weight).sum() + alpha * mean.sum()) / n_markers
        factor = weight * (2 * deviation + alpha) / distance / n_markers
        return float(value), np.einsum("fm,fmi->fi", factor, offset)

    return cost


def local_optimum(joint: Floats, markers: Floats, max_residual: float, max_fallback: int) -> Floats:
    """Move the joint in every frame to where its distances to the markers are nearest to their means.

    This is the local optimisation of Schönauer (2007, 3.5.2). The frames are independent: all are solved at once by
    damped Gauss-Newton steps on three unknowns each. A frame that ends above `max_residual` is tried again from the
    positions of up to `max_fallback` earlier frames.

    Parameters
    ----------
    joint : ndarray, shape (n_frames, 3), mm
        Positions from the global optimisation.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    max_residual : float, mm^2
        Mean squared error of the distances above which a frame is solved again.
    max_fallback : int
        From how many frames back it may start then.
    """
    radii, _ = mean_distances(*contiguous(joint, markers))
    settled, cost = _multilaterate(joint, markers, radii)
    for back in range(1, max_fallback + 1):
        bad = np.flatnonzero(cost > max_residual)
        bad = bad[bad >= back]
        if not len(bad):
            break
        again, new_cost = _multilaterate(settled[bad - back], markers[bad], radii)
        better = new_cost < cost[bad]
        settled[bad[better]], cost[bad[better]] = again[better], new_cost[better]
    return settled


def _multilaterate(joint: Floats, markers: Floats, radii: Floats) -> tuple[Floats, Floats]:
    """Positions and mean squared distance error [mm^2] per frame."""
    seen = ~np.isnan(markers[:, :, 0])
    filled = np.where(seen[..., np.newaxis], markers, 0.0)
    count = np.maximum(seen.sum(axis=1), 1)
    point = joint.copy()

    def residuals(at: Floats) -> tuple[Floats, Floats]:
        offset = at[:, np.newaxis] - filled
        distance = np.linalg.norm(offset, axis=2) + TINY
        return (distance - radii) * seen, offset / distance[..., np.newaxis] * seen[..., np.newaxis]

    error, slope = residuals(point)
    damping = np.full(len(point), LOCAL_DAMPING)
    for _ in range(LOCAL_STEPS):
        normal = np.einsum("fmi,fmj->fij", slope, slope) + damping[:, np.newaxis, np.newaxis] * np.eye(3)
        step = -np.linalg.solve(normal, np.einsum("fmi,fm->fi", slope, error)[..., np.newaxis])[..., 0]
        new_error, new_slope = residuals(point + step)
        better = (new_error**2).sum(axis=1) <= (error**2).sum(axis=1)
        point = np.where(better[:, np.newaxis], point + step, point)
        error = np.where(better[:, np.newaxis], new_error, error)
        slope = np.where(better[:, np.newaxis, np.newaxis], new_slope, slope)
        damping = np.clip(np.where(better, damping / 5, damping * 10), *DAMPING_RANGE)
        if np.abs(step[better]).max(initial=0.0) < LOCAL_TOLERANCE:
            break
    return point, (error**2).sum(axis=1) / count


@dataclass(frozen=True)
class DescentParameters(StageParameters):
    """The nonlinear conjugate gradient method (Schönauer 2007, table 4.16)."""

    stage: ClassVar[str] = "descent"
    config_section: ClassVar[str] = _NLCG
    retired: ClassVar[Mapping[str, str]] = {"line_zero": f"{_NLCG}/ZEPS", "smallest": f"{_NLCG}/EPS"}
    acts_with: ClassVar[str] = "solver=conjugate-gradient or limbs=small"

    method: str = declare(
        "polak-ribiere",
        "how the next search direction is made conjugate",
        choices=("fletcher-reeves", "polak-ribiere"),
        config_name="METHOD",
        config_codes=("fletcher-reeves", "polak-ribiere"),
    )
    tolerance: float = declare(
        1e-6, "stop when a step lowers the cost by less than this part", within=(0.0, 0.1), config_name="FTOL"
    )
    absolute_tolerance: float = declare(
        1e-10,
        "stop when a step lowers the cost by less than this",
        unit="mm^2",
        within=(0.0, 1e6),
        config_name="EPSBREAK",
    )
    max_iterations: int = declare(200, "stop after so many iterations", within=(1, 100000), config_name="ITMAX")
    step_limit: float = declare(
        100.0, "a bracket grows at most by this factor at once", within=(1.1, 1e6), config_name="GLIMIT"
    )
    line_iterations: int = declare(100, "iterations of a line search", within=(1, 100000), config_name="ITMAXDBRENT")
    line_tolerance: float = declare(
        1e-3, "relative width at which a line search stops", within=(1e-15, 0.5), config_name="TOLBRENT"
    )
    anneal: bool = declare(False, "shake the joint while it is optimised, less and less", config_name="ADDRANDOM")
    max_jitter: float = declare(
        1.0,
        "largest shake in the first iteration",
        unit="mm",
        within=(0.0, 1e3),
        config_name="MAXJITTER",
        acts_with="solver=conjugate-gradient and anneal=yes or limbs=small and anneal=yes",
    )


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


def minimise(objective: Objective, start: Floats, parameters: DescentParameters, seed: int = 0) -> Minimum:
    """Minimise a smooth function of many variables.

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
    """
    random = np.random.default_rng(seed) if parameters.anneal else None
    point = np.array(start, dtype=np.float64)
    value, gradient = objective(point)
    # A step that would halve the value of a linear function
    squares = float((gradient**2).sum())
    direction, step = -gradient, (0.5 * abs(value) / squares if squares > 0 else 1.0)
    best = Minimum(point, value, 0)
    for iteration in range(1, parameters.max_iterations + 1):
        step = _line_minimum(objective, point, direction, gradient, step, parameters)
        moved = point + step * direction
        if random is not None:
            left = parameters.max_jitter * (1 - iteration / parameters.max_iterations)
            moved = moved + random.uniform(-left, left, moved.shape)
        new_value, new_gradient = objective(moved)
        drop, point, value = value - new_value, moved, new_value
        if value <= best.value:
            best = Minimum(point, value, iteration)
        settled = abs(drop) <= parameters.tolerance * abs(value) + parameters.absolute_tolerance
        if settled and random is None:
            break
        direction = _next_direction(direction, gradient, new_gradient, parameters)
        gradient = new_gradient
    return Minimum(best.point, best.value, iteration)


def _next_direction(direction: Floats, old: Floats, new: Floats, parameters: DescentParameters) -> Floats:
    """Fletcher-Reeves or Polak-Ribiere; back to steepest descent where the direction would not lead downhill."""
    denominator = max(float((old * old).sum()), SMALLEST)
    if parameters.method == "fletcher-reeves":
        beta = float((new * new).sum()) / denominator
    else:
        beta = max(float((new * (new - old)).sum()) / denominator, 0.0)
    conjugate = -new + beta * direction
    return conjugate if float((conjugate * new).sum()) < 0 else -new


def _line_minimum(
    objective: Objective, point: Floats, direction: Floats, gradient: Floats, step: float, parameters: DescentParameters
) -> float:
    """Find the zero of the slope along a direction: bracket it, then close in."""
    slope_at_zero = float((gradient * direction).sum())
    if slope_at_zero >= 0:
        return 0.0

    def slope(at: float) -> float:
        return float((objective(point + at * direction)[1] * direction).sum())

    low, slope_low, high, slope_high = _bracket(slope, slope_at_zero, max(step, LEAST_STEP), parameters)
    return _slope_zero(slope, low, slope_low, high, slope_high, parameters)


def _bracket(
    slope: Callable[[float], float], slope_at_zero: float, step: float, parameters: DescentParameters
) -> tuple[float, float, float, float]:
    """Grow a step until the slope along it turns upward: by the secant's prediction, within the limits."""
    low, slope_low, high = 0.0, slope_at_zero, step
    slope_high = slope(high)
    for _ in range(parameters.line_iterations):
        if slope_high >= 0 or not np.isfinite(slope_high):
            break
        bend = slope_high - slope_low
        predicted = high - slope_high * (high - low) / bend if bend > 0 else np.inf
        longest = high * parameters.step_limit
        low, slope_low, high = high, slope_high, float(np.clip(predicted, GROWTH * high, longest))
        slope_high = slope(high)
    return low, slope_low, high, slope_high


def _slope_zero(
    slope: Callable[[float], float],
    low: float,
    slope_low: float,
    high: float,
    slope_high: float,
    parameters: DescentParameters,
) -> float:
    """Close in on the zero of a slope by secant steps, by bisection where they stall (as Brent's method does)."""
    if slope_high < 0:
        return high
    for _ in range(parameters.line_iterations):
        width = high - low
        if width <= parameters.line_tolerance * high + LEAST_STEP:
            break
        middle = low - slope_low * width / max(slope_high - slope_low, SMALLEST)
        margin = 0.05 * width
        middle = float(np.clip(middle, low + margin, high - margin))
        slope_middle = slope(middle)
        if abs(slope_middle) <= parameters.line_tolerance * min(-slope_low, slope_high):
            return middle
        if slope_middle < 0:
            low, slope_low = middle, slope_middle
        else:
            high, slope_high = middle, slope_middle
    return low if -slope_low < slope_high else high
