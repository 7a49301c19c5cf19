"""What whole tracks tell: the pose of a frame may take left for right, a track remembers its other frames."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from skelgen.model.arrays import Ints
from skelgen.stages.known.points import TrackedPoints


def by_tracks(points: TrackedPoints, owners: Iterable[Ints], n_markers: int) -> Ints:
    """Return the marker of each point by the votes of all frames of its track.

    Each frame in which a point of a track was taken for a marker is a vote. Pairs of tracks and markers are joined,
    most votes first, unless a track of the marker is seen in the same frames.

    Parameters
    ----------
    points : TrackedPoints
        The take.
    owners : iterable of ndarray of intp, shape (n_points,)
        Markers of the points, -1 for none, from each way of following them.
    n_markers : int
        Number of markers.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for points on no track, or on one without a marker.
    """
    order = np.flatnonzero(points.tracks >= 0)
    n_tracks = int(points.tracks.max(initial=0)) + 1
    votes = np.zeros((n_tracks, n_markers), dtype=np.intp)
    for owner in owners:
        heard = order[owner[order] >= 0]
        np.add.at(votes, (points.tracks[heard], owner[heard]), 1)
    by_track = order[np.argsort(points.tracks[order], kind="stable")]
    ends = np.cumsum(np.bincount(points.tracks[by_track], minlength=n_tracks))
    frames_of = np.split(points.frames[by_track], ends[:-1])
    taken = np.zeros((n_markers, points.cloud.n_frames), dtype=np.bool_)
    marker_of_track = np.full(n_tracks, -1, dtype=np.intp)
    tracks, markers = np.nonzero(votes)
    for pair in np.argsort(-votes[tracks, markers], kind="stable").tolist():
        track, marker = tracks[pair], markers[pair]
        if marker_of_track[track] < 0 and not taken[marker, frames_of[track]].any():
            marker_of_track[track] = marker
            taken[marker, frames_of[track]] = True
    return np.where(points.tracks >= 0, marker_of_track[points.tracks], -1)
