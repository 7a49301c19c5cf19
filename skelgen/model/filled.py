"""Markers whose gaps are filled, and what every value rests on."""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, Ints, check_floats, check_ints, set_fields
from skelgen.model.takes import Trajectories
from skelgen.progress import counted


class PositionSource(IntEnum):
    """What a marker's position in a frame rests on."""

    MEASURED = 0
    LIMB = 1
    """At least three other markers of the limb, seen in the frame."""
    JOINT = 2
    """Fewer markers of the limb, and joints that place it."""
    INTERPOLATED = 3
    """The frames before and after."""
    NONE = 4
    """Nothing: there is no position."""
    PATTERN = 5
    """The path of another marker."""

    @property
    def word(self) -> str:
        """The name for people and files: ``measured``, ``limb``, ``joint``, ``interpolated``, ``none``,
        ``pattern``.
        """
        return self.name.lower()


@dataclass(frozen=True, eq=False)
class Filled:
    """Trajectories with their gaps filled, where every filled value is marked.

    Attributes
    ----------
    measured : Trajectories
        What was seen.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        The measured positions to the last bit, and filled ones; NaN where nothing could be filled.
    source : ndarray of intp, shape (n_frames, n_markers)
        A `PositionSource` for each.
    std : ndarray, shape (n_frames, n_markers), mm
        Standard deviation of each coordinate of a filled position against what would have been measured (root mean
        square over the three axes); 0 where measured, NaN where there is none.
    """

    measured: Trajectories
    positions: Floats
    source: Ints
    std: Floats

    def __post_init__(self) -> None:
        shape = (self.measured.n_frames, self.measured.n_markers)
        positions = check_floats(self.positions, (*shape, 3), "filled positions")
        source = check_ints(self.source, shape, "source")
        seen = self.measured.seen
        if not np.array_equal(source == PositionSource.MEASURED, seen):
            raise InputError("the source of a filled take must be 'measured' where the marker is seen, and only there")
        if not np.array_equal(positions[seen], self.measured.positions[seen]):
            raise InputError("a filled take changes measured positions; they must stay as they are")
        if not np.array_equal(np.isnan(positions[:, :, 0]), source == PositionSource.NONE):
            raise InputError("the source of a filled take must be 'none' where there is no position, and only there")
        set_fields(self, positions=positions, source=source, std=check_floats(self.std, shape, "std"))

    @property
    def filled(self) -> Bools:
        """Which positions are filled, shape (n_frames, n_markers)."""
        return np.asarray((self.source != PositionSource.MEASURED) & (self.source != PositionSource.NONE))

    @property
    def trajectories(self) -> Trajectories:
        """The complete markers, for programs that do not distinguish filled ones; a notice counts these."""
        return replace(self.measured, positions=self.positions, notices=(*self.measured.notices, self.sentence))

    @property
    def sentence(self) -> str:
        """How many positions are filled, by source."""
        counts = {source: int((self.source == source).sum()) for source in PositionSource}
        if not self.filled.any() and not counts[PositionSource.NONE]:
            return "no marker has a gap: nothing is filled"
        parts = [
            f"{counts[PositionSource.LIMB]} from the limb",
            f"{counts[PositionSource.JOINT]} with a joint's help",
            f"{counts[PositionSource.INTERPOLATED]} interpolated",
            *([f"{counts[PositionSource.PATTERN]} by another marker"] if counts[PositionSource.PATTERN] else []),
            f"{counts[PositionSource.NONE]} left empty",
        ]
        filled = counted(int(self.filled.sum()), "position is", "positions are")
        return f"{filled} filled, not measured: {', '.join(parts)}"
