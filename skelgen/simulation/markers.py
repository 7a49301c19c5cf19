"""What a tracker makes of markers: soft-tissue motion, dropouts, jumps, merged and doubled points, ghosts."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.simulation.articulated import Structure
from skelgen.simulation.motion import smooth_curves

SINGLE_SHARE = 0.2
"""Part of the dropouts that are single frames; the rest come in bursts."""

BURST_FRAMES = (5, 40)
"""Shortest and longest burst [frames]: a hand that passes a marker, a marker behind a turned back."""

GHOST_FRAMES = (1, 5)
"""Shortest and longest life [frames] of a ghost."""

DUPLICATE_FRAMES = (1, 10)
"""Shortest and longest time [frames] for which a marker is seen double."""

DUPLICATE_OFFSET = 1.0
"""Distance [mm] between a marker's two points: what two pairs of cameras calibrated to a millimetre disagree by."""

EDGE_FRAMES = 2
"""Frames at both ends of a marker's visibility in which its position may jump."""

_SOFT_TISSUE_FREQUENCIES = (0.2, 2.0)  # Hz: skin slides with the motion and wobbles a little faster than it
_NO_PAIRS = np.empty((0, 2), dtype=np.intp)


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
    poses = world_from_limb[:, structure.limb_of_marker]
    turned = poses[..., :3, :3] @ structure.marker_offsets[..., np.newaxis]
    return np.asarray(turned[..., 0] + poses[..., :3, 3])


def soft_tissue_motion(
    structure: Structure,
    world_from_limb: Floats,
    angles: list[Floats],
    *,
    rate: float,
    deviation: float,
    rng: np.random.Generator,
) -> Floats:
    """Return the displacement of each marker [mm], shape (n_frames, n_markers, 3): half follows joints, half wanders.

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
    """
    n_frames, n_markers = len(world_from_limb), structure.n_markers
    wandering = smooth_curves(rng, n_frames, rate, 3 * n_markers, _SOFT_TISSUE_FREQUENCIES).reshape(
        n_frames, n_markers, 3
    )
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


