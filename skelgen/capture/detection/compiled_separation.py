"""Spots that are several balls in one, compiled: twin of `separation`, which says what is done and why.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.detection.compiled_discs import BRIGHTNESS, RADIUS, STD, Fitted, X, Y, fit_discs
from skelgen.capture.detection.discs import Discs
from skelgen.capture.detection.separation import (
    BETTER,
    CLEARLY_TWO,
    EDGE,
    ENOUGH_HELD,
    ENOUGH_NEW,
    HELD_BY_TWO,
    LEAST_APART,
    LEAST_FILLED,
    LEAST_RADIUS,
    LEAST_SEEN,
    MARGIN,
    MOST_DISCS,
    MOST_RMS,
    MOST_STD,
    MOST_UNLIKE,
    MOST_WIDTH,
    NOISE_ALLOWED,
    UNIT_DISC,
)
from skelgen.capture.detection.spots import FULL
from skelgen.compiling import compile_function
from skelgen.model.arrays import Bools, Floats, Ints

_Borders = tuple[bool, bool, bool, bool]


def find_discs(window: Floats, noise: float, at_border: _Borders) -> Discs | None:
    """Find the balls of a spot; arguments and result as `separation.find_discs`."""
    discs, width, rms = search(window, noise, at_border)
    if not math.isfinite(rms):
        return None
    return Discs(discs[:, :RADIUS], discs[:, RADIUS], discs[:, BRIGHTNESS], discs[:, STD], width, rms)


@compile_function
def search(window: Floats, noise: float, at_border: _Borders) -> Fitted:
    """Return the discs of a spot; what they leave is infinite if it is not made of discs."""
    light, peak, moments = _light(window)
    halves, elongation = _halves(moments)
    nothing = (halves, 0.0, math.inf)
    is_cut = at_border[0] or at_border[1] or at_border[2] or at_border[3]
    if not is_cut and light < LEAST_FILLED * peak * (max(window.shape) - 2 * MARGIN) ** 2:
        return nothing
    limit = MOST_RMS * peak + NOISE_ALLOWED * noise
    if elongation < CLEARLY_TWO or is_cut:
        one = _fitted(window, _whole(light, moments), limit)
        if math.isfinite(one[2]):
            return one
    inside = _inside(window, EDGE * peak)
    are_two = elongation > CLEARLY_TWO and _held_part(inside, halves) > HELD_BY_TWO
    best = _fitted(window, halves, limit) if are_two else nothing
    if best[2] < limit / 2:
        return best
    inscribed = inscribed_discs(inside, at_border)
    if are_two:
        return _better(window, inscribed, limit, best)
    if len(inscribed) < len(halves):
        return _better(window, halves, limit, _better(window, inscribed, limit, best))
    return _better(window, inscribed, limit, _better(window, halves, limit, best))


@compile_function
def _better(window: Floats, guess: Floats, limit: float, best: Fitted) -> Fitted:
    """The discs from one more guess, if they are more and leave much less than the best so far."""
    if math.isfinite(best[2]) and len(guess) <= len(best[0]):
        return best
    found = _fitted(window, guess, limit)
    return found if found[2] < BETTER * best[2] else best


@compile_function
def _fitted(window: Floats, guess: Floats, limit: float) -> Fitted:
    """Discs fitted from a guess, if they leave little and are plausible; one that only fills a gap is left out."""
    while True:
        found = fit_discs(window, guess, limit)
        discs, width, rms = found
        if rms > limit:
            return discs, width, math.inf
        seen = _seen_parts(discs)
        if _are_balls(discs, width, seen):
            return found
        if len(discs) <= 2:
            return discs, width, math.inf
        least = 0
        for disc in range(1, len(discs)):
            if discs[disc, RADIUS] ** 2 * seen[disc] < discs[least, RADIUS] ** 2 * seen[least]:
                least = disc
        guess = np.empty((len(discs) - 1, 3))
        for disc in range(len(guess)):
            guess[disc] = discs[disc + (disc >= least), :3]


@compile_function
def _are_balls(discs: Floats, width: float, seen: Floats) -> bool:
    """Whether fitted discs are plausible as balls of about one size."""
    smallest, largest, are_plain = math.inf, 0.0, True
    for disc in range(len(discs)):
        smallest, largest = min(smallest, discs[disc, RADIUS]), max(largest, discs[disc, RADIUS])
        are_plain &= discs[disc, STD] <= MOST_STD and discs[disc, BRIGHTNESS] > 0.0
        are_plain &= len(discs) == 1 or seen[disc] >= LEAST_SEEN
    return bool(are_plain and smallest >= max(LEAST_RADIUS, width / MOST_WIDTH) and largest <= MOST_UNLIKE * smallest)


@compile_function
def _seen_parts(discs: Floats) -> Floats:
    """Part of each disc that no other one covers, on a grid of points, shape (n_discs,)."""
    seen = np.zeros(len(discs))
    for disc in range(len(discs)):
        for point in range(len(UNIT_DISC)):
            x = discs[disc, X] + discs[disc, RADIUS] * UNIT_DISC[point, 0]
            y = discs[disc, Y] + discs[disc, RADIUS] * UNIT_DISC[point, 1]
            is_free = True
            for other in range(len(discs)):
                across, down = x - discs[other, X], y - discs[other, Y]
                is_free &= other == disc or across * across + down * down > discs[other, RADIUS] ** 2
            seen[disc] += is_free / len(UNIT_DISC)
    return seen


@compile_function
def _light(window: Floats) -> tuple[float, float, Floats]:
    """Sum and largest value of a window, and its mean x and y and second moments xx, xy, yy."""
    peak, sums = 0.0, np.zeros(6)
    for y in range(window.shape[0]):
        for x in range(window.shape[1]):
            weight = window[y, x]
            if weight > 0.0:
                peak = max(peak, weight)
                sums[0] += weight
                sums[1] += weight * x
                sums[2] += weight * y
                sums[3] += weight * x * x
                sums[4] += weight * x * y
                sums[5] += weight * y * y
    light, means = sums[0], sums[1:] / sums[0]
    means[2] -= means[0] * means[0]
    means[3] -= means[0] * means[1]
    means[4] -= means[1] * means[1]
    return light, peak, means


@compile_function
def _inside(window: Floats, limit: float) -> Bools:
    """Pixels that are at least as bright as a limit."""
    out = np.empty(window.shape, dtype=np.bool_)
    for y in range(window.shape[0]):
        for x in range(window.shape[1]):
            out[y, x] = window[y, x] >= limit
    return out


@compile_function
def _whole(light: float, moments: Floats) -> Floats:
    """One disc as large as a window's light."""
    return np.array([[moments[0], moments[1], math.sqrt(light / math.pi)]])


