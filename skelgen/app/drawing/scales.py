"""How values become places and colours: readable on light and on dark pages.

Round values along an axis, a logarithmic scale of colours, the ramp of matrices, colours of limbs, extremes of
stretches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats, Ints

_ROUND_STEPS = (1.0, 2.0, 5.0, 10.0)


def round_below(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that does not exceed a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(power * factor for factor in _ROUND_STEPS if power * factor <= value)


def ticks(low: float, high: float, wanted: int) -> list[float]:
    """Return about `wanted` round values that lie in low .. high.

    Parameters
    ----------
    low, high : float
        Ends of the axis.
    wanted : int
        How many.
    """
    if not high > low:
        return [low]
    rough = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in _ROUND_STEPS if power * factor >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [index * step for index in range(first, last + 1)]


_DECADES = 4.0  # range of the colours: numerical noise far below the largest value is not worth a colour


@dataclass(frozen=True)
class LogScale:
    """A logarithmic scale of matrix cells.

    Attributes
    ----------
    low, high : float
        Values that get the first and the last colour; what is lower counts as `low`.
    """

    low: float
    high: float

    @classmethod
    def of(cls, values: Floats) -> LogScale:
        """Return the scale of some values of any shape; NaN, 0 and values far below the largest do not count."""
        positive = values[values > 0]
        high = float(positive.max()) if len(positive) else 1.0
        low = max(float(positive.min()), high / 10**_DECADES) if len(positive) else high
        return cls(low, high) if low < high else cls(high / 10, high)

    def fractions(self, values: Floats) -> Floats:
        """Return where values lie on the scale, 0 .. 1, for `ramp_rgba`; NaN stays."""
        clipped_low: Floats = np.maximum(values, self.low)  # keeps NaN
        return np.asarray(np.log10(clipped_low / self.low) / np.log10(self.high / self.low))


_BLOCK = 64  # frames whose extremes are kept: an hour at 100 Hz is 6000 blocks


@dataclass(frozen=True, eq=False)
class Extremes:
    """The lowest and highest value of every stretch of a curve, quickly.

    Attributes
    ----------
    low, high : ndarray, shape (n_frames,)
        Lower and upper edge of what is drawn; the same array for a line, NaN where unknown.
    block_low, block_high : ndarray, shape (n_blocks,)
        Extremes of every 64 frames.
    """

    low: Floats
    high: Floats
    block_low: Floats
    block_high: Floats

    @classmethod
    def of(cls, low: Floats, high: Floats | None = None) -> Extremes:
        """Prepare a line, or a band between two lines.

        Parameters
        ----------
        low : ndarray, shape (n_frames,)
            The line, or the lower edge of the band; NaN where unknown.
        high : ndarray, shape (n_frames,), optional
            The upper edge of the band.
        """
        low = np.ascontiguousarray(low)
        high = low if high is None else np.ascontiguousarray(high)
        starts = np.arange(0, len(low), _BLOCK)
        if not len(low):
            return cls(low, high, low, high)
        return cls(low, high, np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts))

    def columns(self, first: float, end: float, n_columns: int) -> tuple[Floats, Floats]:
        """Return the extremes in each column of a picture.

        Where columns are narrower than frames, values between frames are interpolated.

        Parameters
        ----------
        first, end : float
            The stretch [frames] that the picture shows; frame f lies from f to f + 1.
        n_columns : int
            Columns of the picture.

        Returns
        -------
        low, high : ndarray, shape (n_columns,)
            NaN where nothing is known.
        """
        edges = np.linspace(first, end, n_columns + 1)
        per_column = (end - first) / n_columns
        if per_column <= 1:
            places = (edges[1:] + edges[:-1]) / 2 - 0.5
            return _between(self.low, places), _between(self.high, places)
        if per_column >= 2 * _BLOCK:
            return _reduced(self.block_low, self.block_high, edges / _BLOCK)
        return _reduced(self.low, self.high, edges)


def _between(values: Floats, places: Floats) -> Floats:
    """Interpolate; unknown beside an unknown frame."""
    return np.asarray(np.interp(places, np.arange(len(values)), values))


def _reduced(low: Floats, high: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """Extremes between edges that are more than one value apart."""
    starts = np.clip(edges.astype(np.intp), 0, len(low) - 1)
    last = min(int(np.ceil(edges[-1])), len(low))
    return np.fmin.reduceat(low[:last], starts[:-1]), np.fmax.reduceat(high[:last], starts[:-1])


def envelope(values: Floats, n_bins: int, upper: Floats | None = None) -> tuple[Floats, Floats, Floats]:
    """Return the extremes of a curve, or of the band below another one, in stretches of nearly equal length.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One value per frame, NaN where unknown.
    n_bins : int
        Number of stretches at most.
    upper : ndarray, shape (n,), optional
        Upper edge of the band.

    Returns
    -------
    centres, low, high : ndarray, shape (min(n, n_bins),)
        Middle of each stretch as a frame index, and its extremes; NaN where no frame of it is known.
    """
    starts, stops = bin_edges(len(values), n_bins)
    if not len(starts):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    return (starts + stops - 1) / 2, *Extremes.of(values, upper).columns(0.0, len(values), len(starts))


def bin_edges(n_frames: int, n_bins: int) -> tuple[Ints, Ints]:
    """Return first frame and end of each of at most `n_bins` stretches of nearly equal length.

    Parameters
    ----------
    n_frames : int
        Frames in all.
    n_bins : int
        Stretches at most.
    """
    edges = np.linspace(0, n_frames, min(n_frames, n_bins) + 1).astype(np.intp)
    return edges[:-1], edges[1:]


# Lightness on light and on dark pages, chroma and hue [degrees] in OKLab. Each next one is the farthest, on both kinds
# of page, from all before it and from the colour of doubts, as people see them who have all kinds of cones or lack one
# of them; after the last the first comes again. tests/gui/window/test_window_focus.py simulates these people.
# fmt: off
_COLOURS = (
    (0.49, 0.72, 0.13, 250), (0.62, 0.86, 0.07, 0), (0.40, 0.63, 0.07, 70), (0.66, 0.90, 0.07, 110),
    (0.40, 0.63, 0.16, 340), (0.62, 0.86, 0.07, 270), (0.40, 0.63, 0.16, 280), (0.40, 0.63, 0.07, 170),
    (0.62, 0.86, 0.16, 140), (0.53, 0.76, 0.07, 320), (0.53, 0.76, 0.10, 40), (0.40, 0.63, 0.16, 320),
    (0.44, 0.68, 0.10, 70), (0.53, 0.76, 0.07, 160), (0.66, 0.90, 0.07, 150), (0.49, 0.72, 0.16, 350),
    (0.66, 0.90, 0.07, 210), (0.57, 0.81, 0.07, 130), (0.44, 0.68, 0.10, 310), (0.57, 0.81, 0.10, 290),
    (0.49, 0.72, 0.13, 150), (0.44, 0.68, 0.10, 10), (0.40, 0.63, 0.13, 250), (0.57, 0.81, 0.16, 130),
    (0.57, 0.81, 0.10, 180), (0.49, 0.72, 0.07, 0), (0.57, 0.81, 0.07, 230), (0.53, 0.76, 0.16, 310),
    (0.66, 0.90, 0.13, 100), (0.40, 0.63, 0.07, 40),
)

# OKLab to linear sRGB, in two steps as its definition has them (Ottosson 2020, "A perceptual color space").
_LMS_FROM_LAB = np.array(
    [[1.0, 0.3963377774, 0.2158037573], [1.0, -0.1055613458, -0.0638541728], [1.0, -0.0894841775, -1.2914855480]]
)
_RGB_FROM_LMS = np.array([
    [4.0767416621, -3.3077115913, 0.2309699292], [-1.2684380046, 2.6097574011, -0.3413193965],
    [-0.0041960863, -0.7034186147, 1.7076147010],
])

# Small values are warm and opaque, large ones fade into the page, whichever colour that has: red, green, blue, alpha.
_RAMP = np.array([
    [214.0, 64.0, 20.0, 255.0], [240.0, 140.0, 40.0, 250.0], [90.0, 150.0, 160.0, 235.0],
    [47.0, 110.0, 200.0, 190.0], [70.0, 120.0, 210.0, 100.0], [90.0, 130.0, 220.0, 25.0],
])
# fmt: on
_UNKNOWN = (128, 128, 128, 110)


def limb_colour(limb: int, *, dark: bool = False) -> str:
    """Return the colour of a limb as ``#rrggbb``, for a light or a dark page.

    Colours of the first 16 limbs differ for people without one kind of cones as well; names, which every view
    shows on demand, are the second cue.

    Parameters
    ----------
    limb : int
        Limb index, from 0.
    dark : bool
        Whether the page is dark.
    """
    on_light, on_dark, chroma, degrees = _COLOURS[limb % len(_COLOURS)]
    hue = math.radians(degrees)
    lab = np.array([on_dark if dark else on_light, chroma * math.cos(hue), chroma * math.sin(hue)])
    linear = np.clip(_RGB_FROM_LMS @ (_LMS_FROM_LAB @ lab) ** 3, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)  # IEC 61966-2-1
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in encoded)


def ramp_rgba(fractions: Floats) -> NDArray[np.uint8]:
    """Return the colours of matrix cells.

    Parameters
    ----------
    fractions : ndarray, any shape (...)
        0 = smallest, 1 = largest value; NaN = unknown, drawn grey.

    Returns
    -------
    ndarray of uint8, shape (..., 4)
        Red, green, blue and alpha.
    """
    known = np.nan_to_num(np.clip(fractions, 0.0, 1.0))
    stops = np.linspace(0.0, 1.0, len(_RAMP))
    rgba = np.stack([np.interp(known, stops, _RAMP[:, channel]) for channel in range(4)], axis=-1)
    rgba[np.isnan(fractions)] = _UNKNOWN
    return np.asarray(np.round(rgba).astype(np.uint8))
