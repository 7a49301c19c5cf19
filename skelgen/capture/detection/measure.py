"""What the bright spots of an image are: balls with their centres, balls that touch, or no balls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.detection.discs import Discs
from skelgen.capture.detection.separation import MARGIN
from skelgen.capture.detection.spots import (
    AREA,
    BOTTOM,
    EDGE,
    EDGE_X,
    EDGE_XX,
    EDGE_Y,
    EDGE_YY,
    FULL,
    LEFT,
    M00,
    M01,
    M02,
    M10,
    M11,
    M20,
    RIGHT,
    TOP,
)
from skelgen.capture.detection.thresholds import Thresholds
from skelgen.capture.parameters import DetectionParameters
from skelgen.capture.values import Balls, Image
from skelgen.model.arrays import Bools, Floats

_FLOOR = 0.006  # px: what the grid of pixels makes of a centre without any noise
_FITTED_FLOOR = 0.05  # px: what discs with even edges leave of balls that touch
_BLUR_VARIANCE = 0.5  # px^2 that blur adds to a disc's second moments
_TINY = 1e-3  # px^2: a spot of one row or column has no width
_ROUNDER = 0.06  # part by which the second moments of one disc may exceed those of its area


class Fits(NamedTuple):
    """What measures spots: compiled, or their plain twins."""

    edge_centres: Callable[[Image, NDArray[np.int64], float], Floats]
    own_light: Callable[[NDArray[np.int64]], Floats]
    find_discs: Callable[[Floats, float, tuple[bool, bool, bool, bool]], Discs | None]


@dataclass(frozen=True, eq=False)
class Spots:
    """The bright spots of an image, and what their balls are measured from.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The image.
    thresholds : Thresholds
        What is bright in it.
    table : ndarray of int64, shape (n_spots, N_COLUMNS)
        Its spots, by the columns of `skelgen.capture.detection.spots`.
    noise : float, grey levels
        Standard deviation of a pixel.
    fits : Fits
        What measures.
    """

    image: Image
    thresholds: Thresholds
    table: NDArray[np.int64]
    noise: float
    fits: Fits

    def balls(self, settings: DetectionParameters) -> Balls:
        """Return the balls of all spots, largest first."""
        elongation, is_cut = _elongation(self.table), self._is_cut()
        is_odd = settings.separate & _is_odd(self.table, elongation, settings.separate_elongation)
        is_small = self.table[:, AREA] <= settings.max_area
        is_alone = is_small & ~is_cut & (is_odd | (elongation <= settings.max_elongation))
        parts = []
        for spot in np.nonzero(is_small & (is_cut | is_odd))[0]:
            found = self._discs(self.table[spot])
            if found is not None and (len(found) > 1 or is_cut[spot]):
                parts.append(found)
                is_alone[spot] = False
            elif found is None and elongation[spot] > settings.max_elongation:
                is_alone[spot] = False
        rows = np.concatenate([self._single(is_alone, settings.centre == "edge"), *parts])
        rows = rows[np.argsort(-rows[:, 2], kind="stable")]
        return Balls(rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4], rows[:, 5] > 0)

    def _single(self, is_alone: Bools, by_edge: bool) -> Floats:
        """Rows x, y, area, brightness, std, touching of spots that are one ball each."""
        spots = self.table[is_alone]
        rows = _weighted(spots, self._noise_of_weight())
        if by_edge and len(spots):
            found = self.fits.edge_centres(self.image, self.table, self.thresholds.background)[is_alone]
            is_found = np.isfinite(found[:, 2])
            rows[is_found, :2] = found[is_found, :2]
            rows[is_found, 4] = np.hypot(self.noise * found[is_found, 2], _FLOOR)
        return rows

    def _noise_of_weight(self) -> float:
        """Standard deviation of a pixel between the thresholds, 1 being the upper one."""
        return self.noise / (self.thresholds.high - self.thresholds.low)

    def _is_cut(self) -> Bools:
        """Whether the image's border cuts each spot."""
        height, width = self.image.shape
        low = (self.table[:, [LEFT, TOP]] == 0).any(axis=1)
        return np.asarray(low | (self.table[:, RIGHT] == width - 1) | (self.table[:, BOTTOM] == height - 1))

    def _discs(self, spot: NDArray[np.int64]) -> Floats | None:
        """Rows of the balls that discs fitted to a spot are, or None."""
        height, width = self.image.shape
        left, top = max(spot[LEFT] - MARGIN, 0), max(spot[TOP] - MARGIN, 0)
        right, bottom = min(spot[RIGHT] + MARGIN + 1, width), min(spot[BOTTOM] + MARGIN + 1, height)
        window = self.fits.own_light(self.thresholds.weights[self.image[top:bottom, left:right]])
        at_border = (bool(left == 0), bool(right == width), bool(top == 0), bool(bottom == height))
        found = self.fits.find_discs(window, self._noise_of_weight(), at_border)
        return None if found is None else _rows(found, (left, top))


def _rows(found: Discs, corner: tuple[int, int]) -> Floats:
    areas = np.pi * found.radii**2
    std = np.hypot(found.std, _FITTED_FLOOR)
    touching = np.full(len(areas), float(len(areas) > 1))
    return np.column_stack([found.centres + corner, areas, found.brightness * areas, std, touching])


def _weighted(spots: NDArray[np.int64], noise: float) -> Floats:
    """Rows of spots that are one ball each, with the seed's centres, weighted by brightness (equation 3.2)."""
    total = spots[:, M00].astype(np.float64)
    x, y = spots[:, M10] / total, spots[:, M01] / total
    spread = _about(spots[:, EDGE], spots[:, EDGE_X], spots[:, EDGE_XX], x)
    spread += _about(spots[:, EDGE], spots[:, EDGE_Y], spots[:, EDGE_YY], y)
    std = np.hypot(noise * np.sqrt(spread / 2) * FULL / total, _FLOOR)
    return np.column_stack([x, y, spots[:, AREA], total / FULL, std, np.zeros(len(spots))])


def _about(count: Any, first: Any, second: Any, centre: Floats) -> Floats:
    """Sum of squares about a centre, from the sums of values and squares."""
    return np.asarray(np.maximum(second - 2 * centre * first + centre * centre * count, 0.0))


def _covariances(spots: NDArray[np.int64]) -> tuple[Floats, Floats, Floats]:
    """Second moments xx, xy, yy [px^2] of each spot about its centre."""
    total = spots[:, M00].astype(np.float64)
    x, y = spots[:, M10] / total, spots[:, M01] / total
    return spots[:, M20] / total - x * x, spots[:, M11] / total - x * y, spots[:, M02] / total - y * y


def _elongation(spots: NDArray[np.int64]) -> Floats:
    """Longest axis of each spot over its shortest."""
    xx, xy, yy = _covariances(spots)
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return np.asarray(np.sqrt((middle + half) / np.maximum(middle - half, _TINY)))


def _is_odd(spots: NDArray[np.int64], elongation: Floats, limit: float) -> Bools:
    """Whether a spot is too long, or too spread for its area, to be one disc: of a disc 4 pi sqrt(det) is the area."""
    xx, xy, yy = _covariances(spots)
    own = 4 * np.pi * np.sqrt(np.maximum(xx * yy - xy * xy, 0.0))
    area = spots[:, M00] / FULL
    return np.asarray((elongation > limit) | (own > (1 + _ROUNDER) * area + 4 * np.pi * _BLUR_VARIANCE))
