"""Joints that hold for a part of a take: partners who hold hands, a tool that is taken."""

from collections.abc import Sequence
from dataclasses import dataclass

from skelgen.errors import InputError
from skelgen.model.arrays import Floats, check_fields, set_fields


@dataclass(frozen=True, eq=False)
class JointSpan:
    """Two limbs that are joined for a span of a take only.

    Attributes
    ----------
    limbs : tuple of int
        The limbs, the lower index first.
    first_frame, last_frame : int
        The span.
    in_first, in_second : ndarray, shape (3,), mm
        The joint in the frames of both.
    gap, gap_beyond : float, mm
        Root mean square distance of its two images in the span, and their median distance in all other frames.
    is_fixed : bool
        Whether the limbs hardly rotate against each other: what is held is fixed, and the joint a point of many.
    """

    limbs: tuple[int, int]
    first_frame: int
    last_frame: int
    in_first: Floats
    in_second: Floats
    gap: float
    gap_beyond: float
    is_fixed: bool = False

    def __post_init__(self) -> None:
        check_fields(self, {"in_first": (3,), "in_second": (3,)}, finite=True)
        set_fields(self, limbs=(int(self.limbs[0]), int(self.limbs[1])))
        if not 0 <= self.first_frame <= self.last_frame:
            raise InputError(f"a joint holds from frame {self.first_frame} to frame {self.last_frame}")

    def sentence(self, names: Sequence[str]) -> str:
        """Return what a notice says of it, by the names of all limbs; those without one have their numbers."""
        first, second = (f"limb {limb}" if names[limb] == f"limb{limb}" else names[limb] for limb in self.limbs)
        how = "are fixed to each other" if self.is_fixed else "are joined"
        return (
            f"{first} and {second} {how} in frames {self.first_frame} to {self.last_frame} only: the gap of "
            f"their joint is {self.gap:.1f} mm there, {self.gap_beyond:.0f} mm in other frames"
        )
