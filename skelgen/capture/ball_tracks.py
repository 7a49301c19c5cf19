"""Balls followed from image to image, and which balls of both images are one (visual tracking in Gaschler 2011, 6.3.1).

Balls are followed in each image by itself, by a local search near where even motion puts them. Tracks must be pure and
need not be long: where a second ball is nearly as near, a track ends and another one begins.

Of one pair of images only the epipolar line can tell which balls are one; over time it is simple, for two balls that
are one fit whenever both are seen. A pair of balls that has fitted for longer excludes others that share one of its
balls.
"""

import numpy as np

from skelgen.capture.values import Balls, StereoPoints
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


LEAD = 5
"""Images that a pair must have fitted longer than one that it excludes: wrong pairs seldom last as long."""

MOST = 60
"""Images that count at most: a second tells enough, and what is wrong must not last."""

MISFIT = 3
"""Images that one in which both balls are seen and do not fit takes off."""


class BallPairs:
    """Remembers which balls of both images fitted each other.

    Parameters
    ----------
    left, right : tuple of int, px
        Width and height of the images.
    """

    def __init__(self, left: tuple[int, int], right: tuple[int, int]) -> None:
        self._tracks = BallTracks(left), BallTracks(right)
        self._fitted: dict[tuple[int, int], int] = {}  # images in which a left and a right track fitted

    def resolved(self, left: Balls, right: Balls, points: StereoPoints, time: float) -> StereoPoints:
        """Return the points without those that earlier images show to be wrong.

        Parameters
        ----------
        left, right : Balls
            Of both images.
        points : StereoPoints
            All that they may be.
        time : float, s
            Of the images.
        """
        tracks = [one.follow(balls.centres, time) for one, balls in zip(self._tracks, (left, right), strict=True)]
        pairs = list(zip(tracks[0][points.left].tolist(), tracks[1][points.right].tolist(), strict=True))
        there, fits = [set(side.tolist()) for side in tracks], set(pairs)
        for pair in list(self._fitted):
            if pair[0] not in there[0] or pair[1] not in there[1]:
                del self._fitted[pair]  # a track that ended does not come back
            elif pair not in fits:
                self._fitted[pair] = max(self._fitted[pair] - MISFIT, 0)
        for pair in pairs:
            self._fitted[pair] = min(self._fitted.get(pair, 0) + 1, MOST)
        counts = np.array([self._fitted[pair] for pair in pairs], dtype=np.intp)
        kept = np.ones(len(points), dtype=np.bool_)
        for balls, n_balls in ((points.left, len(left)), (points.right, len(right))):
            longest = np.zeros(n_balls, dtype=np.intp)
            np.maximum.at(longest, balls, counts)
            kept &= counts + LEAD > longest[balls]
        return points if kept.all() else _kept_points(points, np.flatnonzero(kept))


def _kept_points(points: StereoPoints, kept: Ints) -> StereoPoints:
    """Some of all points, with what is ambiguous among them."""
    left, right = points.left[kept], points.right[kept]
    shared = (np.bincount(left)[left] > 1) | (np.bincount(right)[right] > 1)
    slack = None if points.slack is None else points.slack[kept]
    return StereoPoints(
        points.points[kept], points.covariance[kept], left, right, points.epipolar_distance[kept], shared, slack
    )
