"""Options of readers and writers, and those that many formats share: axes, unit, frame rate, filled positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen.parameters import Declaration

MM_PER_UNIT = {
    "mm": 1.0,
    "millimeter": 1.0,
    "millimeters": 1.0,
    "millimetre": 1.0,
    "millimetres": 1.0,
    "cm": 10.0,
    "centimeter": 10.0,
    "centimeters": 10.0,
    "centimetre": 10.0,
    "centimetres": 10.0,
    "dm": 100.0,
    "m": 1000.0,
    "meter": 1000.0,
    "meters": 1000.0,
    "metre": 1000.0,
    "metres": 1000.0,
    "in": 25.4,
    "inch": 25.4,
    "inches": 25.4,
    "ft": 304.8,
    "feet": 304.8,
}
"""Length units that files name, in mm."""

AUTO = "auto"
"""The wish that the unit be told from the size of the body."""


@dataclass(frozen=True)
class Option:
    """A choice that a reader or writer offers; given by name to `read_take` and `write_file`.

    Attributes
    ----------
    name : str
        Keyword, e.g. ``timestamp_unit``.
    default : object
        Value when nobody says otherwise.
    help : str
        One sentence for the user.
    choices : tuple of str
        Allowed values, empty for any.
    reading : bool
        Whether the reader takes it too, not only the writer.
    unit : str
        Unit of a number.
    low, high : float or None
        Bounds of a number.
    """

    name: str
    default: Any
    help: str
    choices: tuple[str, ...] = ()
    reading: bool = True
    unit: str = ""
    low: float | None = None
    high: float | None = None

    @property
    def declaration(self) -> Declaration:
        """The option as parameters are declared: for forms, and to check values."""
        kind = str if self.default is None else type(self.default)
        bounds: dict[str, Any] = {"unit": self.unit, "low": self.low, "high": self.high}
        return Declaration(self.name, kind, self.default, self.help, choices=self.choices, **bounds)


AXES = Option(
    "axes",
    AS_RECORDED,
    "Axes of the world: as recorded; z-to-y turns what was up along z up along y, y-to-z the other way.",
    tuple(TURNS),
    reading=False,
)
"""Obeyed by the registry, for every format that has it among its options."""

UNIT = Option("unit", "mm", "Unit of the lengths in the file.", ("mm", "cm", "m"), reading=False)
"""Obeyed by each writer."""

RATE = Option(
    "rate",
    AS_RECORDED_RATE,
    "Frame rate of the file, 0 as recorded; between frames positions go straight, rotations turn evenly, gaps stay.",
    reading=False,
    unit="Hz",
    low=0.0,
    high=1e5,
)
"""Obeyed by the registry, for every format that has it among its options."""


FILLED = Option(
    "filled",
    False,
    "Fill the gaps of a fitted project and write the filled positions as well, told apart by <stem>.filled.csv.",
    reading=False,
)
"""The option of every writer of markers."""


def per_mm(unit: str) -> float:
    """Return how many of the unit a millimetre has, for one of `UNIT.choices`."""
    return 1.0 / MM_PER_UNIT[unit]
