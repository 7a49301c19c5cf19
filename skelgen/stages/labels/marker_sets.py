"""Marker Sets: the points that one track gathered, long enough and trimmed to be trusted (seed, 3.3 and 5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.parameters import LabelParameters

# The seed removes sets shorter than half a second; a take of less than two seconds would lose all, hence the share.
_LEAST_SECONDS = 0.5
_LEAST_SHARE = 0.25
# Share of the shortest set's frames in which the number of markers must be seen.
_COUNTED_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class MarkerSets:
    """Points of each Marker Set, in order of their frames.

    Attributes
    ----------
    points : ndarray of intp, shape (n,)
        Indices into the cloud's points, set after set.
    frames : ndarray of intp, shape (n,)
        Frame of each of `points`.
    starts : ndarray of intp, shape (n_sets + 1,)
        Set k holds ``points[starts[k]:starts[k + 1]]``; no set is empty.
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
        """Number of frames in which each set is seen, shape (n_sets,)."""
        return np.diff(self.starts)

    @property
    def first(self) -> Ints:
        """First frame of each set, shape (n_sets,)."""
        return self.frames[self.starts[:-1]]

    @property
    def last(self) -> Ints:
        """Last frame of each set, shape (n_sets,)."""
        return self.frames[self.starts[1:] - 1]

    @property
    def set_of_point(self) -> Ints:
        """Set of each of `points`, shape (n,)."""
        return np.repeat(np.arange(len(self)), self.lengths)

    @property
    def overlaps(self) -> Bools:
        """Whether two sets span a common frame, shape (n_sets, n_sets); a set overlaps itself."""
        begins_before: Bools = self.first[:, np.newaxis] <= self.last
        return begins_before & begins_before.T

    def chosen(self, keep: Bools) -> MarkerSets:
        """Return only the sets for which `keep` holds."""
        lengths = self.lengths[keep]
        starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.intp)
        kept_points = np.repeat(self.starts[:-1][keep] - starts[:-1], lengths) + np.arange(starts[-1])
        return MarkerSets(self.points[kept_points], self.frames[kept_points], starts, self.n_frames)

    def set_of_points(self, n_points: int) -> Ints:
        """Set of each of all `n_points` points of the take, -1 for none, shape (n_points,)."""
        result = np.full(n_points, -1, dtype=np.intp)
        result[self.points] = self.set_of_point
        return result

    def merged(self, group: Ints) -> MarkerSets:
        """Return one set for each group of sets that do not overlap, in order of the groups, shape (n_sets,)."""
        group_of_point = group[self.set_of_point]
        order = np.lexsort((self.frames, group_of_point))
        starts = np.concatenate([[0], np.cumsum(np.bincount(group_of_point))]).astype(np.intp)
        return MarkerSets(self.points[order], self.frames[order], starts, self.n_frames)

    def indices_at(self, frames: Ints) -> Ints:
        """Index of the point of each set in some frames.

        Parameters
        ----------
        frames : ndarray of intp, shape (n,)
            Distinct, rising frames.

        Returns
        -------
        ndarray of intp, shape (n, n_sets)
            Index into the cloud's points, -1 where the set is not seen.
        """
        row_of_frame = np.full(self.n_frames, -1, dtype=np.intp)
        row_of_frame[frames] = np.arange(len(frames))
        rows = row_of_frame[self.frames]
        wanted = rows >= 0
        table = np.full((len(frames), len(self)), -1, dtype=np.intp)
        table[rows[wanted], self.set_of_point[wanted]] = self.points[wanted]
        return table


def find_marker_sets(cloud: PointCloud, owner: Ints, rate: float, parameters: LabelParameters) -> MarkerSets:
    """Gather the points of each track, trim them, and drop what is too short.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        `min_range` and `trim_range`.
    """
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    points = np.argsort(owner, kind="stable")[int((owner < 0).sum()) :]
    sizes = np.bincount(owner[points])
    sizes = sizes[sizes > 0]
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)
    sets = MarkerSets(points, frame_of_point[points], starts, cloud.n_frames)
    sets = sets.chosen(sets.lengths >= least_length(cloud.n_frames, rate, parameters))
    return _trimmed(sets, parameters.trim_range)


def least_length(n_frames: int, rate: float, parameters: LabelParameters) -> int:
    """Return the number of frames below which a Marker Set is removed."""
    return parameters.min_range or max(1, int(min(_LEAST_SECONDS * rate, _LEAST_SHARE * n_frames)))


def count_markers(sets: MarkerSets, least: int) -> int:
    """Return the largest number of sets that are seen at once, not less than 1.

    It must be reached in a tenth as many frames as the shortest set has, `least`: that keeps a moment in which a marker
    was seen double from adding a marker.
    """
    seen_at_once = np.sort(np.bincount(sets.frames, minlength=sets.n_frames))[::-1]
    return max(1, int(seen_at_once[int(least * _COUNTED_SHARE)]))


def _trimmed(sets: MarkerSets, trim: int) -> MarkerSets:
    """Cut `trim` frames off both ends, but not where the take itself begins or ends."""
    start = np.where(sets.first > 0, trim, 0)
    stop = np.where(sets.last < sets.n_frames - 1, trim, 0)
    lengths = sets.lengths
    rank = np.arange(len(sets.points)) - np.repeat(sets.starts[:-1], lengths)
    inside: Bools = (rank >= np.repeat(start, lengths)) & (rank < np.repeat(lengths - stop, lengths))
    left = np.bincount(sets.set_of_point[inside], minlength=len(sets))
    starts = np.concatenate([[0], np.cumsum(left[left > 0])]).astype(np.intp)
    return MarkerSets(sets.points[inside], sets.frames[inside], starts, sets.n_frames)


def poses_at(cloud_points: Floats, sets: MarkerSets, frames: Ints) -> Floats:
    """Positions [mm] of each set in some frames, shape (len(frames), n_sets, 3); NaN where unseen."""
    table = sets.indices_at(frames)
    return np.where((table >= 0)[..., np.newaxis], cloud_points[table], np.nan)
