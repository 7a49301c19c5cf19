"""From one image to the balls in it: thresholds, spots, and what the spots are."""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType

import numpy as np

from skelgen.capture.detection import edges, opencv, plain, separation
from skelgen.capture.detection.measure import Fits, Spots
from skelgen.capture.detection.spots import MOST_PIXELS
from skelgen.capture.detection.thresholds import dark_noise, find_thresholds
from skelgen.capture.parameters import DetectionParameters
from skelgen.capture.values import Balls, Image
from skelgen.errors import InputError

_DEFAULTS = DetectionParameters()
_PLAIN_FITS = Fits(edges.edge_centres, separation.own_light, separation.find_discs)


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
    loops, fits = _loops(settings.method)
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
    return Spots(image, thresholds, spots, settings.noise or dark_noise(counts), fits).balls(settings)


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


def _no_balls(notice: str) -> Balls:
    nothing = np.empty(0)
    return Balls(np.empty((0, 2)), nothing, nothing, nothing, np.empty(0, dtype=np.bool_), notice)


@lru_cache(maxsize=4)
def _loops(method: str) -> tuple[ModuleType, Fits]:
    """What labels spots and what measures them; the plain loops where numba cannot keep what it compiles."""
    if method == "plain":
        return plain, _PLAIN_FITS
    try:
        from skelgen.capture.detection import compiled, compiled_separation  # noqa: PLC0415 - numba takes a second
    except (ImportError, RuntimeError):
        return (opencv if method == "opencv" else plain), _PLAIN_FITS
    fits = Fits(compiled.edge_centres, compiled_separation.own_light, compiled_separation.find_discs)
    return (opencv if method == "opencv" else compiled), fits
