"""Tracks of markers that fall off: on the floor they are no markers of any body."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skelgen.geometry.falling import Fall, find_fall, has_left, moments_of
from skelgen.geometry.standing import ends_still
from skelgen.model.arrays import Ints, rows_of_each
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.point_labels import sampled_positions

SAME_PLACE = 5.0
"""mm; pieces of tracks that lie there all of the time are the marker that has fallen."""

LOST_SECONDS = 0.5
"""s; a marker may be lost as it hits the floor, and found again where it lies."""


def without_fallen(take: FollowedCloud) -> tuple[FollowedCloud, tuple[str, ...]]:
    """Follow no marker any longer that falls off, nor what lies where it fell; and notice each.

    Parameters
    ----------
    take : FollowedCloud
        The take. Tracks with points whose marker is stated, and those of a very long take, stay as they are.
    """
    if take.is_very_long:
        return take, ()
    track, frame, notices = take.track_of_point.copy(), take.frame_of_point(), list[str]()
    followed = np.flatnonzero(track >= 0)
    pieces = [followed[rows] for rows in rows_of_each(track[followed])]
    first, last = (np.array([frame[points[end]] for points in pieces], dtype=np.intp) for end in (0, -1))
    low = np.array([take.cloud.points[points].min(axis=0) for points in pieces]).reshape(-1, 3)
    high = np.array([take.cloud.points[points].max(axis=0) for points in pieces]).reshape(-1, 3)
    for number, points in enumerate(pieces):
        place = take.cloud.points[points[-1]]
        lies = ((place - low < SAME_PLACE) & (high - place < SAME_PLACE)).all(axis=1)
        if (lies & (last < first[number])).any():  # it has lain there before
            continue
        rest = np.concatenate([points, *(pieces[other] for other in np.flatnonzero(lies & (first > last[number])))])
        if track[points[-1]] < 0 or take.is_fixed[rest].any() or not ends_still(take.cloud.points[rest], take.rate):
            continue
        is_before = (last < first[number]) & (last >= first[number] - LOST_SECONDS * take.rate)
        found = _fall_of(take, rest, [pieces[other] for other in np.flatnonzero(is_before).tolist()], frame)
        if found is not None:
            path, fall = found
            track[path[frame[path] >= fall.first]] = -1
            when = f"at frame {fall.first} and lies still from frame {fall.rest} on"
            notices.append(f"a marker falls off {when}: it is left out then")
    return replace(take, track_of_point=track) if notices else take, tuple(notices)


def _fall_of(take: FollowedCloud, points: Ints, before: Sequence[Ints], frame: Ints) -> tuple[Ints, Fall] | None:
    """Points of a track, or of one that ends before and of it, and how they fall; None if they do not."""
    for path in (np.sort(np.concatenate([*one, points])) for one in ((), *((piece,) for piece in before))):
        frames = frame[path]
        places = np.full((frames[-1] - frames[0] + 1, 3), np.nan)
        places[frames - frames[0]] = take.cloud.points[path]
        fall = find_fall(places, take.rate)
        if fall is None:
            continue
        tracks = take.track_of_point.copy()
        tracks[path] = track = int(tracks[points[0]])
        moments = frames[0] + moments_of(fall, ~np.isnan(places[:, 0]))
        if has_left(sampled_positions(take.cloud, tracks, moments), track):
            return path, fall._replace(first=fall.first + int(frames[0]), rest=fall.rest + int(frames[0]))
    return None
