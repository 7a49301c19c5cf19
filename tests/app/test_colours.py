"""Limbs have colours that are told apart, also by people who lack one of the three kinds of cones."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.app.drawing.colours import limb_colour

N_LIMBS = 20  # of a person with hands and feet: any two of them may be neighbours in the tree
APART = 10.0  # distance in CIELAB: 2 is just noticed by people who look for it

# Linear sRGB as seen without cones for long, middle and short waves: Machado, Oliveira, Fernandes 2009, severity 1
SEEN_AS = {
    "all cones": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
XYZ_FROM_RGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = XYZ_FROM_RGB.sum(axis=1)


def linear(*, dark):
    """Colours of the first limbs in linear sRGB."""
    codes = [limb_colour(limb, dark=dark) for limb in range(N_LIMBS)]
    encoded = np.array([[int(code[place : place + 2], 16) / 255 for place in (1, 3, 5)] for code in codes])
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("seen_as", SEEN_AS)
def test_any_two_limbs_are_told_apart(seen_as, dark):
    ratios = np.clip(linear(dark=dark) @ SEEN_AS[seen_as].T, 0, 1) @ XYZ_FROM_RGB.T / WHITE
    x, y, z = np.where(ratios > 0.008856, np.cbrt(ratios), 7.787 * ratios + 16 / 116).T
    lab = np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)
    distances = np.linalg.norm(lab[:, np.newaxis] - lab, axis=2) + np.diag(np.full(N_LIMBS, np.inf))
    assert distances.min() > APART


@pytest.mark.parametrize(("dark", "page"), [(False, 1.0), (True, 0.0144)])
def test_every_limb_stands_out_from_the_page(dark, page):
    """A contrast of 3, as WCAG 2.1 asks of graphics, up to the rounding of colours."""
    luminance = linear(dark=dark) @ XYZ_FROM_RGB[1]
    lighter, darker = np.maximum(luminance, page), np.minimum(luminance, page)
    assert ((lighter + 0.05) / (darker + 0.05)).min() > 2.95
