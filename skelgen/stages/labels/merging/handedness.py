r"""On which side of their partners' plane two markers lie: where they are exchanged, a limb becomes its mirror image.

Toe and little toe have much the same distances to heel and ankle, so these hardly tell whether they are exchanged. But
a rigid limb is never mirrored. Two partners and the middle between both markers span a plane with the normal n; how far
the markers lie apart across it, :math:`s = (x_a - x_b) \cdot n`, changes its sign, and nothing else, when they are
exchanged. With its usual value :math:`\mu` and deviation :math:`\sigma`, an exchange gains

.. math:: \frac{\nu + 1}{2} \log \frac{1 + (s - \mu)^2 / \nu \sigma^2}{1 + (s + \mu)^2 / \nu \sigma^2}

at a moment, by Student's distribution of :math:`\nu` degrees of freedom.
"""

import itertools

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.merging.likelihood import robust_laws

PARTNERS = 4
"""Markers that are most surely rigid with both: two of them span a plane."""

SURE = 3.0
"""Deviations by which markers must lie apart across a plane; of those that change sides, it is one."""

LEAST_MOMENTS = 8
"""Moments in which they must be seen there."""

FREEDOM = 4.0
"""Of Student's distribution: a pose may be one that was never seen."""

AT_ONCE = 200_000
"""Planes times moments that are looked at together."""

_PLANES = np.array(list(itertools.combinations(range(PARTNERS), 2)))


def evidence_of_sides(pairs: Ints, places: Floats, gains: Floats, spacing: float) -> Floats:
    """How much exchanging two markers gains at each moment by the sides on which they lie [nats].

    Parameters
    ----------
    pairs : ndarray of intp, shape (n_pairs, 2)
        Markers.
    places : ndarray, shape (n_moments, n_markers, 3), mm
        Markers at some moments, NaN where unseen.
    gains : ndarray, shape (n_markers, n_markers), nats
        How well distances are explained by two markers that keep them.
    spacing : float, mm
        How far apart markers are.

    Returns
    -------
    ndarray, shape (n_pairs, n_moments)
        By the plane of most deviations of those that are seen; 0 where there is none.
    """
    evidence = np.zeros((len(pairs), len(places)))
    if gains.shape[0] < PARTNERS + 2:
        return evidence
    step = max(1, AT_ONCE // (len(_PLANES) * max(len(places), 1)))
    for first in range(0, len(pairs), step):
        evidence[first : first + step] = _evidence(pairs[first : first + step], places, gains, spacing)
    return evidence


def _evidence(pairs: Ints, places: Floats, gains: Floats, spacing: float) -> Floats:
    n_pairs, n_moments = len(pairs), len(places)
    common = np.minimum(gains[pairs[:, 0]], gains[pairs[:, 1]])  # 0 for both themselves
    partners = np.argsort(-common, axis=1, kind="stable")[:, :PARTNERS]
    rigid = np.take_along_axis(common, partners, axis=1) > 0.0
    spanned = rigid[:, _PLANES].all(axis=2).ravel()
    planes = partners[:, _PLANES].reshape(-1, 2)
    sides = np.full((len(planes), n_moments), np.nan)
    sides[spanned] = _sides(np.repeat(pairs, len(_PLANES), axis=0)[spanned], planes[spanned], places)
    usual, deviation = robust_laws(np.abs(sides), spacing)
    is_sure = spanned & ((~np.isnan(sides)).sum(axis=1) >= LEAST_MOMENTS) & (usual >= SURE * deviation)
    usual = usual * np.where(np.nansum(np.sign(sides), axis=1) < 0.0, -1.0, 1.0)
    gained = _gained(sides, usual[:, np.newaxis], deviation[:, np.newaxis])
    certainty = np.where(is_sure[:, np.newaxis] & ~np.isnan(sides), (np.abs(usual) / deviation)[:, np.newaxis], 0.0)
    shape = n_pairs, len(_PLANES), n_moments
    surest = certainty.reshape(shape).argmax(axis=1)[:, np.newaxis]
    known = np.where(certainty > 0.0, gained, 0.0).reshape(shape)
    return np.asarray(np.take_along_axis(known, surest, axis=1)[:, 0])


def _sides(pairs: Ints, planes: Ints, places: Floats) -> Floats:
    """How far the first marker lies beyond the second one across the plane [mm], shape (n, n_moments)."""
    one, other, first, second = (places[:, column] for column in (*pairs.T, *planes.T))
    normal = np.cross(second - first, 0.5 * (one + other) - first)
    length = np.linalg.norm(normal, axis=2)
    across = ((one - other) * normal).sum(axis=2)
    sides = np.divide(across, length, out=np.full(length.shape, np.nan), where=length > 0.0)
    return np.asarray(sides.T)


def _gained(side: Floats, usual: Floats, deviation: Floats) -> Floats:
    """How much better the other side is explained [nats]."""
    here, there = ((side - sign * usual) / deviation for sign in (1.0, -1.0))
    return 0.5 * (FREEDOM + 1.0) * (np.log1p(here**2 / FREEDOM) - np.log1p(there**2 / FREEDOM))
