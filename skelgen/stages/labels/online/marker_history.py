"""The history of markers: distances between them, and poses in which they were seen together.

Both are bounded. Distances have a running mean and variance over a window; two markers are rigid neighbours if the
variance is small. Of the poses a fixed number is kept, some of them recent and some spread over the past. To predict a
marker that is not seen, the poses are aligned with its visible neighbours. Rigid neighbours fix its place in every
pose, others in those poses that resemble the present one (compare Kirk, O'Brien and Forsyth 2005, who do the same for
whole takes).
"""

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.marker_history import (
    LEAST_COMMON,
    LEAST_NEIGHBOURS,
    DistanceTables,
    Neighbours,
    SeenNeighbours,
    find_neighbours,
    learn_distances,
    place_marker,
    room_for_poses,
    write_deviations,
    write_misfits,
    write_moments,
)
from skelgen.geometry.orientation import rotation_by_quaternion
from skelgen.model.arrays import Floats, Ints

RECENT, PAST = 24, 96
"""Poses that are kept of the last seconds, and of the time before."""

RECENT_SECONDS = 0.06
"""Time between two recent poses."""

NEIGHBOURS = 6
"""Visible markers by which a lost one is predicted, the most rigid first."""

LEAST_NOISE = 0.002
"""Of the typical spacing: deviations of distances are no smaller, however exact the tracker is."""