def bursts_lost(n_frames: int, n_markers: int, fraction: float, mean_frames: float, rng: np.random.Generator) -> Bools:
    """Return which markers are lost in which frames, in pieces of exponential length, as are those between them.

    Parameters
    ----------
    n_frames, n_markers : int
        Shape of the result.
    fraction : float
        Part of all positions that is lost, 0 to below 1.
    mean_frames : float
        Mean length of a lost piece.
    rng : numpy.random.Generator
        Source of the times.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    stay = 1.0 - 1.0 / max(mean_frames, 1.0)
    leave = (1.0 - stay) * fraction / (1.0 - fraction)  # in the long run a part `fraction` is lost
    draws = rng.random((n_frames, n_markers))
    lost = np.empty((n_frames, n_markers), dtype=np.bool_)
    lost[0] = draws[0] < fraction
    for frame in range(1, n_frames):
        lost[frame] = draws[frame] < np.where(lost[frame - 1], stay, leave)
    return lost


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
    birth, life = _lives(n_frames, per_frame, GHOST_FRAMES, rng)
    place = rng.random((len(birth), 3))
    box = positions[np.maximum(birth, 0)]
    points = box.min(axis=1) + place * np.ptp(box, axis=1)
    frames, of_birth = _lifetimes(birth, life, n_frames)
    return frames, points[of_birth]


def _lives(n_frames: int, per_frame: float, frames: tuple[int, int], rng: np.random.Generator) -> tuple[Ints, Ints]:
    """First frame and number of frames of short-lived points, `per_frame` of them at a time on average."""
    shortest, longest = frames
    mean_life = (shortest + longest) / 2
    n_births = rng.poisson(per_frame * (n_frames + longest - 1) / mean_life)
    birth = rng.integers(1 - longest, n_frames, size=n_births)  # some live when the take begins
    return birth, rng.integers(shortest, longest + 1, size=n_births)


def _lifetimes(birth: Ints, life: Ints, n_frames: int) -> tuple[Ints, Ints]:
    """Frame and number of each birth for every frame of the take that it lives in."""
    of_birth = np.repeat(np.arange(len(birth)), life)
    age = np.arange(len(of_birth)) - np.repeat(np.cumsum(life) - life, life)
    frames = (birth[of_birth] + age).astype(np.intp)
    inside = (frames >= 0) & (frames < n_frames)
    return frames[inside], of_birth[inside]


def edge_jumps(observed: Floats, deviation: float, rng: np.random.Generator) -> Floats:
    """Return observed positions that jump in the first and last frames in which a marker is seen.

    Parameters
    ----------
    observed : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen; the ends of the take are no edges.
    deviation : float, mm
        Standard deviation of the jumps, per coordinate.
    rng : numpy.random.Generator
        Source of the jumps.

    Returns
    -------
    ndarray, shape (n_frames, n_markers, 3), mm
    """
    unseen = np.isnan(observed[:, :, 0])
    near_edge = np.zeros_like(unseen)
    for frames in range(1, EDGE_FRAMES + 1):
        near_edge[frames:] |= unseen[:-frames]
        near_edge[:-frames] |= unseen[frames:]
    jumps = deviation * rng.normal(size=observed.shape)
    return np.where((near_edge & ~unseen)[..., np.newaxis], observed + jumps, observed)


def merged_points(observed: Floats, resolution: float) -> tuple[Floats, Ints, Floats]:
    """Return observed positions without those that merge, and the points that these become.

    Parameters
    ----------
    observed : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    resolution : float, mm
        Seen markers that are nearer to each other than this, directly or through others, become one point.

    Returns
    -------
    apart : ndarray, shape (n_frames, n_markers, 3), mm
        NaN also where a marker has merged with another.
    frames : ndarray of intp, shape (n_merged,)
        Frame of each merged point.
    points : ndarray, shape (n_merged, 3), mm
        Mean of the markers that each merged point stands for.
    """
    apart, frames, points = observed.copy(), [], []
    for frame, positions in enumerate(observed):
        seen = np.flatnonzero(~np.isnan(positions[:, 0]))
        pairs = cKDTree(positions[seen]).query_pairs(resolution, output_type="ndarray") if len(seen) else _NO_PAIRS
        if not len(pairs):
            continue
        links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(seen), len(seen)))
        _, cluster = connected_components(links, directed=False)
        for members in (seen[cluster == one] for one in np.unique(cluster[pairs[:, 0]])):
            frames.append(frame)
            points.append(positions[members].mean(axis=0))
            apart[frame, members] = np.nan
    return apart, np.array(frames, dtype=np.intp), np.array(points).reshape(-1, 3)


def duplicates(observed: Floats, per_frame: float, rng: np.random.Generator) -> tuple[Ints, Ints, Floats]:
    """Return second points of markers that are seen double for some frames.

    Parameters
    ----------
    observed : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen; what is unseen has no double.
    per_frame : float
        Mean number of doubles in a frame in which all markers are seen.
    rng : numpy.random.Generator
        Source of times, markers and directions.

    Returns
    -------
    frames, markers : ndarray of intp, shape (n_duplicates,)
        Frame and marker of each double.
    points : ndarray, shape (n_duplicates, 3), mm
        `DUPLICATE_OFFSET` beside the marker's point, on the same side as long as it lasts.
    """
    n_frames, n_markers = observed.shape[:2]
    birth, life = _lives(n_frames, per_frame, DUPLICATE_FRAMES, rng)
    marker = rng.integers(n_markers, size=len(birth))
    direction = rng.normal(size=(len(birth), 3))
    offset = DUPLICATE_OFFSET * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    frames, of_birth = _lifetimes(birth, life, n_frames)
    double = np.full(observed.shape, np.nan)  # of two doubles of a marker at a time one is kept
    double[frames, marker[of_birth]] = observed[frames, marker[of_birth]] + offset[of_birth]
    seen_frames, seen_markers = np.nonzero(~np.isnan(double[:, :, 0]))
    return seen_frames, seen_markers, double[seen_frames, seen_markers]


def shuffled_points(
    positions: Floats, more: tuple[Ints, Ints, Floats], rng: np.random.Generator
) -> tuple[Floats, Ints, Ints]:
    """Return seen markers and false points in random order within each frame.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    more : tuple of ndarray, shapes (n_more,), (n_more,) and (n_more, 3)
        Frame, marker (-1 for none) and place [mm] of further points.
    rng : numpy.random.Generator
        Source of the order.

    Returns
    -------
    points : ndarray, shape (n_points, 3), mm
        Frame after frame.
    frame_starts : ndarray of intp, shape (n_frames + 1,)
        Where each frame begins.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    frame, marker = np.nonzero(~np.isnan(positions[:, :, 0]))
    frames = np.concatenate([frame, more[0]])
    markers = np.concatenate([marker, more[1]])
    points = np.concatenate([positions[frame, marker], more[2]])
    order = np.lexsort((rng.random(len(frames)), frames))
    starts = np.searchsorted(frames[order], np.arange(len(positions) + 1))
    return points[order], starts.astype(np.intp), markers[order]
