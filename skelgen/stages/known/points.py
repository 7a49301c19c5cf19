"""A take as points in tracks, whether its markers carry names or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import follow_points


@dataclass(frozen=True, eq=False)
class TrackedPoints:
    """Points of a take, and which of them are one in time.

    Attributes
    ----------
    cloud : PointCloud
        All points that are seen.
    frames : ndarray of intp, shape (n_points,)
        Frame of each.
    tracks : ndarray of intp, shape (n_points,)
        Track of each, -1 for none; of a labelled take the index of its marker.
    names : tuple of str
        Names of the tracks of a labelled take; empty for others.
    """

    cloud: PointCloud
    frames: Ints
    tracks: Ints
    names: tuple[str, ...]

    def positions(self, owner: Ints, n_markers: int) -> Floats:
        """Return positions of markers [mm], shape (n_frames, n_markers, 3), from the marker of each point."""
        owned = owner >= 0
        placed = np.full((self.cloud.n_frames, n_markers, 3), np.nan)
        placed[self.frames[owned], owner[owned]] = self.cloud.points[owned]
        return placed


def tracked_points(
    take: PointCloud | Trajectories, parameters: LabelParameters, monitor: Monitor = SILENT
) -> TrackedPoints:
    """Return the points of a take in tracks.

    Parameters
    ----------
    take : PointCloud or Trajectories
        The take.
    parameters : LabelParameters
        How points without names are followed.
    monitor : Monitor
        Told of progress; may cancel.
    """
    if isinstance(take, PointCloud):
        frames = np.repeat(np.arange(take.n_frames), take.points_per_frame)
        owner, _ = follow_points(take, parameters, monitor)
        return TrackedPoints(take, frames, np.asarray(owner, dtype=np.intp), ())
    frames, columns = np.nonzero(~np.isnan(take.positions[:, :, 0]))
    starts = np.searchsorted(frames, np.arange(take.n_frames + 1))
    times = np.arange(take.n_frames) / take.rate
    cloud = PointCloud(take.positions[frames, columns], starts, times, name=take.name)
    return TrackedPoints(cloud, frames, columns, take.names)
