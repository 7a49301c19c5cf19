"""Points followed from frame to frame while they arrive.

Level and slope are predicted as in whole takes (`tracking.follow`), by double exponential smoothing. The reach is found
from the innovations of the last seconds, and the state has a fixed size.
"""

import importlib
from collections import deque

import numpy as np
from scipy.spatial import cKDTree

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.parameters import LabelParameters

MOST_POINTS = 200
"""Points of a frame that are followed; where there are more, those nearest to where tracks are expected."""

MOST_TRACKS = 2000
"""Tracks that are followed at a time; only noise has more, and then the last seen are kept."""

NEWBORN_REACH = 2.0
"""A track that was seen once has only a neighbour's slope, so its next point may lie this many times farther off."""

REMEMBERED = 4096
"""Innovations that the reach is found from: a second of fifty markers."""

RENEWED = 25
"""Frames after which the reach and the spacing are found anew."""

QUANTILE, MARGIN = 0.999, 1.5
"""The reach is this often the innovation that all but one in a thousand stay below."""

LEAST_SPACINGS, MOST_SPACINGS = 0.25, 1.0
"""Bounds of the reach in typical spacings: beyond one an identity is a guess, far below bad points break tracks."""

_TRACK = np.dtype([("level", "f8", 3), ("slope", "f8", 3), ("age", np.intp), ("missed", np.intp), ("number", np.intp)])
"""A track: where it is [mm] and how it moves [mm per frame], frames for which it was followed, frames since it was
seen, and its number."""


class TrackLabels:
    """Labels that tracks carry from frame to frame, and how long tracks were followed.

    Attributes
    ----------
    age : dict of int to int
        Frames for which each track of the present frame was followed.
    """

    def __init__(self) -> None:
        self.age: dict[int, int] = {}
        self._label: dict[int, int] = {}

    def of(self, tracks: Ints) -> Ints:
        """Label of each track, -1 for none; `tracks` has shape (n,)."""
        return np.array([self._label.get(track, -1) for track in tracks.tolist()], dtype=np.intp)

    def grow_older(self, tracks: Ints) -> None:
        """Count a frame for its tracks, -1 for none, shape (n,); others are forgotten."""
        self.age = {track: self.age.get(track, 0) + 1 for track in tracks.tolist() if track >= 0}

    def keep(self, tracks: Ints, labels: Ints) -> None:
        """Keep the labels of a frame's tracks; those of tracks not seen now until another track has the label.

        Parameters
        ----------
        tracks : ndarray of intp, shape (n,)
            Tracks of the frame, -1 for none.
        labels : ndarray of intp, shape (n,)
            Label of each, -1 for none.
        """
        gone = set(tracks.tolist())
        self.drop(labels)
        self._label = {track: label for track, label in self._label.items() if track not in gone}
        known = labels >= 0
        self._label.update(zip(tracks[known].tolist(), labels[known].tolist(), strict=True))

    def drop(self, labels: Ints) -> None:
        """Take some labels away from all tracks."""
        taken = set(labels[labels >= 0].tolist())
        self._label = {track: label for track, label in self._label.items() if label not in taken}

    def clear(self) -> None:
        """Take all labels away."""
        self._label.clear()