class MarkerHistory:
    """Markers in numbered slots, their distances and poses; all arrays have a fixed size.

    Parameters
    ----------
    n_slots : int
        Most markers that are remembered at a time.

    Attributes
    ----------
    window : int
        Samples of a distance over which it is averaged.
    noise : float, mm
        What distances within limbs vary by; 0 before it is known.
    label : ndarray of intp, shape (n_slots,)
        Label of the marker in each slot, -1 = free.
    n_seen, last_seen : ndarray of intp, shape (n_slots,)
        Frames in which it was seen, and the last of these.
    """

    def __init__(self, n_slots: int) -> None:
        self.label: Ints = np.full(n_slots, -1, dtype=np.intp)
        self.n_seen: Ints = np.zeros(n_slots, dtype=np.intp)
        self.last_seen: Ints = np.zeros(n_slots, dtype=np.intp)
        self._distances = DistanceTables(*np.zeros((3, n_slots, n_slots)))
        self._poses: Floats = np.full((RECENT + PAST, n_slots, 3), np.nan)
        self._aligned = room_for_poses(RECENT + PAST)
        self._places = np.empty((1 + RECENT + PAST, 4))
        self._n_past, self._past_every = 0, 1
        self._n_poses = 0
        self.window = 1
        self.noise = 0.0

    @classmethod
    def load_kernels(cls) -> None:
        """Load what numba compiled now, and not amid the first frames: a small history uses it."""
        history, slots, positions = cls(LEAST_NEIGHBOURS + 1), np.arange(LEAST_NEIGHBOURS + 1), np.eye(4, 3)
        for _ in range(LEAST_COMMON):
            history.learn(slots, positions)
        history.keep_pose(slots, positions, 1)
        history.find_noise(slots, 1.0)
        neighbours = history.neighbours(slots[:1], slots[1:])
        history.misfits(neighbours, positions[:1], positions[1:])
        history.expected(neighbours, 0, positions[1:])

    @property
    def common(self) -> Floats:
        """Samples in which two markers were seen together, shape (n_slots, n_slots)."""
        return self._distances.common

    def add(self, label: int, frame: int) -> int:
        """Take a free slot for a marker, or that of the lost one that was seen least; returns the slot, -1 for none.

        Parameters
        ----------
        label : int
            Label of the marker.
        frame : int
            Present frame.
        """
        free = np.flatnonzero(self.label < 0)
        lost = np.flatnonzero(self.last_seen < frame - 1)
        if not len(free) and not len(lost):
            return -1
        slot = int(free[0]) if len(free) else int(lost[np.argmin(self.n_seen[lost])])
        self.clear(slot)
        self.label[slot] = label
        self.last_seen[slot] = frame
        return slot

    def clear(self, slot: int) -> None:
        """Forget a marker."""
        self.label[slot], self.n_seen[slot] = -1, 0
        for table in self._distances:
            table[slot], table[:, slot] = 0.0, 0.0
        self._poses[:, slot] = np.nan

    def lost(self, visible: Ints) -> Ints:
        """Slots of markers that are remembered and not seen; `visible` has the slots of those that are."""
        is_lost = self.label >= 0
        is_lost[visible] = False
        return np.flatnonzero(is_lost)

    def note(self, slots: Ints, frame: int) -> None:
        """Note which markers are seen in a frame.

        Parameters
        ----------
        slots : ndarray of intp, shape (n,)
            The markers.
        frame : int
            Present frame.
        """
        self.n_seen[slots] += 1
        self.last_seen[slots] = frame

    def learn(self, slots: Ints, positions: Floats) -> None:
        """Add the distances between the markers of a frame to their running means and variances.

        Parameters
        ----------
        slots : ndarray of intp, shape (n,)
            The markers.
        positions : ndarray, shape (n, 3), mm
            Where they are.
        """
        learn_distances(self._distances, slots, positions, self.window)

    def keep_pose(self, slots: Ints, positions: Floats, most_every: int) -> None:
        """Keep the frame as a pose; the oldest recent one moves to the past, where one of `most_every` stays at least.

        When the past is full, every second pose of it is dropped and half as many are kept from then on, until
        `most_every` is reached; then the oldest is overwritten.

        Parameters
        ----------
        slots : ndarray of intp, shape (n,)
            Markers of the frame.
        positions : ndarray, shape (n, 3), mm
            Where they are.
        most_every : int
            Of so many recent poses at least one moves to the past.
        """
        place, turn = self._n_poses % RECENT, self._n_poses // RECENT
        if turn > 0 and self._n_poses % self._past_every == 0:
            if self._n_past == PAST and 2 * self._past_every <= most_every:
                past = self._poses[RECENT:]
                past[: PAST // 2] = past[::2].copy()
                past[PAST // 2 :] = np.nan
                self._n_past, self._past_every = PAST // 2, 2 * self._past_every
            self._poses[RECENT + self._n_past % PAST] = self._poses[place]
            self._n_past += 1
        self._poses[place] = np.nan
        self._poses[place, slots] = positions
        self._n_poses += 1

    def poses(self) -> tuple[Floats, Ints]:
        """Poses that are kept, shape (n_poses, n_markers, 3) [mm], and the labels of their markers."""
        known = np.flatnonzero(self.label >= 0)
        poses = self._poses[:, known]
        return poses[~np.isnan(poses[:, :, 0]).all(axis=1)], self.label[known]

    def deviations(self, rows: Ints, columns: Ints) -> Floats:
        """Standard deviations of distances [mm], larger where few samples are known; infinite where too few.

        Parameters
        ----------
        rows, columns : ndarray of intp
            Slots of the markers of both sides.
        """
        deviations = np.empty((len(rows), len(columns)))
        write_deviations(self._distances, rows, columns, self.window, self.noise, deviations)
        return deviations

    def distances(self, rows: Ints, columns: Ints) -> Floats:
        """Mean distances [mm] between markers, shape (n_rows, n_columns).

        Parameters
        ----------
        rows, columns : ndarray of intp
            Slots of the markers of both sides.
        """
        return np.asarray(self._distances.mean[np.ix_(rows, columns)])

    def find_noise(self, slots: Ints, spacing: float) -> None:
        """Estimate the noise: the median over markers of the deviation of the distance to the most rigid neighbour.

        Parameters
        ----------
        slots : ndarray of intp, shape (n,)
            The markers.
        spacing : float, mm
            Typical distance of a point from its nearest neighbour.
        """
        self.noise = LEAST_NOISE * spacing
        if len(slots) < 2:
            return
        deviation = self.deviations(slots, slots)
        np.fill_diagonal(deviation, np.inf)
        least = deviation.min(axis=1)
        if np.isfinite(least).any():
            self.noise = max(self.noise, float(np.median(least[np.isfinite(least)])))

    def neighbours(self, slots: Ints, visible: Ints, most: int = NEIGHBOURS) -> Neighbours:
        """The most rigid visible neighbours of markers.

        Parameters
        ----------
        slots : ndarray of intp, shape (n,)
            The markers.
        visible : ndarray of intp, shape (n_visible,)
            Slots of markers that are seen.
        most : int
            Neighbours of each marker at most.
        """
        shape = (len(slots), most)
        numbers = np.empty((len(slots), 1 + most), dtype=np.intp), np.empty(shape, dtype=np.intp)
        found = Neighbours(*numbers, np.empty(shape), np.empty(shape))
        find_neighbours(self._distances, slots, visible, self.window, self.noise, found)
        return found

    def misfits(self, neighbours: Neighbours, points: Floats, positions: Floats) -> Floats:
        """Root mean square deviation of the distances between points and the neighbours of markers.

        Parameters
        ----------
        neighbours : Neighbours
            Those of the markers that points may be.
        points : ndarray, shape (n_points, 3), mm
            Points.
        positions : ndarray, shape (n_visible, 3), mm
            Where the visible markers are.

        Returns
        -------
        ndarray, shape (n_points, n_markers)
            In deviations; infinite where too few neighbours are seen.
        """
        misfits = np.empty((len(points), len(neighbours.order)))
        some, visible = contiguous(points, positions)
        write_misfits(some, visible, neighbours, misfits)
        return misfits

    def own_misfits(self, slots: Ints, positions: Floats) -> Floats:
        """Median deviation of the distances between visible markers and their most rigid neighbours, shape (n,).

        Parameters
        ----------
        slots : ndarray of intp, shape (n,)
            The markers.
        positions : ndarray, shape (n, 3), mm
            Where they are.
        """
        _, order, deviations, means = self.neighbours(slots, slots, LEAST_NEIGHBOURS)
        apart = np.sqrt(((positions[:, np.newaxis] - positions[order]) ** 2).sum(axis=2))
        return np.asarray(np.median(np.abs(apart - means) / deviations, axis=1))

    def expected(self, neighbours: Neighbours, row: int, positions: Floats) -> tuple[Floats, float] | None:
        """Predict a lost marker, with the variance per coordinate [mm^2]; None if too little is known.

        Parameters
        ----------
        neighbours : Neighbours
            Those of some markers.
        row : int
            Which of the markers is predicted.
        positions : ndarray, shape (n_visible, 3), mm
            Where the visible markers are.
        """
        count = int((neighbours.order[row] >= 0).sum())
        if count < LEAST_NEIGHBOURS:
            return None
        weights = 1.0 / neighbours.deviations[row, :count]
        seen = SeenNeighbours(neighbours.slots[row, : 1 + count], positions[neighbours.order[row, :count]], weights)
        aligned = self._aligned
        n_used = write_moments(self._poses, seen, aligned)
        if not n_used:
            return None
        rotations = rotation_by_quaternion(aligned.moments[:n_used])
        variance = place_marker(self._poses, seen, aligned, rotations, self.noise, self._places)
        return self._places[0, :3].copy(), variance

    def join(self, young: int, old: int) -> None:
        """Merge two slots of one marker; the older keeps its label.

        Parameters
        ----------
        young : int
            Slot that is emptied.
        old : int
            Slot that stays.
        """
        common = self._distances.common
        fresh = common[young] > common[old]
        for table in self._distances:
            table[old, fresh] = table[young, fresh]
            table[fresh, old] = table[fresh, young]
        unknown = np.isnan(self._poses[:, old, 0])
        self._poses[unknown, old] = self._poses[unknown, young]
        self.n_seen[old] += self.n_seen[young]
        self.last_seen[old] = max(self.last_seen[old], self.last_seen[young])
        self.clear(young)
