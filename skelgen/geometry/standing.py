"""What stands still in the room while other things move: markers that rest, and limbs that are fixed.

What is fixed shows white noise: its successive differences have twice the variance of its positions, von Neumann's
ratio (Annals of Mathematical Statistics 12, 1941). A body that holds still sways, however little: its ratio is lower.
"""

from collections.abc import Sequence

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.topology import limbs_of_bodies

STILL = 0.1
"""Part of what limbs usually move in the room, below which a limb stands still."""

STEADY = 0.2
"""mm; feet that stand sway by more."""

STILL_SECONDS = 2.0
"""s; shorter rests do not count."""

_END_SECONDS = 1.0
"""s; the end of a path, from which place and noise of the marker are estimated."""

_OFF_PLACE = 5.0
"""Standard deviations of the noise; a resting marker is never farther from its place."""

_ROUNDING = 1e-3
"""mm; resolution of positions in files: less noise than that counts as none."""

_OWN_NOISE = 0.2
"""Part of a marker's noise by which its steadiest distance varies at least, if no other marker moves as it does."""

_WHITE = 3.0
"""Standard deviations by which the ratio of white noise may be below 2."""


def rest_begins(path: Floats, rate: float) -> int | None:
    """Return the frame from which on a marker stands still; None if it does not, or not for long.

    Parameters
    ----------
    path : ndarray, shape (n_frames, 3), mm
        Its positions; NaN where unseen.
    rate : float, Hz
        Frame rate.
    """
    frames = np.flatnonzero(~np.isnan(path[:, 0]))
    path = path[frames]
    if (end := _still_end(path, rate)) is None:  # of most markers, without a look at all of a long take
        return None
    place, limit = end
    away = np.flatnonzero(np.abs(path - place).max(axis=1) > limit)
    begin = int(away[-1]) + 1 if len(away) else 0
    return int(frames[begin]) if _is_white(path[begin:]) else None


def ends_still(path: Floats, rate: float) -> bool:
    """Return whether a marker keeps its place at the end of its path: if not, it does not rest from any frame on.

    Parameters
    ----------
    path : ndarray, shape (n_frames, 3), mm
        Its positions where it is seen.
    rate : float, Hz
        Frame rate.
    """
    return _still_end(path, rate) is not None


def _still_end(path: Floats, rate: float) -> tuple[Floats, float] | None:
    """The place at which a path ends, and how far noise takes the marker from it [mm]; None if it moves."""
    least = max(3, round(STILL_SECONDS * rate))
    if len(path) < least:
        return None
    end = path[-max(3, round(_END_SECONDS * rate)) :]
    place, limit = np.median(end, axis=0), _OFF_PLACE * noise_of(end) + _ROUNDING
    return (place, limit) if np.abs(path[-least:] - place).max() <= limit else None


def fixed_markers(positions: Floats, rate: float, deviation: Floats) -> Bools:
    """Return which markers stand still in the room whenever they are seen, as long as that tells, shape (n_markers,).

    Paths of postures in no order look like noise, too, but limbs keep their distances there.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    rate : float, Hz
        Frame rate.
    deviation : ndarray, shape (n_markers, n_markers), mm
        Standard deviations of distances, NaN where unknown.
    """
    paths = positions.swapaxes(0, 1)
    are_still = [rest_begins(path, rate) == int(np.argmax(~np.isnan(path[:, 0]))) for path in paths]
    known = np.where(np.isnan(deviation) | np.eye(len(deviation), dtype=np.bool_), np.inf, deviation)
    noise = np.array([noise_of(path) if still else 0.0 for path, still in zip(paths, are_still, strict=True)])
    return np.asarray(np.array(are_still) & (known.min(axis=1) + _ROUNDING > _OWN_NOISE * noise))


def _is_white(path: Floats) -> bool:
    """Whether positions (n, 3) vary by noise alone."""
    variance = float(path.var(axis=0).mean())
    return variance <= _ROUNDING**2 or noise_of(path) ** 2 > (1.0 - _WHITE / np.sqrt(len(path))) * variance


def fixed_limbs(markers: Sequence[Floats], parents: Ints) -> list[int]:
    """Return the limbs that are fixed in the room, one of a tree at most: what a machine stands on is its root.

    Beyond noise they move less than `STILL` times what every other limb of their tree does. Nobody's feet do so, unless
    one of them never leaves its place and the other does.

    Parameters
    ----------
    markers : sequence of ndarray, shape (n_frames, n_markers, 3), mm
        World positions of the markers of each limb; NaN where unseen.
    parents : ndarray of intp, shape (n_limbs,)
        The trees, -1 for roots.
    """
    moved = np.array([variance_in_room(limb) - noise_of(limb) ** 2 for limb in markers])
    found = []
    for limbs in limbs_of_bodies(parents):
        first, *others = limbs[np.argsort(moved[limbs])].tolist()
        if others and moved[first] < STILL**2 * moved[others[0]] < np.inf:
            found.append(first)
    return found


def is_steady(markers: Floats) -> bool:
    """Return whether a limb shows noise alone, or so little else that nobody stands as still.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    noise = noise_of(markers) ** 2
    return variance_in_room(markers) - noise < max(noise, STEADY**2)


def variance_in_room(markers: Floats) -> float:
    """Return the mean variance of the coordinates of a limb's markers [mm^2]; infinite if none is seen.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    shown = markers[:, ~np.isnan(markers[:, :, 0]).all(axis=0)]
    return float(np.nanvar(shown, axis=0).mean()) if shown.shape[1] else np.inf


def noise_of(positions: Floats) -> float:
    """Return the white noise [mm] of coordinates by their successive differences: of what moves smoothly, almost 0.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, ...), mm
        NaN where unseen.
    """
    steps = np.diff(positions, axis=0)
    return float(np.sqrt(np.nanmean(steps**2) / 2)) if np.isfinite(steps).any() else 0.0
