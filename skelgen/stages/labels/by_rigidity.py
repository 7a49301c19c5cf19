"""Markers by rigidity: Marker Sets joined by the likelihood of their distances, then all points by the skeleton."""

from __future__ import annotations

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.articulated import refine_labels
from skelgen.stages.labels.blocks import counts_together, renumbered
from skelgen.stages.labels.by_hand import Fixed
from skelgen.stages.labels.follow import typical_spacing
from skelgen.stages.labels.marker_sets import MarkerSets, stand_alone_frames
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.windows import MOST_KEPT, join_sets

STRANGER_SHARE = 0.1
"""Of all frames in which a marker that no limb carries must be seen."""

FREE_SHARE = 0.8
"""Sets of which the skeleton explains less than the rest are markers that it does not know."""


def markers_by_rigidity(
    cloud: PointCloud,
    owner: Ints,
    sets: MarkerSets,
    rate: float,
    parameters: LabelParameters,
    *,
    n_markers: int | None = None,
    fixed: Fixed | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> Ints:
    """Find the marker of each point.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    sets : MarkerSets
        What the tracks that are long enough gathered.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        Their `rounds` and `stand_alone`.
    n_markers : int or None
        Number of markers, if the user knows it.
    fixed : Fixed or None
        What the user states of some points.
    seed : int
        Seed of the stages that build the model.
    monitor : Monitor
        Hears of progress and may cancel.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    monitor.begin("joining Marker Sets")
    group = join_sets(cloud.points, sets, rate, typical_spacing(cloud), monitor)
    by_distances = np.append(group, -1).astype(np.int32)[sets.set_of_points(cloud.n_points)]
    by_distances = _most_seen(by_distances, MOST_KEPT * max(1, int(np.median(cloud.points_per_frame))))
    found = refine_labels(
        cloud,
        owner,
        by_distances,
        rate,
        parameters,
        n_markers=n_markers,
        fixed=fixed,
        seed=seed,
        monitor=monitor,
    )
    least = max(stand_alone_frames(cloud.n_frames, rate, parameters), STRANGER_SHARE * cloud.n_frames)
    found = _with_strangers(found, by_distances, least)
    return found if n_markers is None else _most_seen(found, n_markers)


def _with_strangers(found: Ints, by_distances: Ints, least: float) -> Ints:
    """Add markers that distances found, were seen for long, and of which the skeleton explains next to nothing."""
    together = counts_together(by_distances, found)[1:]
    free = together[:, 0]
    strangers = (free >= least) & (free >= FREE_SHARE * together.sum(axis=1))
    number = np.full(len(free) + 1, -1, dtype=np.int32)
    number[:-1][strangers] = found.max(initial=-1) + 1 + np.arange(int(strangers.sum()))
    return np.where(found < 0, number[by_distances], found)


def _most_seen(found: Ints, n_markers: int) -> Ints:
    """The `n_markers` that are seen in the most frames."""
    counts = np.bincount(found[found >= 0], minlength=1)
    keep = np.zeros(len(counts), dtype=bool)
    keep[np.argsort(-counts, kind="stable")[:n_markers]] = True
    return renumbered(found, keep & (counts > 0))
