"""What a user can set about the capture: detection of balls, search for rigid bodies."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class DetectionParameters(StageParameters):
    """How balls are found in an image.

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
    centre
        How centres are found.
    """

    stage: ClassVar[str] = "detection"
    retired: ClassVar[Mapping[str, str]] = {"method": ""}

    bright_quantile: float = declare(
        0.9999, "Part of the image's pixels that is darker than the inside of the balls.", within=(0.9, 1.0)
    )
    dark_quantile: float = declare(
        0.98, "Part of the image's pixels that is darker than every ball.", within=(0.1, 1.0)
    )
    mix: float = declare(
        0.2,
        "How far the two thresholds of the brightness stand off both quantiles, as a part of their difference.",
        within=(0.0, 0.45),
    )
    row_step: int = declare(4, "The histogram counts one row of so many.", unit="rows", within=(1, 64))
    min_contrast: float = declare(
        16.0,
        "Least difference between balls and background, below which an image counts as empty.",
        unit="grey levels",
        within=(1.0, 255.0),
    )
    min_area: int = declare(16, "Smallest ball.", unit="px", within=(1, 100_000), basic=True)
    max_area: int = declare(4_000, "Largest spot that is looked at.", unit="px", within=(1, 10_000_000))
    max_elongation: float = declare(
        1.5,
        "Longest axis of a spot over its shortest, above which it is a reflection unless it separates into balls.",
        within=(1.0, 100.0),
    )
    max_balls: int = declare(500, "More spots than this are no balls but a bad image.", within=(1, 20_000))
    separate: bool = declare(True, "Whether touching balls are separated.", basic=True)
    separate_elongation: float = declare(
        1.15, "Longest axis over the shortest, above which a spot may be several balls.", within=(1.05, 10.0)
    )
    noise: float = declare(
        0.0,
        "Standard deviation of a pixel at the edge of a ball; 0 = found from the image's dark part.",
        unit="grey levels",
        within=(0.0, 100.0),
    )
    centre: str = declare(
        "edge",
        "How the centre of a ball is found: from the grey values along its whole edge, or, as in "
        "Gaschler (2011), from all pixels weighted by their brightness between the thresholds.",
        choices=("edge", "brightness"),
    )


@dataclass(frozen=True)
class BodyParameters(StageParameters):
    """How rigid bodies are searched for among the points (Gaschler 2011, 3.3)."""

    stage: ClassVar[str] = "bodies"

    max_distance: float = declare(
        5.0, "Largest root mean square distance of points from a posed target.", unit="mm", within=(0.01, 100.0)
    )
    min_points: int = declare(4, "Balls of a target that must be seen at least; fewer are no proof.", within=(4, 20))
    penalty: float = declare(
        1.5, "Factor on the distance for each ball that is missing, C(m) = penalty^(k-m).", within=(1.0, 100.0)
    )
    gate: float = declare(
        5.0, "Largest deviation of a distance or a point, in its own standard deviations.", within=(1.0, 100.0)
    )
    floor: float = declare(
        0.2, "Distance that calibration and balls may add to the propagated noise.", unit="mm", within=(1e-4, 10.0)
    )
    distinct: float = declare(
        2.0,
        "Root mean square distance by which balls must differ from others that they could be taken for.",
        unit="mm",
        within=(0.0, 100.0),
    )
    doubt: float = declare(
        0.001,
        "A body is left out where another pose, from other points or another order of the balls, is more likely than "
        "this to be the right one.",
        within=(1e-9, 0.5),
    )
    queue: int = declare(
        2000,
        "Edges from which a body is searched at most, the best first; a bound on the time of a frame.",
        within=(1, None),
    )
