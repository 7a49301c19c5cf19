"""Markers that belong nowhere: alone, and moving against all others far more than neighbouring limbs do."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.limbs.rigidity import PairSums

STRAY = 3.0
"""Times the usual deviation between neighbouring limbs. The only marker of a limb hangs on a joint, which keeps it near
some marker; a marker of the room, of a bystander or one whose label wanders has no such neighbour."""


def stray_markers(groups: Ints, deviation: Floats) -> Bools:
    """Find markers that are alone in their group and have no neighbour.

    Parameters
    ----------
    groups : ndarray of intp, shape (n_markers,)
        Group of each marker, from 0 without holes.
    deviation : ndarray, shape (n_markers, n_markers), mm
        Standard deviations of distances, NaN where unknown.

    Returns
    -------
    ndarray of bool, shape (n_markers,)
        None if there are fewer than two limbs with several markers: nothing tells how much limbs usually move.
    """
    known = ~np.isnan(deviation)
    usual = PairSums(np.where(known, deviation, 0.0) ** 2 / 2, known.astype(np.float64), groups).usual_motion()
    others = np.where(known, deviation, np.inf) + np.diag(np.full(len(groups), np.inf))
    is_alone = np.bincount(groups)[groups] == 1
    return np.asarray(is_alone & (others.min(axis=1) ** 2 / 2 > STRAY**2 * usual) & (usual > 0))
