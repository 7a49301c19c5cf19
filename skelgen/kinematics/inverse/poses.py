"""Poses of a known chain in every frame by least squares over all its limbs: Gauss-Newton, limb by limb.

Maximum likelihood for Gaussian noise (Gaschler 2011, 5.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen._kernels.pose_covariances import walk_outward
from skelgen._kernels.posing import settle_frames
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, seen_weights
from skelgen.kinematics.chain.chain_table import chain_table, fresh
from skelgen.model.arrays import Floats

MAX_STEPS = 15


UNKNOWN_TURN = 1.0
"""rad; what is stated for a turn that nothing in the frame determines."""
UNKNOWN_SHIFT = 1000.0
"""mm; the same for the place of the root."""
LEAST_NOISE = 1e-6
"""mm; keeps matrices regular for exact takes."""


def fit_poses(
    chain: Chain,
    start: ChainPoses,
    positions: Floats,
    articulation: Articulation | None = None,
    weights: Floats | None = None,
    max_steps: int = MAX_STEPS,
) -> ChainPoses:
    """Fit a chain to markers in every frame by least squares over all its limbs.

    Parameters
    ----------
    chain : Chain
        Known limbs.
    start : ChainPoses
        First guess; directions that no marker determines stay there. It must obey the joints.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    articulation : Articulation, optional
        What the joints allow; any turn if it is not given.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances; 1 if not given.
    max_steps : int
        Gauss-Newton steps at most.
    """
    articulation = articulation or Articulation.free(chain.n_limbs)
    fitted = ChainPoses(fresh(start.root), fresh(start.rotations))
    measured = fresh(positions), fresh(seen_weights(positions, weights))
    settle_frames(chain_table(chain, articulation), *measured, fitted.root, fitted.rotations, max_steps)
    return fitted


@dataclass(frozen=True, eq=False)
class PoseCovariances:
    """What noise of a frame makes uncertain, if the skeleton is known exactly.

    Attributes
    ----------
    origins : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        Of each limb's origin in the world, the joint above it.
    turns : ndarray, shape (n_frames, n_limbs, 3, 3), rad^2
        Of small turns of each limb against its parent, in the parent's axes; of the root, in the world.
    """

    origins: Floats
    turns: Floats


def pose_covariances(
    chain: Chain,
    articulation: Articulation,
    poses: ChainPoses,
    positions: Floats,
    noise: float,
    weights: Floats | None = None,
) -> PoseCovariances:
    """Return the covariances of places and turns in every frame.

    Parameters
    ----------
    chain, articulation, poses
        A calibrated chain, and where it is.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    noise : float, mm
        Standard deviation of a coordinate of weight 1.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances; 1 if not given.
    """
    known = max(noise, LEAST_NOISE)
    levels = (known / UNKNOWN_TURN) ** 2, (known / UNKNOWN_SHIFT) ** 2
    origins, turns = np.empty(poses.rotations.shape), np.empty(poses.rotations.shape)
    used = fresh(seen_weights(positions, weights))
    walk_outward(chain_table(chain, articulation), fresh(poses.rotations), used, levels, origins, turns)
    return PoseCovariances(noise**2 * origins, noise**2 * turns)
