"""Marker Sets: the points that one track gathered, long enough and trimmed to be trusted (seed, 3.3 and 5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import blocks_of

# The seed removes sets shorter than half a second; a take of less than two seconds would lose all, hence the share.
_LEAST_SECONDS = 0.5
_LEAST_SHARE = 0.25
# Share of the shortest set's frames in which the number of markers must be seen.
_COUNTED_SHARE = 0.1

STAND_ALONE_SHARE = 0.5
"""A set that spans half of the take stands alone, however short the take."""


@dataclass(frozen=True, eq=False)
class MarkerSets:
    """Points of each Marker Set, in order of their frames.

    Attributes
    ----------
    points : ndarray of int32, shape (n,)
        Indices into the cloud's points, set after set.
    frames : ndarray of int32, shape (n,)
        Frame of each of `points`.
    starts : ndarray of intp, shape (n_sets + 1,)
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
        return np.repeat(np.arange(len(self), dtype=np.int32), self.lengths)

    @property
    def overlaps(self) -> Bools:
        """Whether two sets span a common frame, shape (n_sets, n_sets); a set overlaps itself."""
        begins_before: Bools = self.first[:, np.newaxis] <= self.last
        return begins_before & begins_before.T

    def chosen(self, keep: Bools) -> MarkerSets:
        """Return only the sets for which `keep` holds."""
        return self.parts(self.starts[:-1][keep], self.lengths[keep])

    def within(self, chosen: Ints, first: int, last: int) -> MarkerSets:
        """Return the part of some sets from frame `first` to before `last`, which may be empty."""
        begins, lengths = np.empty((2, len(chosen)), dtype=np.intp)
        for place, index in enumerate(chosen):
            start, stop = self.starts[index : index + 2]
            inside = np.searchsorted(self.frames[start:stop], [first, last])
            begins[place], lengths[place] = start + inside[0], inside[1] - inside[0]
        return self.parts(begins, lengths)

    def parts(self, begins: Ints, lengths: Ints) -> MarkerSets:
        """Return sets of so many points each, from some places on, both of shape (n,)."""
        starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.intp)
        index = np.arange(starts[-1])
        index += np.repeat(begins - starts[:-1], lengths)
        return MarkerSets(self.points[index], self.frames[index], starts, self.n_frames)

    def set_of_points(self, n_points: int) -> Ints:
        """Set of each of all `n_points` points of the take, -1 for none, shape (n_points,)."""
        result = np.full(n_points, -1, dtype=np.int32)
        result[self.points] = self.set_of_point
        return result

    def merged(self, group: Ints) -> MarkerSets:
        """Return one set for each group of sets that do not overlap, in order of the groups, shape (n_sets,)."""
        first = np.append(self.frames, 0)[self.starts[:-1]]  # of empty sets, whatever
        order = np.lexsort((first, group))
        sorted_sets = self.parts(self.starts[:-1][order], self.lengths[order])
        sizes = np.bincount(group, weights=self.lengths).astype(np.intp)
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)
        return MarkerSets(sorted_sets.points, sorted_sets.frames, starts, self.n_frames)

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
        row_of_frame = np.full(self.n_frames, -1, dtype=np.int32)
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
    sizes = np.bincount(np.maximum(owner, -1) + 1)[1:]
    is_long = sizes >= least_length(cloud.n_frames, rate, parameters)
    return _trimmed(_gathered(cloud, owner, sizes, is_long), parameters.trim_range)


def _gathered(cloud: PointCloud, owner: Ints, sizes: Ints, wanted: Bools) -> MarkerSets:
    """Points of the wanted tracks, which have so many each: sorted block by block, as long takes need much memory."""
    starts = np.concatenate([[0], np.cumsum(sizes[wanted])]).astype(np.intp)
    points, frames = np.empty((2, starts[-1]), dtype=np.int32)
    following = np.full(len(sizes), -1, dtype=np.intp)  # where a track's next point goes
    following[wanted] = starts[:-1]
    for block in blocks_of(cloud):
        tracks = owner[block.points]
        used = np.flatnonzero(np.append(wanted, False)[tracks])
        used = used[np.argsort(tracks[used], kind="stable")]
        tracks = tracks[used]
        begins = np.flatnonzero(np.diff(tracks, prepend=-1))
        counts = np.diff(begins, append=len(tracks))
        place = np.arange(len(tracks)) + np.repeat(following[tracks[begins]] - begins, counts)
        points[place], frames[place] = block.points.start + used, block.first + block.frames[used]
        following[tracks[begins]] += counts
    return MarkerSets(points, frames, starts, cloud.n_frames)


def least_length(n_frames: int, rate: float, parameters: LabelParameters) -> int:
    """Return the number of frames below which a Marker Set is removed."""
    return parameters.min_range or max(1, int(min(_LEAST_SECONDS * rate, _LEAST_SHARE * n_frames)))


def stand_alone_frames(n_frames: int, rate: float, parameters: LabelParameters) -> float:
    """Number of frames from which a set needs no partner to be trusted."""
    return min(parameters.stand_alone * rate, STAND_ALONE_SHARE * n_frames)


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
    lengths = sets.lengths - start - np.where(sets.last < sets.n_frames - 1, trim, 0)
    left = lengths > 0
    return sets.parts((sets.starts[:-1] + start)[left], lengths[left])


def poses_at(cloud_points: Floats, sets: MarkerSets, frames: Ints) -> Floats:
    """Positions [mm] of each set in some frames, shape (len(frames), n_sets, 3); NaN where unseen."""
    table = sets.indices_at(frames)
    return np.where((table >= 0)[..., np.newaxis], cloud_points[table], np.nan)
