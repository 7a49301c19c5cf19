"""From one image to the balls in it: thresholds, spots, centres, and the balls of spots that touch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.blobs import Balls
from skelgen.capture.detection import discs, opencv, plain
from skelgen.capture.detection.discs import Discs
from skelgen.capture.detection.parameters import DetectionParameters
from skelgen.capture.detection.separation import find_discs
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
    MOST_PIXELS,
    RIGHT,
    TOP,
)
from skelgen.capture.detection.thresholds import Thresholds, dark_noise, find_thresholds
from skelgen.capture.frames import Image
from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats

_DEFAULTS = DetectionParameters()
_FLOOR = 0.005  # px: what the grid of pixels makes of a centre without any noise
_FITTED_FLOOR = 0.03  # px: what a disc with an even edge leaves of a ball
_MARGIN = 2  # px around a spot that are dark, which tells a fit where it ends
_BLUR_VARIANCE = 0.5  # px^2 that blur adds to a disc's second moments
_TINY = 1e-3  # px^2: a spot of one row or column has no width
_ROUNDER = 0.06  # part by which the second moments of one disc may exceed those of its area


def detect_balls(
    image: Image, parameters: DetectionParameters | None = None, *, size: tuple[int, int] | None = None
) -> Balls:
    """Find the bright balls of a grey image.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        What a camera has taken.
    parameters : DetectionParameters, optional
        By default those of the seed.
    size : tuple of int, px, optional
        Width and height that the image must have, those of the calibrated camera.

    Returns
    -------
    Balls
        Largest first. Empty with a notice if the image is black, over-exposed or full of noise.

    Raises
    ------
    InputError
        If it is no grey image of 8 bits, or of another size.
    """
    settings = parameters or _DEFAULTS
    check_image(image, size)
    loops = _loops(settings.method)
    counts = loops.histogram(image, min(settings.row_step, image.shape[0]))
    thresholds = find_thresholds(counts, settings)
    if thresholds.notice:
        return _no_balls(thresholds.notice)
    spots, is_noise = loops.find_spots(image, int(thresholds.low), thresholds.weights, settings.min_area)
    if is_noise or len(spots) > settings.max_balls:
        return _no_balls(
            f"the image has more than {settings.max_balls} bright spots, which cannot all be balls; "
            "keep sunlight and lamps out of the view, or raise the detection's min_area"
        )
    noise = settings.noise or dark_noise(counts)
    found = _Found(image, thresholds, spots, noise / (thresholds.high - thresholds.low))
    return found.balls(settings)


def check_image(image: Image, size: tuple[int, int] | None = None) -> None:
    """Refuse what is no grey image of 8 bits, or has another size than the camera that was calibrated.

    Raises
    ------
    InputError
        Says what the image is and what is needed.
    """
    if not isinstance(image, np.ndarray) or image.ndim != 2 or image.dtype != np.uint8:
        shape, kind = getattr(image, "shape", None), getattr(image, "dtype", type(image).__name__)
        raise InputError(f"an image has shape {shape} and type {kind}; grey images of 8 bits are needed")
    height, width = image.shape
    if not 0 < min(height, width) <= max(height, width) <= MOST_PIXELS:
        raise InputError(f"an image has {width} x {height} pixels; sides of 1 to {MOST_PIXELS} are possible")
    if size is not None and (width, height) != tuple(size):
        raise InputError(
            f"an image has {width} x {height} pixels where the calibrated camera has {size[0]} x {size[1]}; "
            "use the calibration of this camera in this mode"
        )


@dataclass(frozen=True, eq=False)
class _Found:
    """Spots of an image, and what their balls are measured from.

    `noise` is the standard deviation of a pixel's weight, 1 being the upper threshold.
    """

    image: Image
    thresholds: Thresholds
    spots: NDArray[np.int64]
    noise: float

    def balls(self, settings: DetectionParameters) -> Balls:
        """The balls of all spots, largest first."""
        elongation = _elongation(self.spots)
        is_cut = self._is_cut()
        is_odd = _is_odd(self.spots, elongation, settings.separate_elongation) & settings.separate
        is_small = self.spots[:, AREA] <= settings.max_area
        alone = is_small & ~is_cut & ~is_odd
        parts = [_measured(self.spots[alone], self.noise)]
        for spot in np.nonzero(is_small & (is_cut | is_odd))[0]:
            fitted = self._fitted(self.spots[spot])
            if fitted is not None:
                parts.append(fitted)
            elif elongation[spot] <= settings.max_elongation and not is_cut[spot]:
                parts.append(_measured(self.spots[spot : spot + 1], self.noise))
        table = np.concatenate(parts)
        table = table[np.argsort(-table[:, 2], kind="stable")]
        return Balls(table[:, :2], table[:, 2], table[:, 3], table[:, 4], table[:, 5] > 0)

    def _is_cut(self) -> Bools:
        """Whether the image's border cuts each spot."""
        height, width = self.image.shape
        low = (self.spots[:, [LEFT, TOP]] == 0).any(axis=1)
        return np.asarray(low | (self.spots[:, RIGHT] == width - 1) | (self.spots[:, BOTTOM] == height - 1))

    def _fitted(self, spot: NDArray[np.int64]) -> Floats | None:
        """Rows of the balls that discs fitted to a spot are, or None."""
        height, width = self.image.shape
        left, top = max(spot[LEFT] - _MARGIN, 0), max(spot[TOP] - _MARGIN, 0)
        right, bottom = min(spot[RIGHT] + _MARGIN + 1, width), min(spot[BOTTOM] + _MARGIN + 1, height)
        window = self._window(spot, (left, right, top, bottom))
        at_border = (left == 0, right == width, top == 0, bottom == height)
        equations = getattr(_loops("union-find"), "normal_equations", discs.normal_equations)
        found = find_discs(window, self.noise, at_border, equations)
        return None if found is None else _rows(found, (left, top))

    def _window(self, spot: NDArray[np.int64], limits: tuple[int, int, int, int]) -> Floats:
        """Weights of a spot and of the dark around it, 1 being the upper threshold; NaN where other spots are."""
        from scipy.ndimage import label  # noqa: PLC0415 - few spots need it

        left, right, top, bottom = limits
        weights = self.thresholds.weights[self.image[top:bottom, left:right]]
        labels, n_labels = label(weights > 0)
        window = weights / FULL
        if n_labels > 1:
            sizes = np.bincount(labels.ravel())[1:]
            own = 1 + int(np.argmax(sizes))
            window[(labels != own) & (labels > 0)] = np.nan
        return np.asarray(window)


def _rows(found: Discs, corner: tuple[int, int]) -> Floats:
    areas = np.pi * found.radii**2
    std = np.hypot(found.std, _FITTED_FLOOR)
    touching = np.full(len(areas), float(len(areas) > 1))
    return np.column_stack([found.centres + corner, areas, found.brightness * areas, std, touching])


def _measured(spots: NDArray[np.int64], noise: float) -> Floats:
    """Rows x, y, area, brightness, std, touching of spots that are one ball each."""
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


def _no_balls(notice: str) -> Balls:
    nothing = np.empty(0)
    return Balls(np.empty((0, 2)), nothing, nothing, nothing, np.empty(0, dtype=np.bool_), notice)


@lru_cache(maxsize=4)
def _loops(method: str) -> ModuleType:
    """What labels the spots; the plain loops where numba cannot keep what it compiles."""
    if method == "opencv":
        return opencv
    if method == "union-find":
        try:
            from skelgen.capture.detection import compiled  # noqa: PLC0415 - numba takes a second to import
        except (ImportError, RuntimeError):
            return plain
        return compiled
    return plain
