"""How residuals pull at the constants of a chain: at offsets by forces, at joints by the force of all that lies beyond.

Axes are pulled at by the torque of all that turns with them. Forces and torques are summed from the leaves to the root.
"""

from __future__ import annotations

import numpy as np

from skelgen.compiling import loops
from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.border import n_constants
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.kinematics.posing import CHUNK_FRAMES
from skelgen.model.arrays import Floats


def constant_pull(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats
) -> Floats:
    """Return how the residuals of settled poses pull at the constants, summed over frames, shape (n_constants,).

    Parameters
    ----------
    chain, articulation, poses
        Where to linearise.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.
    """
    twin = loops("skelgen.kinematics.compiled_pull", "skelgen.kinematics.plain_pull")
    total = np.zeros(n_constants(chain, articulation))
    for first in range(0, len(positions), CHUNK_FRAMES):
        part = slice(first, first + CHUNK_FRAMES)
        total += twin.summed(chain, articulation, poses[part], positions[part], weights[part])
    return total
