"""The floor: where it lies, its grid, and the shadows on it. Numbers only."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen_gui.model.viewpoint import sign_of

N_FADES = 4
"""Steps in which the grid fades toward its edge."""

_CELLS = 8  # across what is seen in a frame
_MOST_CELLS = 36  # across the take: more would be a haze
_LEAST_CELL = 1.0  # mm, beneath a single point
_BEYOND = 0.25  # of the take's extent, by which the grid exceeds it
_SOLE = 0.12  # of the height: so far may the lowest marker hang above a floor at zero


@dataclass(frozen=True, eq=False)
class Floor:
    """A grid on the floor.

    Attributes
    ----------
    up : int
        The vertical axis, 0 .. 2.
    height : float, mm
        Where the floor lies along it.
    spacing : float, mm
        Size of a cell.
    lines : ndarray, shape (n_lines, 2, 3), mm
        The sides of the cells.
    fade : ndarray of intp, shape (n_lines,)
        0 in the middle .. `N_FADES` - 1 at the edge.
    origin : ndarray, shape (3,), mm
        The world's origin, on the floor.
    """

    up: int
    height: float
    spacing: float
    lines: Floats
    fade: Ints
    origin: Floats

    def below(self, points: Floats) -> Floats:
        """Return points [mm], shape (..., 3), dropped onto the floor."""
        dropped = np.array(points)
        dropped[..., self.up] = np.where(np.isnan(dropped[..., self.up]), np.nan, self.height)
        return dropped


def find_floor(sample: Floats, inliers: Floats, size: float, up: int) -> Floor:
    """Place a floor beneath a take.

    Parameters
    ----------
    sample : ndarray, shape (n_frames, n, 3), mm
        Positions in some frames, NaN where unseen; at least one is seen.
    inliers : ndarray, shape (n, 3), mm
        The same without outliers; at least one.
    size : float, mm
        Extent of what is seen in a frame.
    up : int
        The axis that points up, or with `DOWN` added down.
    """
    level = [axis for axis in range(3) if axis != up % 3]
    box = np.stack([inliers.min(axis=0), inliers.max(axis=0)])
    axis = up % 3
    height = sign_of(up) * _height(sign_of(up) * sample[..., axis])
    extent = float((box[1] - box[0])[level].max())
    spacing = round_step(max(size / _CELLS, (1 + 2 * _BEYOND) * extent / _MOST_CELLS, _LEAST_CELL))
    margin = _BEYOND * max(extent, size) + spacing
    low = np.floor((box[0] - margin)[level] / spacing).astype(np.intp)
    high = np.ceil((box[1] + margin)[level] / spacing).astype(np.intp)
    lines = spacing * _cells(low, high)
    world = np.insert(lines, axis, height, axis=2)
    origin = np.zeros(3)
    origin[axis] = height
    middle, half = spacing * (low + high) / 2, spacing * (high - low) / 2
    far = np.linalg.norm((lines.mean(axis=1) - middle) / half, axis=1)
    fade = np.clip(far * N_FADES, 0, N_FADES - 1).astype(np.intp)
    return Floor(axis, height, spacing, world, fade, origin)


def round_step(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that does not exceed a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9))


def _height(heights: Floats) -> float:
    """The lowest height without outliers; 0 if that is little above 0, as markers sit above the sole."""
    lowest, highest = np.fmin.reduce(heights, axis=1), np.fmax.reduce(heights, axis=1)
    bottom, top = float(np.nanpercentile(lowest, 1)), float(np.nanpercentile(highest, 99))
    return 0.0 if 0.0 <= bottom <= _SOLE * (top - bottom) else bottom


def _cells(low: Ints, high: Ints) -> Floats:
    """Sides of unit cells between two corners, shape (n, 2, 2)."""
    x, y = np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)
    along_x = np.stack(np.broadcast_arrays(x[:-1, None], y, x[1:, None], y), axis=-1)
    along_y = np.stack(np.broadcast_arrays(x, y[:-1, None], x, y[1:, None]), axis=-1)
    return np.concatenate([along_x.reshape(-1, 2, 2), along_y.reshape(-1, 2, 2)]).astype(np.float64)
