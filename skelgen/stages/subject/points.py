"""Tracks that a subject's skeleton does not explain: markers that moved on their limb, or markers that are new."""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.model import Skeleton
from skelgen.model.arrays import Floats, Ints, rows_of_each
from skelgen.stages.labels import FollowedPoints, SkeletonPoses

LEAST_FRAMES = 30
"""Frames that must show a track before its place on a limb counts, as for the skeleton's own limbs."""

MOVED_SHARE = 0.5
"""A marker that is at its place in more than this part of the frames that show the newcomer has not moved there."""


@dataclass(frozen=True, eq=False)
class PlacedTrack:
    """A marker at a place of its own on a limb.

    Attributes
    ----------
    points : ndarray of intp
        Its points in the take.
    limb : int
        The limb, -1 for none.
    place : ndarray, shape (3,), mm
        Where it is in the limb's frame; NaN on no limb.
    spread : float, mm
        Root mean square of a coordinate around that place.
    marker : int
        The marker of the skeleton that moved there; -1 for a new one.
    name : str
        Name in the take, empty where it has none.
    """

    points: Ints
    limb: int
    place: Floats
    spread: float
    marker: int
    name: str


def place_tracks(
    points: FollowedPoints,
    marker_of_point: Ints,
    skeleton: Skeleton,
    poses: SkeletonPoses,
    gates: Floats,
    marker_of_track: dict[int, int],
) -> tuple[tuple[PlacedTrack, ...], tuple[PlacedTrack, ...]]:
    """Find moved and new markers among the tracks that no marker explains.

    Parameters
    ----------
    points : FollowedPoints
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    skeleton : Skeleton
        The subject's skeleton.
    poses : SkeletonPoses
        Its poses.
    gates : ndarray, shape (n_markers,), mm
        How far from its place each marker may be.
    marker_of_track : mapping of int to int
        The marker that a track is by its name.
    """
    gate = float(np.median(gates))
    found = _joined(_alone(points, marker_of_point, poses, gate), points, gate)
    seen = np.zeros((points.cloud.n_frames, len(skeleton.limb_of_marker)), dtype=np.bool_)
    seen[points.frames[marker_of_point >= 0], marker_of_point[marker_of_point >= 0]] = True
    moved: list[PlacedTrack] = []
    new: list[PlacedTrack] = []
    for one in sorted(found, key=lambda one: -len(one.points)):
        track = int(points.tracks[one.points[0]])
        named = marker_of_track.get(track, -1) if points.names else -1
        taken = {other.marker for other in moved}
        absent = ~(seen[points.frames[one.points]].mean(axis=0) > MOVED_SHARE)
        on_limb = skeleton.markers_of(one.limb).tolist() if one.limb >= 0 else []
        candidates = [m for m in on_limb if absent[m] and m not in taken]
        if named >= 0 and absent[named] and named not in taken:
            moved.append(replace(one, marker=named))
        elif candidates:
            apart = np.linalg.norm(skeleton.marker_offsets[candidates] - one.place, axis=1)
            moved.append(replace(one, marker=candidates[int(np.argmin(apart))]))
        else:
            new.append(one)
    return tuple(moved), tuple(new)


def _alone(points: FollowedPoints, marker_of_point: Ints, poses: SkeletonPoses, gate: float) -> list[PlacedTrack]:
    """Tracks without a marker that are seen for long: on the limb on which they stay, or on none."""
    left = np.flatnonzero((marker_of_point < 0) & (points.tracks >= 0))
    lengths = np.bincount(points.tracks[points.tracks >= 0])
    is_there, found = poses.seen.any(axis=0), []
    for rows in rows_of_each(points.tracks[left]):
        some = left[rows]
        if len(some) < max(LEAST_FRAMES, MOVED_SHARE * lengths[points.tracks[some[0]]]):
            continue
        frames = points.frames[some]
        shifted = points.cloud.points[some, np.newaxis] - poses.world_from_limb[frames, :, :3, 3]
        local = (poses.world_from_limb[frames, :, :3, :3].swapaxes(-1, -2) @ shifted[..., np.newaxis])[..., 0]
        middle = np.median(local, axis=0)
        off = np.where(is_there, np.linalg.norm(local - middle, axis=2), np.inf)
        limb = int(np.argmin(np.median(off, axis=0)))
        near = off[:, limb] < gate
        name = points.names[int(points.tracks[some[0]])] if points.names else ""
        if near.sum() >= max(LEAST_FRAMES, len(some) / 2):
            place = local[near, limb].mean(axis=0)
            spread = float(np.sqrt(((local[near, limb] - place) ** 2).mean()))
            found.append(PlacedTrack(some[near], limb, place, spread, -1, name))
        elif name:
            found.append(PlacedTrack(some, -1, np.full(3, np.nan), np.nan, -1, name))
    return found


def _joined(found: list[PlacedTrack], points: FollowedPoints, gate: float) -> list[PlacedTrack]:
    """Join found at one place of a limb that are never seen together: one marker, lost and found again."""
    joined: list[PlacedTrack] = []
    for one in sorted(found, key=lambda one: -len(one.points)):
        for index, other in enumerate(joined):
            near = one.limb >= 0 and one.limb == other.limb and np.linalg.norm(one.place - other.place) < gate
            if near and not points.names and not np.isin(points.frames[one.points], points.frames[other.points]).any():
                both = np.sort(np.concatenate([other.points, one.points]))
                joined[index] = replace(other, points=both)
                break
        else:
            joined.append(one)
    return joined
