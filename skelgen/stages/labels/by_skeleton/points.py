"""A take as points in tracks, whether its markers have names or not."""

from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.merging.bridges import follow_over_gaps
from skelgen.stages.labels.parameters import LabelParameters


@dataclass(frozen=True, eq=False)
class FollowedPoints:
    """Points of a take, and which of them are one point in several frames.

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

    def positions(self, marker_of_point: Ints, n_markers: int) -> Floats:
        """Return positions of markers [mm], shape (n_frames, n_markers, 3).

        Parameters
        ----------
        marker_of_point : ndarray of intp, shape (n_points,)
            Marker of each point, -1 for none.
        n_markers : int
            Number of markers.
        """
        owned = marker_of_point >= 0
        placed = np.full((self.cloud.n_frames, n_markers, 3), np.nan)
        placed[self.frames[owned], marker_of_point[owned]] = self.cloud.points[owned]
        return placed


def tracked_points(
    take: PointCloud | Trajectories, parameters: LabelParameters, monitor: Monitor = SILENT
) -> FollowedPoints:
    """Return the points of a take in tracks.

    Parameters
    ----------
    take : PointCloud or Trajectories
        The take.
    parameters : LabelParameters
        How points without names are followed.
    monitor : Monitor
        Receives progress; may cancel.
    """
    if isinstance(take, PointCloud):
        frames = np.repeat(np.arange(take.n_frames), take.points_per_frame)
        tracks = follow_over_gaps(take, parameters, monitor)
        return FollowedPoints(take, frames, np.asarray(tracks, dtype=np.intp), ())
    frames, columns = np.nonzero(~np.isnan(take.positions[:, :, 0]))
    starts = np.searchsorted(frames, np.arange(take.n_frames + 1))
    times = np.arange(take.n_frames) / take.rate
    cloud = PointCloud(take.positions[frames, columns], starts, times, name=take.name)
    return FollowedPoints(cloud, frames, columns, take.names)
