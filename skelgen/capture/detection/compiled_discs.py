"""Discs fitted to the grey values of a spot, compiled: twin of `discs`.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels.small_matrices import factorise, solve
from skelgen.capture.detection.discs import (
    FAR_OFF,
    FIRST_DAMPING,
    FIRST_WIDTH,
    LESS,
    MAX_STEPS,
    MORE,
    MOST_DAMPING,
    PATIENCE,
    PER_DISC,
    SETTLED,
    TINY,
    WIDTHS,
)
from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats

X, Y, RADIUS, BRIGHTNESS, STD = range(5)
"""Columns of a table of discs; a guess has the first three."""

Fitted = tuple[Floats, float, float]
"""Table of discs, width of their edges, and what they leave; the latter is infinite if the fit was given up."""

_FAR = 5.0  # standard deviations: 3e-7 is left
_HEIGHT = 1.0 / math.sqrt(2.0 * math.pi)  # of the normal distribution
_NOTHING = 1e-9  # derivative: brightness by a pixel or by a part of itself
_OUTSIDE, _WITHIN, _AT_EDGE = -1, 0, 1  # where a pixel lies: out of all discs, within one alone, at an edge


@compile_function
def fit_discs(window: Floats, guess: Floats, limit: float) -> Fitted:
    """Fit discs to the pixels of a window.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        See `discs.fit_discs`.
    guess : ndarray, shape (n_discs, 3), px
        x, y and radius at first.
    limit : float
        See `discs.fit_discs`.
    """
    unknowns = _first(window, guess)
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
        furthest = _stepped(unknowns, step, tried)
        next_normal, next_slope, next_cost, _ = normal_equations(window, tried)
        if next_cost < cost:
            unknowns[:] = tried
            normal, slope, cost = next_normal, next_slope, next_cost
            damping *= LESS
        else:
            damping *= MORE
        if furthest < SETTLED or damping > MOST_DAMPING:
            break
        if n_steps >= PATIENCE and cost > FAR_OFF * limit * limit * n_pixels:
            return guess, 0.0, math.inf
    return _table(unknowns, normal, cost, n_pixels)


@compile_function
def _first(window: Floats, guess: Floats) -> Floats:
    """Unknowns that a fit starts from."""
    peak = 0.0
    for y in range(window.shape[0]):
        for x in range(window.shape[1]):
            if math.isfinite(window[y, x]):
                peak = max(peak, window[y, x])
    unknowns = np.empty(PER_DISC * len(guess) + 1)
    for disc in range(len(guess)):
        for column in range(3):
            unknowns[PER_DISC * disc + column] = guess[disc, column]
        unknowns[PER_DISC * disc + BRIGHTNESS] = peak
    unknowns[-1] = FIRST_WIDTH
    return unknowns


@compile_function
def _stepped(unknowns: Floats, step: Floats, tried: Floats) -> float:
    """Fill the unknowns after a step, within their bounds; returns the largest change."""
    furthest, last = 0.0, len(unknowns) - 1
    for i in range(len(unknowns)):
        value = unknowns[i] + step[i]
        if i == last:
            value = min(max(value, WIDTHS[0]), WIDTHS[1])
        elif i % PER_DISC == RADIUS:
            value = max(value, WIDTHS[0])
        tried[i] = value
        furthest = max(furthest, abs(value - unknowns[i]))
    return furthest


@compile_function
def _table(unknowns: Floats, normal: Floats, cost: float, n_pixels: int) -> Fitted:
    """Discs with the deviations of their centres."""
    n_discs, n_free = len(unknowns) // PER_DISC, n_pixels - len(unknowns)
    out, column = np.empty((n_discs, 5)), np.empty(len(unknowns))
    if n_free <= 0 or not math.isfinite(unknowns.sum()) or not factorise(normal):
        return out, 0.0, math.inf
    for disc in range(n_discs):
        variance = 0.0
        for axis in range(2):
            place = PER_DISC * disc + axis
            column[:] = 0.0
            column[place] = 1.0
            solve(normal, column)
            variance += max(column[place], 0.0) * cost / n_free / 2.0
        out[disc, :PER_DISC] = unknowns[PER_DISC * disc : PER_DISC * (disc + 1)]
        out[disc, STD] = math.sqrt(variance)
    return out, unknowns[-1], math.sqrt(cost / n_free)


@compile_function
def normal_equations(window: Floats, unknowns: Floats) -> tuple[Floats, Floats, float, int]:
    """Return the sums of a fit of discs; arguments and results as `discs.normal_equations`."""
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
                place = PER_DISC * disc + BRIGHTNESS
                residual = unknowns[place] - window[y, x]
                cost += residual * residual
                slope[place] += residual
                normal[place, place] += 1.0
                continue
            residual = _derivatives(unknowns, x, y, row) - window[y, x]
            cost += residual * residual
            n_used = 0
            for i in range(n_unknowns):
                if abs(row[i]) > _NOTHING:  # most pixels are far from most discs, or wholly inside one
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


@compile_function
def _place(unknowns: Floats, x: int, y: int) -> tuple[int, int]:
    """Where a pixel lies, and in which disc; where several overlap, their edges may count."""
    reach, where, within = _FAR * unknowns[-1], _OUTSIDE, -1
    for first in range(0, len(unknowns) - 1, PER_DISC):
        across, down, radius = x - unknowns[first], y - unknowns[first + 1], unknowns[first + 2]
        squared = across * across + down * down
        if squared >= (radius + reach) * (radius + reach):
            continue
        if where == _WITHIN or radius <= reach or squared > (radius - reach) * (radius - reach):
            return _AT_EDGE, -1
        where, within = _WITHIN, first // PER_DISC
    return where, within


@compile_function
def _depth(across: float, down: float, radius: float, width: float) -> tuple[float, float]:
    """Distance of a pixel from a disc's centre, and how deep it lies in the disc in widths of the edge.

    Beyond `_FAR` widths from the edge, where most pixels are, both are stand-ins that need no root.
    """
    squared, reach = across * across + down * down, _FAR * width
    if squared >= (radius + reach) * (radius + reach):
        return 1.0, -2.0 * _FAR
    if radius > reach and squared <= (radius - reach) * (radius - reach):
        return 1.0, 2.0 * _FAR
    distance = max(math.sqrt(squared), TINY)
    return distance, (radius - distance) / width


@compile_function
def _part_covered(depth: float) -> float:
    """The normal distribution; beyond `_FAR` deviations it is 0 or 1, as most pixels of a window are."""
    if depth > _FAR:
        return 1.0
    return 0.5 * math.erfc(-depth * math.sqrt(0.5)) if depth > -_FAR else 0.0


@compile_function
def _derivatives(unknowns: Floats, x: int, y: int, row: Floats) -> float:
    """Fill the derivatives of a pixel's brightness by all unknowns; returns the brightness."""
    width, last = unknowns[-1], len(unknowns) - 1
    free, total, light = 1.0, 0.0, 0.0
    for first in range(0, last, PER_DISC):
        distance, depth = _depth(x - unknowns[first], y - unknowns[first + 1], unknowns[first + 2], width)
        part = max(_part_covered(depth), TINY)
        row[first], row[first + 1], row[first + 2], row[first + 3] = distance, depth, part, max(1.0 - part, TINY)
        free *= row[first + 3]
        total += part
        light += part * unknowns[first + 3]
    covered, mean, share = 1.0 - free, light / total, (1.0 - free) / total
    row[last] = 0.0
    for first in range(0, last, PER_DISC):
        distance, depth, part, free_of_it = row[first], row[first + 1], row[first + 2], row[first + 3]
        row[first] = row[first + 1] = row[first + 2] = 0.0
        row[first + 3] = share * part
        if abs(depth) < _FAR:
            by_part = free / free_of_it * mean + share * (unknowns[first + 3] - mean)
            rise = by_part * math.exp(-depth * depth / 2.0) * _HEIGHT / width
            row[first] = rise / distance * (x - unknowns[first])
            row[first + 1] = rise / distance * (y - unknowns[first + 1])
            row[first + 2] = rise
            row[last] -= rise * depth
    return covered * mean