@compile_function
def _halves(moments: Floats) -> tuple[Floats, float]:
    """Two equal discs with the second moments of a window, and its longest axis over its shortest."""
    x, y, xx, xy, yy = moments
    middle, half = (xx + yy) / 2.0, math.sqrt(((xx - yy) / 2.0) ** 2 + xy * xy)
    turn = math.atan2(2.0 * xy, xx - yy) / 2.0
    short, long = max(middle - half, LEAST_RADIUS**2 / 4.0), middle + half
    shift = math.sqrt(max(long - short, 0.0))
    across, down, radius = shift * math.cos(turn), shift * math.sin(turn), 2.0 * math.sqrt(short)
    return np.array([[x - across, y - down, radius], [x + across, y + down, radius]]), math.sqrt(long / short)


@compile_function
def _held_part(inside: Bools, discs: Floats) -> float:
    """Part of a shape that discs hold."""
    n_inside, n_held = 0, 0
    for y in range(inside.shape[0]):
        for x in range(inside.shape[1]):
            if inside[y, x]:
                is_held = False
                for disc in range(len(discs)):
                    across, down = x - discs[disc, X], y - discs[disc, Y]
                    is_held |= across * across + down * down <= discs[disc, RADIUS] ** 2
                n_inside += 1
                n_held += is_held
    return n_held / n_inside


@compile_function
def inscribed_discs(inside: Bools, at_border: _Borders) -> Floats:
    """Return the fewest large discs that hold nearly all pixels of a shape: x, y and radius, shape (n_discs, 3)."""
    candidates, places = _candidates(inside, _distance_from_outline(inside, at_border))
    is_held, n_held = np.zeros(len(places), dtype=np.bool_), 0
    chosen, n_chosen = np.empty((MOST_DISCS, 3)), 0
    while n_chosen < MOST_DISCS and n_held < ENOUGH_HELD * len(places):
        best, most, size = -1, -1, 0
        for one in range(len(candidates)):
            added, held = _added(candidates[one], chosen[:n_chosen], places, is_held)
            if added > most:
                best, most, size = one, added, held
        if n_chosen and most < ENOUGH_NEW * size:
            break
        chosen[n_chosen] = candidates[best]
        n_chosen += 1
        for place in range(len(places)):
            if not is_held[place] and _holds(candidates[best], places[place]):
                is_held[place] = True
                n_held += 1
    return chosen[:n_chosen].copy()


@compile_function
def _holds(disc: Floats, place: Floats) -> bool:
    """Whether a place lies in a disc."""
    return bool((place[0] - disc[X]) ** 2 + (place[1] - disc[Y]) ** 2 <= disc[RADIUS] ** 2)


