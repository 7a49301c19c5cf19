"""Distances that markers keep from each other, learned while a recording runs: those of one limb stay the same."""

import numpy as np

from skelgen._kernels.room_limbs import Kept
from skelgen.model.arrays import Floats, Ints

EVERY = 2
"""Frames between two looks at the distances: they change slowly."""

MEMORY = 150
"""Looks after which older ones fade."""

FEWEST_LOOKS = 25
"""Looks without which nobody knows whether a distance stays."""

RIGID, REACH = 10.0, 600.0
"""mm; largest deviation of a distance that is kept, and the largest such distance."""

FARTHER = 0.005
"""Deviation that each mm of a distance counts for: of a body that stands still all distances stay."""

MOST = 6
"""Neighbours of a marker."""

LEAST_STD, LASTS = 1.0, 2.0
"""mm; least deviation of a distance, as skin is not stiff; and the deviation above which errors last for many frames,
so that the next frame tells little that is new: its square counts 1 + (deviation / LASTS)^2 times."""


class KeptDistances:
    """Distances of markers through time; a few numbers of each two are held."""

    def __init__(self) -> None:
        self._slots: dict[int, int] = {}
        self._looks = 0
        self._count, self._mean, self._square = (np.zeros((0, 0)) for _ in range(3))
        self._now = np.empty((0, 3))

    def see(self, tracks: Ints, places: Floats) -> None:
        """Take where markers are now.

        Parameters
        ----------
        tracks : ndarray of intp, shape (n_points,)
            Which they are.
        places : ndarray, shape (n_points, 3), mm
            Where they are.
        """
        slots = self._slots_of(tracks)
        self._now[:] = np.nan
        self._now[slots] = places
        self._looks += 1
        if self._looks % EVERY == 0 and len(slots):
            gaps = places[:, np.newaxis] - places
            self._learn(np.ix_(slots, slots), np.sqrt((gaps**2).sum(axis=2)))

    def _learn(self, both: tuple[Ints, ...], distances: Floats) -> None:
        count = np.minimum(self._count[both] + 1.0, MEMORY)
        before = distances - self._mean[both]
        mean = self._mean[both] + before / count
        self._square[both] += (before * (distances - mean) - self._square[both]) / count
        self._count[both], self._mean[both] = count, mean

    def forget(self, tracks: Ints) -> None:
        """Give up tracks that have ended."""
        slots = [slot for track in tracks.tolist() if (slot := self._slots.pop(track, None)) is not None]
        for table in (self._count, self._mean, self._square):
            table[slots] = 0.0
            table[:, slots] = 0.0
        self._now[slots] = np.nan

    def of(self, tracks: Ints) -> Kept:
        """Return the distances that hidden markers keep from those that are seen, the most constant first.

        Parameters
        ----------
        tracks : ndarray of intp, shape (n,)
            Which are hidden; seen before and not now.
        """
        slots = np.array([self._slots[track] for track in tracks.tolist()], dtype=np.intp)
        mean, square = self._mean[slots], self._square[slots]
        is_kept = (self._count[slots] >= FEWEST_LOOKS) & (square <= RIGID**2) & (mean <= REACH)
        key = np.where(is_kept & np.isfinite(self._now[:, 0]), square + (FARTHER * mean) ** 2, np.inf)
        chosen = np.argsort(key, axis=1)[:, :MOST]
        places = np.where(np.isfinite(np.take_along_axis(key, chosen, 1))[..., np.newaxis], self._now[chosen], np.nan)
        square = np.take_along_axis(square, chosen, 1)
        variances = LEAST_STD**2 + square * (1.0 + square / LASTS**2)
        return Kept(places, np.take_along_axis(mean, chosen, 1), variances)

    def _slots_of(self, tracks: Ints) -> Ints:
        used = set(self._slots.values())
        free = (slot for slot in range(len(used) + len(tracks)) if slot not in used)
        for track in tracks.tolist():
            if track not in self._slots:
                self._slots[track] = next(free)
        slots = np.array([self._slots[track] for track in tracks.tolist()], dtype=np.intp)
        more = max(slots.max(initial=-1) + 1 - len(self._now), 0)
        if more:
            more = max(more, len(self._now), 32)
            sides = ((0, more), (0, more))
            self._count, self._mean, self._square = (
                np.pad(table, sides) for table in (self._count, self._mean, self._square)
            )
            self._now = np.pad(self._now, (sides[0], (0, 0)), constant_values=np.nan)
        return slots
