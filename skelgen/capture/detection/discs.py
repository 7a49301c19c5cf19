"""Blurred discs fitted to the grey values of a spot: balls that touch, and balls that the image's border cuts.

This is the plain twin of `compiled_discs`.

Disc i covers the part q_i = Phi((r_i - |p - c_i|) / w) of a pixel at p: its edge is blurred by w. All discs together
cover 1 - prod (1 - q_i) of it, and what is covered is as bright as the discs in the mean, weighted by their parts.
Levenberg and Marquardt's method finds centres, radii and brightnesses a_i from all pixels at once, so that the centres
are as certain as the pixels make them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats

PER_DISC = 4
"""Numbers of a disc: x, y, radius, brightness. The width of all edges comes last."""

TINY = 1e-12
"""Part of a pixel, or distance [px], below which nothing is divided by it."""

FIRST_WIDTH = 0.6
"""Width [px] that the fit starts from: the blur of a lens, sharpened by the thresholds."""

MAX_STEPS = 25
PATIENCE, FAR_OFF = 5, 4.0  # steps after which, and square of the limit from which, a fit is given up
SETTLED = 3e-3  # px: the step after one below it, and no centre changes by a tenth of that
FIRST_DAMPING, LESS, MORE, MOST_DAMPING = 1e-3, 0.2, 8.0, 1e6
WIDTHS = (0.15, 3.0)  # px: sharper than a pixel shows, and blurred beyond use


@dataclass(frozen=True, eq=False)
class Discs:
    """Fitted discs.

    Attributes
    ----------
    centres : ndarray, shape (n_discs, 2), px
        In the window: pixel (0, 0) is its first.
    radii : ndarray, shape (n_discs,), px
        Radii.
    brightness : ndarray, shape (n_discs,)
        1 is the upper threshold.
    std : ndarray, shape (n_discs,), px
        Standard deviation of a centre along one axis, from the residuals.
    width : float, px
        Width of all edges.
    rms : float
        Root mean square residual; 1 is the upper threshold.
    """

    centres: Floats
    radii: Floats
    brightness: Floats
    std: Floats
    width: float
    rms: float


def fit_discs(window: Floats, centres: Floats, radii: Floats, limit: float = np.inf) -> Discs | None:
    """Fit discs to the pixels of a window.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        Brightness between the thresholds, 0 .. 1; NaN for pixels that belong to others.
    centres : ndarray, shape (n_discs, 2), px
        Where the discs are at first.
    radii : ndarray, shape (n_discs,), px
        How large they are at first.
    limit : float
        Root mean square residual that is wanted; a fit that is still far from it after some steps is given up.

    Returns
    -------
    Discs or None
        None where the pixels do not determine the discs, or the fit was given up.
    """
    peak = float(np.nanmax(window))
    discs = np.column_stack([centres, radii, np.full(len(radii), peak)])
    unknowns = np.append(discs.ravel(), FIRST_WIDTH)
    normal, slope, cost, n_pixels = normal_equations(window, unknowns)
    damping = FIRST_DAMPING
    for n_steps in range(MAX_STEPS):
        step = _solved(normal + damping * np.diag(np.diag(normal) + TINY), -slope)
        if step is None:
            return None
        tried = _bounded(unknowns + step)
        is_settled = np.abs(tried - unknowns).max() < SETTLED
        next_normal, next_slope, next_cost, _ = normal_equations(window, tried)
        if next_cost < cost:
            unknowns, normal, slope, cost = tried, next_normal, next_slope, next_cost
            damping *= LESS
        else:
            damping *= MORE
        if is_settled or damping > MOST_DAMPING:
            break
        if n_steps >= PATIENCE and cost > FAR_OFF * limit**2 * n_pixels:
            return None
    return _discs(unknowns, normal, cost, n_pixels)


def normal_equations(window: Floats, unknowns: Floats) -> tuple[Floats, Floats, float, int]:
    """Return J^T J, J^T residual, the sum of squared residuals and the number of pixels.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        Brightness; NaN pixels do not count.
    unknowns : ndarray, shape (n_discs * `PER_DISC` + 1,)
        The discs and the width of their edges.
    """
    from scipy.special import ndtr  # noqa: PLC0415 - the compiled twin needs none of it

    rows, columns = np.nonzero(np.isfinite(window))
    x, y, radius, level = unknowns[:-1].reshape(-1, PER_DISC).T
    width = unknowns[-1]
    across, down = columns[:, np.newaxis] - x, rows[:, np.newaxis] - y
    distance = np.maximum(np.hypot(across, down), TINY)
    depth = (radius - distance) / width
    part = np.maximum(ndtr(depth), TINY)
    rise = np.exp(-(depth**2) / 2) / np.sqrt(2 * np.pi) / width
    free = np.maximum(1.0 - part, TINY)
    covered, total = 1.0 - free.prod(axis=1, keepdims=True), part.sum(axis=1, keepdims=True)
    mean = (part @ level)[:, np.newaxis] / total
    by_part = (1.0 - covered) / free * mean + covered * (level - mean) / total
    jacobian = np.empty((len(rows), len(unknowns)))
    jacobian[:, :-1:PER_DISC] = by_part * rise * across / distance
    jacobian[:, 1:-1:PER_DISC] = by_part * rise * down / distance
    jacobian[:, 2:-1:PER_DISC] = by_part * rise
    jacobian[:, 3:-1:PER_DISC] = covered * part / total
    jacobian[:, -1] = -(by_part * rise * depth).sum(axis=1)
    residual = (covered * mean)[:, 0] - window[rows, columns]
    return jacobian.T @ jacobian, jacobian.T @ residual, float(residual @ residual), len(rows)


def _solved(matrix: Floats, vector: Floats) -> Floats | None:
    """What a symmetric matrix takes to a vector, or None if the matrix is not positive."""
    try:
        np.linalg.cholesky(matrix)
        return np.asarray(np.linalg.solve(matrix, vector))
    except np.linalg.LinAlgError:
        return None


def _bounded(unknowns: Floats) -> Floats:
    unknowns[-1] = min(max(unknowns[-1], WIDTHS[0]), WIDTHS[1])
    unknowns[2:-1:PER_DISC] = np.maximum(unknowns[2:-1:PER_DISC], WIDTHS[0])
    return unknowns


def _discs(unknowns: Floats, normal: Floats, cost: float, n_pixels: int) -> Discs | None:
    n_free = n_pixels - len(unknowns)
    if n_free <= 0 or not np.isfinite(unknowns).all():
        return None
    covariance = _solved(normal, np.eye(len(unknowns)))
    if covariance is None:
        return None
    variances = np.maximum(np.diag(covariance) * cost / n_free, 0.0)[:-1].reshape(-1, PER_DISC)
    discs = unknowns[:-1].reshape(-1, PER_DISC)
    std = np.sqrt(variances[:, :2].mean(axis=1))
    return Discs(discs[:, :2], discs[:, 2], discs[:, 3], std, float(unknowns[-1]), float(np.sqrt(cost / n_free)))
