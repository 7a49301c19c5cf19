"""Which marker sits on which rigid limb."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats, Ints, check_floats, check_ints


@dataclass(frozen=True, eq=False)
class Limbs:
    """The result of clustering markers into rigid limbs.

    Attributes
    ----------
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb index of each marker, -1 = left out. Limbs are numbered 0 .. n_limbs - 1 without holes.
    distance_deviation : ndarray, shape (n_markers, n_markers), mm
        Standard deviation over the sampled frames of the distance between each two markers, which the clustering
        rests on; NaN where two markers are never seen together.
    """

    limb_of_marker: Ints
    distance_deviation: Floats

    def __post_init__(self) -> None:
        limb_of_marker = check_ints(self.limb_of_marker, (None,), "limb_of_marker")
        n_markers = len(limb_of_marker)
        used = np.unique(limb_of_marker[limb_of_marker >= 0])
        if (limb_of_marker < -1).any() or not np.array_equal(used, np.arange(len(used))):
            raise InputError("limbs must be numbered from 0 without holes; -1 marks what is left out")
        deviation = check_floats(self.distance_deviation, (n_markers, n_markers), "distance_deviation")
        object.__setattr__(self, "limb_of_marker", limb_of_marker)
        object.__setattr__(self, "distance_deviation", deviation)

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return int(self.limb_of_marker.max(initial=-1)) + 1

    @property
    def n_markers(self) -> int:
        """Number of markers, those left out included."""
        return len(self.limb_of_marker)

    @property
    def left_out(self) -> Ints:
        """Indices of the markers that belong to no limb."""
        return np.flatnonzero(self.limb_of_marker < 0)

    def markers_of(self, limb: int) -> Ints:
        """Indices of the markers on one limb, rising."""
        return np.flatnonzero(self.limb_of_marker == limb)
