"""Options of readers and writers, and those that many formats share: axes, unit, frame rate, filled positions."""

from __future__ import annotations

from dataclasses import dataclass

from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen.model import Project, Take
from skelgen.model.filled import Filled
from skelgen.parameters import Declaration

_UNITS = {
    1.0: ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    10.0: ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
    100.0: ("dm",),
    1000.0: ("m", "meter", "meters", "metre", "metres"),
    25.4: ("in", "inch", "inches"),
    304.8: ("ft", "feet"),
}
MM_PER_UNIT = {name: mm for mm, names in _UNITS.items() for name in names}
"""Length units that files name, in mm."""

AUTO = "auto"
"""Find the unit from the size of the body."""


OptionValue = str | float | bool

Writable = Project | Take | Filled
"""What writers are given; each says which of these it can hold."""

AS_MOVED, AS_FOUND = "as-moved", "as-found"
"""Choices of `JOINTS`."""


@dataclass(frozen=True)
class Options:
    """What the user chose about a file; each format offers some of these, declared as an `Option` of the same name.

    Attributes
    ----------
    axes : str
        Axes of the world, one of `TURNS`.
    rate : float, Hz
        Frame rate of the file; 0 as recorded.
    unit : str
        Unit of the lengths in the file.
    filled : bool
        Whether gaps are filled, and the filled positions written.
    joints : str
        Whether joints keep the kinds found (`AS_FOUND`) or move freely where the motion does (`AS_MOVED`).
    dropout : str
        How CSM writes an unseen marker: ``word`` or ``zero``.
    id_width : str
        Bytes of a unique id in mfml, or `AUTO`.
    timestamp_unit : str
        Unit of the time stamps in mfml.
    """

    axes: str = AS_RECORDED
    rate: float = AS_RECORDED_RATE
    unit: str = "mm"
    filled: bool = False
    joints: str = AS_MOVED
    dropout: str = "word"
    id_width: str = AUTO
    timestamp_unit: str = "us"


@dataclass(frozen=True)
class Option:
    """One choice that a reader or writer offers; given by name to `read_take` and `write_file`.

    Attributes
    ----------
    name : str
        Field of `Options`, e.g. ``timestamp_unit``.
    default : str, float or bool
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
    default: OptionValue
    help: str
    choices: tuple[str, ...] = ()
    reading: bool = True
    unit: str = ""
    low: float | None = None
    high: float | None = None

    @property
    def declaration(self) -> Declaration:
        """The option as parameters are declared: for forms, and to check values."""
        bounds = (self.low, self.high, self.choices)
        return Declaration(self.name, type(self.default), self.default, self.help, self.unit, *bounds)


AXES = Option(
    "axes",
    AS_RECORDED,
    "Axes of the world: as recorded; z-to-y turns what was up along z up along y, y-to-z the other way.",
    tuple(TURNS),
    reading=False,
)
"""The registry turns the value before it is written, for every format that offers this."""

UNIT = Option("unit", "mm", "Unit of the lengths in the file.", ("mm", "cm", "m"), reading=False)
"""Each writer scales by itself."""

RATE = Option(
    "rate",
    AS_RECORDED_RATE,
    "Frame rate of the file, 0 as recorded; between frames positions go straight, rotations turn evenly, gaps stay.",
    reading=False,
    unit="Hz",
    low=0.0,
    high=1e5,
)
"""The registry resamples the value before it is written, for every format that offers this."""


FILLED = Option(
    "filled",
    False,
    "Fill the gaps of a fitted project and write the filled positions as well, listed in <stem>.filled.csv.",
    reading=False,
)
"""The option of every writer of markers."""


JOINTS = Option(
    "joints",
    AS_MOVED,
    "Joints that the motion does not hold to their kinds: free as they moved, or of the kinds found, poses changed.",
    (AS_MOVED, AS_FOUND),
    reading=False,
)
"""The option of every writer that poses a skeleton by angles."""


def per_mm(unit: str) -> float:
    """Return how many of the unit a millimetre has, for one of `UNIT.choices`."""
    return 1.0 / MM_PER_UNIT[unit]
