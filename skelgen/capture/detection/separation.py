"""Spots that are several balls in one: where the balls may be, and whether discs fit there; the plain twin.

Pintaric and Kaufmann (2007) find the circles of overlapping markers by their outlines; the seed names that as its
future work. Here the largest discs that the outline can hold are placed first, by the distance of each pixel from it,
and then fitted to the grey values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.detection.discs import Discs, fit_discs
from skelgen.capture.detection.spots import FULL
from skelgen.model.arrays import Bools, Floats

MOST_DISCS = 6
"""Balls in one spot: more have no outline left to be found by."""

EDGE = 0.5  # of the brightest pixel: where the outline is drawn
ENOUGH_NEW = 0.12  # of a disc's own pixels that no disc before it holds
ENOUGH_HELD = 0.97  # of the spot's pixels
MOST_RMS = 0.06  # of the brightest pixel, without noise: balls leave 0.01 to 0.035, dull metal 0.05 to 0.2
NOISE_ALLOWED = 1.5
MOST_WIDTH = 0.33  # of the smallest radius: edges of balls are 0.05 to 0.2 wide, dull metal has 0.36 and more
BETTER = 0.5  # rms of more discs over that of fewer, above which the fewer are believed
LEAST_RADIUS = 1.2  # px: below it a disc is noise on an outline
MOST_UNLIKE = 2.0  # largest radius over the smallest of balls of one size
LEAST_SEEN = 0.2  # of a disc that no other covers
LEAST_APART = 0.33  # of a radius between two centres: nearer ones would leave less than that to be seen
HELD_BY_TWO = 0.85  # of a spot's pixels by two discs, below which it is not two balls
CLEARLY_TWO = 1.35  # longest axis over the shortest of a spot that is not one ball
UNIT_DISC = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 13)] * 2), axis=-1).reshape(-1, 2)
UNIT_DISC = UNIT_DISC[(UNIT_DISC**2).sum(axis=1) <= 1.0]
MOST_STD = 0.5  # px: no better than where the spot is
MARGIN = 2  # px around a spot that are dark, which tells a fit where it ends
LEAST_FILLED = 0.08
"""Of the square about a spot: six discs in a row fill 0.13 of theirs, seams of light and cables hardly any."""


def find_discs(window: Floats, noise: float, at_border: tuple[bool, bool, bool, bool]) -> Discs | None:
    """Find the balls of a spot.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        Brightness between the thresholds, 0 .. 1; NaN for pixels of other spots.
    noise : float
        Standard deviation of a pixel.
    at_border : tuple of bool
        Whether the window's left, right, upper and lower side is the image's border, beyond which a ball may go on.

    Returns
    -------
    Discs or None
        None if the spot is not made of discs.
    """
    peak = float(np.nanmax(window))
    if not any(at_border) and np.nansum(window) < LEAST_FILLED * peak * (max(window.shape) - 2 * MARGIN) ** 2:
        return None
    limit = MOST_RMS * peak + NOISE_ALLOWED * noise
    halves, elongation = _halves(window)
    if elongation < CLEARLY_TWO or any(at_border):
        one = _fitted(window, _whole(window), limit)
        if one is not None:
            return one
    inside = window >= EDGE * peak
    are_two = elongation > CLEARLY_TWO and _held_part(inside, *halves) > HELD_BY_TWO
    best = _fitted(window, halves, limit) if are_two else None
    if best is not None and best.rms < limit / 2:  # most spots are two balls: nothing else need be tried
        return best
    inscribed = inscribed_discs(inside, at_border)
    guesses = [inscribed] if are_two else [halves, inscribed]
    for guess in sorted(guesses, key=lambda guess: len(guess[1])):
        if best is not None and len(guess[1]) <= len(best.radii):
            continue
        found = _fitted(window, guess, limit)
        if found is not None and (best is None or found.rms < BETTER * best.rms):
            best = found
    return best


def _fitted(window: Floats, guess: tuple[Floats, Floats], limit: float) -> Discs | None:
    """Discs fitted from a guess, if they leave little and are plausible; one that only fills a gap is left out."""
    while True:
        found = fit_discs(window, *guess, limit)
        if found is None or found.rms > limit:
            return None
        if _are_balls(found):
            return found
        if len(found.radii) <= 2:
            return None
        kept = np.arange(len(found.radii)) != np.argmin(found.radii**2 * _seen_parts(found))
        guess = found.centres[kept], found.radii[kept]


def own_light(weights: NDArray[np.int64]) -> Floats:
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
    from scipy.ndimage import label  # noqa: PLC0415 - few spots need it

    labels, n_labels = label(weights > 0)
    window = weights / FULL
    if n_labels > 1:
        own = 1 + int(np.argmax(np.bincount(labels.ravel())[1:]))
        window[(labels != own) & (labels > 0)] = np.nan
    return np.asarray(window)


def inscribed_discs(inside: Bools, at_border: tuple[bool, bool, bool, bool]) -> tuple[Floats, Floats]:
    """Return the fewest large discs that hold nearly all pixels of a shape, in the order of what each adds.

    Parameters
    ----------
    inside : ndarray of bool, shape (height, width)
        The shape.
    at_border : tuple of bool
        Sides at which it may go on.

    Returns
    -------
    centres : ndarray, shape (n_discs, 2), px
        x and y.
    radii : ndarray, shape (n_discs,), px
        Radii.
    """
    distance = _distance_from_outline(inside, at_border)
    rows, columns = np.nonzero(inside)
    places = np.column_stack([columns, rows]).astype(np.float64)
    is_peak = _is_largest_around(distance)[rows, columns]
    candidates, radii = places[is_peak], distance[rows, columns][is_peak]
    gaps = np.linalg.norm(candidates[:, np.newaxis] - places, axis=2)
    holds = gaps <= radii[:, np.newaxis]
    chosen: list[int] = []
    is_held = np.zeros(len(places), dtype=np.bool_)
    while len(chosen) < MOST_DISCS and is_held.mean() < ENOUGH_HELD:
        away = np.linalg.norm(candidates[:, np.newaxis] - candidates[chosen], axis=2)
        is_apart = (away >= LEAST_APART * radii[:, np.newaxis]).all(axis=1)
        added = (holds & ~is_held).sum(axis=1) * is_apart
        best = int(np.argmax(added))
        if chosen and added[best] < ENOUGH_NEW * holds[best].sum():
            break
        chosen.append(best)
        is_held |= holds[best]
    return candidates[chosen], radii[chosen]


def _held_part(inside: Bools, centres: Floats, radii: Floats) -> float:
    """Part of a shape that discs hold."""
    rows, columns = np.nonzero(inside)
    across, down = columns[:, np.newaxis] - centres[:, 0], rows[:, np.newaxis] - centres[:, 1]
    return float((across**2 + down**2 <= radii**2).any(axis=1).mean())


def _whole(window: Floats) -> tuple[Floats, Floats]:
    """One disc as large as a window's light."""
    weights = np.nan_to_num(window)
    total = weights.sum()
    centre = np.array([weights.sum(axis=0) @ np.arange(window.shape[1]), weights.sum(axis=1) @ np.arange(len(window))])
    return centre[np.newaxis] / total, np.array([np.sqrt(total / np.pi)])


