"""Places on limbs: markers that share one are the same marker, tracks that keep a free one are a marker of its own."""

from __future__ import annotations

import numpy as np

from skelgen.model import Limbs, Motion
from skelgen.model.arrays import Bools, Floats, Ints

LEAST_FRAMES = 25
"""Frames that must show a track on a limb before its place there counts."""

LEAST_SHARE = 0.03
"""Of all frames that a new marker must be seen in."""

STEADINESS = 0.5
"""A track keeps its place on a limb if it moves there by less than this part of the gate."""

COMMON_FRAMES = 3
"""Two markers that are seen together in more frames are two."""


def local_positions(points: Floats, frames: Ints, motion: Motion, limb: int) -> Floats:
    """Points in the frame of a limb [mm], shape (n_points, 3)."""
    pose = motion.world_from_limb[frames, limb]
    return np.asarray(np.einsum("pji,pj->pi", pose[:, :3, :3], points - pose[:, :3, 3]))


def join_markers(positions: Floats, offsets: Floats, limbs: Limbs, gate: float) -> Floats:
    """Join markers that have one place on one limb and are never seen together.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Trajectories, NaN where unseen.
    offsets : ndarray, shape (n_markers, 3), mm
        Places on the limbs.
    limbs : Limbs
        Limb of each marker.
    gate : float, mm
        Places nearer than this are one.

    Returns
    -------
    ndarray, shape (n_frames, n_left, 3), mm
    """
    seen = ~np.isnan(positions[:, :, 0])
    common = seen.T.astype(np.float64) @ seen
    same_limb = (limbs.limb_of_marker[:, np.newaxis] == limbs.limb_of_marker) & (limbs.limb_of_marker >= 0)
    distance = np.linalg.norm(offsets[:, np.newaxis] - offsets, axis=2)
    near = same_limb & (common <= COMMON_FRAMES) & (np.nan_to_num(distance, nan=np.inf) < gate)
    result = positions.copy()
    gone: set[int] = set()
    for first, second in np.argwhere(np.triu(near, 1)):
        if first in gone or second in gone:
            continue
        result[:, first] = np.where(seen[:, first, np.newaxis], result[:, first], result[:, second])
        gone.add(int(second))
    return np.delete(result, sorted(gone), axis=1)


def new_markers(
    points: Floats, frames: Ints, pieces: Ints, free: Bools, motion: Motion, credible: Bools, gate: float
) -> list[Ints]:
    """Find tracks without a marker that keep a place of their own on a limb.

    Parameters
    ----------
    points, frames, pieces : ndarray
        Position [mm], frame and track of each point.
    free : ndarray of bool, shape (n_points,)
        Points that belong to no marker.
    motion : Motion
        Poses of the limbs.
    credible : ndarray of bool, shape (n_frames, n_limbs)
        Poses that are to be believed.
    gate : float, mm
        Places nearer than this are one.

    Returns
    -------
    list of ndarray of intp
        Indices of the points of each new marker.
    """
    found: list[tuple[int, Floats, Ints]] = []
    order = np.flatnonzero(free & (pieces >= 0))
    order = order[np.argsort(pieces[order], kind="stable")]
    for members in np.split(order, np.flatnonzero(np.diff(pieces[order])) + 1):
        if len(members) < LEAST_FRAMES:
            continue
        place = _steadiest_place(points[members], frames[members], motion, credible, STEADINESS * gate)
        if place is not None:
            _join_or_add(found, place, members, frames, gate)
    least = max(LEAST_FRAMES, LEAST_SHARE * motion.n_frames)
    return [members for _, _, members in found if len(members) >= least]


def _steadiest_place(
    points: Floats, frames: Ints, motion: Motion, credible: Bools, limit: float
) -> tuple[int, Floats] | None:
    """The limb against which points move least, and their mean place there; None if they move too much on all."""
    best: tuple[float, int, Floats] | None = None
    for limb in range(credible.shape[1]):
        sure = credible[frames, limb]
        if sure.sum() < max(LEAST_FRAMES, 0.5 * len(frames)):
            continue
        local = local_positions(points[sure], frames[sure], motion, limb)
        spread = float(np.sqrt(local.var(axis=0).sum()))
        if spread < limit and (best is None or spread < best[0]):
            best = (spread, limb, local.mean(axis=0))
    return None if best is None else best[1:]


def _join_or_add(
    found: list[tuple[int, Floats, Ints]], place: tuple[int, Floats], members: Ints, frames: Ints, gate: float
) -> None:
    limb, where = place
    for index, (other_limb, other, others) in enumerate(found):
        apart = len(np.intersect1d(frames[members], frames[others])) <= COMMON_FRAMES
        if other_limb == limb and np.linalg.norm(other - where) < gate and apart:
            found[index] = (limb, (other + where) / 2, np.concatenate([others, members]))
            return
    found.append((limb, where, members))
