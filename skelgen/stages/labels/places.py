"""Places on limbs: markers that share one are the same marker, tracks that keep a free one are a marker of its own."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.blocks import Block
from skelgen.stages.labels.posing import Poses, steadiest_place

LEAST_FRAMES = 25
"""Frames that must show a track on a limb before its place there counts."""

LEAST_SHARE = 0.03
"""Of all frames that a new marker must be seen in."""

COMMON_FRAMES = 3
"""Two markers that are seen together in more frames are two."""


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
class _Newcomer:
    """A place that tracks keep: where it is, the points, and those of the latest block with their frames."""

    place: Floats
    points: list[Ints]
    block: int
    frames: Ints

    @property
    def n_points(self) -> int:
        return sum(len(points) for points in self.points)


class Newcomers:
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
        self._found: dict[int, list[_Newcomer]] = {}  # by limb

    def look(self, points: Floats, block: Block, free: Ints, pieces: Ints, poses: Poses) -> None:
        """Look at the free tracks of a block.

        Parameters
        ----------
        points : ndarray, shape (n_points, 3), mm
            Points of the block.
        block : Block
            Their frames, and where they are in the take.
        free : ndarray of intp
            Points that are no marker's.
        pieces : ndarray of intp, shape (n_points,)
            Track of each point, -1 for none.
        poses : Poses
            Where limbs are in the block.
        """
        order = free[pieces[free] >= 0]
        order = order[np.argsort(pieces[order], kind="stable")]
        for members in np.split(order, np.flatnonzero(np.diff(pieces[order])) + 1):
            if len(members) < LEAST_FRAMES:
                continue
            frames = block.frames[members]
            place = steadiest_place(points[members], poses.at(frames), self._limits, LEAST_FRAMES)
            if place is not None:
                self._add(place, block, members)

    def found(self, n_frames: int) -> list[Ints]:
        """Points of each new marker, of those that are seen in enough of the take's `n_frames`."""
        least = max(LEAST_FRAMES, LEAST_SHARE * n_frames)
        everybody = itertools.chain.from_iterable(self._found.values())
        return [np.concatenate(one.points) for one in everybody if one.n_points >= least]

    def _add(self, place: tuple[int, Floats], block: Block, members: Ints) -> None:
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
        others.append(_Newcomer(position, [points], block.first, frames))
