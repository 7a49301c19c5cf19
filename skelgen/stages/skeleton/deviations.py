"""How sure joints are in every frame: noise of the frame, and the error of the skeleton that all frames share.

The frame's part rests on what it shows. The skeleton's part hardly changes with the pose when it is seen from the
parent: it is averaged there over some frames. Errors that last, as soft tissue makes, average out over fewer frames
than there are: the skeleton's part grows by as much.
"""

from __future__ import annotations

import numpy as np

from skelgen.compiling import in_order
from skelgen.kinematics.calibration import Calibration
from skelgen.kinematics.chain import Chain, ChainPoses, chain_loops, residuals_in_limbs
from skelgen.kinematics.correlated import effective_frames
from skelgen.kinematics.pose_covariances import pose_covariances
from skelgen.kinematics.uncertainty import frame_covariances, hinge_axes, inverse_root
from skelgen.model.arrays import Bools, Floats, Ints

SHARED_FRAMES = 60
"""Frames over which the skeleton's part is averaged."""

EXACT_FRAMES = 2000
"""Frames whose part is computed; the others of a long take have that of the nearest one."""


def lasting(last: Calibration, positions: Floats) -> float:
    """How many frames of residuals tell as much as one independent frame, at least 1.

    Parameters
    ----------
    last : Calibration
        The fit.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        What it was fitted to, in the order of time.
    """
    if len(positions) == 0 or last.noise == 0.0:
        return 1.0
    own = residuals_in_limbs(last.chain, last.poses, positions)
    return len(own) / effective_frames(own.reshape(len(own), -1))


def joint_deviations(
    last: Calibration, chain: Chain, poses: ChainPoses, positions: Floats, unseen: Bools, growth: float
) -> Floats:
    """Standard deviations of joints along the world's axes, of hinges across theirs, shape (n_frames, n_limbs, 3), mm.

    Parameters
    ----------
    last : Calibration
        The fit of the constants.
    chain : Chain
        Its chain, hinges settled along their axes.
    poses : ChainPoses
        All frames.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers.
    unseen : ndarray of bool, shape (n_frames,)
        Frames that show too little of a limb.
    growth : float
        How much less than independent ones the frames tell, see `lasting`.
    """
    frames = _exact_frames(unseen)
    articulation, some = last.articulation, poses[frames]
    axes = hinge_axes(chain, articulation, some)
    covariances = pose_covariances(chain, articulation, some, positions[frames], last.noise).origins
    shared = growth * _shared(last, chain, poses, positions)
    held = in_order(covariances, some.rotations, chain.parents, shared, axes)
    variances = chain_loops(len(frames)).variances_across(*held)
    deviations = np.sqrt(np.maximum(variances, 0.0))
    if len(frames) == len(positions):
        return np.asarray(deviations)
    places = np.arange(len(positions))
    after = np.minimum(np.searchsorted(frames, places), len(frames) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.where(np.abs(frames[before] - places) < np.abs(frames[after] - places), before, after)
    return np.asarray(deviations[nearer])


def _exact_frames(unseen: Bools) -> Ints:
    n_frames = len(unseen)
    even = np.linspace(0, n_frames - 1, min(n_frames, EXACT_FRAMES)).astype(np.intp)
    return np.unique(np.concatenate([even, np.flatnonzero(unseen)[:EXACT_FRAMES]]))


def _shared(last: Calibration, chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    """Covariances of the skeleton's part in the parents' axes, shape (n_limbs, 3, 3), mm^2."""
    frames = np.unique(np.linspace(0, len(positions) - 1, min(len(positions), SHARED_FRAMES)).astype(np.intp))
    some = poses[frames]
    root = inverse_root(last.information)
    found = frame_covariances(chain, last.articulation, some, positions[frames], root, last.noise)
    turn = some.rotations[:, np.maximum(chain.parents, 0)]
    return np.asarray((turn.swapaxes(2, 3) @ found.constant_share @ turn).mean(axis=0))
