"""Blurred discs fitted to the grey values of a spot: balls that touch, and balls that the image's border cuts.

Disc i covers the part q_i = Phi((r_i - |p - c_i|) / w) of a pixel at p: its edge is blurred by w. All discs together
cover 1 - prod (1 - q_i) of it, and what is covered is as bright as the discs in the mean, weighted by their parts.
Levenberg and Marquardt's method finds centres, radii and brightnesses a_i from all pixels at once, so that the centres
are as certain as the pixels make them.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import array_kernel, array_part, kernel_part
from skelgen._kernels.least_squares import factorise, solve
from skelgen.model.arrays import Floats

X, Y, RADIUS, BRIGHTNESS, STD = range(5)
"""Columns of a table of discs. A guess has the first three; the unknowns of a fit are the first four of each disc, one
disc after the other, and then the width of all edges."""

N_UNKNOWNS = 4  # of a disc

TINY = 1e-12
"""Part of a pixel, or distance [px], below which nothing is divided by it."""

FIRST_WIDTH = 0.6
"""Width [px] that the fit starts from: the blur of a lens, sharpened by the thresholds."""

MIN_WIDTH, MAX_WIDTH = 0.15, 3.0  # px: sharper than a pixel shows, and blurred beyond use
MAX_STEPS = 25
PATIENCE, FAR_OFF = 5, 4.0  # steps after which, and square of the limit from which, a fit is given up
SMALL_STEP = 3e-3  # px: the step after one below it changes no centre by a tenth of that
FIRST_DAMPING, LESS, MORE, MAX_DAMPING = 1e-3, 0.2, 8.0, 1e6

_FAR = 5.0  # standard deviations: 3e-7 is left
_NORMAL_PEAK = 1.0 / math.sqrt(2.0 * math.pi)
_NO_SLOPE = 1e-9  # derivative: brightness by a pixel or by a part of itself
_OUTSIDE, _WITHIN, _AT_EDGE = -1, 0, 1  # where a pixel lies: out of all discs, within one alone, at an edge

Fit = tuple[Floats, float, float]
"""Table of discs, width of their edges [px], and the root mean square of what they leave; the latter is infinite if the
fit was given up."""


@array_kernel
def fit_discs(window: Floats, guess: Floats, limit: float) -> Fit:
    """Fit discs to the pixels of a window.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        Brightness between the thresholds, 0 .. 1; NaN for pixels that belong to others.
    guess : ndarray, shape (n_discs, 3), px
        x, y and radius at first.
    limit : float
        Root mean square residual that is wanted; a fit that is still far from it after some steps is given up.

    Returns
    -------
    discs : ndarray, shape (n_discs, 5)
        By the columns above: x, y, radius [px], brightness, standard deviation of the centre along one axis [px].
    width : float, px
        Width of all edges.
    rms : float
        Root mean square residual; infinite where the pixels do not determine the discs, or the fit was given up.
    """
    unknowns = _first_unknowns(window, guess)
    n = len(unknowns)
    tried, step = unknowns.copy(), np.empty(n)
    normal, slope, cost, n_pixels = normal_equations(window, unknowns)
    damping = FIRST_DAMPING
    for n_steps in range(MAX_STEPS):
        damped = normal.copy()
        for i in range(n):
            damped[i, i] += damping * (normal[i, i] + TINY)
            step[i] = -slope[i]
        if not factorise(damped):
            return guess, 0.0, math.inf
        solve(damped, step)
        longest = _take_step(unknowns, step, tried)
        next_normal, next_slope, next_cost, _ = normal_equations(window, tried)
        if next_cost < cost:
            unknowns[:] = tried
            normal, slope, cost = next_normal, next_slope, next_cost
            damping *= LESS
        else:
            damping *= MORE
        if longest < SMALL_STEP or damping > MAX_DAMPING:
            break
        if n_steps >= PATIENCE and cost > FAR_OFF * limit * limit * n_pixels:
            return guess, 0.0, math.inf
    return _fit_with_deviations(unknowns, normal, cost, n_pixels)


@array_part
def _first_unknowns(window: Floats, guess: Floats) -> Floats:
    """Return the unknowns that a fit starts from."""
    peak = 0.0
    for y in range(window.shape[0]):
        for x in range(window.shape[1]):
            if math.isfinite(window[y, x]):
                peak = max(peak, window[y, x])
    unknowns = np.empty(N_UNKNOWNS * len(guess) + 1)
    for disc in range(len(guess)):
        for column in range(3):
            unknowns[N_UNKNOWNS * disc + column] = guess[disc, column]
        unknowns[N_UNKNOWNS * disc + BRIGHTNESS] = peak
    unknowns[-1] = FIRST_WIDTH
    return unknowns


@kernel_part
def _take_step(unknowns: Floats, step: Floats, tried: Floats) -> float:
    """Fill the unknowns after a step, within their bounds; return the largest change."""
    longest, last = 0.0, len(unknowns) - 1
    for i in range(len(unknowns)):
        value = unknowns[i] + step[i]
        if i == last:
            value = min(max(value, MIN_WIDTH), MAX_WIDTH)
        elif i % N_UNKNOWNS == RADIUS:
            value = max(value, MIN_WIDTH)
        tried[i] = value
        longest = max(longest, abs(value - unknowns[i]))
    return longest


@array_part
def _fit_with_deviations(unknowns: Floats, normal: Floats, cost: float, n_pixels: int) -> Fit:
    """Return the discs with the deviations of their centres."""
    n_discs, n_free = len(unknowns) // N_UNKNOWNS, n_pixels - len(unknowns)
    discs, column = np.empty((n_discs, 5)), np.empty(len(unknowns))
    is_finite = True
    for i in range(len(unknowns)):
        is_finite &= math.isfinite(unknowns[i])
    if n_free <= 0 or not is_finite or not factorise(normal):
        return discs, 0.0, math.inf
    for disc in range(n_discs):
        variance = 0.0
        for axis in range(2):
            place = N_UNKNOWNS * disc + axis
            column[:] = 0.0
            column[place] = 1.0
            solve(normal, column)
            variance += max(column[place], 0.0) * cost / n_free / 2.0
        for i in range(N_UNKNOWNS):
            discs[disc, i] = unknowns[N_UNKNOWNS * disc + i]
        discs[disc, STD] = math.sqrt(variance)
    return discs, unknowns[-1], math.sqrt(cost / n_free)


@array_kernel
def normal_equations(window: Floats, unknowns: Floats) -> tuple[Floats, Floats, float, int]:
    """Return J^T J, J^T residual, the sum of squared residuals and the number of pixels.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        Brightness; NaN pixels do not count.
    unknowns : ndarray, shape (4 n_discs + 1,)
        The discs and the width of their edges.
    """
    n_unknowns = len(unknowns)
    normal, slope, row = np.zeros((n_unknowns, n_unknowns)), np.zeros(n_unknowns), np.empty(n_unknowns)
    used, cost, n_pixels = np.empty(n_unknowns, dtype=np.intp), 0.0, 0
    for y in range(window.shape[0]):
        for x in range(window.shape[1]):
            if math.isnan(window[y, x]):
                continue
            n_pixels += 1
            where, disc = _place(unknowns, x, y)
            if where == _OUTSIDE:
                cost += window[y, x] * window[y, x]
                continue
            if where == _WITHIN:  # only its brightness counts
                place = N_UNKNOWNS * disc + BRIGHTNESS
                residual = unknowns[place] - window[y, x]
                cost += residual * residual
                slope[place] += residual
                normal[place, place] += 1.0
                continue
            residual = _derivatives(unknowns, x, y, row) - window[y, x]
            cost += residual * residual
            n_used = 0
            for i in range(n_unknowns):
                if abs(row[i]) > _NO_SLOPE:  # most pixels are far from most discs, or wholly inside one
                    used[n_used] = i
                    n_used += 1
            for a in range(n_used):
                i = used[a]
                slope[i] += row[i] * residual
                for b in range(a + 1):
                    normal[i, used[b]] += row[i] * row[used[b]]
    for i in range(n_unknowns):
        for j in range(i):
            normal[j, i] = normal[i, j]
    return normal, slope, cost, n_pixels


@kernel_part
def _place(unknowns: Floats, x: int, y: int) -> tuple[int, int]:
    """Return where a pixel lies, and in which disc; where several overlap, their edges may count."""
    reach, where, within = _FAR * unknowns[-1], _OUTSIDE, -1
    for first in range(0, len(unknowns) - 1, N_UNKNOWNS):
        across, down, radius = x - unknowns[first], y - unknowns[first + 1], unknowns[first + 2]
        squared = across * across + down * down
        if squared >= (radius + reach) * (radius + reach):
            continue
        if where == _WITHIN or radius <= reach or squared > (radius - reach) * (radius - reach):
            return _AT_EDGE, -1
        where, within = _WITHIN, first // N_UNKNOWNS
    return where, within


@kernel_part
def _depth(across: float, down: float, radius: float, width: float) -> tuple[float, float]:
    """Return the distance of a pixel from a disc's centre, and how deep it lies in the disc in widths of the edge.

    Beyond `_FAR` widths from the edge, where most pixels are, both are stand-ins that need no root.
    """
    squared, reach = across * across + down * down, _FAR * width
    if squared >= (radius + reach) * (radius + reach):
        return 1.0, -2.0 * _FAR
    if radius > reach and squared <= (radius - reach) * (radius - reach):
        return 1.0, 2.0 * _FAR
    distance = max(math.sqrt(squared), TINY)
    return distance, (radius - distance) / width


@kernel_part
def _part_covered(depth: float) -> float:
    """Return the normal distribution; beyond `_FAR` deviations it is 0 or 1, as for most pixels of a window."""
    if depth > _FAR:
        return 1.0
    return 0.5 * math.erfc(-depth * math.sqrt(0.5)) if depth > -_FAR else 0.0


@kernel_part
def _derivatives(unknowns: Floats, x: int, y: int, row: Floats) -> float:
    """Fill the derivatives of a pixel's brightness by all unknowns; return the brightness."""
    width, last = unknowns[-1], len(unknowns) - 1
    free, total, light = 1.0, 0.0, 0.0
    for first in range(0, last, N_UNKNOWNS):
        distance, depth = _depth(x - unknowns[first], y - unknowns[first + 1], unknowns[first + 2], width)
        part = max(_part_covered(depth), TINY)
        row[first], row[first + 1], row[first + 2], row[first + 3] = distance, depth, part, max(1.0 - part, TINY)
        free *= row[first + 3]
        total += part
        light += part * unknowns[first + 3]
    covered, mean, share = 1.0 - free, light / total, (1.0 - free) / total
    row[last] = 0.0
    for first in range(0, last, N_UNKNOWNS):
        distance, depth, part, free_of_it = row[first], row[first + 1], row[first + 2], row[first + 3]
        row[first] = row[first + 1] = row[first + 2] = 0.0
        row[first + 3] = share * part
        if abs(depth) < _FAR:
            by_part = free / free_of_it * mean + share * (unknowns[first + 3] - mean)
            rise = by_part * math.exp(-depth * depth / 2.0) * _NORMAL_PEAK / width
            row[first] = rise / distance * (x - unknowns[first])
            row[first + 1] = rise / distance * (y - unknowns[first + 1])
            row[first + 2] = rise
            row[last] -= rise * depth
    return covered * mean
