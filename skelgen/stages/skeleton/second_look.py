"""A second look at frames that fit two poses: an arm that shows one marker too few may bend to either side.

Least squares in a frame end in the minimum next to the start, and where markers are unseen the closed form may start
beside the wrong one. Such frames are posed again from a start that the determined frames around them lend, limb by limb
against the parent. The more likely pose is kept; where both are about as likely, the one that follows in time.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import fill_rotations
from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.chain import Chain, ChainPoses, residuals
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.skeleton.ringed import BodyRings, all_poses

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
