r"""Tracks that go on over short gaps: who goes on as whom is decided for all that are lost at about the same time.

When an arm passes behind a body, ten markers are lost at once, and what would carry them along (`continuity`) is hidden
with them. But their own speeds before and behind a gap of length g tell where they have been taken. With the velocities
:math:`v_i` and :math:`v_j` at its ends, the trapezoidal rule misses the displacement by as much as the acceleration
changes, and so do tracks that are seen all the time, if gaps of this length are made in them. Their errors are

.. math:: \sigma^2 = a_g^2 + (b_g\, g\, |v_j - v_i|)^2

in a coordinate. In recorded people that walk, fight and turn somersaults, b is .1 for 0.1 s and .2 for 0.3 s. The
speeds are one prediction, the neighbours that are seen at both ends another one; either may be the right one.

Limbs that turn fast are mispredicted alike, and keep their shape: two tracks that end together and two that begin
together are a likely pair of links if their distance is nearly the same. Links gather the evidence of the likely ones
beside them, in turns (mean field). Those that are far more likely than any other of the same end or beginning are
made. Then more tracks last, which carry others along, and it is done again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, lengths_of
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.input_checks import frame_rate
from skelgen.stages.labels.merging.bridge_links import (
    BridgeWindow,
    Laws,
    missed_by_speeds,
    points_of_chains,
    speed_frames,
)
from skelgen.stages.labels.merging.continuity import LONGEST
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.windows import CHI_MEDIAN
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing

ROUNDS, FEW = 3, 0.02
"""Times that links are sought, as what is linked carries others along the next time; and the part of the chains that is
linked at least for another time."""

WINDOW_SECONDS, WINDOW_ENDS = 5.0, 1000
"""Links whose gaps begin within this time are sought together, of fewer ends if they are dense: bounds the memory."""

TRIED_GAPS = (0.05, 0.1, 0.2, 0.4, 0.6, 1.0)
"""Parts of `LONGEST` over which errors of predictions are measured."""

TRIED_FRAMES = 30
"""Frames in which each of these begins."""

STRAIGHTEST = 0.25
"""Part of the predictions, those whose speeds differ least, whose errors are `Laws.least`."""

LEAST_ERROR = 1e-6
"""mm; of predictions in takes without noise."""

NEAREST = 4
"""Neighbours of each chain whose distances are measured over gaps."""

LEAST_STRETCH = 0.01
"""Deviation of a distance that is expected at least, in spacings."""


def follow_over_gaps(cloud: PointCloud, parameters: LabelParameters, monitor: Monitor = SILENT) -> Ints:
    """Follow points into tracks, which go on over short gaps where that is sure.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    parameters : LabelParameters
        How points are followed.
    monitor : Monitor
        Receives progress; may cancel.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    """
    tracks, _ = follow_points(cloud, parameters, monitor)
    rate, _ = frame_rate(cloud, parameters)
    return with_bridges(FollowedCloud(cloud, tracks, rate, typical_spacing(cloud))).track_of_point


def with_bridges(take: FollowedCloud) -> FollowedCloud:
    """Link tracks over the gaps between them where that is sure.

    Parameters
    ----------
    take : FollowedCloud
        The take. Tracks of one point, those with points whose marker is stated, and any of a very long take, which must
        do with little memory, are not linked.

    Returns
    -------
    FollowedCloud
        The same take; tracks that are linked have one number.
    """
    if take.is_very_long:
        return take
    track, is_linkable = take.track_of_point, _linkable(take)
    chain = point_labels.renumbered(track, is_linkable)
    laws = _measured_laws(take, chain)
    if laws is None:
        return take
    for _ in range(ROUNDS):
        first, last = _ends(take.cloud, chain)
        goes_on_as = np.arange(len(first))
        for span in _spans(last, take):
            window = BridgeWindow(take, chain, (first, last), span)
            links = window.sure_links(laws, goes_on_as)
            goes_on_as[window.chains[links.begins]] = window.chains[links.ends]
        n_linked = int((goes_on_as != np.arange(len(goes_on_as))).sum())
        chain = np.append(np.unique(_roots(goes_on_as), return_inverse=True)[1], -1)[chain]
        if n_linked <= FEW * len(goes_on_as):
            break
    others = point_labels.renumbered(track, ~is_linkable)
    numbered = np.where(others >= 0, others + int(chain.max(initial=-1)) + 1, chain)
    return replace(take, track_of_point=numbered.astype(track.dtype))


def _linkable(take: FollowedCloud) -> Bools:
    """Tracks of several points none of which is stated, shape (n_tracks,)."""
    track = take.track_of_point
    n_tracks = int(track.max(initial=-1)) + 1
    count = np.bincount(track[track >= 0], minlength=n_tracks)
    return np.asarray((count > 1) & (np.bincount(track[take.is_fixed & (track >= 0)], minlength=n_tracks) == 0))


def _ends(cloud: PointCloud, chain_of_point: Ints) -> tuple[Ints, Ints]:
    """First and last frame of each chain; points lie in the order of frames."""
    first, last = np.full((2, int(chain_of_point.max(initial=-1)) + 1), -1, dtype=np.intp)
    for block in point_labels.blocks_of(cloud, point_labels.LONG_BLOCK_FRAMES):
        owned = np.flatnonzero(chain_of_point[block.points] >= 0)
        chain, frame = chain_of_point[block.points][owned], block.first + block.frames[owned]
        last[chain] = frame
        is_new = first[chain] < 0
        first[chain[is_new][::-1]] = frame[is_new][::-1]  # of several the last that is written, the earliest
    return first, last


def _spans(last: Ints, take: FollowedCloud) -> Iterator[tuple[int, int]]:
    """First frame of each window and the one behind its last, by the last frames of chains."""
    last, longest, begin = np.sort(last), max(1, int(WINDOW_SECONDS * take.rate)), 0
    while begin < take.cloud.n_frames:
        full = np.searchsorted(last, begin) + WINDOW_ENDS
        dense = int(last[full]) if full < len(last) else take.cloud.n_frames
        behind = min(begin + longest, max(dense, begin + 1), take.cloud.n_frames)
        yield begin, behind
        begin = behind


def _roots(goes_on_as: Ints) -> Ints:
    """The first of all that each one is linked to, itself or one before it."""
    while (goes_on_as[goes_on_as] != goes_on_as).any():
        goes_on_as = goes_on_as[goes_on_as]
    return goes_on_as


def _measured_laws(take: FollowedCloud, chain_of_point: Ints) -> Laws | None:
    """Measure how badly predictions fail on chains that are seen at both ends of gaps; None if nothing shows it."""
    cloud, step, rows = take.cloud, speed_frames(take.rate), []
    for part in TRIED_GAPS:
        gap = max(1, round(part * LONGEST * take.rate))
        missed, turned, stretched = [], [], []
        for first in spread_frames(max(cloud.n_frames - gap - 2 * step, 0), TRIED_FRAMES).tolist():
            seen = first + np.array([0, step, step + gap, 2 * step + gap])
            points = points_of_chains(cloud, chain_of_point, seen)[1]
            places = cloud.points[points[:, (points >= 0).all(axis=0)]]
            off, bend = missed_by_speeds(
                places[1:3], np.stack([places[1] - places[0], places[3] - places[2]]), gap / step
            )
            missed.append(off)
            turned.append(bend)
            stretched.append(_changes_of_distances(places[1], places[2]))
        off, bend, stretch = (np.concatenate([np.zeros(0), *parts]) for parts in (missed, turned, stretched))
        if len(stretch):
            is_bent = bend >= np.median(bend)
            least = float(np.median(off[bend <= np.quantile(bend, STRAIGHTEST)])) / CHI_MEDIAN
            ratio = float(np.median(off[is_bent] / np.maximum(bend[is_bent], LEAST_ERROR))) / CHI_MEDIAN
            away = max(SIGMA_OF_MEDIAN * float(np.median(stretch)), LEAST_STRETCH * take.spacing)
            rows.append((gap / take.rate, max(least, LEAST_ERROR), ratio, away))
    return Laws(*np.array(rows).T) if rows else None


def _changes_of_distances(before: Floats, after: Floats) -> Floats:
    """How much the distances of points from the nearest others change [mm]."""
    if len(before) <= NEAREST:
        return np.zeros(0)
    then, nearest = (found[:, 1:] for found in cKDTree(before).query(before, k=NEAREST + 1))
    return np.asarray(np.abs(lengths_of(after[nearest] - after[:, np.newaxis]) - then).ravel())
