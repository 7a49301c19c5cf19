"""How badly points of markers suit what is usual of another marker's distances to its witnesses, moment by moment."""

from __future__ import annotations

import math

from skelgen._kernels import kernel
from skelgen.model.arrays import Floats, Ints

MOST_MISFIT = 5.0
"""nats that one distance says at most against a point."""


@kernel
def write_misfits(
    marker: int, points: Ints, witnesses: Ints, distance: Floats, law: tuple[Floats, Floats], misfits: Floats
) -> None:
    """Write the misfits of some markers' points to one marker: sums of min(off^2 / 2, `MOST_MISFIT`) [nats].

    Parameters
    ----------
    marker : int
        The marker whose distances are usual.
    points : ndarray of intp, shape (n_points,)
        Markers whose points are looked at.
    witnesses : ndarray of intp, shape (n_witnesses,)
        Markers to which distances count; -1 for none. A marker says nothing of its own points.
    distance : ndarray, shape (n_markers, n_markers, n_moments), mm
        NaN where unseen, which says nothing.
    law : tuple of two ndarrays, shape (n_markers, n_markers), mm
        Usual distances, and how far they vary.
    misfits : ndarray, shape (n_markers, n_markers, n_moments), nats
        Receives them at ``[points, marker]``.
    """
    usual, deviation = law
    for point in points:
        for moment in range(misfits.shape[2]):
            misfits[point, marker, moment] = 0.0
        for witness in witnesses:
            if witness < 0 or witness == point:
                continue
            middle, width = usual[marker, witness], deviation[marker, witness]
            for moment in range(misfits.shape[2]):
                off = (distance[point, witness, moment] - middle) / width
                if not math.isnan(off):
                    misfits[point, marker, moment] += min(off * off / 2.0, MOST_MISFIT)
