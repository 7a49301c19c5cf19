"""Which marker each point became, found from the positions alone: labels may have been changed by hand or repaired."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skelgen.model import PointCloud
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.blocks import LONG_BLOCK_FRAMES, blocks_of

_MIXERS = tuple(np.uint64(value) for value in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9))
"""Odd numbers that scatter the bits of coordinates over a key."""

_FRAME_MIXER = np.uint64(0xD6E8FEB86659FD93)

Keys = NDArray[np.uint64]


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


def _keys(frames: Ints, points: Floats) -> Keys:
    """One number for each point of each frame; equal numbers mean equal points, but for one case in 2^64."""
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)  # + 0.0: minus zero is zero
    key = frames.astype(np.uint64) * _FRAME_MIXER
    for axis, mixer in enumerate(_MIXERS):
        key = (key ^ bits[:, axis]) * mixer
        key ^= key >> np.uint64(29)
    return key


def _places(keys: Keys, wanted: Keys) -> Ints:
    """Index of each wanted key among all keys, each used once; -1 where it is not there."""
    order, turn = np.argsort(keys, kind="stable"), np.argsort(wanted, kind="stable")
    ordered = wanted[turn]
    place = np.searchsorted(keys[order], ordered) + np.arange(len(turn)) - np.searchsorted(ordered, ordered)
    there = place < len(keys)
    there[there] = keys[order[place[there]]] == ordered[there]
    result = np.full(len(wanted), -1, dtype=np.intp)
    result[turn[there]] = order[place[there]]
    return result