@compile_function
def _added(disc: Floats, chosen: Floats, places: Floats, is_held: Bools) -> tuple[int, int]:
    """Places that a disc holds and no chosen one, 0 if it is too near to one; and all that it holds."""
    added, held, is_apart = 0, 0, True
    for other in range(len(chosen)):
        away = (disc[X] - chosen[other, X]) ** 2 + (disc[Y] - chosen[other, Y]) ** 2
        is_apart &= away >= (LEAST_APART * disc[RADIUS]) ** 2
    for place in range(len(places)):
        if _holds(disc, places[place]):
            held += 1
            added += is_apart and not is_held[place]
    return added, held


@compile_function
def _candidates(inside: Bools, distance: Floats) -> tuple[Floats, Floats]:
    """Discs about the pixels that are farthest in around, shape (n, 3), and all pixels inside, shape (n_inside, 2)."""
    height, width = inside.shape
    discs, places, n_discs, n_places = np.empty((inside.size, 3)), np.empty((inside.size, 2)), 0, 0
    for y in range(height):
        for x in range(width):
            if not inside[y, x]:
                continue
            places[n_places, 0], places[n_places, 1] = x, y
            n_places += 1
            is_peak = True
            for row in range(max(y - 1, 0), min(y + 2, height)):
                for column in range(max(x - 1, 0), min(x + 2, width)):
                    is_peak &= distance[row, column] <= distance[y, x]
            if is_peak:
                discs[n_discs, X], discs[n_discs, Y], discs[n_discs, RADIUS] = x, y, distance[y, x]
                n_discs += 1
    return discs[:n_discs], places[:n_places]


@compile_function
def _distance_from_outline(inside: Bools, at_border: _Borders) -> Floats:
    """Distance [px] of each pixel's centre from the nearest edge of a pixel outside, about.

    Along columns first, then along rows (Felzenszwalb and Huttenlocher 2012, for small shapes).
    """
    left, right, top, bottom = at_border
    height, width = inside.shape
    reach = max(height, width)
    upper, before = 1 + top * reach, 1 + left * reach
    tall, wide = upper + height + bottom * reach + 1, before + width + right * reach + 1
    nearest = np.zeros((tall, wide))  # the outermost rows and columns are outside
    for x in range(1, wide - 1):
        column = min(max(x - before, 0), width - 1)
        for y in range(1, tall - 1):
            row = min(max(y - upper, 0), height - 1)
            nearest[y, x] = nearest[y - 1, x] + 1.0 if inside[row, column] else 0.0
        for y in range(tall - 2, 0, -1):
            nearest[y, x] = min(nearest[y, x], nearest[y + 1, x] + 1.0)
    out = np.empty((height, width))
    for y in range(height):
        for x in range(width):
            row, column = nearest[y + upper], x + before
            squared, away = row[column] * row[column], 1.0
            while away * away < squared:
                for other in (column - int(away), column + int(away)):
                    if 0 <= other < wide:
                        squared = min(squared, away * away + row[other] * row[other])
                away += 1.0
            out[y, x] = math.sqrt(squared) - 0.5
    return out


@compile_function
def own_light(weights: NDArray[np.int64]) -> Floats:
    """Return the light of a window's largest spot; argument and result as `separation.own_light`."""
    height, width = weights.shape
    labels, waiting = np.zeros(weights.shape, dtype=np.intp), np.empty((weights.size, 2), dtype=np.intp)
    n_labels, own, largest = 0, 0, 0
    for y in range(height):
        for x in range(width):
            if weights[y, x] > 0 and labels[y, x] == 0:
                n_labels += 1
                size = _flood(weights, labels, waiting, y, x, n_labels)
                if size > largest:
                    own, largest = n_labels, size
    window = np.empty(weights.shape)
    for y in range(height):
        for x in range(width):
            is_other = labels[y, x] > 0 and labels[y, x] != own
            window[y, x] = math.nan if is_other else weights[y, x] / FULL
    return window


@compile_function
def _flood(weights: NDArray[np.int64], labels: Ints, waiting: Ints, y: int, x: int, label: int) -> int:
    """Label the bright pixels that hang together with one; returns how many they are."""
    waiting[0, 0], waiting[0, 1] = y, x
    labels[y, x] = label
    n_waiting, size = 1, 0
    while n_waiting:
        n_waiting -= 1
        size += 1
        row, column = waiting[n_waiting, 0], waiting[n_waiting, 1]
        for down, across in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            y, x = row + down, column + across
            is_inside = 0 <= y < weights.shape[0] and 0 <= x < weights.shape[1]
            if is_inside and weights[y, x] > 0 and labels[y, x] == 0:
                labels[y, x] = label
                waiting[n_waiting, 0], waiting[n_waiting, 1] = y, x
                n_waiting += 1
    return size
