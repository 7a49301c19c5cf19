"""The history of markers: distances between them, and poses in which they were seen together.

Both are bounded. Distances have a running mean and variance over a window; two markers are rigid neighbours if the
variance is small. Of the poses a fixed number is kept, some of them recent and some spread over the past. To predict a
marker that is not seen, the poses are aligned with its visible neighbours. Rigid neighbours fix its place in every
pose, others in those poses that resemble the present one (compare Kirk, O'Brien and Forsyth 2005, who do the same for
whole takes).
"""

import numpy as np

from skelgen.geometry.orientation import rotation_by_quaternion
from skelgen.model.arrays import Floats, Ints

RECENT, PAST = 24, 96
"""Poses that are kept of the last seconds, and of the time before."""

RECENT_SECONDS = 0.06
"""Time between two recent poses."""

NEIGHBOURS = 6
"""Visible markers by which a lost one is predicted, the most rigid first."""

LEAST_NEIGHBOURS = 3
"""Fewer do not fix a rotation."""

PRIOR_SAMPLES = 20.0
"""Weight of the prior variance of a distance, in samples: after fewer a distance is not known to be rigid."""

PRIOR_SHARE = 0.1
"""Prior deviation of a distance, as a part of it: that of near markers across a joint."""

LEAST_COMMON = 3
"""Samples that a distance needs."""

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
    common : ndarray, shape (n_slots, n_slots)
        Samples in which two markers were seen together.
    """

    def __init__(self, n_slots: int) -> None:
        self.label: Ints = np.full(n_slots, -1, dtype=np.intp)
        self.n_seen: Ints = np.zeros(n_slots, dtype=np.intp)
        self.last_seen: Ints = np.zeros(n_slots, dtype=np.intp)
        self.common: Floats = np.zeros((n_slots, n_slots))
        self._mean: Floats = np.zeros((n_slots, n_slots))
        self._variance: Floats = np.zeros((n_slots, n_slots))
        self._poses: Floats = np.full((RECENT + PAST, n_slots, 3), np.nan)
        self._n_past, self._past_every = 0, 1
        self._n_poses = 0
        self.window = 1
        self.noise = 0.0

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
        for table in (self.common, self._mean, self._variance):
            table[slot], table[:, slot] = 0.0, 0.0
        self._poses[:, slot] = np.nan

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
        pairs = np.ix_(slots, slots)
        distance = _distances(positions, positions)
        common = self.common[pairs] + 1.0
        step = 1.0 / np.minimum(common, self.window)
        surprise = distance - self._mean[pairs]
        self.common[pairs] = common
        self._mean[pairs] += step * surprise
        self._variance[pairs] = (1.0 - step) * (self._variance[pairs] + step * surprise**2)

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
        pairs = np.ix_(rows, columns)
        common = np.minimum(self.common[pairs], self.window)
        prior = (PRIOR_SHARE * self._mean[pairs]) ** 2
        variance = (common * self._variance[pairs] + PRIOR_SAMPLES * prior) / (common + PRIOR_SAMPLES)
        return np.where(common >= LEAST_COMMON, np.sqrt(variance + self.noise**2), np.inf)

    def distances(self, rows: Ints, columns: Ints) -> Floats:
        """Mean distances [mm] between markers, shape (n_rows, n_columns).

        Parameters
        ----------
        rows, columns : ndarray of intp
            Slots of the markers of both sides.
        """
        return np.asarray(self._mean[np.ix_(rows, columns)])

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

    def misfits(self, slots: Ints, points: Floats, visible: Ints, positions: Floats) -> Floats:
        """Root mean square deviation of the distances between points and a marker's most rigid visible neighbours.

        Parameters
        ----------
        slots : ndarray of intp, shape (n_slots,)
            Markers that points may be.
        points : ndarray, shape (n_points, 3), mm
            Points.
        visible : ndarray of intp, shape (n_visible,)
            Slots of other markers that are seen.
        positions : ndarray, shape (n_visible, 3), mm
            Where they are.

        Returns
        -------
        ndarray, shape (n_points, n_slots)
            In deviations; infinite where too few neighbours are seen.
        """
        result = np.full((len(points), len(slots)), np.inf)
        if len(visible) < LEAST_NEIGHBOURS or not len(slots):
            return result
        deviation = self.deviations(slots, visible)
        deviation[slots[:, np.newaxis] == visible] = np.inf
        order = np.argsort(deviation, axis=1, kind="stable")[:, :NEIGHBOURS]
        chosen = np.take_along_axis(deviation, order, axis=1)
        mean = np.take_along_axis(self._mean[np.ix_(slots, visible)], order, axis=1)
        apart = _distances(points, positions)[:, order]
        squares = ((apart - mean) / chosen) ** 2
        enough = np.isfinite(chosen).sum(axis=1) >= LEAST_NEIGHBOURS
        known = np.isfinite(chosen).sum(axis=1).clip(1)
        result[:, enough] = np.sqrt(squares.sum(axis=2) / known)[:, enough]
        return result

    def own_misfits(self, slots: Ints, positions: Floats) -> Floats:
        """Median deviation of the distances between visible markers and their most rigid neighbours, shape (n,).

        Parameters
        ----------
        slots : ndarray of intp, shape (n,)
            The markers.
        positions : ndarray, shape (n, 3), mm
            Where they are.
        """
        deviation = self.deviations(slots, slots)
        np.fill_diagonal(deviation, np.inf)
        order = np.argsort(deviation, axis=1, kind="stable")[:, :LEAST_NEIGHBOURS]
        off = np.abs(_distances(positions, positions) - self._mean[np.ix_(slots, slots)]) / deviation
        return np.asarray(np.median(np.take_along_axis(off, order, axis=1), axis=1))

    def expected(self, slot: int, visible: Ints, positions: Floats) -> tuple[Floats, float] | None:
        """Predict a lost marker, with the variance per coordinate [mm^2]; None if too little is known.

        Parameters
        ----------
        slot : int
            The marker.
        visible, positions
            As in `misfits`.
        """
        deviation = self.deviations(np.array([slot]), visible)[0]
        order = np.argsort(deviation, kind="stable")[:NEIGHBOURS]
        order = order[np.isfinite(deviation[order])]
        if len(order) < LEAST_NEIGHBOURS:
            return None
        poses = self._poses[~np.isnan(self._poses[:, slot, 0])]
        seen = ~np.isnan(poses[:, visible[order], 0])
        usable = seen.sum(axis=1) >= LEAST_NEIGHBOURS
        if not usable.any():
            return None
        poses, seen = poses[usable], seen[usable]
        weights = seen / deviation[order]
        return _placed(poses[:, visible[order]], positions[order], weights, poses[:, slot], self.noise)

    def join(self, young: int, old: int) -> None:
        """Merge two slots of one marker; the older keeps its label.

        Parameters
        ----------
        young : int
            Slot that is emptied.
        old : int
            Slot that stays.
        """
        fresh = self.common[young] > self.common[old]
        for table in (self._mean, self._variance, self.common):
            table[old, fresh] = table[young, fresh]
            table[fresh, old] = table[fresh, young]
        unknown = np.isnan(self._poses[:, old, 0])
        self._poses[unknown, old] = self._poses[unknown, young]
        self.n_seen[old] += self.n_seen[young]
        self.last_seen[old] = max(self.last_seen[old], self.last_seen[young])
        self.clear(young)


def _distances(first: Floats, second: Floats) -> Floats:
    apart = first[:, np.newaxis] - second
    return np.asarray(np.sqrt((apart * apart).sum(axis=2)))


def _placed(
    poses: Floats, positions: Floats, weights: Floats, places: Floats, noise: float
) -> tuple[Floats, float] | None:
    """Align poses with what is seen, and average where they put a marker, weighted by how well they fit.

    Parameters
    ----------
    poses : ndarray, shape (n_poses, n_neighbours, 3), mm
        Neighbours in earlier poses.
    positions : ndarray, shape (n_neighbours, 3), mm
        Neighbours now.
    weights : ndarray, shape (n_poses, n_neighbours)
        0 for neighbours that a pose lacks.
    places : ndarray, shape (n_poses, 3), mm
        The marker in the poses.
    noise : float, mm
        Standard deviation of rigid distances.
    """
    share = (weights / weights.sum(axis=1, keepdims=True))[..., np.newaxis]
    known = np.where(share > 0, poses, 0.0)
    centre, now = (share * known).sum(axis=1), (share * positions).sum(axis=1)
    source, target = known - centre[:, np.newaxis], positions - now[:, np.newaxis]
    rotation = rotation_by_quaternion((share * target).swapaxes(1, 2) @ source)
    placed = (rotation @ (places - centre)[..., np.newaxis])[..., 0] + now
    left = target - source @ rotation.swapaxes(1, 2)
    misfit = (share * left**2).sum(axis=(1, 2))
    scale = misfit.min() + noise**2
    share_of_pose = np.exp(-0.5 * (misfit - misfit.min()) / scale)
    share_of_pose /= share_of_pose.sum()
    mean = share_of_pose @ placed
    spread = float(share_of_pose @ ((placed - mean) ** 2).sum(axis=1)) / 3
    return mean, spread + scale
