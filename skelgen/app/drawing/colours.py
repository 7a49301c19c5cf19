"""Colours of limbs, and the ramp of matrices: readable on light and on dark pages."""

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats

_FIRST_HUE = 255.0  # degrees: blue
_GOLDEN_ANGLE = 137.508  # degrees: successive hues stay far apart, however many limbs there are
_CHROMA = 0.135
_LIGHTNESS_ON_LIGHT = (0.55, 0.64, 0.47)  # cycles with the limb, so that near hues differ in lightness too
_LIGHTNESS_ON_DARK = (0.72, 0.80, 0.66)

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

    Parameters
    ----------
    limb : int
        Limb index, from 0.
    dark : bool
        Whether the page is dark.
    """
    lightness = (_LIGHTNESS_ON_DARK if dark else _LIGHTNESS_ON_LIGHT)[limb % 3]
    hue = math.radians(_FIRST_HUE + _GOLDEN_ANGLE * limb)
    lab = np.array([lightness, _CHROMA * math.cos(hue), _CHROMA * math.sin(hue)])
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
