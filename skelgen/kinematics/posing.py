"""Poses of a known chain in every frame by least squares over all its limbs: Gauss-Newton, limb by limb.

Maximum likelihood for Gaussian noise (Gaschler 2011, 5.3).
"""

from __future__ import annotations

import numpy as np

from skelgen.compiling import loops
from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.chain import Chain, ChainPoses, seen_weights
from skelgen.model.arrays import Floats

CHUNK_FRAMES = 1024
"""Frames solved together: enough that calls cost little, few enough that a limb's arrays stay in the cache."""

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
