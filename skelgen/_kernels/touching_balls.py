"""Spots that are several balls in one: where the balls may be, and whether discs fit there.

Pintaric and Kaufmann (2007) find the circles of overlapping markers by their outlines; Gaschler (2011) names that as
future work. Here the largest discs that the outline can hold are placed first, by the distance of each pixel from it,
and then fitted to the grey values.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels import array_kernel, array_part, kernel_part
from skelgen._kernels.ball_discs import BRIGHTNESS, RADIUS, STD, Fit, X, Y, fit_discs
from skelgen._kernels.bright_spots import FULL
from skelgen.model.arrays import Bools, Floats, Ints

MAX_DISCS = 6
"""Balls in one spot: more have no outline left to be found by."""

MARGIN = 2
"""Pixels around a spot that are dark, which tells a fit where it ends."""

LEAST_FILLED = 0.08
"""Of the square about a spot: six discs in a row fill 0.13 of theirs, seams of light and cables hardly any."""

OUTLINE = 0.5  # of the brightest pixel: where the outline is drawn
ENOUGH_NEW = 0.12  # of a disc's own pixels that no disc before it holds
ENOUGH_HELD = 0.97  # of the spot's pixels
MAX_RMS = 0.06  # of the brightest pixel, without noise: balls leave 0.01 to 0.035, dull metal 0.05 to 0.2
NOISE_ALLOWED = 1.5
MAX_WIDTH = 0.33  # of the smallest radius: edges of balls are 0.05 to 0.2 wide, dull metal has 0.36 and more
BETTER = 0.5  # rms of more discs over that of fewer, above which the fewer are taken
MIN_RADIUS = 1.2  # px: below it a disc is noise on an outline
MAX_UNLIKE = 2.0  # largest radius over the smallest of balls of one size
LEAST_SEEN = 0.2  # of a disc that no other covers
LEAST_APART = 0.33  # of a radius between two centres: nearer ones would leave less than that to be seen
HELD_BY_TWO = 0.85  # of a spot's pixels by two discs, below which it is not two balls
CLEARLY_TWO = 1.35  # longest axis over the shortest of a spot that is not one ball
MAX_STD = 0.5  # px: no better than where the spot is
UNIT_DISC = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 13)] * 2), axis=-1).reshape(-1, 2)
UNIT_DISC = UNIT_DISC[(UNIT_DISC**2).sum(axis=1) <= 1.0]

Borders = tuple[bool, bool, bool, bool]
"""Whether a window's left, right, upper and lower side is the image's border, beyond which a ball may go on."""


@array_kernel
def find_discs(window: Floats, noise: float, at_border: Borders) -> Fit:
    """Find the balls of a spot.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        Brightness between the thresholds, 0 .. 1; NaN for pixels of other spots.
    noise : float
        Standard deviation of a pixel.
    at_border : tuple of bool
        See `Borders`.

    Returns
    -------
    Fit
        See `fit_discs`; the root mean square residual is infinite if the spot is not made of discs.
    """
    light, peak, moments = _light(window)
    halves, elongation = _halves(moments)
    nothing = (halves, 0.0, math.inf)
    is_cut = at_border[0] or at_border[1] or at_border[2] or at_border[3]
    size = max(window.shape[0], window.shape[1]) - 2 * MARGIN
    if not is_cut and light < LEAST_FILLED * peak * size * size:
        return nothing
    limit = MAX_RMS * peak + NOISE_ALLOWED * noise
    if elongation < CLEARLY_TWO or is_cut:
        one = _fit_balls(window, _whole(light, moments), limit)
        if math.isfinite(one[2]):
            return one
    inside = _pixels_above(window, OUTLINE * peak)
    are_two = elongation > CLEARLY_TWO and _part_held(inside, halves) > HELD_BY_TWO
    best = _fit_balls(window, halves, limit) if are_two else nothing
    if best[2] < limit / 2.0:  # most spots are two balls: nothing else need be tried
        return best
    inscribed = inscribed_discs(inside, at_border)
    if are_two:
        return _better_fit(window, inscribed, limit, best)
    if len(inscribed) < len(halves):
        return _better_fit(window, halves, limit, _better_fit(window, inscribed, limit, best))
    return _better_fit(window, inscribed, limit, _better_fit(window, halves, limit, best))


@array_part
def _better_fit(window: Floats, guess: Floats, limit: float, best: Fit) -> Fit:
    """Return the discs from one more guess, if they are more and leave much less than the best so far."""
    if math.isfinite(best[2]) and len(guess) <= len(best[0]):
        return best
    found = _fit_balls(window, guess, limit)
    return found if found[2] < BETTER * best[2] else best


@array_part
def _fit_balls(window: Floats, guess: Floats, limit: float) -> Fit:
    """Return discs fitted from a guess, if they leave little and are plausible; without one that only fills a gap."""
    while True:
        found = fit_discs(window, guess, limit)
        discs, width, rms = found
        if rms > limit:
            return discs, width, math.inf
        seen = _parts_seen(discs)
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
            for column in range(3):
                guess[disc, column] = discs[disc + (disc >= least), column]


@kernel_part
def _are_balls(discs: Floats, width: float, seen: Floats) -> bool:
    """Return whether fitted discs are plausible as balls of about one size."""
    smallest, largest, are_plain = math.inf, 0.0, True
    for disc in range(len(discs)):
        smallest, largest = min(smallest, discs[disc, RADIUS]), max(largest, discs[disc, RADIUS])
        are_plain &= discs[disc, STD] <= MAX_STD and discs[disc, BRIGHTNESS] > 0.0
        are_plain &= len(discs) == 1 or seen[disc] >= LEAST_SEEN
    return bool(are_plain and smallest >= max(MIN_RADIUS, width / MAX_WIDTH) and largest <= MAX_UNLIKE * smallest)


@array_part
def _parts_seen(discs: Floats) -> Floats:
    """Return the part of each disc that no other one covers, on a grid of points, shape (n_discs,)."""
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


@array_part
def _light(window: Floats) -> tuple[float, float, Floats]:
    """Return sum and largest value of a window, and its mean x and y and second moments xx, xy, yy."""
    light, peak, moments = 0.0, 0.0, np.zeros(5)
    for y in range(window.shape[0]):
        for x in range(window.shape[1]):
            weight = window[y, x]
            if weight > 0.0:
                peak = max(peak, weight)
                light += weight
                moments[0] += weight * x
                moments[1] += weight * y
                moments[2] += weight * x * x
                moments[3] += weight * x * y
                moments[4] += weight * y * y
    for i in range(5):
        moments[i] /= light
    moments[2] -= moments[0] * moments[0]
    moments[3] -= moments[0] * moments[1]
    moments[4] -= moments[1] * moments[1]
    return light, peak, moments


@array_part
def _pixels_above(window: Floats, limit: float) -> Bools:
    """Return the pixels that are at least as bright as a limit."""
    inside = np.empty(window.shape, dtype=np.bool_)
    for y in range(window.shape[0]):
        for x in range(window.shape[1]):
            inside[y, x] = window[y, x] >= limit
    return inside


@array_part
def _whole(light: float, moments: Floats) -> Floats:
    """Return one disc as large as a window's light."""
    disc = np.empty((1, 3))
    disc[0, X], disc[0, Y], disc[0, RADIUS] = moments[0], moments[1], math.sqrt(light / math.pi)
    return disc