class Links:
    """Tracks of points, one frame at a time, in bounded memory.

    Parameters
    ----------
    parameters : LabelParameters
        Their `prediction`, `smoothing`, `max_jump` and `max_gap`.

    Attributes
    ----------
    spacing : float, mm
        Typical distance between a point and its nearest neighbour; 1 before any is known.
    reach : float, mm
        Farthest that a point may lie from where its track expected it.
    """

    def __init__(self, parameters: LabelParameters) -> None:
        importlib.import_module("scipy.optimize")  # now, and not amid the first frames
        self._level_gain, self._slope_gain = parameters.update_gains
        self._max_gap, self._max_jump = parameters.max_gap, parameters.max_jump
        self._tracks = np.zeros(0, dtype=_TRACK)
        self._n_given = 0
        self._innovations: deque[float] = deque(maxlen=REMEMBERED)
        self._spacings: deque[float] = deque(maxlen=RENEWED)
        self.spacing, self.reach = 1.0, 0.0
        self._n_frames = 0

    def follow(self, points: Floats, n_steps: int) -> Ints:
        """Follow the tracks into the next frame.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            The frame.
        n_steps : int
            Frame periods since the frame before; more than 1 where frames are missing. After more than may be bridged
            all tracks end.

        Returns
        -------
        ndarray of intp, shape (n,)
            Number of the track of each point; numbers are never used again. -1 for points that are not followed.
        """
        self._tracks["missed"] += n_steps
        self._tracks = tracks = self._tracks[
            self._tracks["missed"] <= np.minimum(self._max_gap, self._tracks["age"]) + 1
        ]
        expected = tracks["level"] + tracks["missed"][:, np.newaxis] * tracks["slope"]
        chosen = _nearest(points, expected)
        self._renew(points[chosen])
        numbers = np.full(len(points), -1, dtype=np.intp)
        numbers[chosen] = self._followed(points[chosen], expected)
        return numbers

    def _followed(self, points: Floats, expected: Floats) -> Ints:
        rows, columns = _matched(expected, self.reach * np.where(self._tracks["age"] == 1, NEWBORN_REACH, 1.0), points)
        numbers = np.full(len(points), -1, dtype=np.intp)
        numbers[columns] = self._tracks["number"][rows]
        self._correct(rows, points[columns], expected[rows])
        free = np.flatnonzero(numbers < 0)
        numbers[free] = self._begin(points[free])
        return numbers

    def _correct(self, rows: Ints, points: Floats, expected: Floats) -> None:
        error, tracks = points - expected, self._tracks[rows]
        new = tracks["age"] == 1
        level_gain = np.where(new, 1.0, self._level_gain)[:, np.newaxis]
        slope_gain = np.where(new, float(self._slope_gain > 0), self._slope_gain)[:, np.newaxis]
        steady = ~new & (tracks["missed"] == 1)
        self._innovations.extend((error[steady] ** 2).sum(axis=1).tolist())
        tracks["level"] = expected + level_gain * error
        tracks["slope"] += slope_gain * error / tracks["missed"][:, np.newaxis]
        tracks["age"] += 1
        tracks["missed"] = 0
        self._tracks[rows] = tracks

    def _begin(self, points: Floats) -> Ints:
        """Begin tracks at points, with the slope of the nearest track that is seen and has one; their numbers."""
        tracks, new = self._tracks, np.zeros(len(points), dtype=_TRACK)
        new["level"], new["age"], new["number"] = points, 1, self._n_given + np.arange(len(points))
        known = tracks[(tracks["age"] > 1) & (tracks["missed"] == 0)]
        if len(known) and len(points) and self._slope_gain > 0:
            _, nearest = cKDTree(known["level"]).query(points)
            new["slope"] = known["slope"][nearest]
        self._n_given += len(points)
        tracks = np.concatenate([tracks, new])
        last_seen = np.sort(np.argsort(tracks["missed"], kind="stable")[:MOST_TRACKS])
        self._tracks = tracks[last_seen]
        return np.asarray(new["number"])

    def _renew(self, points: Floats) -> None:
        """Find spacing and reach from what was seen so far."""
        self._n_frames += 1
        is_time = self._n_frames % RENEWED == 1
        if len(points) > 1 and (is_time or not self._spacings):
            nearest, _ = cKDTree(points).query(points, k=2)
            self._spacings.append(float(np.median(nearest[:, 1])) or 1.0)
            self.spacing = float(np.median(self._spacings))
        if self._max_jump > 0:
            self.reach = self._max_jump
        elif is_time or len(self._innovations) < REMEMBERED // 4:
            self.reach = self._found_reach()

    def _found_reach(self) -> float:
        spacing = self.spacing
        if len(self._innovations) < REMEMBERED // 4:
            return MOST_SPACINGS * spacing
        usual = float(np.sqrt(np.quantile(np.array(self._innovations), QUANTILE)))
        return float(np.clip(MARGIN * usual, LEAST_SPACINGS * spacing, MOST_SPACINGS * spacing))


def _nearest(points: Floats, expected: Floats) -> Ints:
    """Indices of the points to follow: all, or the `MOST_POINTS` nearest to where tracks are expected."""
    if len(points) <= MOST_POINTS or not len(expected):
        return np.arange(min(len(points), MOST_POINTS))
    distance, _ = cKDTree(expected).query(points)
    return np.sort(np.argsort(distance, kind="stable")[:MOST_POINTS])


def _matched(expected: Floats, reaches: Floats, points: Floats) -> tuple[Ints, Ints]:
    """Tracks and their points, for the largest sum of squares by which points are nearer than the reach."""
    apart = points - expected[:, np.newaxis]
    gain = np.maximum((reaches**2)[:, np.newaxis] - (apart * apart).sum(axis=2), 0.0)
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    rows, columns = linear_sum_assignment(gain, maximize=True)
    useful = gain[rows, columns] > 0.0
    return rows[useful], columns[useful]
