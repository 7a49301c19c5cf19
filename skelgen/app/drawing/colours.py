"""Colours of limbs, and the ramp of matrices: readable on light and on dark pages."""

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats

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
# fmt: on

# OKLab to linear sRGB, in two steps as its definition has them (Ottosson 2020, "A perceptual color space").
_LMS_FROM_LAB = np.array(
    [[1.0, 0.3963377774, 0.2158037573], [1.0, -0.1055613458, -0.0638541728], [1.0, -0.0894841775, -1.2914855480]]
)
_RGB_FROM_LMS = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)

# Small values are warm and opaque, large ones fade into the page, whichever colour that has: red, green, blue, alpha.
_RAMP = np.array(
    [
        [214, 64, 20, 255],
        [240, 140, 40, 250],
        [90, 150, 160, 235],
        [47, 110, 200, 190],
        [70, 120, 210, 100],
        [90, 130, 220, 25],
    ],
    dtype=np.float64,
)
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
