"""Options that all formats with positions share: the axis that points up, and the unit of length."""

from __future__ import annotations

from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen_formats.markers import MM_PER_UNIT
from skelgen_formats.registry import AXES_NAME, Option

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


def per_mm(unit: str) -> float:
    """Return how many of the unit a millimetre has, for one of `UNIT.choices`."""
    return 1.0 / MM_PER_UNIT[unit]
