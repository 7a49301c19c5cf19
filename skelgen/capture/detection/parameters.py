"""What a user can set about the detection of balls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class DetectionParameters(StageParameters):
    """How balls are told from the background of an image.

    Attributes
    ----------
    bright_quantile, dark_quantile, mix, row_step, min_contrast
        The two thresholds, from the image's histogram.
    min_area, max_area, max_elongation, max_balls
        Which bright spots are balls.
    separate, separate_elongation
        Whether and when a spot is looked at as several balls that touch.
    noise
        How uncertain the brightness of a pixel is.
    centre, method
        How centres are found, and what labels the spots.
    """

    stage: ClassVar[str] = "detection"

    bright_quantile: float = declare(
        0.9999, "Part of the image's pixels that is darker than the inside of the balls.", low=0.9, high=1.0
    )
    dark_quantile: float = declare(
        0.98, "Part of the image's pixels that is darker than every ball.", low=0.1, high=1.0
    )
    mix: float = declare(
        0.2,
        "How far the two thresholds of the brightness stand off both quantiles, as a part of their difference.",
        low=0.0,
        high=0.45,
    )
    row_step: int = declare(4, "The histogram counts one row of so many.", unit="rows", low=1, high=64)
    min_contrast: float = declare(
        16.0,
        "Least difference between balls and background, below which an image counts as empty.",
        unit="grey levels",
        low=1.0,
        high=255.0,
    )
    min_area: int = declare(16, "Smallest ball, the seed's 4 x 4.", unit="px", low=1, high=100_000, basic=True)
    max_area: int = declare(4_000, "Largest spot that is looked at.", unit="px", low=1, high=10_000_000)
    max_elongation: float = declare(
        1.5,
        "Longest axis of a spot over its shortest, above which it is a reflection unless it separates into balls.",
        low=1.0,
        high=100.0,
    )
    max_balls: int = declare(500, "More spots than this are no balls but a bad image.", low=1, high=20_000)
    separate: bool = declare(True, "Whether touching balls are separated.", basic=True)
    separate_elongation: float = declare(
        1.15, "Longest axis over the shortest, above which a spot may be several balls.", low=1.05, high=10.0
    )
    noise: float = declare(
        0.0,
        "Standard deviation of a pixel at the edge of a ball; 0 = found from the image's dark part.",
        unit="grey levels",
        low=0.0,
        high=100.0,
    )
    centre: str = declare(
        "edge",
        "How the centre of a ball is found: from the grey values along its whole edge, or as in the seed, from all "
        "pixels weighted by their brightness between the thresholds.",
        choices=("edge", "brightness"),
    )
    method: str = declare(
        "union-find",
        "What labels the spots; all give the same balls. plain is slow and needs no compiler, opencv needs OpenCV.",
        choices=("union-find", "plain", "opencv"),
    )
