"""Which marker a piece of a track is, by the distances that it keeps to the markers beside it."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.distance_statistics import squared_distance
from skelgen._kernels.tracklet_evidence import WITNESSES
from skelgen.model.arrays import Floats, Ints

FREEDOM = 4.0
"""Of Student's distribution: a distance may be in a pose that was never seen."""


def distances_to_markers(points: Floats, places: Floats, row: Ints) -> Floats:
    """Return the distances of points to the markers of their frames [mm], shape (n_points, n_markers).

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The points.
    places : ndarray, shape (n_frames, n_markers, 3), mm
        The markers in some frames, NaN where unseen.
    row : ndarray of intp, shape (n_points,)
        Which of these frames each point is in.
    """
    distances = np.empty((len(points), places.shape[1]))
    _write_distances(points, places, row, distances)
    return distances


def evidence_of_means(sums: tuple[Floats, Floats], laws: tuple[Floats, Floats], spacing: float, least: int) -> Floats:
    """Return the evidence [nats] that each piece is each marker, -inf where too little is known; shape as the sums.

    Parameters
    ----------
    sums : tuple of ndarray, shape (n_pieces, n_markers)
        Number, and sum [mm], of the distances between the points of each piece and each marker.
    laws : tuple of ndarray, shape (n_markers, n_markers)
        Usual distances [mm] between markers, and their variances [mm^2].
    spacing : float, mm
        How far apart markers are.
    least : int
        Witnesses at least.
    """
    evidence = np.full(sums[0].shape, -np.inf)
    near = np.argsort(laws[1], axis=1, kind="stable")
    _write_evidence(sums, laws, near, (spacing, least), evidence)
    return evidence


@kernel
def _write_distances(points: Floats, places: Floats, row: Ints, distances: Floats) -> None:
    for point in range(len(points)):
        for marker in range(places.shape[1]):
            distances[point, marker] = math.sqrt(squared_distance(places[row[point]], marker, points, point))


@kernel
def _write_evidence(
    sums: tuple[Floats, Floats], laws: tuple[Floats, Floats], near: Ints, limits: tuple[float, int], evidence: Floats
) -> None:
    """Write what `evidence_of_means` returns; the markers `near` each one are those of least variance first."""
    (counts, totals), (usual, variance), (spacing, least) = sums, laws, limits
    for piece in range(len(evidence)):
        for marker in range(len(near)):
            n_found, total = 0, 0.0
            for witness in near[marker]:
                narrow = variance[marker, witness]
                if narrow >= spacing * spacing or n_found == WITNESSES:
                    break
                if counts[piece, witness] > 0.0:
                    off = totals[piece, witness] / counts[piece, witness] - usual[marker, witness]
                    total += _log_ratio(off * off, narrow, narrow + spacing * spacing)
                    n_found += 1
            if n_found >= least:
                evidence[piece, marker] = total


@kernel_part
def _log_ratio(square: float, narrow: float, wide: float) -> float:
    """Log ratio of Student's distributions of two variances."""
    share = square / FREEDOM
    nearer = (1.0 + share / wide) / (1.0 + share / narrow)
    return 0.5 * (math.log(wide / narrow) + (FREEDOM + 1.0) * math.log(nearer))