@array_part
def _halves(moments: Floats) -> tuple[Floats, float]:
    """Return two equal discs with the second moments of a window, and its longest axis over its shortest."""
    x, y, xx, xy, yy = moments[0], moments[1], moments[2], moments[3], moments[4]
    middle, half = (xx + yy) / 2.0, math.sqrt(((xx - yy) / 2.0) ** 2 + xy * xy)
    turn = math.atan2(2.0 * xy, xx - yy) / 2.0
    short, long = max(middle - half, MIN_RADIUS**2 / 4.0), middle + half
    shift = math.sqrt(max(long - short, 0.0))
    across, down = shift * math.cos(turn), shift * math.sin(turn)
    discs = np.empty((2, 3))
    discs[0, X], discs[0, Y], discs[1, X], discs[1, Y] = x - across, y - down, x + across, y + down
    discs[0, RADIUS] = discs[1, RADIUS] = 2.0 * math.sqrt(short)
    return discs, math.sqrt(long / short)


@kernel_part
def _part_held(inside: Bools, discs: Floats) -> float:
    """Return the part of a shape that discs hold."""
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


@array_kernel
def inscribed_discs(inside: Bools, at_border: Borders) -> Floats:
    """Return the fewest large discs that hold nearly all pixels of a shape, in the order of what each adds.

    Parameters
    ----------
    inside : ndarray of bool, shape (height, width)
        The shape.
    at_border : tuple of bool
        Sides at which it may go on; see `Borders`.

    Returns
    -------
    ndarray, shape (n_discs, 3), px
        x, y and radius.
    """
    candidates, places = _candidates(inside, _distance_from_outline(inside, at_border))
    is_held, n_held = np.zeros(len(places), dtype=np.bool_), 0
    chosen, n_chosen = np.empty((MAX_DISCS, 3)), 0
    while n_chosen < MAX_DISCS and n_held < ENOUGH_HELD * len(places):
        best, most, size = -1, -1, 0
        for one in range(len(candidates)):
            added, held = _added(candidates[one], chosen[:n_chosen], places, is_held)
            if added > most:
                best, most, size = one, added, held
        if n_chosen > 0 and most < ENOUGH_NEW * size:
            break
        for column in range(3):
            chosen[n_chosen, column] = candidates[best, column]
        n_chosen += 1
        for place in range(len(places)):
            if not is_held[place] and _holds(candidates[best], places[place]):
                is_held[place] = True
                n_held += 1
    return chosen[:n_chosen].copy()


