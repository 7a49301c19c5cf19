"""Markers that fall off: free fall in the room, and rest where it ends."""

from typing import NamedTuple

import numpy as np

from skelgen.geometry.standing import noise_of, rest_begins
from skelgen.geometry.statistics import median_of_known
from skelgen.model.arrays import Bools, Floats, Ints

GRAVITY = 9807.0
"""mm/s^2."""

_WINDOW_SECONDS, _LEAST_WINDOW = 0.1, 5
"""s and frames of free fall that are looked for: 5 cm of it."""

_BEFORE_REST = 2.0
"""s; what falls rolls and bounces no longer."""

_OFF_GRAVITY = 0.1
"""Part of gravity by which air, and errors of scale, change how something falls."""

_NEIGHBOURS, _LEFT, _MOMENTS = 3, 0.2, 9
"""Markers that are nearest before a fall, the least change of each one's distance, as a part of it, and frames in which
that is looked at."""

_CHANCE = 3.0
"""Standard deviations."""


class Fall(NamedTuple):
    """The first frame of a fall, and that from which on the marker lies."""

    first: int
    rest: int


def find_fall(path: Floats, rate: float) -> Fall | None:
    """Return where a marker falls freely and lies still from then on; None if it does not.

    Nothing that a body carries falls with gravity's acceleration, straight down, and lies still after that.

    Parameters
    ----------
    path : ndarray, shape (n_frames, 3), mm
        Its positions; NaN where unseen.
    rate : float, Hz
        Frame rate.
    """
    rest = rest_begins(path, rate)
    size = max(_LEAST_WINDOW, round(_WINDOW_SECONDS * rate))
    begin = max((rest or 0) - round(_BEFORE_REST * rate), 0)
    if rest is None or rest - begin < size:
        return None
    noise, place = noise_of(path[rest:]), np.nanmedian(path[rest:], axis=0)
    windows = np.lib.stride_tricks.sliding_window_view(path[begin:rest], size, axis=0)
    falling, accelerations = _is_free_fall(windows, noise, rate)
    falling &= ((place - windows[:, :, 0]) * accelerations).sum(axis=1) > GRAVITY * _drop(size / rate)
    if not falling.any():
        return None
    last = int(np.flatnonzero(falling)[-1])
    first = last - int(np.argmin(np.append(falling[: last + 1][::-1], False)))
    return Fall(begin + first + 1, rest)


def moments_of(fall: Fall, seen: Bools) -> Ints:
    """Return the last frame before a fall in which the marker is seen, else the first of all; some in which it lies.

    Parameters
    ----------
    fall : Fall
        From `find_fall`.
    seen : ndarray of bool, shape (n_frames,)
        When the marker is seen.
    """
    frames = np.flatnonzero(seen)
    lying = frames[frames >= fall.rest]
    before = frames[max(int(np.searchsorted(frames, fall.first)) - 1, 0)]
    return np.append(before, lying[np.linspace(0, len(lying) - 1, _MOMENTS).astype(np.intp)])


def has_left(positions: Floats, marker: int) -> bool:
    """Return whether a marker has left its nearest neighbours, as what falls off does; a body that rests does not.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Of all markers in the frames of `moments_of`; NaN where unseen.
    marker : int
        The marker.
    """
    apart, *later = np.linalg.norm(positions - positions[:, [marker]], axis=2)
    change, apart[marker] = median_of_known(np.abs(np.array(later) - apart)), np.nan
    known = np.flatnonzero(np.isfinite(apart) & np.isfinite(change))
    near = known[np.argsort(apart[known])[:_NEIGHBOURS]]
    return len(near) == _NEIGHBOURS and bool((change[near] > _LEFT * apart[near]).all())


def _drop(seconds: float) -> float:
    """How far something falls from rest [mm]."""
    return GRAVITY * seconds**2 / 2


def _is_free_fall(windows: Floats, noise: float, rate: float) -> tuple[Bools, Floats]:
    """Which pieces of a path, shape (n, 3, n_frames), are parabolas that gravity makes, and their accelerations."""
    size = windows.shape[2]
    times = (np.arange(size) - (size - 1) / 2) / rate
    powers = np.stack([np.ones(size), times, times**2 / 2], axis=1)
    inverse = np.linalg.pinv(powers)
    fitted = windows @ inverse.T
    off = windows - fitted @ powers.T
    acceleration = fitted[:, :, 2]
    freedoms = 3 * (size - 3)
    margin = _OFF_GRAVITY * GRAVITY + _CHANCE * noise * float(np.linalg.norm(inverse[2]))
    is_smooth = np.square(off).sum(axis=(1, 2)) <= (_CHANCE * noise) ** 2 * freedoms
    return is_smooth & (np.abs(np.linalg.norm(acceleration, axis=1) - GRAVITY) < margin), acceleration
