"""Balls followed from image to image of one camera, by a local search near where even motion puts them.

Tracks must be pure and need not be long: where a second ball is nearly as near, a track ends and another one begins.
"""

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints

MIN_RATIO = 3.0
"""A track goes on if the second nearest ball is so many times farther from the expected place than the nearest."""

REACH = 0.04
"""Farthest that a ball may be from where it is expected, as a part of the image's longer side: 25 px of 640."""

MAX_PAUSE = 5.0
"""Time steps over which a track still goes on: in a longer pause any motion is possible."""


class BallTracks:
    """Tracks in the images of one camera.

    Parameters
    ----------
    size : tuple of int, px
        Width and height of the images.

    Attributes
    ----------
    first, last : list of int
        Frame in which each track begins, and in which it ends.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._reach = REACH * max(size)
        self._step = np.inf
        self._time = -np.inf
        self._places, self._speeds = np.zeros((0, 2)), np.zeros((0, 2))
        self._tracks = np.zeros(0, dtype=np.intp)
        self._n_frames = 0
        self.first: list[int] = []
        self.last: list[int] = []

    def follow(self, centres: Floats, time: float) -> Ints:
        """Add the balls of the next image to the tracks.

        Parameters
        ----------
        centres : ndarray, shape (n_balls, 2), px
            Where they are.
        time : float, s
            When.

        Returns
        -------
        ndarray of intp, shape (n_balls,)
            The track of each ball.
        """
        pause = time - self._time
        if 0 < pause < np.inf:
            self._step = min(self._step, pause)
        tracks = np.full(len(centres), -1, dtype=np.intp)
        speeds = np.zeros((len(centres), 2))
        if len(centres) and len(self._places) and 0 < pause <= MAX_PAUSE * self._step:
            before, now = self._links(centres, pause)
            tracks[now] = self._tracks[before]
            speeds[now] = (centres[now] - self._places[before]) / pause
            if len(now):  # new balls most likely move as the others do
                speeds[tracks < 0] = np.median(speeds[now], axis=0)
        new = np.flatnonzero(tracks < 0)
        tracks[new] = len(self.first) + np.arange(len(new))
        self.first.extend([self._n_frames] * len(new))
        self.last.extend([self._n_frames] * len(new))
        for track in tracks.tolist():
            self.last[track] = self._n_frames
        self._places, self._speeds, self._tracks, self._time = centres, speeds, tracks, time
        self._n_frames += 1
        return tracks

    def _links(self, centres: Floats, pause: float) -> tuple[Ints, Ints]:
        """Indices of balls of the image before and of this one that are surely the same."""
        expected = self._places + self._speeds * pause
        gaps = np.linalg.norm(expected[:, np.newaxis] - centres, axis=2)
        before, now = np.arange(len(gaps)), gaps.argmin(axis=1)
        nearest = gaps[before, now]
        is_mutual = gaps.argmin(axis=0)[now] == before
        gaps[before, now] = np.where(is_mutual, np.inf, nearest)
        others = np.minimum(gaps.min(axis=1), gaps.min(axis=0)[now])
        is_sure: Bools = is_mutual & (nearest < self._reach) & (MIN_RATIO * nearest < others)
        return before[is_sure], now[is_sure]
