"""Points through time: where each is expected next, and which points of two cameras are no ghosts.

Where the rays of two balls meet by chance they do so for a few frames. A point that three cameras have seen is none;
one that only ever two cameras see must last. A marker that is hidden is carried along by those that keep their distance
from it, as is learned while a recording runs, and a ball of one camera that lies where it must be is its own.
"""

import numpy as np

from skelgen._kernels.room_limbs import RIGID, Kept, carry
from skelgen.capture.room.points import REACH, PointMatcher, RoomPoints, Views, balls_at
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import CameraRig

LASTING = 8
"""Frames that a point of two cameras lasts if it is no ghost."""

KEPT = 5
"""Frames for which a point that is lost, and carried by no others, is still expected."""

CARRIED = 15
"""Frames for which a marker that no camera sees is carried along by others at most."""

ACCELERATION = 15e3
"""mm/s^2; by which the speed of a hidden marker may change."""

FIRST_STD = (1.0, 300.0)
"""mm and mm/s; deviation of place and speed of a marker that was just lost."""

KEEPS = 3.5
"""Standard deviations within which a distance is kept."""

MOST_STD = 20.0
"""mm; a hidden marker that is less certain is carried no farther."""

OLD = 3
"""Frames in a row after which a marker's path predicts its next place."""

CONTRADICTED = 4.0
"""Standard deviations off its marker's path from which on a point of two cameras is not the marker."""

CHANGES = 6.0
"""Variance of the second difference of three places, in variances of a place: 1 + 4 + 1."""

DOUBTED, LATEST = 2.5, 0.3
"""Frames off the path after which points are believed all the same; weight of the newest frame in a path."""

SURPRISES = 50
"""Frames over which it is learned how evenly markers move."""

HANDED_ON = 3.0
"""mm; a marker that one camera sees is handed on if its standard deviation is at most this."""

PLACED_OFF = 2.0
"""Standard deviations that a placed marker may be off a distance of its limb."""

SURE_CAMERAS = 3
"""Rays of so many cameras do not meet by chance: their point is no ghost."""


