"""Positions that can be right, and the poses from the root outward that rest on them."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.orientation import Rotator
from skelgen.geometry.robust import SIGMA_OF_MEDIAN, median_of_known
from skelgen.geometry.rotations import fill_rotations
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, residuals, seen_weights
from skelgen.kinematics.inverse.poses import fit_poses
from skelgen.kinematics.inverse.root_outward import pose_outward
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.skeleton.assembly import Body
from skelgen.stages.skeleton.loops import BodyRings, all_poses
from skelgen.stages.skeleton.parameters import SkeletonParameters


def without_outliers(
    body: Body, chain: Chain, parameters: SkeletonParameters, rotator: Rotator
) -> tuple[Floats, ChainPoses, Bools]:
    """Return positions without those that cannot be right, poses, and which rotations rest on points of the frame.

    Parameters
    ----------
    body : Body
        What is measured.
    chain : Chain
        Its limbs.
    parameters : SkeletonParameters
        Their `outlier_limit` and `flatness`.
    rotator : callable
        Closed form of absolute orientation.
    """
    trusted = body.positions
    poses, posed = pose_outward(chain, trusted, body.raw_joints, rotator=rotator, flatness=parameters.flatness)
    for find in (out_of_reach, out_of_place):
        outliers = find(chain, poses, posed, trusted, parameters.outlier_limit)
        if outliers.any():
            trusted = np.where(outliers[..., np.newaxis], np.nan, trusted)
            poses, posed = pose_outward(chain, trusted, body.raw_joints, rotator=rotator, flatness=parameters.flatness)
    return trusted, poses, posed


LEAST_PART = 0.02
"""Of the markers' typical distance from the joint: less than this is no gross error, however exact the take."""

SQUARE_OF_MEDIAN = 2.366
"""Median of the squared length of a normal vector of deviation 1 along three axes."""

GENTLE = 2.0
"""Deviations at which Cauchy's weights are a half: noise keeps most of its weight."""

REWEIGHTINGS = 6
STEPS_BETWEEN = 2
"""Steps of the poses after each new weights: enough to follow."""


def out_of_line(chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, factor: float) -> Bools:
    """Tell which positions a fit of the whole chain does not explain.

    One wrong position pulls its limb off the others. So the frames in question are fitted again with Cauchy's weights,
    under which what is far off hardly pulls, and judged then (Huber and Ronchetti 2009, *Robust Statistics*, 7).

    Parameters
    ----------
    chain, articulation, poses
        A fitted chain.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        What it was fitted to, NaN where unseen.
    factor : float
        Standard deviations of a coordinate beyond which a position is an outlier.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    size = _sizes(chain, poses, positions)
    typical = _typical(size, positions)
    limit = np.maximum(factor * typical, LEAST_PART * float(np.sqrt((chain.offsets**2).sum(axis=1).mean())))
    far = size > limit
    frames = np.flatnonzero(far.any(axis=1))
    if not len(frames):
        return far
    some, measured = poses[frames], positions[frames]
    for _ in range(REWEIGHTINGS):
        ratio = _sizes(chain, some, measured) / np.maximum(GENTLE * typical, np.finfo(np.float64).tiny)
        weights = seen_weights(measured, 1 / (1 + ratio**2))
        some = fit_poses(chain, some, measured, articulation, weights, STEPS_BETWEEN)
    far[frames] = _sizes(chain, some, measured) > limit
    return far


def _sizes(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    return np.asarray(np.linalg.norm(residuals(chain, poses, positions), axis=2))


def _typical(size: Floats, positions: Floats) -> Floats:
    """Deviation of a coordinate of each marker, of all markers where that is larger, shape (n_markers,), mm."""
    known = np.where(np.isnan(positions[:, :, 0]), np.nan, size)
    heard = ~np.isnan(known).all(axis=0)
    typical = np.zeros(size.shape[1])
    if heard.any():
        typical[heard] = median_of_known(known[:, heard]) / np.sqrt(SQUARE_OF_MEDIAN)
        typical = np.maximum(typical, np.median(typical[heard]))
    return typical


def out_of_reach(chain: Chain, poses: ChainPoses, posed: Bools, positions: Floats, factor: float) -> Bools:
    """Tell which positions no rotation of their limb explains.

    Parameters
    ----------
    chain : Chain
        The limbs.
    poses : ChainPoses
        Poses from the root outward.
    posed : ndarray of bool, shape (n_frames, n_limbs)
        Whether a rotation rests on points of the frame.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    factor : float
        Deviations beyond this many typical ones are outliers.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    limb = chain.limb_of_marker
    origins = poses.origins(chain)[:, limb]
    radius = np.linalg.norm(chain.offsets, axis=1)
    off_sphere = np.abs(np.linalg.norm(positions - origins, axis=2) - radius)
    counts = _parents_posed(chain, posed)[:, limb] & (chain.parents[limb] >= 0)
    return _beyond(off_sphere, counts, factor, _least(chain))


