"""Poses of a known chain in every frame by Gauss-Newton steps over all its limbs, and their covariances.

They are maximum likelihood for Gaussian noise (Gaschler 2011, 5.3).
"""

from dataclasses import dataclass

import numpy as np

from skelgen._kernels.pose_covariances import propagate_covariances
from skelgen._kernels.posing import room_for, solve_frames
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, chain_table, rows, seen_weights, writable
from skelgen.model.arrays import Floats

MAX_STEPS = 60

UNKNOWN_TURN = 1.0
"""rad; standard deviation of a rotation that nothing in the frame determines."""

UNKNOWN_SHIFT = 1000.0
"""mm; the same for the position of the root."""

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
    """Fit the poses of a chain to its markers in every frame.

    Parameters
    ----------
    chain : Chain
        Known limbs.
    start : ChainPoses
        First guess, which the joints must allow; directions that no marker determines stay there.
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
    fitted = ChainPoses(writable(start.root), writable(start.rotations))
    measured = rows(positions, 3), writable(seen_weights(positions, weights)).ravel()
    rotations = fitted.rotations.reshape(-1, 9)
    table = chain_table(chain, articulation)
    solve_frames(table, measured, (fitted.root, rotations), max_steps, room_for(table))
    return fitted


@dataclass(frozen=True, eq=False)
class PoseCovariances:
    """Covariances of poses by the noise of their frames, for a skeleton that is known exactly.

    Attributes
    ----------
    origins : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        Of each limb's origin in the world, the joint above it.
    turns : ndarray, shape (n_frames, n_limbs, 3, 3), rad^2
        Of small rotations of each limb against its parent, in the parent's axes; of the root, in the world.
    """

    origins: Floats
    turns: Floats


def pose_covariances(observed: ObservedChain, noise: float) -> PoseCovariances:
    """Return the covariances of positions and rotations in every frame.

    Parameters
    ----------
    observed : ObservedChain
        A calibrated chain. Of the measured markers only the weights count.
    noise : float, mm
        Standard deviation of a coordinate of weight 1.
    """
    known = max(noise, LEAST_NOISE)
    levels = (known / UNKNOWN_TURN) ** 2, (known / UNKNOWN_SHIFT) ** 2
    rotations, measured = rows(observed.poses.rotations, 9), observed.measured
    origins, turns = np.empty(observed.poses.rotations.shape), np.empty(observed.poses.rotations.shape)
    out = origins.reshape(-1, 9), turns.reshape(-1, 9)
    propagate_covariances(observed.table, rotations, measured, levels, out, room_for(observed.table))
    return PoseCovariances(noise**2 * origins, noise**2 * turns)


def weak_prior(articulation: Articulation, noise: float) -> Floats:
    """Return the information on poses without any marker, for noise 1; it keeps deviations finite.

    Parameters
    ----------
    articulation : Articulation
        Says how many freedoms a frame has.
    noise : float, mm
        Standard deviation of a coordinate.

    Returns
    -------
    ndarray, shape (n_freedoms, n_freedoms)
    """
    noise = max(noise, LEAST_NOISE)
    level = np.full(articulation.n_freedoms, (noise / UNKNOWN_TURN) ** 2)
    level[:3] = (noise / UNKNOWN_SHIFT) ** 2
    return np.diag(level)
