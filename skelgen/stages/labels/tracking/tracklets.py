"""Tracklets: parts of tracks that are long enough, and trimmed, to be trusted (Marker Sets in Schönauer 2007, 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import blocks_of

LEAST_SECONDS, LEAST_SHARE = 0.5, 0.25
"""s, and part of the take: shorter tracklets are removed. The thesis removes those below half a second; a take of less
than two seconds would lose all of them, hence the share."""

COUNTED_SHARE = 0.1
"""Part of the shortest tracklet's frames in which the number of markers must be seen."""

STAND_ALONE_SHARE = 0.5
"""A tracklet that spans half of the take stands alone, however short the take."""


@dataclass(frozen=True, eq=False)
class TrackletPoints:
    """Points of each tracklet, in order of their frames.

    Attributes
    ----------
    points : ndarray of int32, shape (n,)
        Indices into the cloud's points, tracklet after tracklet.
    frames : ndarray of int32, shape (n,)
        Frame of each of `points`.
    starts : ndarray of intp, shape (n_tracklets + 1,)
        Set k holds ``points[starts[k]:starts[k + 1]]``.
    n_frames : int
        Number of frames of the take.
    """

    points: Ints
    frames: Ints
    starts: Ints
    n_frames: int

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def lengths(self) -> Ints:
        """Number of frames in which each tracklet is seen, shape (n_tracklets,)."""
        return np.diff(self.starts)

    @property
    def first(self) -> Ints:
        """First frame of each tracklet, shape (n_tracklets,)."""
        return self.frames[self.starts[:-1]]

    @property
    def last(self) -> Ints:
        """Last frame of each tracklet, shape (n_tracklets,)."""
        return self.frames[self.starts[1:] - 1]

    @property
    def tracklet_of_point(self) -> Ints:
        """Set of each of `points`, shape (n,)."""
        return np.repeat(np.arange(len(self), dtype=np.int32), self.lengths)

    @property
    def overlaps(self) -> Bools:
        """Whether two tracklets span a common frame, shape (n_tracklets, n_tracklets); a tracklet overlaps itself."""
        begins_before: Bools = self.first[:, np.newaxis] <= self.last
        return begins_before & begins_before.T

    def chosen(self, keep: Bools) -> TrackletPoints:
        """Return only the tracklets for which `keep` holds."""
        return self.parts(self.starts[:-1][keep], self.lengths[keep])

    def within(self, chosen: Ints, first: int, last: int) -> TrackletPoints:
        """Return the parts of some tracklets in a span of frames; parts may be empty.

        Parameters
        ----------
        chosen : ndarray of intp, shape (n,)
            The tracklets.
        first, last : int
            The span, from `first` to before `last`.
        """
        begins, lengths = np.empty((2, len(chosen)), dtype=np.intp)
        for place, index in enumerate(chosen):
            start, stop = self.starts[index : index + 2]
            inside = np.searchsorted(self.frames[start:stop], [first, last])
            begins[place], lengths[place] = start + inside[0], inside[1] - inside[0]
        return self.parts(begins, lengths)

    def parts(self, begins: Ints, lengths: Ints) -> TrackletPoints:
        """Return tracklets that are parts of `points`.

        Parameters
        ----------
        begins : ndarray of intp, shape (n,)
            Place in `points` at which each begins.
        lengths : ndarray of intp, shape (n,)
            Number of points of each.
        """
        starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.intp)
        index = np.arange(starts[-1])
        index += np.repeat(begins - starts[:-1], lengths)
        return TrackletPoints(self.points[index], self.frames[index], starts, self.n_frames)

    def tracklet_of_all_points(self, n_points: int) -> Ints:
        """Set of each of all `n_points` points of the take, -1 for none, shape (n_points,)."""
        result = np.full(n_points, -1, dtype=np.int32)
        result[self.points] = self.tracklet_of_point
        return result

    def merged(self, group: Ints) -> TrackletPoints:
        """Return one tracklet for each group of tracklets that do not overlap; `group` has shape (n_tracklets,)."""
        first = np.append(self.frames, 0)[self.starts[:-1]]  # any number does for empty tracklets
        order = np.lexsort((first, group))
        sorted_sets = self.parts(self.starts[:-1][order], self.lengths[order])
        sizes = np.bincount(group, weights=self.lengths).astype(np.intp)
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)
        return TrackletPoints(sorted_sets.points, sorted_sets.frames, starts, self.n_frames)

    def indices_at(self, frames: Ints) -> Ints:
        """Index of the point of each tracklet in some frames.

        Parameters
        ----------
        frames : ndarray of intp, shape (n,)
            Distinct, rising frames.

        Returns
        -------
        ndarray of intp, shape (n, n_tracklets)
            Index into the cloud's points, -1 where the tracklet is not seen.
        """
        row_of_frame = np.full(self.n_frames, -1, dtype=np.int32)
        row_of_frame[frames] = np.arange(len(frames))
        rows = row_of_frame[self.frames]
        wanted = rows >= 0
        table = np.full((len(frames), len(self)), -1, dtype=np.intp)
        table[rows[wanted], self.tracklet_of_point[wanted]] = self.points[wanted]
        return table


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
    return _trimmed(_gathered(cloud, track_of_point, sizes, is_long), parameters.trim_range)


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


def count_markers(tracklets: TrackletPoints, least: int) -> int:
    """Return the largest number of tracklets that are seen at once, not less than 1.

    A tenth of the frames of the shortest tracklet must show that number: a moment in which a marker is seen double does
    not add a marker.

    Parameters
    ----------
    tracklets : TrackletPoints
        The tracklets.
    least : int
        Frames of the shortest one.
    """
    seen_at_once = np.sort(np.bincount(tracklets.frames, minlength=tracklets.n_frames))[::-1]
    return max(1, int(seen_at_once[int(least * COUNTED_SHARE)]))


def _trimmed(tracklets: TrackletPoints, trim: int) -> TrackletPoints:
    """Cut `trim` frames off both ends, but not where the take itself begins or ends."""
    start = np.where(tracklets.first > 0, trim, 0)
    lengths = tracklets.lengths - start - np.where(tracklets.last < tracklets.n_frames - 1, trim, 0)
    left = lengths > 0
    return tracklets.parts((tracklets.starts[:-1] + start)[left], lengths[left])


def poses_at(cloud_points: Floats, tracklets: TrackletPoints, frames: Ints) -> Floats:
    """Positions [mm] of each tracklet in some frames, shape (len(frames), n_tracklets, 3); NaN where unseen.

    Parameters
    ----------
    cloud_points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    tracklets : TrackletPoints
        The tracklets.
    frames : ndarray of intp
        Distinct, rising frames.
    """
    table = tracklets.indices_at(frames)
    return np.where((table >= 0)[..., np.newaxis], cloud_points[table], np.nan)