class PointTracks:
    """Points of all frames in turn as tracks; only the current ones are held, and a few numbers of each that was."""

    def __init__(self) -> None:
        self._places, self._speeds = np.empty((0, 3)), np.empty((0, 3))  # mm, mm/s
        self._times, self._lost = np.empty(0), np.empty(0, dtype=np.intp)
        self._tracks, self._unseen = np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
        self._covariances, self._hidden = np.empty((0, 6, 6)), np.empty(0, dtype=np.intp)
        self._ages, self._time = np.empty(0, dtype=np.intp), 0.0  # frames in a row, s
        self._own, self._surprise, self._n_surprises = np.empty(0), 0.0, 0  # mm^2 along an axis; frames
        self._lengths: list[int] = []
        self._is_sure: list[bool] = []
        self._distances = KeptDistances()

    def expected(self, time: float) -> Floats:
        """Return where points are expected, shape (n, 3), mm.

        Parameters
        ----------
        time : float, s
            Of the frame.
        """
        return np.asarray(self._places + (time - self._times)[:, np.newaxis] * self._speeds)

    def follow(self, points: RoomPoints, time: float) -> Ints:
        """Take the points of the next frame; return the track of each, shape (n_points,).

        Parameters
        ----------
        points : RoomPoints
            Of the frame.
        time : float, s
            Of the frame.
        """
        before, places = self._nearest(points.points, self.expected(time)), points.points
        known, n = before >= 0, len(points)
        tracks = np.empty(n, dtype=np.intp)
        tracks[known] = self._tracks[before[known]]
        tracks[~known] = len(self._lengths) + np.arange(int((~known).sum()))
        self._lengths += [0] * int((~known).sum())
        self._is_sure += [False] * int((~known).sum())
        for track, n_cameras in zip(tracks.tolist(), points.n_cameras.tolist(), strict=True):
            self._lengths[track] += 1
            self._is_sure[track] |= n_cameras >= SURE_CAMERAS
        speeds = np.zeros_like(places)
        passed = time - self._times[before[known]]
        speeds[known] = (places[known] - self._places[before[known]]) / np.maximum(passed, 1e-9)[:, np.newaxis]
        ages = np.zeros(n, dtype=np.intp)
        ages[known] = self._ages[before[known]] + 1
        own = np.zeros(n)
        own[known] = np.square(places[known] - self.expected(time)[before[known]]).mean(axis=1)
        own[known] = np.where(ages[known] > OLD, LATEST * own[known] + (1 - LATEST) * self._own[before[known]], 0.0)
        left = np.setdiff1d(np.flatnonzero((self._lost < KEPT) & (self._unseen < CARRIED)), before)
        self._distances.forget(np.setdiff1d(self._tracks, np.concatenate([tracks, self._tracks[left]])))
        zeros = np.zeros(n, dtype=np.intp)
        self._places = np.concatenate([places, self._places[left]])
        self._speeds = np.concatenate([speeds, self._speeds[left]])
        self._times = np.concatenate([np.full(n, time), self._times[left]])
        self._lost = np.concatenate([zeros, self._lost[left] + 1])
        self._unseen = np.concatenate([zeros, self._unseen[left] + 1])
        self._tracks = np.concatenate([tracks, self._tracks[left]])
        self._ages, self._time = np.concatenate([ages, self._ages[left]]), time
        self._own = np.concatenate([own, self._own[left]])
        first = np.tile(np.diag(np.repeat(np.square(FIRST_STD), 3)), (n, 1, 1))
        self._covariances = np.concatenate([first, self._covariances[left]])
        self._carry(n, time)
        return tracks

    def contradicted(self, points: RoomPoints, time: float) -> Bools:
        """Return which points of two cameras are not where their markers must be, shape (n_points,).

        A ball that is two in one image, or another marker's, moves a point along the ray of the other camera, and there
        is no third camera to tell. The path of its marker decides;
        how evenly markers move is learned from points that more cameras see.

        Parameters
        ----------
        points : RoomPoints
            Of the next frame, before `follow` takes them.
        time : float, s
            Of the frame.
        """
        wrong, expected = np.zeros(len(points), dtype=np.bool_), self.expected(time)
        before = self._nearest(points.points, expected)
        old = np.flatnonzero(before >= 0)
        old = old[self._ages[before[old]] >= OLD]
        rows, is_sure = before[old], points.n_cameras[old] >= SURE_CAMERAS
        off = points.points[old] - expected[rows]
        steps = (time - self._times[rows]) / max(time - self._time, 1e-9)
        if self._n_surprises:
            spread = CHANGES * points.covariance[old]
            surprise = np.maximum(self._surprise, self._own[rows])
            spread += ((steps * (steps + 1) / 2) ** 2 * surprise)[:, np.newaxis, np.newaxis] * np.eye(3)
            square = np.einsum("ni,ni->n", off, np.linalg.solve(spread, off[..., np.newaxis])[..., 0])
            wrong[old] = ~is_sure & (square > CONTRADICTED**2) & (steps < DOUBTED)
        sure = off[is_sure & (steps < 1.5)]
        if len(sure):
            self._n_surprises = min(self._n_surprises + 1, SURPRISES)
            self._surprise += (float(np.square(sure).mean()) - self._surprise) / self._n_surprises
        return wrong

    def _carry(self, n_seen: int, time: float) -> None:
        """Take hidden markers along with those that they keep their distances from."""
        is_marker = self.are_markers(self._tracks)
        self._distances.see(self._tracks[:n_seen][is_marker[:n_seen]], self._places[:n_seen][is_marker[:n_seen]])
        self._hidden = np.empty(0, dtype=np.intp)
        rows = n_seen + np.flatnonzero(is_marker[n_seen:])
        if not len(rows):
            return
        states = np.concatenate([self._places[rows], self._speeds[rows]], axis=1)
        covariances, passed = self._covariances[rows], time - self._times[rows]
        kept = self._distances.of(self._tracks[rows])
        fits = carry(states, covariances, kept, passed, ACCELERATION, KEEPS)
        fits &= np.trace(covariances[:, :3, :3], axis1=1, axis2=2) <= MOST_STD**2
        self._hidden = rows[fits]
        self._times[self._hidden], self._lost[self._hidden], self._ages[self._hidden] = time, 0, 0
        self._move(self._hidden, states[fits], covariances[fits])

    def _move(self, rows: Ints, states: Floats, covariances: Floats) -> None:
        self._places[rows], self._speeds[rows], self._covariances[rows] = states[:, :3], states[:, 3:], covariances

    def place_hidden(self, points: RoomPoints, matcher: PointMatcher) -> tuple[RoomPoints, Ints]:
        """Return the hidden markers that a ball of one camera makes certain, and their tracks, shape (n_points,).

        Parameters
        ----------
        points : RoomPoints
            Of the frame, as `follow` has taken them.
        matcher : PointMatcher
            Which has found them.
        """
        rows = self._hidden
        states = np.concatenate([self._places[rows], self._speeds[rows]], axis=1)
        covariances = self._covariances[rows]
        is_settled = self.are_markers(self._tracks[: len(points)]) | (points.n_cameras >= SURE_CAMERAS)
        placed = matcher.by_single_balls(points, is_settled, states, covariances)
        has_ball = np.asarray((placed.balls >= 0).any(axis=1))
        rows = rows[has_ball]
        self._move(rows, states[has_ball], covariances[has_ball])
        self._unseen[rows] = 0
        is_certain = np.trace(placed.covariance[has_ball], axis1=1, axis2=2) <= HANDED_ON**2
        is_certain &= self._keep_distances(rows)
        return placed.of(np.flatnonzero(has_ball)[is_certain]), self._tracks[rows[is_certain]]

    def _keep_distances(self, rows: Ints) -> Bools:
        """Whether hidden markers, as they were placed, still keep their distances: a joint that turns deceives."""
        kept = self._distances.of(self._tracks[rows])
        distances = np.linalg.norm(self._places[rows][:, np.newaxis] - kept.places, axis=2)
        square = (distances - kept.distances) ** 2 / kept.variances
        return np.asarray(~((square > PLACED_OFF**2) & (kept.variances <= RIGID)).any(axis=1))

    def doubt(self, tracks: Ints) -> None:
        """Count tracks as new from now on: their balls belong to other markers."""
        for track in tracks.tolist():
            self._lengths[track] = 0

    def are_markers(self, tracks: Ints, lasting: int = LASTING) -> Bools:
        """Return whether points of tracks are markers by all that was seen so far, shape (n_points,).

        Parameters
        ----------
        tracks : ndarray of intp, shape (n_points,)
            Of the points.
        lasting : int
            Frames for which a point of two cameras must have been seen.
        """
        are = [self._lengths[track] >= lasting or self._is_sure[track] for track in tracks.tolist()]
        return np.array(are, dtype=np.bool_)

    @staticmethod
    def _nearest(points: Floats, expected: Floats) -> Ints:
        """The expected place of each point, else -1: both are each other's nearest, and within `REACH`."""
        if not len(points) or not len(expected):
            return np.full(len(points), -1, dtype=np.intp)
        squares = np.square(points[:, np.newaxis] - expected).sum(axis=2)
        nearest, numbers = squares.argmin(axis=1), np.arange(len(points))
        is_it = (squares.argmin(axis=0)[nearest] == numbers) & (squares[numbers, nearest] <= REACH**2)
        return np.asarray(np.where(is_it, nearest, -1))


