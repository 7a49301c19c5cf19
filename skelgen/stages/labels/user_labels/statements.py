"""Identities given by the user: constraints on the labels.

A statement holds for the whole track of its point; a track of which two names are stated is cut between them at the
step that constant velocity explains worst. Constrained points vote for their markers alone, and whatever else sits
there makes room.
"""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.corrections import Identities, Identity
from skelgen.stages.labels.explanations import Explanations

NOBODY = -1
"""In `PointConstraints.name_of_point`: the user says that the point is no marker."""

ANYBODY = -2
"""In `PointConstraints.name_of_point`: nothing is stated of the point."""

POINT_TOLERANCE = 1.0
"""mm; a stated position must be so near to a point: files and screens round, but not that much."""

CERTAIN = 1e6
"""Score of a constrained point for its marker: more than any number of other points can gather."""


@dataclass(frozen=True, eq=False)
class PointConstraints:
    """What the user's statements mean for the points of a take.

    Attributes
    ----------
    names : tuple of str
        Markers that are named.
    name_of_point : ndarray of intp, shape (n_points,)
        Index into `names`, `NOBODY` or `ANYBODY` for each point; a name has one point in a frame.
    track_of_point : ndarray of intp, shape (n_points,)
        Tracks, cut so that each belongs to one name or to none; -1 for points without a track.
    """

    names: tuple[str, ...]
    name_of_point: Ints
    track_of_point: Ints

    @property
    def open_tracks(self) -> Ints:
        """Tracks of points that may be markers, shape (n_points,); -1 also for what the user says is none."""
        return np.where(self.name_of_point == NOBODY, -1, self.track_of_point)


class _Claim(NamedTuple):
    """A statement about one track: its points `first` .. `last`, in order of frames, have the name `name`."""

    first: int
    last: int
    name: int
    open: bool
    entry: Identity


def find_constraints(cloud: PointCloud, track_of_point: Ints, identities: Identities) -> PointConstraints:
    """Find what the user's statements mean for points.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    identities : Identities
        What the user states.

    Raises
    ------
    SkelgenError
        If a statement names no point, or contradicts another one; with the line and what is nearest.
    """
    track_of_point = track_of_point.copy()
    stated = [(entry, _point_of(cloud, identities, entry)) for entry in identities.entries]
    _refuse_doubles(identities, stated)
    for _, point in stated:
        if track_of_point[point] < 0:
            track_of_point[point] = track_of_point.max(initial=-1) + 1
    name_of_point = np.full(cloud.n_points, ANYBODY, dtype=np.intp)
    away = np.full(cloud.n_points, np.inf)
    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    by_track: dict[int, list[tuple[Identity, int]]] = {}
    for entry, point in stated:
        by_track.setdefault(int(track_of_point[point]), []).append((entry, point))
    n_tracks = int(track_of_point.max(initial=-1)) + 1
    for track, statements in by_track.items():
        members = np.flatnonzero(track_of_point == track)
        claims = _claims(identities, statements, members, frames[members])
        piece, name_of_point[members] = _divided(claims, cloud.points[members], frames[members])
        track_of_point[members[piece > 0]] = n_tracks + piece[piece > 0] - 1
        n_tracks += int(piece.max())
        for claim in claims:
            mine = members[name_of_point[members] == claim.name]
            away[mine] = np.minimum(away[mine], np.abs(frames[mine] - claim.entry.frame))
    # Where two tracks of one name meet in a frame, keep the point whose statement is nearer in time
    named = np.flatnonzero(name_of_point >= 0)
    order = named[np.lexsort((named, away[named], name_of_point[named], frames[named]))]
    again: Bools = np.zeros(len(order), dtype=np.bool_)
    again[1:] = (frames[order[1:]] == frames[order[:-1]]) & (name_of_point[order[1:]] == name_of_point[order[:-1]])
    name_of_point[order[again]] = ANYBODY
    return PointConstraints(identities.names, name_of_point, track_of_point)


