"""A cloud whose points have been followed: what all that merges, exchanges and moves markers knows of the take."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.likelihood import distance_sums, evidence_of_labels, sample_frames

FRAMES_AT_ONCE = 600
"""Frames whose positions are held at once."""

MOST_DISTANCES = 1_000_000
"""Distances that are held at once: of long takes, fewer moments are looked at."""

MOST_MARKERS = 200
"""Of more, none are exchanged, pushed on, or matched in groups: all pairs are looked at."""

MOST_ROUNDS = 20
"""A guard for what goes on while it gains: points between the moments, which do not count, might undo that."""


@dataclass(frozen=True, eq=False)
class FollowedCloud:
    """A cloud, the tracks of its points, and which of them keep their marker.

    Attributes
    ----------
    cloud : PointCloud
        The take.
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.
    stated : ndarray of bool, shape (n_points,), optional
        Points whose marker the user states; none, if it is not given.
    """

    cloud: PointCloud
    track_of_point: Ints
    rate: float
    spacing: float
    stated: Bools | None = None

    @cached_property
    def is_fixed(self) -> Bools:
        """Points that keep their marker, shape (n_points,)."""
        return np.zeros(self.cloud.n_points, dtype=bool) if self.stated is None else self.stated

    def frame_of_point(self) -> Ints:
        """Return the frame of each point, shape (n_points,)."""
        return np.repeat(np.arange(self.cloud.n_frames, dtype=np.int32), self.cloud.points_per_frame)

    def moments(self, n_markers: int) -> Ints:
        """Return the frames in which markers are compared: independent ones, at most `MOST_DISTANCES` distances.

        Parameters
        ----------
        n_markers : int
            Number of markers.
        """
        moments = sample_frames(self.rate, 0, self.cloud.n_frames)
        return moments[:: max(1, -(-len(moments) * n_markers**2 // MOST_DISTANCES))]

    def distances(self, marker_of_point: Ints) -> Floats:
        """Return number, sum [mm] and sum of squares [mm^2] of distances in frames that are independent.

        Parameters
        ----------
        marker_of_point : ndarray of intp, shape (n_points,)
            Marker of each point, -1 for none.

        Returns
        -------
        ndarray, shape (3, n_markers, n_markers)
        """
        n_markers = int(marker_of_point.max(initial=-1)) + 1
        frames = sample_frames(self.rate, 0, self.cloud.n_frames)
        sums = np.zeros((3, n_markers, n_markers))
        for start in range(0, len(frames), FRAMES_AT_ONCE):
            some = frames[start : start + FRAMES_AT_ONCE]
            sums += distance_sums(point_labels.sampled_positions(self.cloud, marker_of_point, some))
        return sums

    def evidence(self, marker_of_point: Ints) -> tuple[float, float]:
        """Return how well labels explain the take [nats], and how far that may be chance; see `evidence_of_labels`.

        Parameters
        ----------
        marker_of_point : ndarray of intp, shape (n_points,)
            Marker of each point, -1 for none.
        """
        return evidence_of_labels(self.distances(marker_of_point), self.spacing)
