"""How many limbs there are, for the clusterings that have to be told."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats
from skelgen.stages.limbs.alignment import aligned_count
from skelgen.stages.limbs.parameters import LimbParameters
from skelgen.stages.limbs.rigidity import noise_variance, rigid_groups
from skelgen.stages.limbs.spectral import affinities, spectral_clusters, spectrum

RIGID_FACTOR = 8.0
"""The automatic limit of the rising count, in units of the noise of a distance: beyond the largest of many pairs."""


def count_limbs(deviation: Floats, parameters: LimbParameters, seed: int) -> int:
    """Find the number of limbs.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    parameters : LimbParameters
        Their `count` says how.
    seed : int
        Seed of k-means for the rising count.
    """
    if parameters.count == "eigengap":
        return _largest_gap(deviation, parameters)
    if parameters.count == "rotation":
        _, vectors = spectrum(affinities(deviation, parameters)[0], parameters.zero)
        return aligned_count(vectors[:, ::-1])
    if parameters.count == "rising":
        return _first_rigid(deviation, parameters, seed)
    return int(rigid_groups(deviation, parameters).max()) + 1


def _largest_gap(deviation: Floats, parameters: LimbParameters) -> int:
    """Number of leading eigenvalues before the largest gap (von Luxburg 2007, 8.3)."""
    values, _ = spectrum(affinities(deviation, parameters)[0], parameters.zero)
    falling = values[::-1]
    gaps = falling[:-1] - falling[1:]
    return int(np.argmax(gaps[: max(1, len(values) // 2)])) + 1


def _first_rigid(deviation: Floats, parameters: LimbParameters, seed: int) -> int:
    """Smallest k whose clusters hold no pair that varies more than the limit (seed 3.4.1)."""
    limit = parameters.rigid_limit or RIGID_FACTOR * float(np.sqrt(2 * noise_variance(deviation)))
    for k in range(1, len(deviation)):
        labels = spectral_clusters(deviation, k, parameters, seed)
        if deviation[labels[:, np.newaxis] == labels].max() <= limit:
            return k
    return len(deviation)
