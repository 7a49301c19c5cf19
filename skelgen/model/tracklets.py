"""Points of tracklets: pieces of the trajectories of markers, as a cloud's points were followed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints

COUNTED_SHARE = 0.1
"""Part of the shortest tracklet's frames in which the number of markers must be seen."""


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

    def positions_at(self, cloud_points: Floats, frames: Ints) -> Floats:
        """Positions [mm] of each tracklet in some frames, shape (len(frames), n_tracklets, 3); NaN where unseen.

        Parameters
        ----------
        cloud_points : ndarray, shape (n_points, 3), mm
            The cloud's points.
        frames : ndarray of intp
            Distinct, rising frames.
        """
        table = self.indices_at(frames)
        return np.where((table >= 0)[..., np.newaxis], cloud_points[table], np.nan)

    def most_at_once(self, least: int) -> int:
        """Return the largest number of tracklets that are seen at once, not less than 1.

        A tenth of the frames of the shortest tracklet, `least`, must show that number: a moment in which a marker is
        seen double does not add a marker.
        """
        seen_at_once = np.sort(np.bincount(self.frames, minlength=self.n_frames))[::-1]
        return max(1, int(seen_at_once[int(least * COUNTED_SHARE)]))
