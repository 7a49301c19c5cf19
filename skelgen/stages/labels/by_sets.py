"""The seed's method: Marker Sets that meet when the poses in which they are seen are aligned are one marker.

Kirk, O'Brien and Forsyth 2005; Schönauer 2007, 3.3 and 4.2. It needs the number of markers, given or as many as are
seen at once.
"""

from __future__ import annotations

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.follow import typical_spacing
from skelgen.stages.labels.grouping import group_sets
from skelgen.stages.labels.marker_sets import MarkerSets, count_markers, least_length, stand_alone_frames
from skelgen.stages.labels.parameters import LabelParameters

MOST_SETS = 3000
"""Bounds time and memory, which grow with the square of the number of sets."""


def markers_by_sets(
    cloud: PointCloud,
    sets: MarkerSets,
    rate: float,
    parameters: LabelParameters,
    *,
    n_markers: int | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> tuple[Ints, int]:
    """Find the marker of each point by joining Marker Sets over aligned poses.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    sets : MarkerSets
        Its Marker Sets.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        How to compare and group sets.
    n_markers : int or None
        Number of markers; None takes the largest number of sets seen at once.
    seed : int
        Seed of spectral clustering.
    monitor : Monitor
        Hears of progress and may cancel.

    Returns
    -------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_removed : int
        Number of Marker Sets that found no marker.
    """
    n_too_many = max(0, len(sets) - MOST_SETS)
    sets = _longest(sets)
    wanted = n_markers or count_markers(sets, least_length(cloud.n_frames, rate, parameters))
    limit = parameters.remove_distance or typical_spacing(cloud)
    group, nearest = group_sets(cloud.points, sets, wanted, limit, parameters, seed, monitor)
    markers = sets.merged(group)
    trusted = (markers.lengths >= stand_alone_frames(cloud.n_frames, rate, parameters)) | (nearest <= limit)
    kept = _chosen(markers, trusted, wanted)
    return markers.chosen(kept).set_of_points(cloud.n_points), n_too_many + int((~kept)[group].sum())


def _longest(sets: MarkerSets) -> MarkerSets:
    """Bound the number of sets by leaving the shortest out."""
    order = np.argsort(-sets.lengths, kind="stable")
    keep = np.zeros(len(sets), dtype=np.bool_)
    keep[order[:MOST_SETS]] = True
    return sets.chosen(keep)


def _chosen(markers: MarkerSets, trusted: Bools, wanted: int) -> Bools:
    """The `wanted` markers that are seen longest, after all trusted ones."""
    keep = np.zeros(len(markers), dtype=np.bool_)
    keep[np.lexsort((-markers.lengths, ~trusted))[:wanted]] = True
    return keep
