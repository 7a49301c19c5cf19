"""Poses of a known chain in every frame by least squares over all its limbs: Gauss-Newton, limb by limb.

Maximum likelihood for Gaussian noise (Gaschler 2011, 5.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.compiling import loops
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import CHUNK_FRAMES, Chain, ChainPoses, seen_weights
from skelgen.model.arrays import Floats

MAX_STEPS = 15


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
    twin = loops("skelgen.kinematics.compiled_posing", "skelgen.kinematics.plain_posing")
    fitted = ChainPoses(np.empty(start.root.shape), np.empty(start.rotations.shape))
    for first in range(0, len(positions), CHUNK_FRAMES):
        part = slice(first, first + CHUNK_FRAMES)
        heard = seen_weights(positions[part], None if weights is None else weights[part])
        found = twin.settled(chain, articulation, start[part], positions[part], heard, max_steps)
        fitted.root[part], fitted.rotations[part] = found.root, found.rotations
    return fitted


UNKNOWN_TURN = 1.0
"""rad; what is stated for a turn that nothing in the frame determines."""

UNKNOWN_SHIFT = 1000.0
"""mm; the same for the place of the root."""

LEAST_NOISE = 1e-6
"""mm; keeps matrices regular for exact takes."""


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
    twin = loops("skelgen.kinematics.compiled_covariances", "skelgen.kinematics.plain_covariances")
    known = max(noise, LEAST_NOISE)
    levels = (known / UNKNOWN_TURN) ** 2, (known / UNKNOWN_SHIFT) ** 2
    shape = (len(positions), chain.n_limbs, 3, 3)
    found = PoseCovariances(np.empty(shape), np.empty(shape))
    for first in range(0, len(positions), CHUNK_FRAMES):
        part = slice(first, first + CHUNK_FRAMES)
        heard = seen_weights(positions[part], None if weights is None else weights[part])
        origins, turns = twin.outward(chain, articulation, poses[part], heard, levels)
        found.origins[part], found.turns[part] = noise**2 * origins, noise**2 * turns
    return found
