"""Labels of points: the marker of each. Long takes are handled block of frames by block, to need little memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints, numbers_between

BLOCK_FRAMES = 2000
"""Frames that are labelled at once; bounds the memory."""

LONG_BLOCK_FRAMES = 20_000
"""Frames that are handled together, where one number a point is enough."""

BLOCK_POINTS = 100_000
"""Points that are handled together, where frames do not matter."""

UNEXPLAINED_SHARE = 0.8
"""Part of its points that later labels leave without a marker: less, and the marker is known by another number."""

_MIXERS = tuple(np.uint64(value) for value in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9))
"""Odd numbers that scatter the bits of coordinates over a key."""

_FRAME_MIXER = np.uint64(0xD6E8FEB86659FD93)

_Keys = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class Block:
    """Successive frames of a take.

    Attributes
    ----------
    first : int
        First frame.
    n_frames : int
        Number of frames.
    points : slice
        Their points in the cloud.
    frames : ndarray of int32
        Frame of each of these points, counted from `first`.
    """

    first: int
    n_frames: int
    points: slice
    frames: Ints


def blocks_of(cloud: PointCloud, size: int = BLOCK_FRAMES) -> Iterator[Block]:
    """Cut a take into blocks of frames.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    size : int
        Frames of a block.
    """
    for first in range(0, cloud.n_frames, size):
        starts = cloud.frame_starts[first : first + size + 1]
        frames = np.repeat(np.arange(len(starts) - 1, dtype=np.int32), np.diff(starts))
        yield Block(first, len(starts) - 1, slice(int(starts[0]), int(starts[-1])), frames)


def renumbered(marker_of_point: Ints, keep: Bools) -> Ints:
    """Number the markers that are kept without holes; points of others get -1.

    Parameters
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    keep : ndarray of bool, shape (n_markers,)
        Whether a marker is kept.
    """
    place = np.full(len(keep) + 1, -1, dtype=np.int32)
    place[:-1][keep] = np.arange(int(keep.sum()))
    return place[marker_of_point]


def without_holes(marker_of_point: Ints) -> Ints:
    """Number the markers that have points without holes.

    Parameters
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    return renumbered(marker_of_point, np.bincount(marker_of_point[marker_of_point >= 0], minlength=1) > 0)


def joined(cloud: PointCloud, marker_of_point: Ints, part_of: Ints) -> Ints:
    """Give points the markers that theirs became part of, at most one of a frame, numbered without holes.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    part_of : ndarray of intp, shape (n_markers,)
        What each marker became part of, itself or another one; -1 for none.
    """
    return without_holes(one_point_a_frame(cloud, np.append(part_of, -1).astype(np.int32)[marker_of_point]))


def marker_positions(cloud: PointCloud, marker_of_point: Ints, n_markers: int, block: Block) -> Floats:
    """Positions of markers in a block [mm], NaN where unseen, shape (n_frames, n_markers, 3).

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point of the take, -1 for none.
    n_markers : int
        Number of markers.
    block : Block
        The frames.
    """
    positions = np.full((block.n_frames, n_markers, 3), np.nan)
    marker = marker_of_point[block.points]
    owned = marker >= 0
    positions[block.frames[owned], marker[owned]] = cloud.points[block.points][owned]
    return positions


