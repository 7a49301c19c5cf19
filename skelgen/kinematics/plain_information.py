"""Information of a chain's constants from the blocks of `border`: the meaning of its twin `compiled_information`."""

from __future__ import annotations

import numpy as np

from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.chain.normal_equations import frames_together, linearised, n_constants, reduced_information
from skelgen.model.arrays import Floats


def summed(chain: Chain, articulation: Articulation, poses: ChainPoses, weights: Floats) -> Floats:
    """Return the information of the constants summed over frames, poses eliminated, shape (n_constants, n_constants).

    Parameters
    ----------
    chain, articulation, poses
        Where to linearise.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.
    """
    together = frames_together(chain, articulation)
    total = np.zeros((n_constants(chain, articulation),) * 2)
    for first in range(0, len(weights), together):
        part = slice(first, first + together)
        own = poses[part]
        total += reduced_information(linearised(chain, articulation, own, own.markers(chain), weights[part]))
    return np.asarray((total + total.T) / 2)
