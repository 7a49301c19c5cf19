"""What a tracker makes of markers: noise, soft-tissue motion, dropouts, ghosts, points in no order."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.simulation.articulated import Structure
from skelgen.simulation.motion import smooth_curves

SINGLE_SHARE = 0.2
"""Part of the dropouts that are single frames; the rest come in bursts."""

BURST_FRAMES = (5, 40)
"""Shortest and longest burst [frames]: a hand that passes a marker, a marker behind a turned back."""

GHOST_FRAMES = (1, 5)
"""Shortest and longest life [frames] of a ghost."""

_SKIN_FREQUENCIES = (0.2, 2.0)  # Hz: skin slides with the motion and wobbles a little faster than it


def carried_markers(structure: Structure, world_from_limb: Floats) -> Floats:
    """Return the world positions of markers that are rigidly fixed to their limbs.

    Parameters
    ----------
    structure : Structure
        Marker offsets.
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Poses of the limbs.

    Returns
    -------
    ndarray, shape (n_frames, n_markers, 3), mm
    """
    return _carried(world_from_limb[:, structure.limb_of_marker], structure.marker_offsets)


def _carried(world_from_marker_limb: Floats, offsets: Floats) -> Floats:
    turned = world_from_marker_limb[..., :3, :3] @ offsets[..., np.newaxis]
    return np.asarray(turned[..., 0] + world_from_marker_limb[..., :3, 3])


def soft_tissue_motion(
    structure: Structure,
    world_from_limb: Floats,
    angles: list[Floats],
    *,
    rate: float,
    deviation: float,
    rng: np.random.Generator,
) -> Floats:
    """Return the displacement of each marker from its rigid place, half of it following the joint, half wandering.

    Parameters
    ----------
    structure : Structure
        Markers and limbs.
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4)
        Poses of the limbs.
    angles : list of ndarray, shape (n_frames, n_angles), rad
        Joint angles of every limb, which the skin follows; the root's skin only wanders.
    rate : float, Hz
        Frame rate.
    deviation : float, mm
        Standard deviation over time of each coordinate in the limb's frame, reached by every marker.
    rng : numpy.random.Generator
        Source of the directions and of the wandering.

    Returns
    -------
    ndarray, shape (n_frames, n_markers, 3), mm, in the world
    """
    n_frames, n_markers = len(world_from_limb), structure.n_markers
    wandering = smooth_curves(rng, n_frames, rate, 3 * n_markers, _SKIN_FREQUENCIES).reshape(n_frames, n_markers, 3)
    local = _standardised(wandering)
    for index, limb_angles in enumerate(angles):
        if structure.limbs[index].kind == "free":
            continue
        markers = np.flatnonzero(structure.limb_of_marker == index)
        directions = rng.normal(size=(limb_angles.shape[1], 3 * len(markers)))
        following = (_standardised(limb_angles) @ directions).reshape(n_frames, len(markers), 3)
        local[:, markers] += _standardised(following)
    local = deviation * _standardised(local)
    rotations = world_from_limb[:, structure.limb_of_marker, :3, :3]
    return np.asarray((rotations @ local[..., np.newaxis])[..., 0])


def _standardised(curves: Floats) -> Floats:
    spread = curves.std(axis=0)
    return np.asarray((curves - curves.mean(axis=0)) / np.where(spread > 0, spread, 1.0))


def dropouts(n_frames: int, n_markers: int, fraction: float, rng: np.random.Generator) -> Bools:
    """Return which markers are lost in which frames, in bursts and in single frames.

    Parameters
    ----------
    n_frames, n_markers : int
        Shape of the result.
    fraction : float
        Part of all positions that is lost, 0 to below 1.
    rng : numpy.random.Generator
        Source of the times.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    single = SINGLE_SHARE * fraction
    in_bursts = 1 - (1 - fraction) / (1 - single)  # so that both together lose `fraction`
    lost = _bursts(n_frames, n_markers, in_bursts, rng)
    return lost | (rng.random((n_frames, n_markers)) < single)


def _bursts(n_frames: int, n_markers: int, fraction: float, rng: np.random.Generator) -> Bools:
    """Cover `fraction` of the frames: the part left by n bursts at random places is (1 - 1 / size) ^ (n length)."""
    shortest, longest = BURST_FRAMES
    rows = n_frames + longest - 1  # bursts may start before the take does
    n_bursts = round(-np.log1p(-fraction) * rows * n_markers / ((shortest + longest) / 2))
    first = rng.integers(0, rows, size=n_bursts)
    marker = rng.integers(0, n_markers, size=n_bursts)
    length = rng.integers(shortest, longest + 1, size=n_bursts)
    steps = np.zeros((rows + longest + 1, n_markers), dtype=np.intp)
    np.add.at(steps, (first, marker), 1)
    np.add.at(steps, (first + length, marker), -1)
    return np.asarray(np.cumsum(steps, axis=0)[longest - 1 : longest - 1 + n_frames] > 0)


def ghosts(positions: Floats, per_frame: float, rng: np.random.Generator) -> tuple[Ints, Floats]:
    """Return short-lived false points at random places of the box around the markers.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        All markers.
    per_frame : float
        Mean number of ghosts in a frame.
    rng : numpy.random.Generator
        Source of places and times.

    Returns
    -------
    frames : ndarray of intp, shape (n_ghosts,)
        Frame of each ghost point.
    points : ndarray, shape (n_ghosts, 3), mm
        Each ghost stays where it was born.
    """
    n_frames = len(positions)
    shortest, longest = GHOST_FRAMES
    mean_life = (shortest + longest) / 2
    n_births = rng.poisson(per_frame * (n_frames + longest - 1) / mean_life)
    birth = rng.integers(1 - longest, n_frames, size=n_births)
    life = rng.integers(shortest, longest + 1, size=n_births)
    place = rng.random((n_births, 3))
    box = positions[np.maximum(birth, 0)]
    points = box.min(axis=1) + place * np.ptp(box, axis=1)
    of_birth = np.repeat(np.arange(n_births), life)
    age = np.arange(len(of_birth)) - np.repeat(np.cumsum(life) - life, life)
    frames = birth[of_birth] + age
    inside = (frames >= 0) & (frames < n_frames)
    return frames[inside].astype(np.intp), points[of_birth][inside]


def shuffled_points(
    positions: Floats, ghost_frames: Ints, ghost_points: Floats, rng: np.random.Generator
) -> tuple[Floats, Ints, Ints]:
    """Return seen markers and ghosts as points in random order within each frame.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    ghost_frames : ndarray of intp, shape (n_ghosts,)
        Frame of each ghost.
    ghost_points : ndarray, shape (n_ghosts, 3), mm
        Place of each ghost.
    rng : numpy.random.Generator
        Source of the order.

    Returns
    -------
    points : ndarray, shape (n_points, 3), mm
        Frame after frame.
    frame_starts : ndarray of intp, shape (n_frames + 1,)
        Where each frame begins.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for a ghost.
    """
    frame, marker = np.nonzero(~np.isnan(positions[:, :, 0]))
    frames = np.concatenate([frame, ghost_frames])
    markers = np.concatenate([marker, np.full(len(ghost_frames), -1, dtype=np.intp)])
    points = np.concatenate([positions[frame, marker], ghost_points])
    order = np.lexsort((rng.random(len(frames)), frames))
    starts = np.searchsorted(frames[order], np.arange(len(positions) + 1))
    return points[order], starts.astype(np.intp), markers[order]
