"""Which balls of both images are one, by the images before (visual tracking in Gaschler 2011, 6.3.1).

Of one pair of images only the epipolar line can tell which balls are one; over time it is simple, for two balls that
are one fit whenever both are seen. Balls are followed in each image by itself, by a local search near where even motion
puts them. A pair of balls that has fitted for longer excludes others that share one of its balls.
"""

import numpy as np

from skelgen.capture.ball_tracks import BallTracks
from skelgen.capture.values import Balls, StereoPoints
from skelgen.model.arrays import Ints

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
        """Return the points without those that the images before tell to be wrong.

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
        return points if kept.all() else _some(points, np.flatnonzero(kept))


def _some(points: StereoPoints, kept: Ints) -> StereoPoints:
    """Some of all points, with what is ambiguous among them."""
    left, right = points.left[kept], points.right[kept]
    shared = (np.bincount(left)[left] > 1) | (np.bincount(right)[right] > 1)
    slack = None if points.slack is None else points.slack[kept]
    return StereoPoints(
        points.points[kept], points.covariance[kept], left, right, points.epipolar_distance[kept], shared, slack
    )