def _halves(window: Floats) -> tuple[tuple[Floats, Floats], float]:
    """Two equal discs with the second moments of a window, and its longest axis over its shortest."""
    weights = np.nan_to_num(window)
    x, y = np.arange(window.shape[1]), np.arange(window.shape[0])
    by_x, by_y = weights.sum(axis=0), weights.sum(axis=1)
    total = by_x.sum()
    centre = np.array([by_x @ x, by_y @ y]) / total
    off_x, off_y = x - centre[0], y - centre[1]
    xx, xy, yy = by_x @ off_x**2 / total, off_y @ weights @ off_x / total, by_y @ off_y**2 / total
    middle, half, turn = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy), np.arctan2(2 * xy, xx - yy) / 2
    short, long = max(middle - half, LEAST_RADIUS**2 / 4), middle + half
    shift = np.sqrt(max(long - short, 0.0)) * np.array([np.cos(turn), np.sin(turn)])
    return (np.stack([centre - shift, centre + shift]), np.full(2, 2 * np.sqrt(short))), float(np.sqrt(long / short))


def _distance_from_outline(inside: Bools, at_border: tuple[bool, bool, bool, bool]) -> Floats:
    """Distance [px] of each pixel's centre from the nearest edge of a pixel outside, about."""
    from scipy.ndimage import distance_transform_edt  # noqa: PLC0415 - imported where it is used

    left, right, top, bottom = at_border
    reach = max(inside.shape)
    padded = np.pad(inside, ((top * reach, bottom * reach), (left * reach, right * reach)), mode="edge")
    padded = np.pad(padded, 1)
    distance = distance_transform_edt(padded)[1:-1, 1:-1] - 0.5
    rows, columns = slice(top * reach, top * reach + inside.shape[0]), slice(left * reach, None)
    return np.asarray(distance[rows, columns][:, : inside.shape[1]])


def _is_largest_around(values: Floats) -> Bools:
    from scipy.ndimage import maximum_filter  # noqa: PLC0415 - imported where it is used

    return np.asarray(values >= maximum_filter(values, size=3))


def _are_balls(found: Discs) -> bool:
    """Whether fitted discs are plausible as balls of about one size."""
    radii = found.radii
    return bool(
        radii.min() >= LEAST_RADIUS
        and found.width <= MOST_WIDTH * radii.min()
        and radii.max() <= MOST_UNLIKE * radii.min()
        and found.std.max() <= MOST_STD
        and found.brightness.min() > 0.0
        and (len(radii) == 1 or _seen_parts(found).min() >= LEAST_SEEN)
    )


def _seen_parts(found: Discs) -> Floats:
    """Part of each disc that no other one covers, on a grid of points, shape (n_discs,)."""
    n_discs = len(found.radii)
    points = found.centres[:, np.newaxis] + found.radii[:, np.newaxis, np.newaxis] * UNIT_DISC
    gaps = np.linalg.norm(points[:, :, np.newaxis] - found.centres, axis=3) - found.radii
    gaps[np.arange(n_discs), :, np.arange(n_discs)] = np.inf
    return np.asarray((gaps > 0.0).all(axis=2).mean(axis=1))
