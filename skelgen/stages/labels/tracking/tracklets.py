"""Tracklets: parts of tracks that are long enough, and trimmed, to be trusted (Marker Sets in Schönauer 2007, 3.3)."""

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Ints
from skelgen.model.tracklets import TrackletPoints
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import blocks_of

LEAST_SECONDS, LEAST_SHARE = 0.5, 0.25
"""s, and part of the take: shorter tracklets are removed. The thesis removes those below half a second; a take of less
than two seconds would lose all of them, hence the share."""

STAND_ALONE_SHARE = 0.5
"""A tracklet that spans half of the take stands alone, however short the take."""


def find_tracklets(cloud: PointCloud, track_of_point: Ints, rate: float, parameters: LabelParameters) -> TrackletPoints:
    """Gather the points of each track, trim them, and drop what is too short.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        `min_range` and `trim_range`.
    """
    sizes = np.bincount(np.maximum(track_of_point, -1) + 1)[1:]
    is_long = sizes >= least_length(cloud.n_frames, rate, parameters)
    # Cut `trim` frames off both ends, but not where the take itself begins or ends
    tracklets = _gathered(cloud, track_of_point, sizes, is_long)
    start = np.where(tracklets.first > 0, parameters.trim_range, 0)
    lengths = tracklets.lengths - start - np.where(tracklets.last < tracklets.n_frames - 1, parameters.trim_range, 0)
    left = lengths > 0
    return tracklets.parts((tracklets.starts[:-1] + start)[left], lengths[left])


def _gathered(cloud: PointCloud, track_of_point: Ints, sizes: Ints, wanted: Bools) -> TrackletPoints:
    """Points of the wanted tracks, which have so many each: sorted block by block, as long takes need much memory."""
    starts = np.concatenate([[0], np.cumsum(sizes[wanted])]).astype(np.intp)
    points, frames = np.empty((2, starts[-1]), dtype=np.int32)
    following = np.full(len(sizes), -1, dtype=np.intp)  # where a track's next point goes
    following[wanted] = starts[:-1]
    for block in blocks_of(cloud):
        tracks = track_of_point[block.points]
        used = np.flatnonzero(np.append(wanted, False)[tracks])
        used = used[np.argsort(tracks[used], kind="stable")]
        tracks = tracks[used]
        begins = np.flatnonzero(np.diff(tracks, prepend=-1))
        counts = np.diff(begins, append=len(tracks))
        place = np.arange(len(tracks)) + np.repeat(following[tracks[begins]] - begins, counts)
        points[place], frames[place] = block.points.start + used, block.first + block.frames[used]
        following[tracks[begins]] += counts
    return TrackletPoints(points, frames, starts, cloud.n_frames)


def least_length(n_frames: int, rate: float, parameters: LabelParameters) -> int:
    """Return the number of frames below which a tracklet is removed.

    Parameters
    ----------
    n_frames : int
        Frames of the take.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        `min_range`.
    """
    return parameters.min_range or max(1, int(min(LEAST_SECONDS * rate, LEAST_SHARE * n_frames)))


def stand_alone_frames(n_frames: int, rate: float, parameters: LabelParameters) -> float:
    """Number of frames from which a tracklet needs no partner to be trusted.

    Parameters
    ----------
    n_frames : int
        Frames of the take.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        `stand_alone`.
    """
    return min(parameters.stand_alone * rate, STAND_ALONE_SHARE * n_frames)
