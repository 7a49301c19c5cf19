"""Tracks are assigned to markers: every point of a track votes for the markers whose predicted places explain it.

Markers that share a place on a limb are the same marker; tracks that keep a free place are a new one.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats, Ints, rows_of_each, runs_of_equal
from skelgen.stages.labels.explanations import Explanations
from skelgen.stages.labels.model_fit.model import LimbPoses, steadiest_place
from skelgen.stages.labels.point_labels import Block

PERSISTENT = 7
"""Frames for which another marker must explain a track better before the track is cut."""

LEAST_FRAMES = 25
"""Frames that must show a track on a limb before its place there counts."""

LEAST_SHARE = 0.03
"""Of all frames that a new marker must be seen in."""

COMMON_FRAMES = 3
"""Two markers that are seen together in more frames are two."""


def split_where_marker_changes(track_of_point: Ints, explained: Explanations) -> Ints:
    """Cut tracks at which one marker stops to explain the points and another begins to.

    Parameters
    ----------
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point in order of frames, -1 for none.
    explained : Explanations
        Which markers explain the points.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Finer tracks, numbered from 0; -1 for points of none.
    """
    best = explained.best
    order = np.argsort(track_of_point, kind="stable")
    order = order[track_of_point[order] >= 0]
    tracks = np.full(len(track_of_point), -1, dtype=np.intp)
    if not len(order):
        return tracks
    track, voted = track_of_point[order], best[order]
    voting = np.flatnonzero(voted >= 0)
    steady = _without_short_runs(track[voting], voted[voting])
    held = _carried(track, voting, steady)
    first, last = runs_of_equal(track, held)
    tracks[order] = np.repeat(np.arange(len(first)), last - first + 1)
    return tracks


def _without_short_runs(track: Ints, voted: Ints) -> Ints:
    """Votes of a track in order, runs shorter than `PERSISTENT` replaced by the run before (or after, at the start)."""
    if not len(voted):
        return voted
    starts, ends = runs_of_equal(track, voted)
    lengths = ends - starts + 1
    track_of_run, values, is_short = track[starts].tolist(), voted[starts].tolist(), (lengths < PERSISTENT).tolist()
    for run in range(1, len(starts)):
        if is_short[run] and track_of_run[run - 1] == track_of_run[run]:
            values[run] = values[run - 1]
    for run in range(len(starts) - 2, -1, -1):
        is_first = run == 0 or track_of_run[run - 1] != track_of_run[run]
        if is_short[run] and is_first and track_of_run[run + 1] == track_of_run[run]:
            values[run] = values[run + 1]
    return np.repeat(np.array(values, dtype=np.intp), lengths)


def _carried(track: Ints, voting: Ints, steady: Ints) -> Ints:
    """Vote of every point of a track: that of the last point that voted, at the start that of the next one."""
    held = np.full(len(track), -1, dtype=np.intp)
    if not len(voting):
        return held
    index = np.searchsorted(voting, np.arange(len(track)), side="right") - 1
    before = np.clip(index, 0, len(voting) - 1)
    after = np.clip(index + 1, 0, len(voting) - 1)
    use = np.where((index >= 0) & (track[voting[before]] == track), before, after)
    same = track[voting[use]] == track
    held[same] = steady[use[same]]
    return held


def assign_tracks(tracks: Ints, frames: Ints, explained: Explanations, n_frames: int) -> Ints:
    """Give tracks to markers, the best explained first; a marker has one point in a frame.

    Parameters
    ----------
    tracks : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    frames : ndarray of intp, shape (n_points,)
        Frame of each point.
    explained : Explanations
        Which markers explain the points.
    n_frames : int
        Number of frames.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    n_tracks = int(tracks.max(initial=-1)) + 1
    marker_of_point = np.full(len(tracks), -1, dtype=np.intp)
    if n_tracks == 0:
        return marker_of_point
    order = np.argsort(tracks, kind="stable")[int((tracks < 0).sum()) :]
    starts = np.searchsorted(tracks[order], np.arange(n_tracks + 1))
    votes = np.zeros((n_tracks, explained.n_markers), dtype=np.float32)
    voting = tracks[explained.points] >= 0
    ballots = tracks[explained.points[voting]], explained.markers[voting]
    np.add.at(votes, ballots, explained.scores[voting])
    taken = np.zeros((n_frames, explained.n_markers), dtype=bool)
    candidates = np.argwhere(votes > 0)
    ranking = np.argsort(-votes[votes > 0], kind="stable")
    placed = np.zeros(n_tracks, dtype=bool)
    for track, marker in candidates[ranking].tolist():
        if placed[track]:
            continue
        members = order[starts[track] : starts[track + 1]]
        clash = taken[frames[members], marker]
        if clash.mean() > 0.5:
            continue
        kept = members[~clash]
        marker_of_point[kept] = marker
        taken[frames[kept], marker] = True
        placed[track] = True
    return marker_of_point


