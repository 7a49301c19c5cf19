"""Options that all formats with positions share: the axis that points up, the unit of length, the frame rate."""

from __future__ import annotations

from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen_formats.markers import MM_PER_UNIT
from skelgen_formats.registry import AXES_NAME, RATE_NAME, Option

AXES = Option(
    AXES_NAME,
    AS_RECORDED,
    "Axes of the world: as recorded; z-to-y turns what was up along z up along y, y-to-z the other way.",
    tuple(TURNS),
    reading=False,
)
"""Obeyed by the registry, for every format that has it among its options."""

UNIT = Option("unit", "mm", "Unit of the lengths in the file.", ("mm", "cm", "m"), reading=False)
"""Obeyed by each writer."""

RATE = Option(
    RATE_NAME,
    AS_RECORDED_RATE,
    "Frame rate of the file, 0 as recorded; between frames positions go straight, rotations turn evenly, gaps stay.",
    reading=False,
    unit="Hz",
    low=0.0,
    high=1e5,
)
"""Obeyed by the registry, for every format that has it among its options."""


def per_mm(unit: str) -> float:
    """Return how many of the unit a millimetre has, for one of `UNIT.choices`."""
    return 1.0 / MM_PER_UNIT[unit]
