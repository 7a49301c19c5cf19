"""Two thresholds from an image's histogram, and the weight that each grey level has between them.

The brightest ten-thousandth of an image lies inside the balls, and at most a fiftieth of it is balls at all (Gaschler
2011, chapter 3.1.2). With very few or very many balls this is wrong: then the brightest pixels or the median are used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels.bright_spots import FULL
from skelgen.capture.parameters import DetectionParameters

_WHITE = 200  # grey level of half the image above which it is over-exposed
_QUANTILES = (0.1587, 0.5, 0.6915)  # of the normal distribution, at -1, 0 and 1/2 standard deviations
_LEAST_NOISE = 0.5  # grey levels: what rounding to whole levels hides
_FEW_PIXELS = 4  # counted pixels of the smallest ball: 4 x 4 px in every fourth row


@dataclass(frozen=True, eq=False)
class Thresholds:
    """What is dark, what is bright, and why there may be nothing.

    Attributes
    ----------
    background : float, grey levels
        Half of the pixels are not brighter.
    low, high : float, grey levels
        Pixels up to `low` have the weight 0, from `high` on `FULL`, and a rising one between them.
    weights : ndarray of int64, shape (256,)
        Weight of each grey level.
    notice : str
        Why the image shows no balls; empty if it may.
    """

    background: float
    low: float
    high: float
    weights: NDArray[np.int64]
    notice: str = ""


def find_thresholds(counts: NDArray[np.int64], parameters: DetectionParameters) -> Thresholds:
    """Return the thresholds of an image (Gaschler 2011, equation 3.1 and below).

    Parameters
    ----------
    counts : ndarray of int64, shape (256,)
        Histogram of the image, or of some of its rows.
    parameters : DetectionParameters
        Quantiles, mix and least contrast.
    """
    dark, bright = _levels(counts, parameters)
    margin = parameters.mix * (bright - dark)
    low, high = dark + margin, bright - margin
    notice = _why_no_balls(counts, dark, bright, parameters.min_contrast)
    part = (np.arange(256) - low) / (max(high, low + 1.0) - low)
    weights = np.round(np.clip(part, 0.0, 1.0) * FULL).astype(np.int64)
    return Thresholds(level_of(counts, 0.5), low, high, np.where(part > 0.0, np.maximum(weights, 1), 0), notice)


def level_of(counts: NDArray[np.int64], quantile: float) -> float:
    """Return a quantile of the grey levels: the darkest one that enough pixels do not exceed.

    Parameters
    ----------
    counts : ndarray of int64, shape (256,)
        Histogram.
    quantile : float
        Part of the pixels, 0 .. 1.
    """
    total = counts.cumsum()
    return float(np.searchsorted(total, quantile * total[-1]))


def dark_noise(counts: NDArray[np.int64]) -> float:
    """Return the standard deviation of the dark pixels [grey levels], from the width of the histogram's main part.

    Parameters
    ----------
    counts : ndarray of int64, shape (256,)
        Histogram of the image; balls are a small part of it.
    """
    steps = np.concatenate([[0.0], counts.cumsum() / counts.sum()])
    low, middle, high = np.interp(_QUANTILES, steps, np.arange(257))
    is_cut_off = low < 1.0  # shadows end at 0: then the brighter side tells, near the middle only
    return float(max(2 * (high - middle) if is_cut_off else middle - low, _LEAST_NOISE))


def _levels(counts: NDArray[np.int64], parameters: DetectionParameters) -> tuple[float, float]:
    """Grey levels of background and balls."""
    dark, bright = level_of(counts, parameters.dark_quantile), level_of(counts, parameters.bright_quantile)
    if bright - dark < parameters.min_contrast:  # one small ball has fewer pixels than the quantile leaves
        bright = max(bright, level_of(counts, 1.0 - _FEW_PIXELS / counts.sum()))
    middle = level_of(counts, 0.5)
    if dark - middle > (bright - middle) / 2:  # so many or so large balls that the quantile lies inside them
        dark = middle
    return dark, bright


def _why_no_balls(counts: NDArray[np.int64], dark: float, bright: float, min_contrast: float) -> str:
    middle = level_of(counts, 0.5)
    if middle >= _WHITE:
        return (
            f"the image is over-exposed: half of its pixels are at grey level {middle:.0f} of 255 or above; "
            "shorten the shutter time, lower the gain or close the aperture"
        )
    if bright - dark < min_contrast:
        return (
            f"the image shows no balls: its brightest pixels are at grey level {bright:.0f} of 255, its background at "
            f"{dark:.0f}; check lamps, lens caps and shutter time"
        )
    return ""