def sampled_positions(cloud: PointCloud, marker_of_point: Ints, frames: Ints, n_markers: int | None = None) -> Floats:
    """Positions of markers in some frames [mm], NaN where unseen, shape (len(frames), n_markers, 3).

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point of the take, -1 for none.
    frames : ndarray of intp
        Rising frames.
    n_markers : int, optional
        Number of markers; as many as points have, if it is not given.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1 if n_markers is None else n_markers
    point = points_of_markers(cloud, marker_of_point, frames, n_markers)
    seen = point >= 0
    positions = np.full((*point.shape, 3), np.nan)
    positions[seen] = cloud.points[point[seen]]
    return positions


def points_of_markers(cloud: PointCloud, marker_of_point: Ints, frames: Ints, n_markers: int) -> Ints:
    """Point of each marker in some frames, -1 where it is unseen, shape (len(frames), n_markers).

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point of the take, -1 for none.
    frames : ndarray of intp
        Rising frames.
    n_markers : int
        Number of markers.
    """
    row, point = points_in_frames(cloud, frames)
    marker = marker_of_point[point]
    owned = marker >= 0
    found = np.full((len(frames), n_markers), -1, dtype=np.intp)
    found[row[owned], marker[owned]] = point[owned]
    return found


def points_in_frames(cloud: PointCloud, frames: Ints) -> tuple[Ints, Ints]:
    """Return the points of some frames: the index in `frames`, and the index in the cloud, of each.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    frames : ndarray of intp
        Rising frames.
    """
    return numbers_between(cloud.frame_starts[frames], cloud.frame_starts[frames + 1])


def seen_together(cloud: PointCloud, marker_of_point: Ints, n_markers: int) -> Floats:
    """Number of frames in which two markers are seen together, shape (n_markers, n_markers).

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_markers : int
        Number of markers.
    """
    together = np.zeros((n_markers, n_markers))
    for block in blocks_of(cloud):
        seen, marker = np.zeros((block.n_frames, n_markers)), marker_of_point[block.points]
        seen[block.frames[marker >= 0], marker[marker >= 0]] = 1.0
        together += seen.T @ seen
    return together


def marker_names(n_markers: int) -> tuple[str, ...]:
    """Return the names of markers that have no labels: ``M000``, ``M001``, ..."""
    return tuple(f"M{index:03d}" for index in range(n_markers))


def all_positions(cloud: PointCloud, marker_of_point: Ints, n_markers: int) -> Floats:
    """Positions of markers in all frames [mm], NaN where unseen, shape (n_frames, n_markers, 3); read-only.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_markers : int
        Number of markers.
    """
    positions = np.full((cloud.n_frames, n_markers, 3), np.nan)
    for block in blocks_of(cloud):
        part = slice(block.first, block.first + block.n_frames)
        positions[part] = marker_positions(cloud, marker_of_point, n_markers, block)
    positions.flags.writeable = False
    return positions


def in_order_of_appearance(marker_of_point: Ints) -> Ints:
    """Number markers in the order in which they are first seen, without holes.

    Parameters
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of int32, shape (n_points,)
        The same markers with other numbers, -1 for none.
    """
    first = np.full(int(marker_of_point.max(initial=-1)) + 1, -1, dtype=np.intp)
    for start in reversed(range(0, len(marker_of_point), BLOCK_POINTS)):
        owned = np.flatnonzero(marker_of_point[start : start + BLOCK_POINTS] >= 0)[::-1] + start
        first[marker_of_point[owned]] = owned  # of several the last that is written, the first point
    order = np.argsort(first, kind="stable")
    order = order[first[order] >= 0]
    place = np.full(len(first) + 1, -1, dtype=np.int32)
    place[order] = np.arange(len(order))
    return np.asarray(place[marker_of_point])


def one_point_a_frame(cloud: PointCloud, marker_of_point: Ints) -> Ints:
    """Let markers that were merged keep the first of two points in a frame.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; changed in place, and returned.
    """
    for block in blocks_of(cloud):
        marker = marker_of_point[block.points]
        owned = np.flatnonzero(marker >= 0)[::-1]
        first = np.empty((block.n_frames, int(marker.max(initial=0)) + 1), dtype=np.intp)
        first[block.frames[owned], marker[owned]] = owned  # of several the last that is written, the first point
        later = owned[first[block.frames[owned], marker[owned]] != owned]
        marker_of_point[block.points.start + later] = -1
    return marker_of_point


def counts_together(one: Ints, other: Ints) -> Ints:
    """Number of points with each pair of markers of two labellings, -1 for none, shape (n_one + 1, n_other + 1).

    Row and column 0 stand for points of no marker.

    Parameters
    ----------
    one, other : ndarray of intp, shape (n_points,)
        Marker of each point by either labelling, -1 for none.
    """
    n_one, n_other = int(one.max(initial=-1)) + 2, int(other.max(initial=-1)) + 2
    counts = np.zeros(n_one * n_other, dtype=np.intp)
    for start in range(0, len(one), BLOCK_POINTS):
        part = slice(start, start + BLOCK_POINTS)
        counts += np.bincount((one[part] + 1) * np.intp(n_other) + (other[part] + 1), minlength=len(counts))
    return counts.reshape(n_one, n_other)


def with_unexplained(before: Ints, after: Ints, least: float) -> Ints:
    """Add to later labels the markers of earlier ones that were seen for long, and of which next to nothing is left.

    Parameters
    ----------
    before, after : ndarray of intp, shape (n_points,)
        Marker of each point by the earlier and the later labels, -1 for none.
    least : float
        Points without a marker that such a marker has.
    """
    together = counts_together(before, after)[1:]
    left_out = together[:, 0]
    free = (left_out >= least) & (left_out >= UNEXPLAINED_SHARE * together.sum(axis=1))
    number = np.full(len(free) + 1, -1, dtype=np.int32)
    number[:-1][free] = after.max(initial=-1) + 1 + np.arange(int(free.sum()))
    return np.where(after < 0, number[before], after)


def filled_labels(cloud: PointCloud, ways: Sequence[Ints], n_markers: int) -> Ints:
    """Label points by the first way, by the next ones where that leaves both point and marker alone.

    Parameters
    ----------
    cloud : PointCloud
        The points.
    ways : sequence of ndarray of intp, shape (n_points,)
        Marker of each point by each way, -1 for none.
    n_markers : int
        Number of markers.
    """
    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    marker_of_point = ways[0]
    for other in ways[1:]:
        taken = np.zeros((cloud.n_frames, n_markers), dtype=np.bool_)
        owned = marker_of_point >= 0
        taken[frames[owned], marker_of_point[owned]] = True
        free = (marker_of_point < 0) & (other >= 0) & ~taken[frames, other]
        marker_of_point = np.where(free, other, marker_of_point)
    return marker_of_point


def find_points(cloud: PointCloud, positions: Floats) -> Ints:
    """Find which marker each point became, from positions that are exactly those of points.

    Parameters
    ----------
    cloud : PointCloud
        The points.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Of the markers, NaN where unseen.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        -1 for points that are no marker's.
    """
    marker_of_point = np.full(cloud.n_points, -1, dtype=np.intp)
    for block in blocks_of(cloud, LONG_BLOCK_FRAMES):
        theirs = positions[block.first : block.first + block.n_frames]
        frame, marker = np.nonzero(~np.isnan(theirs[:, :, 0]))
        wanted = _keys(frame, theirs[frame, marker])
        found = _places(_keys(block.frames, cloud.points[block.points]), wanted)
        marker_of_point[block.points][found[found >= 0]] = marker[found >= 0]
    return marker_of_point


def _keys(frames: Ints, points: Floats) -> _Keys:
    """One number for each point of each frame; equal numbers mean equal points, but for one case in 2^64."""
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)  # + 0.0: minus zero is zero
    key = frames.astype(np.uint64) * _FRAME_MIXER
    for axis, mixer in enumerate(_MIXERS):
        key = (key ^ bits[:, axis]) * mixer
        key ^= key >> np.uint64(29)
    return key


def _places(keys: _Keys, wanted: _Keys) -> Ints:
    """Index of each wanted key among all keys, each used once; -1 where it is not there."""
    order, turn = np.argsort(keys, kind="stable"), np.argsort(wanted, kind="stable")
    ordered = wanted[turn]
    place = np.searchsorted(keys[order], ordered) + np.arange(len(turn)) - np.searchsorted(ordered, ordered)
    there = place < len(keys)
    there[there] = keys[order[place[there]]] == ordered[there]
    result = np.full(len(wanted), -1, dtype=np.intp)
    result[turn[there]] = order[place[there]]
    return result


def numbered_as(labels: Ints, other: Ints) -> Ints:
    """Other labels by the numbers of the markers with which theirs have most points in common, -1 where none has.

    Parameters
    ----------
    labels, other : ndarray of intp, shape (n_points,)
        Marker of each point by both, -1 for none.
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    together = counts_together(labels, other)[1:, 1:]
    rows, columns = linear_sum_assignment(together, maximize=True)
    same = np.full(together.shape[1] + 1, -1, dtype=labels.dtype)
    same[columns] = np.where(together[rows, columns] > 0, rows, -1)
    return same[other]