def constrained(explained: Explanations, name_of_point: Ints, target: Ints) -> Explanations:
    """Let constrained points vote for their markers alone, and with certainty.

    Parameters
    ----------
    explained : Explanations
        Which markers explain the points.
    name_of_point : ndarray of intp, shape (n_points,)
        As in `PointConstraints`.
    target : ndarray of intp, shape (n_names,)
        Marker of each name, from `markers_of_names`; those beyond the last marker have no votes yet.
    """
    named = np.flatnonzero(name_of_point >= 0)
    marker = target[name_of_point[named]]
    known = marker < explained.n_markers
    free = explained.kept(name_of_point[explained.points] == ANYBODY)
    return free.with_pairs(named[known], marker[known], CERTAIN)


def markers_of_names(
    marker_of_point: Ints, constraints: PointConstraints, n_markers: int, labels: tuple[str, ...] = ()
) -> Ints:
    """Marker of each name: the one called so, else the one with most of its points; new ones where there is none.

    Parameters
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    constraints : PointConstraints
        What the user states.
    n_markers : int
        Number of markers; new ones are numbered from here.
    labels : tuple of str
        Names that the markers have already, if any.

    Returns
    -------
    ndarray of intp, shape (n_names,)
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    together = np.zeros((len(constraints.names), n_markers))
    both = (constraints.name_of_point >= 0) & (marker_of_point >= 0)
    np.add.at(together, (constraints.name_of_point[both], marker_of_point[both]), 1.0)
    for name, label in itertools.product(range(len(constraints.names)), range(len(labels))):
        if constraints.names[name] == labels[label]:
            together[:, label] = 0.0
            together[name] = 0.0
            together[name, label] = 1.0
    target = np.full(len(constraints.names), -1, dtype=np.intp)
    rows, columns = linear_sum_assignment(-together)
    shared = together[rows, columns] > 0
    target[rows[shared]] = columns[shared]
    target[target < 0] = n_markers + np.arange(int((target < 0).sum()))
    return target


def with_constraints(marker_of_point: Ints, frames: Ints, constraints: PointConstraints, target: Ints) -> Ints:
    """Give constraints points to their markers; a point that must make room takes the place that became free, if any.

    Parameters
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; a marker has one point in a frame.
    frames : ndarray of intp, shape (n_points,)
        Frame of each point.
    constraints : PointConstraints
        What the user states.
    target : ndarray of intp, shape (n_names,)
        Marker of each name, from `markers_of_names`.
    """
    result = marker_of_point.copy()
    result[constraints.name_of_point == NOBODY] = -1
    named = np.flatnonzero(constraints.name_of_point >= 0)
    result[named] = target[constraints.name_of_point[named]]
    n_markers = int(max(result.max(initial=-1), marker_of_point.max(initial=-1))) + 1
    place = frames[named] * n_markers + result[named]
    in_order = np.argsort(place)
    others = np.flatnonzero((constraints.name_of_point == ANYBODY) & (marker_of_point >= 0))
    if not len(named) or not len(others):
        return result
    wanted = frames[others] * n_markers + marker_of_point[others]
    intruder = _found_in(place[in_order], wanted)
    pushed = intruder >= 0
    free = marker_of_point[named[in_order[intruder[pushed]]]]
    refuge = np.where(free >= 0, frames[others[pushed]] * n_markers + free, -1)
    result[others[pushed]] = np.where(_found_in(place[in_order], refuge) < 0, free, -1)
    return result


def _found_in(rising: Ints, wanted: Ints) -> Ints:
    """Index of each wanted number among rising ones, -1 where it is not there."""
    index = np.minimum(np.searchsorted(rising, wanted), len(rising) - 1)
    return np.where(rising[index] == wanted, index, -1)


def _point_of(cloud: PointCloud, identities: Identities, entry: Identity) -> int:
    """Index of the point that a statement means."""
    if entry.frame >= cloud.n_frames or (entry.last_frame or 0) >= cloud.n_frames:
        last = max(entry.frame, entry.last_frame or 0)
        raise identities.error(entry, f"frame {last} is not in the take; its last frame is {cloud.n_frames - 1}")
    start, points = int(cloud.frame_starts[entry.frame]), cloud.frame(entry.frame)
    if len(points) == 0:
        raise identities.error(entry, f"frame {entry.frame} holds no points")
    if entry.point is not None:
        if entry.point >= len(points):
            raise identities.error(
                entry, f"there is no point {entry.point} in frame {entry.frame}; its points are 0 to {len(points) - 1}"
            )
        return start + entry.point
    distance = np.linalg.norm(points - np.array(entry.position), axis=1)
    nearest = int(np.argmin(distance))
    if distance[nearest] > POINT_TOLERANCE:
        where = ", ".join(f"{value:.1f}" for value in points[nearest])
        raise identities.error(
            entry,
            f"no point of frame {entry.frame} lies within {POINT_TOLERANCE:g} mm of the stated position; the nearest "
            f"is point {nearest} at ({where}), {distance[nearest]:.1f} mm away",
        )
    return start + nearest


def _refuse_doubles(identities: Identities, stated: list[tuple[Identity, int]]) -> None:
    """Raise if one name is given to two points of a frame."""
    given: dict[tuple[str, int], int] = {}
    for entry, point in stated:
        if not entry.is_nobody and given.setdefault((entry.name, entry.frame), point) != point:
            raise identities.error(entry, f"another point of frame {entry.frame} has this name already")


def _claims(
    identities: Identities, statements: list[tuple[Identity, int]], members: Ints, frames: Ints
) -> list[_Claim]:
    """Statements about one track, in order; contradictions are errors."""
    claims = []
    for entry, point in statements:
        first = int(np.searchsorted(members, point))
        end = entry.frame if entry.last_frame is None else entry.last_frame
        last = int(np.searchsorted(frames, end, side="right")) - 1
        name = NOBODY if entry.is_nobody else identities.names.index(entry.name)
        claims.append(_Claim(first, last, name, entry.last_frame is None, entry))
    claims.sort(key=lambda claim: (claim.first, claim.last))
    for earlier, later in itertools.combinations(claims, 2):
        if later.first <= earlier.last and later.name != earlier.name:
            raise identities.error(
                later.entry,
                f"the point in frame {frames[later.first]} is {earlier.entry.name} by another statement"
                + (f" in line {earlier.entry.line}" if earlier.entry.line else ""),
            )
    return claims


def _divided(claims: list[_Claim], points: Floats, frames: Ints) -> tuple[Ints, Ints]:
    """Part of the track that each of its points belongs to, numbered from 0, and the name of each point."""
    name_of_point = np.full(len(frames), ANYBODY, dtype=np.intp)
    for claim in claims:
        name_of_point[claim.first : claim.last + 1] = claim.name
    if claims[0].open:
        name_of_point[: claims[0].first] = claims[0].name
    if claims[-1].open:
        name_of_point[claims[-1].last + 1 :] = claims[-1].name
    for before, after in itertools.pairwise(claims):
        start, stop = before.last + 1, after.first
        if start >= stop or not (before.open or after.open):
            continue
        cut = start if not before.open else stop
        if before.open and after.open and before.name != after.name:
            cut = start + most_doubtful_link(points, frames, start - 1, stop)
        name_of_point[start:cut], name_of_point[cut:stop] = before.name, after.name
    piece = np.concatenate([[0], np.cumsum(np.diff(name_of_point) != 0)])
    return piece, name_of_point


def most_doubtful_link(points: Floats, frames: Ints, first: int, last: int) -> int:
    """Of the steps of a track between points `first` and `last`, the one that constant velocity explains worst.

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        Points of the track.
    frames : ndarray of intp, shape (n,)
        Their frames.
    first, last : int
        The steps first -> first + 1 up to last - 1 -> last are compared.

    Returns
    -------
    int
        0 for the first of these steps.
    """
    steps = np.diff(points, axis=0) / np.diff(frames)[:, np.newaxis]
    change = np.linalg.norm(np.diff(steps, axis=0), axis=1)  # at every inner point
    padded = np.concatenate([[0.0], change, [0.0]])
    surprise = (padded[:-1] + padded[1:]) * np.diff(frames)  # of both ends of a step; unseen frames add to the doubt
    return int(np.argmax(surprise[first:last]))
