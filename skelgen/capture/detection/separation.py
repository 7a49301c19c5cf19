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
    best: Discs | None = None
    inscribed = inscribed_discs(window >= _EDGE * peak, at_border)
    largest = inscribed[0][:1], inscribed[1][:1]
    for centres, radii in sorted((largest, _halves(window), inscribed), key=lambda guess: len(guess[1])):
        if best is not None and (best.rms < limit / 2 or len(radii) <= len(best.radii)):
            continue
        found = fit_discs(window, centres, radii, equations)
        if found is None or found.rms > limit or not _are_balls(found):
            continue
        if best is None or found.rms < _BETTER * best.rms:
            best = found
    return best


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
        added = (holds & ~is_held).sum(axis=1)
        best = int(np.argmax(added))
        if chosen and added[best] < _ENOUGH_NEW * holds[best].sum():
            break
        chosen.append(best)
        is_held |= holds[best]
    return candidates[chosen], radii[chosen]


def _halves(window: Floats) -> tuple[Floats, Floats]:
    """Two equal discs with the second moments of a window."""
    weights = np.nan_to_num(window)
    y, x = np.indices(window.shape)
    places, total = np.stack([x, y]).reshape(2, -1), weights.sum()
    centre = places @ weights.ravel() / total
    aside = places - centre[:, np.newaxis]
    variances, axes = np.linalg.eigh(aside * weights.ravel() @ aside.T / total)
    shift = np.sqrt(max(variances[1] - variances[0], 0.0)) * axes[:, 1]
    return np.stack([centre - shift, centre + shift]), np.full(2, 2 * np.sqrt(max(variances[0], 0.0)))


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
        and all(_seen_part(found, disc) >= _LEAST_SEEN for disc in range(len(radii)))
    )


def _seen_part(found: Discs, disc: int) -> float:
    """Part of a disc that no other disc covers, on a grid of points."""
    steps = np.linspace(-1.0, 1.0, 15)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    points = found.centres[disc] + found.radii[disc] * grid[(grid**2).sum(axis=1) <= 1.0]
    gaps = np.linalg.norm(points[:, np.newaxis] - found.centres, axis=2) - found.radii
    return float((np.delete(gaps, disc, axis=1) > 0.0).all(axis=1).mean())
