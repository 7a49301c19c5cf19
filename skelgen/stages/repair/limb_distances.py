"""Rigid limbs and their inner distances, robust against labels that are wrong for part of the time."""

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.statistics import median_and_deviation, pair_lengths
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.stages.limbs import LimbParameters, rigid_groups

GROUPING_FRAMES = 400
"""Frames from which limbs are grouped; more do not change the groups."""

STATISTIC_FRAMES = 5000
"""Frames from which medians are taken: bounds memory for long takes."""

KEPT_PART = 0.75
"""Part of a distance's samples, the densest, from which its deviation is computed: the others hold wrong labels."""

TRIMMED_DEVIATION = 0.607
"""Standard deviation of the central three quarters of a standard normal variable."""

LEAST_COMMON = 8
"""Common frames that a distance needs."""

LEAST_SPREAD = 1e-3
"""Of a distance: the least spread, however exact the take."""

STARTS = 11
"""Places at which the densest part of the samples may begin."""


@dataclass(frozen=True, eq=False)
class RigidModel:
    """Limbs with their usual inner distances.

    Attributes
    ----------
    limb_of_marker : ndarray of intp, shape (n_markers,)
        -1 = on no limb.
    distance : ndarray, shape (n_markers, n_markers), mm
        Median distance of markers of one limb; NaN for others.
    spread : ndarray, shape (n_markers, n_markers), mm
        Robust standard deviation of these.
    """

    limb_of_marker: Ints
    distance: Floats
    spread: Floats

    def partners(self, marker: int) -> Ints:
        """Markers whose distance to one marker is known."""
        return np.flatnonzero(~np.isnan(self.distance[marker]))


def robust_limbs(trajectories: Trajectories) -> Limbs:
    """Group markers into limbs, unmoved by labels that are wrong for up to a quarter of the time."""
    n_markers = trajectories.n_markers
    labels = np.full(n_markers, -1, dtype=np.intp)
    deviation = _trimmed_deviations(trajectories.positions[spread_frames(trajectories.n_frames, GROUPING_FRAMES)])
    usable = np.flatnonzero((~np.isnan(deviation)).sum(axis=1) > 1)
    if len(usable) > 1:
        inner = deviation[np.ix_(usable, usable)]
        inner = np.where(np.isnan(inner), np.nanmax(inner), inner)
        groups = rigid_groups(inner, LimbParameters())
        labels[usable] = np.unique(groups, return_inverse=True)[1]
    return Limbs(labels, deviation)


def rigid_model(trajectories: Trajectories, limbs: Limbs) -> RigidModel:
    """Compute the median and the spread of all distances within limbs.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Rigid groups of these.
    """
    n_markers = trajectories.n_markers
    distance, spread = np.full((2, n_markers, n_markers), np.nan)
    first, second = limb_pairs(limbs)
    if len(first):
        positions = trajectories.positions[spread_frames(trajectories.n_frames, STATISTIC_FRAMES)]
        middle, deviation, count = median_and_deviation(pair_lengths(positions, first, second))
        usual = float(np.median(deviation[count >= LEAST_COMMON])) if (count >= LEAST_COMMON).any() else 0.0
        deviation = np.maximum(deviation, np.maximum(usual / 2, LEAST_SPREAD * middle))
        known = (count >= LEAST_COMMON) & (deviation > 0)
        for matrix, values in ((distance, middle), (spread, deviation)):
            matrix[first[known], second[known]] = matrix[second[known], first[known]] = values[known]
    return RigidModel(limbs.limb_of_marker, distance, spread)


def limb_pairs(limbs: Limbs) -> tuple[Ints, Ints]:
    """All pairs of markers that share a limb."""
    first, second = np.triu_indices(limbs.n_markers, 1)
    same = (limbs.limb_of_marker[first] == limbs.limb_of_marker[second]) & (limbs.limb_of_marker[first] >= 0)
    return first[same], second[same]


def _trimmed_deviations(positions: Floats) -> Floats:
    """Standard deviations of the densest three quarters of all distances, shape (n_markers, n_markers)."""
    n_markers = positions.shape[1]
    first, second = np.triu_indices(n_markers, 1)
    values = np.sort(pair_lengths(positions, first, second), axis=1)
    count = (~np.isnan(values)).sum(axis=1)
    kept = np.maximum((KEPT_PART * count).astype(np.intp), 1)
    starts = (np.linspace(0, 1, STARTS)[:, np.newaxis] * np.maximum(count - kept, 0)).astype(np.intp)
    rows = np.arange(len(values))
    widths = values[rows, starts + kept - 1] - values[rows, starts]
    start = starts[np.argmin(np.where(np.isnan(widths), np.inf, widths), axis=0), rows]
    index = np.arange(kept.max(initial=1))
    inside = np.minimum(start[:, np.newaxis] + index, values.shape[1] - 1)
    centred = np.take_along_axis(values, inside, axis=1) - values[rows, start][:, np.newaxis]
    centred[index >= kept[:, np.newaxis]] = 0.0
    variance = (centred**2).sum(axis=1) / kept - (centred.sum(axis=1) / kept) ** 2
    result = np.zeros((n_markers, n_markers))
    deviation = np.sqrt(np.maximum(variance, 0.0)) / TRIMMED_DEVIATION
    result[first, second] = result[second, first] = np.where(count >= LEAST_COMMON, deviation, np.nan)
    return result
