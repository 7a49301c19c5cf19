"""Labels of points: one marker for each, looked at block of frames by block, so that long takes need little memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints

BLOCK_FRAMES = 2000
"""Frames that are labelled at once; bounds the memory."""


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
    frames : ndarray of intp
        Frame of each of these points, counted from `first`.
    """

    first: int
    n_frames: int
    points: slice
    frames: Ints


def blocks_of(cloud: PointCloud, size: int = BLOCK_FRAMES) -> Iterator[Block]:
    """Cut a take into blocks of frames."""
    for first in range(0, cloud.n_frames, size):
        starts = cloud.frame_starts[first : first + size + 1]
        frames = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        yield Block(first, len(starts) - 1, slice(int(starts[0]), int(starts[-1])), frames)


def renumbered(marker_of_point: Ints, keep: Bools) -> Ints:
    """Number the markers that are kept without holes; points of others get -1."""
    place = np.full(len(keep) + 1, -1, dtype=np.intp)
    place[:-1][keep] = np.arange(int(keep.sum()))
    return place[marker_of_point]


def marker_positions(cloud: PointCloud, marker_of_point: Ints, n_markers: int, block: Block) -> Floats:
    """Positions of markers in a block [mm], NaN where unseen, shape (n_frames, n_markers, 3)."""
    positions = np.full((block.n_frames, n_markers, 3), np.nan)
    marker = marker_of_point[block.points]
    owned = marker >= 0
    positions[block.frames[owned], marker[owned]] = cloud.points[block.points][owned]
    return positions


def marker_names(n_markers: int) -> tuple[str, ...]:
    """Return the names of markers that have no labels: ``M000``, ``M001``, ..."""
    return tuple(f"M{index:03d}" for index in range(n_markers))


def all_positions(cloud: PointCloud, marker_of_point: Ints, n_markers: int) -> Floats:
    """Positions of markers in all frames [mm], NaN where unseen, shape (n_frames, n_markers, 3); read-only."""
    positions = np.full((cloud.n_frames, n_markers, 3), np.nan)
    for block in blocks_of(cloud):
        part = slice(block.first, block.first + block.n_frames)
        positions[part] = marker_positions(cloud, marker_of_point, n_markers, block)
    positions.flags.writeable = False
    return positions


def in_order_of_appearance(marker_of_point: Ints) -> Ints:
    """Number markers in the order in which they are first seen, without holes."""
    owned = np.flatnonzero(marker_of_point >= 0)
    markers, first = np.unique(marker_of_point[owned], return_index=True)
    place = np.full(int(marker_of_point.max(initial=-1)) + 2, -1, dtype=np.intp)
    place[markers[np.argsort(first, kind="stable")]] = np.arange(len(markers))
    return np.asarray(place[marker_of_point])


def one_point_a_frame(cloud: PointCloud, marker_of_point: Ints) -> Ints:
    """Let markers that were joined keep the first of two points in a frame."""
    for block in blocks_of(cloud):
        marker = marker_of_point[block.points]
        owned = np.flatnonzero(marker >= 0)
        _, first = np.unique(block.frames[owned] * (int(marker.max(initial=0)) + 1) + marker[owned], return_index=True)
        single = np.full(len(marker), -1, dtype=np.intp)
        single[owned[first]] = marker[owned[first]]
        marker_of_point[block.points] = single
    return marker_of_point