def out_of_place(chain: Chain, poses: ChainPoses, posed: Bools, positions: Floats, factor: float) -> Bools:
    """Tell which positions are far off their place on a posed limb, only the worst of each limb in each frame.

    One wrong position pulls the limb off the others: they are judged when it is gone. Parameters and result are those
    of `out_of_reach`.
    """
    limb = chain.limb_of_marker
    off_place = np.linalg.norm(positions - poses.markers(chain), axis=2)
    counts = (_parents_posed(chain, posed) & posed)[:, limb]
    far = _beyond(off_place, counts, factor, _least(chain))
    known = np.where(np.isnan(off_place), -np.inf, off_place)
    for one in range(chain.n_limbs):
        own = np.flatnonzero(limb == one)
        far[:, own] &= known[:, own] == known[:, own].max(axis=1, keepdims=True)
    return far


def _least(chain: Chain) -> float:
    return LEAST_PART * float(np.sqrt((chain.offsets**2).sum(axis=1).mean()))


def _parents_posed(chain: Chain, posed: Bools) -> Bools:
    """Whether all limbs from the root to a limb's parent are posed, shape (n_frames, n_limbs)."""
    placed = np.ones_like(posed)
    for limb in range(1, chain.n_limbs):
        parent = chain.parents[limb]
        placed[:, limb] = placed[:, parent] & posed[:, parent]
    return placed


def _beyond(deviation: Floats, counts: Bools, factor: float, limit: float) -> Bools:
    """Deviations beyond `factor` typical ones of their marker, or of all markers where those are larger."""
    known = np.where(counts & ~np.isnan(deviation), deviation, np.nan)
    heard = ~np.isnan(known).all(axis=0)
    if not heard.any():
        return np.zeros(deviation.shape, dtype=bool)
    typical = np.zeros(deviation.shape[1])
    typical[heard] = median_of_known(known[:, heard]) * SIGMA_OF_MEDIAN
    typical = np.maximum(typical, np.median(typical[heard]))
    return np.nan_to_num(known) > np.maximum(factor * typical, limit)


LARGE_TURN = 0.1
"""rad: a limb that is nearer to its way through time needs no second look."""

ABOUT_AS_LIKELY = 9.21
"""Twice the logarithm of the ratio of two likelihoods, 100 to 1, from which on the frame's own markers decide."""


def posed_with_care(
    chain: Chain,
    rings: BodyRings | None,
    start: ChainPoses,
    positions: Floats,
    articulation: Articulation,
    seen: Bools,
) -> ChainPoses:
    """Pose a chain in all frames, and in frames that may have two solutions twice.

    Parameters
    ----------
    chain, rings, start, positions, articulation
        See `ringed.all_poses`; the frames follow each other in time.
    seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether each rotation of the start rests on markers of the frame.
    """
    poses = all_poses(chain, rings, start, positions, articulation)
    lent, frames = _lent(chain, poses, seen)
    if not len(frames):
        return poses
    begin = ChainPoses(poses.root[frames], articulation.projected(chain.parents, lent))
    again = all_poses(chain, rings, begin, positions[frames], articulation)
    both = _squares(chain, poses[frames], positions[frames]), _squares(chain, again, positions[frames])
    better = both[1] <= both[0] + ABOUT_AS_LIKELY * _noise_variance(chain, poses, positions, seen)
    poses.root[frames[better]], poses.rotations[frames[better]] = again.root[better], again.rotations[better]
    return poses


def _lent(chain: Chain, poses: ChainPoses, seen: Bools) -> tuple[Floats, Ints]:
    """Rotations that follow in time where a frame does not fix them, in the frames where that makes a difference."""
    certain = _certain(chain, seen)
    turned = np.zeros(len(seen), dtype=bool)
    lent = poses.rotations.copy()
    for limb in range(chain.n_limbs):
        parent = int(chain.parents[limb])
        above = poses.rotations[:, parent].swapaxes(1, 2) if parent >= 0 else np.eye(3)
        own = above @ poses.rotations[:, limb]
        way = fill_rotations(own, certain[:, limb]) if certain[:, limb].any() else own
        turned |= np.einsum("fij,fij->f", own, way) < 1 + 2 * np.cos(LARGE_TURN)  # the trace of the turn between them
        lent[:, limb] = lent[:, parent] @ way if parent >= 0 else way
    frames = np.flatnonzero(turned)
    return lent[frames], frames


def _certain(chain: Chain, seen: Bools) -> Bools:
    """Limbs that a frame fixes together with those that they hang on and that hang on them."""
    certain = seen.copy()
    for limb in range(1, chain.n_limbs):
        parent = int(chain.parents[limb])
        certain[:, limb] &= seen[:, parent]
        certain[:, parent] &= seen[:, limb]
    return certain


def _squares(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    return np.asarray((residuals(chain, poses, positions) ** 2).sum(axis=(1, 2)))


def _noise_variance(chain: Chain, poses: ChainPoses, positions: Floats, seen: Bools) -> float:
    """Mean square of a coordinate's residual [mm^2] in frames that fix all limbs."""
    whole: Bools = np.asarray(seen.all(axis=1))
    if not whole.any():
        whole = np.ones(len(seen), dtype=np.bool_)
    count = 3 * int((~np.isnan(positions[whole, :, 0])).sum())
    return float(_squares(chain, poses[whole], positions[whole]).sum()) / max(count, 1)
