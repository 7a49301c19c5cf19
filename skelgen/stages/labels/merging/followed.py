r"""A cloud whose points have been followed: what all that merges, exchanges and moves markers knows of the take.

Distances are compared at moments that are some time apart. While a body stands still, these are not independent: all
distances stay what they are, to the far hand as to the same limb, and a marker that is seen only then explains itself
by any of them, as often as it is looked at. So moments may be weighed by how much the posture has changed since the
moment before, which tracks tell without labels. With :math:`c_t`, the median change of the distances between tracks
that go on, moment t counts

.. math:: w_t = \min(1,\; c_t / \operatorname{median}_s c_s) .

A take of few seconds has few independent moments, and pieces of tracks between them would not speak at all. There,
markers are compared more often, and each moment counts as a part of one: there is no more evidence, but more hear it.

Where another take of the same markers is known, moments of it stand before the take, as frames of their own whose
points keep their marker: so all that is compared within the take is compared with the other one, too.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.continuity import Continuity
from skelgen.stages.labels.merging.likelihood import distance_sums, evidence_of_labels, sample_frames

FRAMES_AT_ONCE = 600
"""Frames whose positions are held at once."""

MOST_DISTANCES = 1_000_000
"""Distances that are held at once: of long takes, fewer moments are looked at."""

MOST_MARKERS = 200
"""Of more, none are exchanged, pushed on, or matched in groups: all pairs are looked at."""

LEAST_COMMON = 4
"""Tracks that must go on from one moment to the next for their distances to tell how much the posture changes."""

WEIGHT_STEP = 2.0**-6
"""Weights are multiples of it: sums of them are exact, and what is taken away of them leaves nothing behind."""

FEW_MOMENTS = 24
"""Of fewer independent moments, some six seconds, markers are compared more often."""

MOST_OFTEN = 4
"""How often at most for each independent moment."""

MOST_POINTS = 6_000_000
"""Of more, some twelve minutes of 40 markers at 200 Hz, markers are compared so rarely that pieces lie between, and
gaps are not looked at: an hour must do with 2.5 GB."""

MOST_ROUNDS = 20
"""A guard for what goes on while it gains: points between the moments, which do not count, and sides, which are found
anew after each exchange, might undo that."""


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
    by_posture : bool
        Whether moments count in the evidence by how much the posture changes; else all count alike.
    joins_sparingly : bool
        Whether markers found twice are joined only where the evidence hardly falls; else where distances at independent
        moments say so.
    exchanges_over_gaps : bool
        Whether it counts where markers are exchanged who goes on as whom over gaps.
    n_known : int
        Frames at the beginning that are independent moments of another take, in which all markers are known.
    """

    cloud: PointCloud
    track_of_point: Ints
    rate: float
    spacing: float
    stated: Bools | None = None
    by_posture: bool = False
    joins_sparingly: bool = False
    exchanges_over_gaps: bool = False
    n_known: int = 0

    @cached_property
    def is_fixed(self) -> Bools:
        """Points that keep their marker, shape (n_points,)."""
        is_fixed = np.zeros(self.cloud.n_points, dtype=bool) if self.stated is None else self.stated.copy()
        is_fixed[: self.cloud.frame_starts[self.n_known]] = True
        return is_fixed

    def is_stated(self, marker_of_point: Ints, n_markers: int) -> Bools:
        """Return of which markers the user states points, shape (n_markers,): these are exchanged nowhere.

        Parameters
        ----------
        marker_of_point : ndarray of intp, shape (n_points,)
            Marker of each point, -1 for none.
        n_markers : int
            Number of markers.
        """
        stated = np.zeros(0, dtype=np.intp) if self.stated is None else marker_of_point[self.stated]
        return np.bincount(stated[stated >= 0], minlength=n_markers) > 0

    @property
    def has_few_moments(self) -> bool:
        """Whether the take has so few independent moments that markers are compared more often."""
        return len(self._every_moment) > len(self._independent)

    @property
    def is_very_long(self) -> bool:
        """Whether the take has so many points that only what needs little memory is done with it."""
        return self.cloud.n_points > MOST_POINTS

    def frame_of_point(self) -> Ints:
        """Return the frame of each point, shape (n_points,)."""
        return np.repeat(np.arange(self.cloud.n_frames, dtype=np.int32), self.cloud.points_per_frame)

    def is_followed_between(self, before: Ints, after: Ints) -> Bools:
        """Return whether points are of one track with others of it in between, shape (n_pairs,).

        Parameters
        ----------
        before, after : ndarray of intp, shape (n_pairs,)
            Points, and later ones.
        """
        track, result = self.track_of_point, np.zeros(len(before), dtype=bool)
        pairs = np.flatnonzero((track[before] == track[after]) & (track[before] >= 0))
        if len(pairs):
            concerned = np.zeros(int(track.max()) + 2, dtype=bool)  # the last place is that of no track, -1
            concerned[track[before[pairs]]] = True
            points = np.flatnonzero(concerned[track])
            points = points[np.argsort(track[points], kind="stable")]
            place = np.empty(len(track), dtype=np.intp)
            place[points] = np.arange(len(points))
            result[pairs] = place[after[pairs]] > place[before[pairs]] + 1
        return result

    def unlabelled_per_track(self, marker_of_point: Ints) -> Ints:
        """Return how many points of each track have no marker, up to the last track with any.

        Parameters
        ----------
        marker_of_point : ndarray of intp, shape (n_points,)
            Marker of each point, -1 for none.
        """
        tracks = self.track_of_point
        return np.bincount(tracks[(marker_of_point < 0) & (tracks >= 0)], minlength=1)

    def moments(self, n_markers: int) -> Ints:
        """Return the frames in which markers are compared, at most `MOST_DISTANCES` distances.

        Parameters
        ----------
        n_markers : int
            Number of markers.
        """
        step = max(1, -(-len(self._every_moment) * n_markers**2 // MOST_DISTANCES))
        return self._every_moment[::step]

    def weights(self, moments: Ints) -> Floats:
        """Return how much moments count, in steps of `WEIGHT_STEP`: an independent one 1, less if `by_posture` says so.

        Parameters
        ----------
        moments : ndarray of intp, shape (n_moments,)
            Rising frames.
        """
        key = moments.tobytes()  # every move asks for the same moments
        if key not in self._known_weights:
            weights, is_own = np.ones(len(moments)), moments >= self.n_known
            if self.by_posture:
                weights[is_own] = _weights(_changes(self.cloud, self.track_of_point, moments[is_own]))
            n_independent, n_every = len(self._independent) - self.n_known, len(self._every_moment) - self.n_known
            weights[is_own] *= n_independent / max(n_every, 1)
            self._known_weights[key] = np.maximum(np.round(weights / WEIGHT_STEP), 1.0) * WEIGHT_STEP
        return self._known_weights[key]

    @cached_property
    def _independent(self) -> Ints:
        return self._sampled()

    @cached_property
    def _every_moment(self) -> Ints:
        n_independent = len(self._independent) - self.n_known
        return self._sampled(min(-(-FEW_MOMENTS // max(n_independent, 1)), MOST_OFTEN))

    def _sampled(self, how_often: int = 1) -> Ints:
        own = sample_frames(self.rate, self.n_known, self.cloud.n_frames, how_often)
        return np.concatenate([np.arange(self.n_known), own])

    @cached_property
    def _known_weights(self) -> dict[bytes, Floats]:
        return {}

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
        return self._distances(marker_of_point, self._independent, None)

    def evidence(self, marker_of_point: Ints) -> tuple[float, float]:
        """Return how well labels explain the take [nats], by distances and over gaps, and how far that may be chance.

        See `evidence_of_labels` and `continuity`.

        Parameters
        ----------
        marker_of_point : ndarray of intp, shape (n_points,)
            Marker of each point, -1 for none.
        """
        frames = self._every_moment
        sums = self._distances(marker_of_point, frames, self.weights(frames))
        evidence, chance = evidence_of_labels(sums, self.spacing)
        gaps = self.continuity(marker_of_point)
        return evidence + (gaps.total() if gaps else 0.0), chance

    def continuity(self, marker_of_point: Ints) -> Continuity | None:
        """Return what looks at the gaps of labels; None for takes that are too long.

        Parameters
        ----------
        marker_of_point : ndarray of intp, shape (n_points,)
            Marker of each point, -1 for none.
        """
        return None if self.is_very_long else Continuity(self, marker_of_point)

    def _distances(self, marker_of_point: Ints, frames: Ints, weights: Floats | None) -> Floats:
        n_markers = int(marker_of_point.max(initial=-1)) + 1
        sums = np.zeros((3, n_markers, n_markers))
        for start in range(0, len(frames), FRAMES_AT_ONCE):
            part = slice(start, start + FRAMES_AT_ONCE)
            places = point_labels.sampled_positions(self.cloud, marker_of_point, frames[part], n_markers)
            sums += distance_sums(places, None if weights is None else weights[part])
        return sums


def _weights(change: Floats) -> Floats:
    """How much moments count by the change of posture before each [mm], infinite where it is not known."""
    known = change[np.isfinite(change)]
    usual = float(np.median(known)) if len(known) else 0.0
    return np.minimum(change / usual, 1.0) if usual > 0.0 else np.ones(len(change))


def _changes(cloud: PointCloud, track_of_point: Ints, moments: Ints) -> Floats:
    """Median change of distances between tracks since the moment before [mm]; infinite where too few go on."""
    from scipy.spatial.distance import pdist  # noqa: PLC0415 - heavy

    row, point = point_labels.points_in_frames(cloud, moments)
    followed = track_of_point[point] >= 0
    row, point = row[followed], point[followed]
    track, places = track_of_point[point], cloud.points[point]
    parts = [slice(*ends) for ends in itertools.pairwise(np.searchsorted(row, np.arange(len(moments) + 1)))]
    change = np.full(len(moments), np.inf)
    for moment, (before, now) in enumerate(itertools.pairwise(parts), start=1):
        _, one, other = np.intersect1d(track[before], track[now], return_indices=True)
        if len(one) >= LEAST_COMMON:
            distances = [pdist(places[part][rows]) for part, rows in ((before, one), (now, other))]
            change[moment] = np.median(np.abs(distances[1] - distances[0]))
    return change
