"""Bright balls in an image (Gaschler 2011, 3.1): thresholds, bright spots, centres from edges, balls that touch.

The thresholds come from the image's histogram: the brightest ten-thousandth of an image lies inside the balls, and at
most a fiftieth of it is balls at all (3.1.2). With very few or very many balls this is wrong: then the brightest pixels
or the median are used.

A ball off the axis is seen as an ellipse whose middle lies farther out than the image of the ball's centre, by the part
(radius / distance)^2 of its distance from the axis; and a lens that bends the outer edge more than the inner one shifts
it as much. At half a metre that is a tenth of a pixel, ten times what the camera's noise does. `correct_eccentricity`
takes it off.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels import bright_spots as column
from skelgen._kernels.ball_discs import BRIGHTNESS, RADIUS, STD
from skelgen._kernels.bright_spots import FULL, MOST_PIXELS, SpotTable, edge_centres, find_spots, histogram
from skelgen._kernels.camera import outline_offsets
from skelgen._kernels.touching_balls import MARGIN, find_discs, light_of_spot
from skelgen.capture.optics import camera_numbers
from skelgen.capture.parameters import DetectionParameters
from skelgen.capture.values import Balls, FrameSet, Image
from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import AnySettings, Camera

_DEFAULTS = DetectionParameters()
_FLOOR = 0.006  # px: what the grid of pixels makes of a centre without any noise
_FITTED_FLOOR = 0.05  # px: what discs with even edges leave of balls that touch
_BLUR_VARIANCE = 0.5  # px^2 that blur adds to a disc's second moments
_TINY = 1e-3  # px^2: a spot of one row or column has no width
_ROUNDER = 0.06  # part by which the second moments of one disc may exceed those of its area
_WHITE = 200  # grey level of half the image above which it is over-exposed
_QUANTILES = (0.1587, 0.5, 0.6915)  # of the normal distribution, at -1, 0 and 1/2 standard deviations
_LEAST_NOISE = 0.5  # grey levels: what rounding to whole levels hides
_FEW_PIXELS = 4  # counted pixels of the smallest ball: 4 x 4 px in every fourth row


def detect_balls(image: Image, parameters: DetectionParameters | None = None) -> Balls:
    """Find the bright balls of a grey image.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        What a camera has taken.
    parameters : DetectionParameters, optional
        Thresholds, and which spots are balls.

    Returns
    -------
    Balls
        Largest first. Empty with a notice if the image is black, over-exposed or full of noise.

    Raises
    ------
    InputError
        If it is no grey image of 8 bits.
    """
    settings = parameters or _DEFAULTS
    _check_image(image)
    image = np.ascontiguousarray(image)
    counts = histogram(image, min(settings.row_step, image.shape[0]))
    thresholds = find_thresholds(counts, settings)
    if thresholds.notice:
        return _no_balls(thresholds.notice)
    spots, is_noise = find_spots(image, int(thresholds.low), thresholds.weights, settings.min_area)
    if is_noise or len(spots) > settings.max_balls:
        return _no_balls(
            f"the image has more than {settings.max_balls} bright spots, which cannot all be balls; "
            "keep sunlight and lamps out of the view, or raise the detection's min_area"
        )
    return _Spots(image, thresholds, spots, settings.noise or dark_noise(counts)).balls(settings)


class BallFinder:
    """Images of all cameras to balls.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        The cameras, and the parameters of the detection.
    executor : Executor, optional
        Threads for the images.
    """

    def __init__(self, settings: AnySettings, executor: Executor | None = None) -> None:
        self._rig, self._executor = settings.rig, executor
        self._parameters = DetectionParameters.from_mapping(settings.detection, "detection")

    def find(self, frame: FrameSet) -> list[Balls]:
        """Return the balls that each camera shows; none where an image was lost.

        Raises
        ------
        InputError
            If there are not as many images as cameras, or one has another size than its camera.
        """
        cameras = self._rig.cameras
        if len(frame.images) != len(cameras):
            raise InputError(
                f"the source has {len(frame.images)} cameras, and the settings have {len(cameras)}: "
                f"{', '.join(self._rig.names)}"
            )
        run = map if self._executor is None else self._executor.map
        return list(run(self._balls, frame.images, cameras, self._rig.names))

    def _balls(self, image: Image | None, camera: Camera, name: str) -> Balls:
        if image is None:
            return _no_balls("")
        balls = detect_balls(image, self._parameters)
        height, width = image.shape
        if (width, height) != camera.size:
            raise InputError(
                f"{name} sends {width} x {height} pixels, and its calibration is for {camera.width} x "
                f"{camera.height}: these settings are of another rig, or it is in another mode; calibrate it again"
            )
        return correct_eccentricity(camera, balls)


def _check_image(image: Image) -> None:
    """Refuse what is no grey image of 8 bits."""
    if not isinstance(image, np.ndarray) or image.ndim != 2 or image.dtype != np.uint8:
        shape, kind = getattr(image, "shape", None), getattr(image, "dtype", type(image).__name__)
        raise InputError(f"an image has shape {shape} and type {kind}; grey images of 8 bits are needed")
    height, width = image.shape
    if not 0 < min(height, width) <= max(height, width) <= MOST_PIXELS:
        raise InputError(f"an image has {width} x {height} pixels; sides of 1 to {MOST_PIXELS} are possible")


def _no_balls(notice: str) -> Balls:
    nothing = np.empty(0)
    return Balls(np.empty((0, 2)), nothing, nothing, nothing, np.empty(0, dtype=np.bool_), notice)


@dataclass(frozen=True, eq=False)
class _Spots:
    """The bright spots of an image.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The image.
    thresholds : Thresholds
        What is bright in it.
    table : ndarray of int64, shape (n_spots, N_COLUMNS)
        Sums of each spot; see `skelgen._kernels.bright_spots`.
    noise : float, grey levels
        Standard deviation of a pixel.
    """

    image: Image
    thresholds: Thresholds
    table: SpotTable
    noise: float

    def balls(self, settings: DetectionParameters) -> Balls:
        """Return the balls of all spots, largest first."""
        height, width = self.image.shape
        is_cut = (self.table[:, [column.LEFT, column.TOP]] == 0).any(axis=1)  # by the image's border
        is_cut |= (self.table[:, column.RIGHT] == width - 1) | (self.table[:, column.BOTTOM] == height - 1)
        elongation, is_too_spread = _shapes(self.table)
        may_be_several = settings.separate & ((elongation > settings.separate_elongation) | is_too_spread)
        is_small = self.table[:, column.AREA] <= settings.max_area
        is_one_ball = is_small & ~is_cut & (may_be_several | (elongation <= settings.max_elongation))
        parts = []
        for spot in np.nonzero(is_small & (is_cut | may_be_several))[0]:
            found = self._fitted_discs(self.table[spot])
            if found is not None and (len(found) > 1 or is_cut[spot]):
                parts.append(found)
                is_one_ball[spot] = False
            elif found is None and elongation[spot] > settings.max_elongation:
                is_one_ball[spot] = False
        rows = np.concatenate([self._single_balls(is_one_ball, settings.centre == "edge"), *parts])
        rows = rows[np.argsort(-rows[:, 2], kind="stable")]
        return Balls(rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4], rows[:, 5] > 0)

    def _single_balls(self, is_one_ball: Bools, by_edge: bool) -> Floats:
        """Rows x, y, area, brightness, std, touching of spots that are one ball each."""
        spots = self.table[is_one_ball]
        rows = _weighted_centres(spots, self._noise_of_weight())
        if by_edge and len(spots):
            found = edge_centres(self.image, self.table, self.thresholds.background)[is_one_ball]
            is_found = np.isfinite(found[:, 2])
            rows[is_found, :2] = found[is_found, :2]
            rows[is_found, 4] = np.hypot(self.noise * found[is_found, 2], _FLOOR)
        return rows

    def _noise_of_weight(self) -> float:
        """Standard deviation of a pixel between the thresholds, 1 being the upper one."""
        return self.noise / (self.thresholds.high - self.thresholds.low)

    def _fitted_discs(self, spot: NDArray[np.int64]) -> Floats | None:
        """Rows of the balls that discs fitted to a spot are, or None if it is not made of discs."""
        height, width = self.image.shape
        left, top = max(spot[column.LEFT] - MARGIN, 0), max(spot[column.TOP] - MARGIN, 0)
        right, bottom = min(spot[column.RIGHT] + MARGIN + 1, width), min(spot[column.BOTTOM] + MARGIN + 1, height)
        window = light_of_spot(self.thresholds.weights[self.image[top:bottom, left:right]])
        at_border = (bool(left == 0), bool(right == width), bool(top == 0), bool(bottom == height))
        discs, _, rms = find_discs(window, self._noise_of_weight(), at_border)
        if not math.isfinite(rms):
            return None
        areas, std = np.pi * discs[:, RADIUS] ** 2, np.hypot(discs[:, STD], _FITTED_FLOOR)
        touching = np.full(len(discs), float(len(discs) > 1))
        return np.column_stack([discs[:, :RADIUS] + (left, top), areas, discs[:, BRIGHTNESS] * areas, std, touching])


def _weighted_centres(spots: SpotTable, noise: float) -> Floats:
    """Rows of spots that are one ball each, centres weighted by brightness (Gaschler 2011, equation 3.2)."""
    total = spots[:, column.M00].astype(np.float64)
    x, y = spots[:, column.M10] / total, spots[:, column.M01] / total
    in_x, in_y = [column.EDGE, column.EDGE_X, column.EDGE_XX], [column.EDGE, column.EDGE_Y, column.EDGE_YY]
    spread = _squares_about(spots[:, in_x], x) + _squares_about(spots[:, in_y], y)
    std = np.hypot(noise * np.sqrt(spread / 2) * FULL / total, _FLOOR)
    return np.column_stack([x, y, spots[:, column.AREA], total / FULL, std, np.zeros(len(spots))])


def _squares_about(sums: NDArray[np.int64], centre: Floats) -> Floats:
    """Sums of squares about a centre, from number, sum and sum of squares, shape (n, 3)."""
    count, first, second = sums.T
    return np.asarray(np.maximum(second - 2 * centre * first + centre * centre * count, 0.0))


def _shapes(spots: SpotTable) -> tuple[Floats, Bools]:
    """Longest axis of each spot over its shortest, and whether it is too spread for its area to be one disc."""
    total = spots[:, column.M00].astype(np.float64)
    x, y = spots[:, column.M10] / total, spots[:, column.M01] / total
    # second moments [px^2] about the centre; of a disc 4 pi sqrt(det) is the area
    xx, xy, yy = spots[:, [column.M20, column.M11, column.M02]].T / total - [x * x, x * y, y * y]
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    elongation = np.sqrt((middle + half) / np.maximum(middle - half, _TINY))
    own = 4 * np.pi * np.sqrt(np.maximum(xx * yy - xy * xy, 0.0))
    return elongation, own > (1 + _ROUNDER) * (spots[:, column.M00] / FULL) + 4 * np.pi * _BLUR_VARIANCE


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


def correct_eccentricity(camera: Camera, balls: Balls) -> Balls:
    """Return balls with their centres moved from the middles of their outlines to the images of their centres.

    Parameters
    ----------
    camera : Camera
        That saw them.
    balls : Balls
        As `detect_balls` finds them. Their brightness is the area of their outlines, as far as those are bright.

    Returns
    -------
    Balls
        The same balls. Those that the lens sends no ray to stay where they are.
    """
    if not len(balls):
        return balls
    centres, areas = (np.array(part, dtype=np.float64, order="C") for part in (balls.centres, balls.brightness))
    return replace(balls, centres=centres - outline_offsets(centres, areas, camera_numbers(camera)))
