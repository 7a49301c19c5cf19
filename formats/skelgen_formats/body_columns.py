"""The columns of a table that belong to one point or body."""

from dataclasses import dataclass, field

from skelgen_formats.flags import Flag
from skelgen_formats.turn_titles import AXES, COMPONENTS


@dataclass
class Body:
    """The columns of a point or a body: along which axis, and which component of its quaternion, where it has one.

    Angles about x, y and z stand for a quaternion where there is none; with the order in which they turn and
    their unit, if titles say it; or the cells of a matrix. A fourth column beside x, y and z may show that these are a
    quaternion; columns of flags whether the point is seen, or how surely.
    """

    name: str
    unit: str = ""
    place: dict[str, int] = field(default_factory=dict)
    turn: dict[str, int] = field(default_factory=dict)
    angles: dict[str, int] = field(default_factory=dict)
    matrix: dict[str, int] = field(default_factory=dict)
    fourth: int | None = None
    flags: dict[int, Flag] = field(default_factory=dict)
    stated_order: str = ""
    angle_unit: str = ""

    @property
    def is_placed(self) -> bool:
        """Whether all three coordinates are there."""
        return len(self.place) == len(AXES)

    @property
    def is_turned(self) -> bool:
        """Whether a whole quaternion or matrix is there."""
        return len(self.turn) == len(COMPONENTS) or bool(self.cells)

    @property
    def cells(self) -> list[int]:
        """The columns of the nine cells of its matrix, row by row, counted from 1 or 0; empty if one is missing."""
        for first in (0, 1):
            flat = [str(key) for key in range(first, first + 9)]
            pairs = [f"{row}{column}" for row in range(first, first + 3) for column in range(first, first + 3)]
            for keys in (flat, pairs):
                if self.matrix.keys() >= {*keys}:
                    return [self.matrix[key] for key in keys]
        return []

    @property
    def has_angles(self) -> bool:
        """Whether three angles are there, and neither quaternion nor matrix."""
        return len(self.angles) == len(AXES) and not self.is_turned

    @property
    def angle_order(self) -> str:
        """How the angles turn the body: as titles say, else about the axes in the order of their columns."""
        return self.stated_order or "".join(sorted(self.angles, key=self.angles.__getitem__))

    @property
    def every_column(self) -> set[int]:
        """All columns that belong to it, but its fourth one and its flags."""
        return {at for part in (self.place, self.turn, self.angles, self.matrix) for at in part.values()}

    def columns(self, *, turned: bool) -> list[int]:
        """Return the columns of x, y, z, and of w, x, y, z, the matrix or the three angles if they are wanted."""
        if len(self.turn) == len(COMPONENTS):
            turn = [self.turn[component] for component in COMPONENTS]
        else:
            turn = self.cells or [self.angles[axis] for axis in AXES if axis in self.angles]
        return [*(self.place[axis] for axis in AXES), *(turn if turned else [])]
