"""Points through time: where each is expected next, and which points of two cameras are no ghosts.

Where the rays of two balls meet by chance they do so for a few frames. A point that three cameras have seen is none;
one that only ever two cameras see must last.
"""

import numpy as np
from scipy.spatial import cKDTree

from skelgen.capture.room.points import REACH
from skelgen.capture.room.values import RoomPoints
from skelgen.model.arrays import Bools, Floats, Ints

LASTING = 8
"""Frames that a point of two cameras lasts if it is no ghost."""

KEPT = 5
"""Frames for which a point that is lost is still expected."""

SURE_CAMERAS = 3
"""Cameras that make no ghost."""


class PointTracks:
    """Points of all frames in turn as tracks; only the current ones are held, and a few numbers of each that was."""

    def __init__(self) -> None:
        self._places, self._speeds = np.empty((0, 3)), np.empty((0, 3))  # mm, mm/s
        self._times, self._lost = np.empty(0), np.empty(0, dtype=np.intp)
        self._tracks = np.empty(0, dtype=np.intp)
        self._lengths: list[int] = []
        self._is_sure: list[bool] = []

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
        known = before >= 0
        tracks = np.empty(len(points), dtype=np.intp)
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
        left = np.setdiff1d(np.flatnonzero(self._lost < KEPT), before)
        self._places, self._speeds = (
            np.concatenate([places, self._places[left]]),
            np.concatenate([speeds, self._speeds[left]]),
        )
        self._times = np.concatenate([np.full(len(points), time), self._times[left]])
        self._lost = np.concatenate([np.zeros(len(points), dtype=np.intp), self._lost[left] + 1])
        self._tracks = np.concatenate([tracks, self._tracks[left]])
        return tracks

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
        """The expected place that each point is, -1 if it is new; two are each other's nearest."""
        if not len(points) or not len(expected):
            return np.full(len(points), -1, dtype=np.intp)
        distance, nearest = cKDTree(expected).query(points)
        back = cKDTree(points).query(expected)[1]
        mutual = back[nearest] == np.arange(len(points))
        return np.asarray(np.where(mutual & (distance <= REACH), nearest, -1))
