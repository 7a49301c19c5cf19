"""Stage 2: group markers into rigid limbs.

Two markers on one limb keep their distance; two on different limbs do not. The standard deviation of every pairwise
distance over jittered sample frames is clustered (Schönauer 2007, 3.4; Kirk, O'Brien and Forsyth 2005).
"""

from __future__ import annotations

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.limbs.bodies import Distances, rigid_bodies
from skelgen.stages.limbs.count import count_limbs
from skelgen.stages.limbs.deviation import distance_deviation, sample_frames
from skelgen.stages.limbs.parameters import LimbParameters
from skelgen.stages.limbs.relative import Group, Movements
from skelgen.stages.limbs.rigidity import rigid_groups
from skelgen.stages.limbs.spectral import greedy_clusters, spectral_clusters

__all__ = ["LimbParameters", "find_limbs"]

HALF_BELIEVED = 20
"""Sampled frames with which a pair of markers counts half: in fewer, limbs have hardly moved against each other."""


def find_limbs(
    trajectories: Trajectories,
    parameters: LimbParameters | None = None,
    *,
    n_limbs: int | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> Limbs:
    """Group the markers of a take into rigid limbs.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers; gaps are fine.
    parameters : LimbParameters, optional
        How; the defaults suit most takes.
    n_limbs : int, optional
        Number of limbs, if known; otherwise it is found.
    seed : int
        Seed of the jittered samples and of k-means++.
    monitor : Monitor
        Told of progress.

    Returns
    -------
    Limbs
        Limbs numbered in the order of their first marker.

    Raises
    ------
    InputError
        If there are fewer than two markers that are ever seen together, or `n_limbs` is out of range.
    """
    parameters = parameters or LimbParameters()
    monitor.begin("limbs")
    frames = sample_frames(trajectories.n_frames, parameters, seed)
    deviation, common = distance_deviation(trajectories.positions, frames)
    usable = np.flatnonzero(_has_company(deviation))
    if len(usable) < 2:
        raise InputError(
            f"{trajectories.name or 'the take'}: no two markers are seen together; there is no limb to find"
        )
    _report_lonely(trajectories, usable, monitor)
    if n_limbs is not None and not 1 <= n_limbs <= len(usable):
        raise InputError(f"{n_limbs} limbs cannot be made of {len(usable)} markers")
    block = np.ix_(usable, usable)
    movements = Movements(trajectories.positions[:, usable], frames)
    groups = _clusters(movements, deviation[block], common[block], parameters, n_limbs, seed)
    labels = np.full(trajectories.n_markers, -1, dtype=np.intp)
    labels[usable] = _numbered_by_first(groups)
    monitor.advance(1, 1)
    return Limbs(labels, deviation)


def _clusters(
    movements: Movements, deviation: Floats, common: Ints, parameters: LimbParameters, n_limbs: int | None, seed: int
) -> Ints:
    if parameters.method in ("rigidity", "distances"):
        weight = np.where(np.isnan(deviation), 0.0, (common + 1) / (common + HALF_BELIEVED))
        if parameters.method == "distances":
            groups = rigid_groups(deviation, parameters, weight)
        else:
            distances = Distances(np.where(weight > 0, deviation, 0.0) ** 2 / 2, weight)
            blocks: list[Group] = [(marker,) for marker in range(len(deviation))]
            apart = np.zeros(deviation.shape, dtype=np.bool_)
            groups = rigid_bodies(movements, distances, parameters, blocks, apart, n_limbs)
        if n_limbs in (None, int(groups.max()) + 1):
            return groups
    deviation = _complete(deviation)
    k = n_limbs if n_limbs is not None else count_limbs(deviation, parameters, seed)
    if parameters.method == "greedy":
        return greedy_clusters(deviation, k)
    return spectral_clusters(deviation, k, parameters, seed)


def _has_company(deviation: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    others: Floats = deviation + np.where(np.eye(len(deviation)) > 0, np.nan, 0.0)
    return np.asarray(~np.isnan(others).all(axis=1))


def _complete(deviation: Floats) -> Floats:
    """Give pairs that are never seen together the largest deviation: nothing says that they are rigid."""
    return np.where(np.isnan(deviation), np.nanmax(deviation), deviation)


def _numbered_by_first(labels: Ints) -> Ints:
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.intp)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse]


def _report_lonely(trajectories: Trajectories, usable: Ints, monitor: Monitor) -> None:
    lonely = [name for index, name in enumerate(trajectories.names) if index not in set(usable.tolist())]
    if lonely:
        monitor.notice(f"left out, never seen together with another marker: {', '.join(lonely)}")
