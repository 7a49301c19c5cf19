"""A chain and its joints as plain arrays, as compiled loops take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import Chain
from skelgen.model.arrays import Floats, Ints


class ChainTable(NamedTuple):
    """A chain with what its joints allow; markers are sorted by limb.

    Attributes
    ----------
    parents, freedoms : ndarray of intp, shape (n_limbs,)
        Parent of each limb, and how many turns its joint allows.
    in_parent, in_child, joints : ndarray, shape (n_limbs, 3)
        Of `Articulation` and `Chain`.
    markers : ndarray of intp, shape (n_markers,)
        Markers in the order of their limbs.
    starts : ndarray of intp, shape (n_limbs + 1,)
        Where those of each limb begin among them.
    offsets : ndarray, shape (n_markers, 3), mm
        Of the markers in this order.
    """

    parents: Ints
    freedoms: Ints
    in_parent: Floats
    in_child: Floats
    joints: Floats
    markers: Ints
    starts: Ints
    offsets: Floats


def chain_table(chain: Chain, articulation: Articulation) -> ChainTable:
    """Return the table of a chain: copies, so that loops are compiled for one sort of arrays only."""
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
