"""A chain and its joints as plain arrays, as kernels take them."""

from __future__ import annotations

import numpy as np

from skelgen._kernels.posing import ChainTable
from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import Chain
from skelgen.model.arrays import Floats


def chain_table(chain: Chain, articulation: Articulation) -> ChainTable:
    """Return the table of a chain: copies, so that kernels are compiled for one sort of arrays only."""
    markers = np.argsort(chain.limb_of_marker, kind="stable").astype(np.intp)
    limbs = np.arange(chain.n_limbs + 1)
    return ChainTable(
        parents=np.array(chain.parents, dtype=np.intp),
        freedoms=np.array([FREEDOMS[kind] for kind in articulation.kinds], dtype=np.intp),
        in_parent=fresh(articulation.in_parent),
        in_child=fresh(articulation.in_child),
        joints=fresh(chain.joints),
        markers=markers,
        starts=np.searchsorted(chain.limb_of_marker[markers], limbs).astype(np.intp),
        offsets=fresh(chain.offsets[markers]),
    )


def fresh(values: Floats) -> Floats:
    """Return a copy in the order of memory that may be written to."""
    return np.array(values, dtype=np.float64, order="C")