class RoomTracker:
    """Balls of all cameras to points that are followed; markers that one camera sees are placed by those beside them.

    Parameters
    ----------
    rig : CameraRig
        The cameras.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._matcher, self.tracks = PointMatcher(rig), PointTracks()

    def load(self) -> None:
        """Load the kernels, which takes a second."""
        nothing = self._matcher.find([balls_at(np.empty((0, 2)), 1.0)] * len(self._matcher.rig.cameras))
        states, covariances = np.empty((0, 6)), np.empty((0, 6, 6))
        carry(states, covariances, KeptDistances().of(np.empty(0, dtype=np.intp)), np.empty(0), ACCELERATION, KEEPS)
        self._matcher.by_single_balls(nothing, np.zeros(0, dtype=np.bool_), states, covariances)

    def see(self, views: Views, time: float) -> tuple[RoomPoints, Ints]:
        """Return the points of the next frame and the track of each, shape (n_points,).

        Parameters
        ----------
        views : sequence of Balls
            What each camera sees.
        time : float, s
            Of the frame.
        """
        points = self._matcher.find(views, self.tracks.expected(time))
        points = points.of(~self.tracks.contradicted(points, time))
        own = self.tracks.follow(points, time)
        placed, tracks = self.tracks.place_hidden(points, self._matcher)
        # A crossing of two rays whose ball is a hidden marker's is a ghost.
        taken = np.asarray(((points.balls[:, np.newaxis] == placed.balls) & (placed.balls >= 0)).any(axis=(1, 2)))
        self.tracks.doubt(own[taken])
        return points.of(~taken).and_also(placed), np.concatenate([own[~taken], tracks])


EVERY = 2
"""Frames between two looks at the distances: they change slowly."""

HISTORY = 150
"""Looks after which older ones fade."""

FEWEST_LOOKS = 25
"""Looks without which nobody knows whether a distance stays."""

SPREAD, LIMB_REACH = 10.0, 600.0
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
        count = np.minimum(self._count[both] + 1.0, HISTORY)
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
        is_kept = (self._count[slots] >= FEWEST_LOOKS) & (square <= SPREAD**2) & (mean <= LIMB_REACH)
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
