"""Spots that are several balls in one: where the balls may be, and whether discs fit there.

Pintaric and Kaufmann (2007) find the circles of overlapping markers by their outlines; the seed names that as its
future work. Here the largest discs that the outline can hold are placed first, by the distance of each pixel from it,
and then fitted to the grey values.
"""

from __future__ import annotations

import numpy as np

from skelgen.capture.detection.discs import Discs, NormalEquations, fit_discs
from skelgen.model.arrays import Bools, Floats

MOST_DISCS = 6
"""Balls in one spot: more have no outline left to be found by."""

_EDGE = 0.5  # of the brightest pixel: where the outline is drawn
_ENOUGH_NEW = 0.12  # of a disc's own pixels that no disc before it holds
_ENOUGH_HELD = 0.97  # of the spot's pixels
_MOST_RMS = 0.06  # of the brightest pixel, without noise: balls leave 0.01 to 0.035, dull metal 0.05 to 0.2
_NOISE_ALLOWED = 1.5
_MOST_WIDTH = 0.33  # of the smallest radius: edges of balls are 0.05 to 0.2 wide, dull metal has 0.36 and more
_BETTER = 0.5  # rms of more discs over that of fewer, above which the fewer are believed
_LEAST_RADIUS = 1.2  # px: below it a disc is noise on an outline
_MOST_UNLIKE = 2.0  # largest radius over the smallest of balls of one size
_LEAST_SEEN = 0.2  # of a disc that no other covers
_LEAST_APART = 0.33  # of a radius between two centres: nearer ones would leave less than that to be seen
_HELD_BY_TWO = 0.85  # of a spot's pixels by two discs, below which it is not two balls
_CLEARLY_TWO = 1.35  # longest axis over the shortest of a spot that is not one ball
_UNIT_DISC = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 13)] * 2), axis=-1).reshape(-1, 2)
_UNIT_DISC = _UNIT_DISC[(_UNIT_DISC**2).sum(axis=1) <= 1.0]
_MOST_STD = 0.5  # px: no better than where the spot is


def find_discs(
    window: Floats, noise: float, at_border: tuple[bool, bool, bool, bool], equations: NormalEquations
) -> Discs | None:
    """Find the balls of a spot.

    Parameters
    ----------
    window : ndarray, shape (height, width)
        Brightness between the thresholds, 0 .. 1; NaN for pixels of other spots.
    noise : float
        Standard deviation of a pixel.
    at_border : tuple of bool
        Whether the window's left, right, upper and lower side is the image's border, beyond which a ball may go on.
    equations : NormalEquations
        The compiled twin or the plain one.

    Returns
    -------
    Discs or None
        None if the spot is not made of discs.
    """
    peak = float(np.nanmax(window))
    limit = _MOST_RMS * peak + _NOISE_ALLOWED * noise
    halves, elongation = _halves(window)
    if elongation < _CLEARLY_TWO or any(at_border):
        one = _fitted(window, _whole(window), equations, limit)
        if one is not None:
            return one
    inside = window >= _EDGE * peak
    are_two = elongation > _CLEARLY_TWO and _held_part(inside, *halves) > _HELD_BY_TWO
    best = _fitted(window, halves, equations, limit) if are_two else None
    if best is not None and best.rms < limit / 2:  # most spots are two balls: nothing else need be tried
        return best
    inscribed = inscribed_discs(inside, at_border)
    guesses = [inscribed] if are_two else [halves, inscribed]
    for guess in sorted(guesses, key=lambda guess: len(guess[1])):
        if best is not None and len(guess[1]) <= len(best.radii):
            continue
        found = _fitted(window, guess, equations, limit)
        if found is not None and (best is None or found.rms < _BETTER * best.rms):
            best = found
    return best


def _fitted(window: Floats, guess: tuple[Floats, Floats], equations: NormalEquations, limit: float) -> Discs | None:
    """Discs fitted from a guess, if they leave little and are plausible; one that only fills a gap is left out."""
    while True:
        found = fit_discs(window, *guess, equations, limit)
        if found is None or found.rms > limit:
            return None
        if _are_balls(found):
            return found
        if len(found.radii) <= 2:
            return None
        kept = np.arange(len(found.radii)) != np.argmin(found.radii**2 * _seen_parts(found))
        guess = found.centres[kept], found.radii[kept]


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
    while len(chosen) < MOST_DISCS and is_held.mean() < _ENOUGH_HELD:
        away = np.linalg.norm(candidates[:, np.newaxis] - candidates[chosen], axis=2)
        is_apart = (away >= _LEAST_APART * radii[:, np.newaxis]).all(axis=1)
        added = (holds & ~is_held).sum(axis=1) * is_apart
        best = int(np.argmax(added))
        if chosen and added[best] < _ENOUGH_NEW * holds[best].sum():
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
    mixed = off_y @ weights @ off_x
    moments = np.array([[by_x @ off_x**2, mixed], [mixed, by_y @ off_y**2]]) / total
    (short, long), axes = np.linalg.eigh(moments)
    short = max(short, _LEAST_RADIUS**2 / 4)
    shift = np.sqrt(max(long - short, 0.0)) * axes[:, 1]
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
        radii.min() >= _LEAST_RADIUS
        and found.width <= _MOST_WIDTH * radii.min()
        and radii.max() <= _MOST_UNLIKE * radii.min()
        and found.std.max() <= _MOST_STD
        and found.brightness.min() > 0.0
        and (len(radii) == 1 or _seen_parts(found).min() >= _LEAST_SEEN)
    )


def _seen_parts(found: Discs) -> Floats:
    """Part of each disc that no other one covers, on a grid of points, shape (n_discs,)."""
    n_discs = len(found.radii)
    points = found.centres[:, np.newaxis] + found.radii[:, np.newaxis, np.newaxis] * _UNIT_DISC
    gaps = np.linalg.norm(points[:, :, np.newaxis] - found.centres, axis=3) - found.radii
    gaps[np.arange(n_discs), :, np.arange(n_discs)] = np.inf
    return np.asarray((gaps > 0.0).all(axis=2).mean(axis=1))
