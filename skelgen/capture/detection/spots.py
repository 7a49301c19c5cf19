"""The table of bright spots that labelling fills: whole numbers, so that every way of labelling gives the same bits.

Brightness is a weight of 0 .. `FULL` (the seed's fixed-point arithmetic); a spot is one row of sums over its pixels.
"""

from __future__ import annotations

FULL = 4096
"""Weight of a pixel at or above the upper threshold: finer than 8 bits, so that rounding does not count."""

MOST_PIXELS = 16_384
"""Longest side [px] of an image whose second moments cannot overflow 63 bits."""

MOST_RUNS = 30_000
"""Runs of bright pixels beyond which an image is noise: 40 balls have about 1000."""

(
    AREA,  # pixels above the lower threshold
    M00,  # sum of weights w
    M10,  # sum of w x
    M01,
    M20,  # sum of w x^2
    M11,
    M02,
    EDGE,  # pixels between both thresholds, which alone carry the noise of the camera into the centre
    EDGE_X,  # sum of their x
    EDGE_Y,
    EDGE_XX,  # sum of their x^2
    EDGE_YY,
    LEFT,  # first and last column and row
    RIGHT,
    TOP,
    BOTTOM,
) = range(16)
N_COLUMNS = 16
N_SUMS = LEFT  # the columns before are sums