@kernel_part
def _holds(disc: Floats, place: Floats) -> bool:
    """Return whether a place lies in a disc."""
    return bool((place[0] - disc[X]) ** 2 + (place[1] - disc[Y]) ** 2 <= disc[RADIUS] ** 2)


@kernel_part
def _added(disc: Floats, chosen: Floats, places: Floats, is_held: Bools) -> tuple[int, int]:
    """Return how many places a disc holds and no chosen one, 0 if it is too near to one; and all that it holds."""
    added, held, is_apart = 0, 0, True
    for other in range(len(chosen)):
        away = (disc[X] - chosen[other, X]) ** 2 + (disc[Y] - chosen[other, Y]) ** 2
        is_apart &= away >= (LEAST_APART * disc[RADIUS]) ** 2
    for place in range(len(places)):
        if _holds(disc, places[place]):
            held += 1
            added += is_apart and not is_held[place]
    return added, held


@array_part
def _candidates(inside: Bools, distance: Floats) -> tuple[Floats, Floats]:
    """Return discs about the pixels that are farthest in around, shape (n, 3), and all pixels inside, (n_inside, 2)."""
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


@array_part
def _distance_from_outline(inside: Bools, at_border: Borders) -> Floats:
    """Return the distance [px] of each pixel's centre from the nearest edge of a pixel outside, about.

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
    distance = np.empty((height, width))
    for y in range(height):
        for x in range(width):
            column = x + before
            squared, away = nearest[y + upper, column] ** 2, 1
            while away * away < squared:
                for other in (column - away, column + away):
                    if 0 <= other < wide:
                        squared = min(squared, away * away + nearest[y + upper, other] ** 2)
                away += 1
            distance[y, x] = math.sqrt(squared) - 0.5
    return distance


@array_kernel
def light_of_spot(weights: NDArray[np.int64]) -> Floats:
    """Return the light of a window's largest spot and of the dark around it.

    Parameters
    ----------
    weights : ndarray of int64, shape (height, width)
        Weights of all pixels, 0 .. `FULL`.

    Returns
    -------
    ndarray, shape (height, width)
        1 is the upper threshold; NaN where other spots are.
    """
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


@kernel_part
def _flood(weights: NDArray[np.int64], labels: Ints, waiting: Ints, y: int, x: int, label: int) -> int:
    """Label the bright pixels that hang together with one; return how many they are."""
    waiting[0, 0], waiting[0, 1] = y, x
    labels[y, x] = label
    n_waiting, size = 1, 0
    while n_waiting > 0:
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