def fill_single_points(marker_of_point: Ints, frames: Ints, explained: Explanations, n_frames: int) -> Ints:
    """Give points that no track brought to the markers that explain them and have none, the best first.

    Parameters
    ----------
    marker_of_point, frames, explained, n_frames
        As in `assign_tracks`; the marker of each point is what that returned.
    """
    result = marker_of_point.copy()
    taken = np.zeros((n_frames, explained.n_markers), dtype=bool)
    owned = result >= 0
    taken[frames[owned], result[owned]] = True
    free = explained.kept(~owned[explained.points])
    ranking = np.argsort(-free.scores, kind="stable")
    for point, marker in zip(free.points[ranking].tolist(), free.markers[ranking].tolist(), strict=True):
        if result[point] < 0 and not taken[frames[point], marker]:
            result[point] = marker
            taken[frames[point], marker] = True
    return result


def same_places(together: Floats, offsets: Floats, limb_of_marker: Ints, limits: Floats) -> Ints:
    """Find markers that have one place on one limb and are never seen together.

    Parameters
    ----------
    together : ndarray, shape (n_markers, n_markers)
        Number of frames in which two markers are seen together.
    offsets : ndarray, shape (n_markers, 3), mm
        Places on the limbs.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker, -1 for none.
    limits : ndarray, shape (n_limbs,), mm
        Places on a limb that are nearer than this are one.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        The marker that each one is, itself or an earlier one.
    """
    same_limb = (limb_of_marker[:, np.newaxis] == limb_of_marker) & (limb_of_marker >= 0)
    distance = np.linalg.norm(offsets[:, np.newaxis] - offsets, axis=2)
    near = same_limb & (together <= COMMON_FRAMES) & (np.nan_to_num(distance, nan=np.inf) < limits[limb_of_marker])
    result = np.arange(len(offsets))
    used: set[int] = set()
    for first, second in np.argwhere(np.triu(near, 1)).tolist():
        if first not in used and second not in used:
            result[second] = first
            used |= {first, second}
    return result


@dataclass(eq=False)
class _NewMarker:
    """A place that tracks keep: where it is, the points, and those of the latest block with their frames."""

    place: Floats
    points: list[Ints]
    block: int
    frames: Ints

    @property
    def n_points(self) -> int:
        return sum(len(points) for points in self.points)


class NewMarkers:
    """Tracks without a marker that keep a place of their own on a limb; gathered block by block.

    Parameters
    ----------
    gate : float, mm
        Places nearer than this are one.
    limits : ndarray, shape (n_limbs,), mm
        How far a track may stray from its place on each limb.
    """

    def __init__(self, gate: float, limits: Floats) -> None:
        self._gate, self._limits = gate, limits
        self._found: dict[int, list[_NewMarker]] = {}  # by limb

    def add(self, points: Floats, block: Block, free: Ints, tracks: Ints, poses: LimbPoses) -> None:
        """Add the free tracks of a block that keep a place.

        Parameters
        ----------
        points : ndarray, shape (n_points, 3), mm
            Points of the block.
        block : Block
            Their frames, and where they are in the take.
        free : ndarray of intp
            Points that are no marker's.
        tracks : ndarray of intp, shape (n_points,)
            Track of each point, -1 for none.
        poses : LimbPoses
            Where limbs are in the block.
        """
        followed = free[tracks[free] >= 0]
        for rows in rows_of_each(tracks[followed]):
            members = followed[rows]
            if len(members) < LEAST_FRAMES:
                continue
            frames = block.frames[members]
            place = steadiest_place(points[members], poses.at(frames), self._limits, LEAST_FRAMES)
            if place is not None:
                self._add_to_place(place, block, members)

    def found(self, n_frames: int) -> list[Ints]:
        """Points of each new marker, of those that are seen in enough of the take's `n_frames`."""
        least = max(LEAST_FRAMES, LEAST_SHARE * n_frames)
        all_places = itertools.chain.from_iterable(self._found.values())
        return [np.concatenate(one.points) for one in all_places if one.n_points >= least]

    def _add_to_place(self, place: tuple[int, Floats], block: Block, members: Ints) -> None:
        """Add a track's points to those of its place; tracks of earlier blocks are in other frames anyway."""
        limb, position = place
        points, frames = (block.points.start + members).astype(np.int32), block.frames[members]
        others = self._found.setdefault(limb, [])
        for other in others:
            if np.linalg.norm(other.place - position) >= self._gate:
                continue
            known = other.frames if other.block == block.first else frames[:0]
            if len(np.intersect1d(frames, known)) <= COMMON_FRAMES:
                other.place = (other.place + position) / 2
                other.points.append(points)
                other.block, other.frames = block.first, np.concatenate([known, frames])
                return
        others.append(_NewMarker(position, [points], block.first, frames))
