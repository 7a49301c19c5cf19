"""What the search for bodies can be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class BodyParameters(StageParameters):
    """Parameters of `find_bodies`."""

    stage: ClassVar[str] = "bodies"

    max_distance: float = declare(
        5.0, "Largest root mean square distance of points from a posed target.", unit="mm", low=0.01, high=100.0
    )
    min_points: int = declare(4, "Balls of a target that must be seen at least; fewer are no proof.", low=4, high=20)
    penalty: float = declare(
        1.5, "Factor on the distance for each ball that is missing, C(m) = penalty^(k-m).", low=1.0, high=100.0
    )
    gate: float = declare(
        5.0, "Largest deviation of a distance or a point, in its own standard deviations.", low=1.0, high=100.0
    )
    floor: float = declare(
        0.2, "Distance that calibration and balls may add to the propagated noise.", unit="mm", low=1e-4, high=10.0
    )
    distinct: float = declare(
        2.0,
        "Root mean square distance by which balls must differ from others that they could be taken for.",
        unit="mm",
        low=0.0,
        high=100.0,
    )
    doubt: float = declare(
        0.001,
        "A body is left out where another pose, from other points or another order of the balls, is more likely than "
        "this to be the right one.",
        low=1e-9,
        high=0.5,
    )
    queue: int = declare(
        2000, "Edges from which a body is searched at most, the best first; a bound on the time of a frame.", low=1
    )
