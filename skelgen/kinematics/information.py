"""What some frames tell of a chain's constants: offsets, joints and axes, poses eliminated."""

from __future__ import annotations

import numpy as np

from skelgen.compiling import loops
from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.border import n_constants
from skelgen.kinematics.chain import Chain, ChainPoses, seen_weights
from skelgen.kinematics.posing import CHUNK_FRAMES
from skelgen.model.arrays import Floats


def total_information(
    chain: Chain,
    articulation: Articulation,
    poses: ChainPoses,
    positions: Floats,
    weights: Floats | None = None,
) -> Floats:
    """Information of the constants from all frames for noise 1, poses eliminated, shape (n_constants, n_constants).

    Parameters
    ----------
    chain, articulation, poses
        Where to linearise.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers: only which are seen counts.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances.
    """
    twin = loops("skelgen.kinematics.compiled_information", "skelgen.kinematics.plain_information")
    weights = seen_weights(positions, weights)
    total = np.zeros((n_constants(chain, articulation),) * 2)
    for first in range(0, len(weights), CHUNK_FRAMES):
        part = slice(first, first + CHUNK_FRAMES)
        total += twin.summed(chain, articulation, poses[part], weights[part])
    return total
