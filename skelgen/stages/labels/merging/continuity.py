r"""Evidence that a tracklet continues one that ended shortly before.

The markers around carry a marker along: the rigid motion of its nearest neighbours over the gap predicts where it must
come back. How far such predictions err after a time is measured on the tracklets themselves. With the error's deviation
:math:`\sigma` after that time and the spacing w of markers, a tracklet that begins at a distance r from the prediction
is the same marker with the evidence

.. math:: E = 3 \log\frac{\sqrt{\sigma^2 + w^2}}{\sigma} - h(r / \sigma) + h(r / \sqrt{\sigma^2 + w^2}),

where h is minus the logarithm of Student's distribution with few degrees of freedom, because the predictions of some
markers err far more than those of most.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.orientation import fit_transform
from skelgen.model.arrays import Floats, Ints
from skelgen.model.tracklets import TrackletPoints

LONGEST = 0.5
"""s; over longer gaps the neighbours do not predict a marker."""

NEIGHBOURS = 5
"""Markers that carry a marker over a gap."""

LEAST_NEIGHBOURS = 3
"""Fewer fix no motion."""

TRIED_FRAMES = 40
"""Frames from which the error of predictions is measured."""

TRIED_GAPS = (0.1, 0.25, 0.5, 0.75, 1.0)
"""Parts of `LONGEST` over which it is measured."""

FREEDOM = 2.0
"""Of Student's distribution: heavy tails."""

CHI_MEDIAN = 1.538
"""Median length of a vector of three normal numbers."""

PAIRS_AT_ONCE = 2000


def continuity_evidence(
    points: Floats, tracklets: TrackletPoints, rate: float, spacing: float
) -> tuple[Ints, Ints, Floats]:
    """Evidence that one tracklet goes on where another ended.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    tracklets : TrackletPoints
        What may be joined.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.

    Returns
    -------
    before, after : ndarray of intp, shape (n,)
        Pairs of tracklets of which the first ends and the second begins within `LONGEST`.
    evidence : ndarray, shape (n,), nats
        That they are one marker; 0 where too few neighbours are seen.
    """
    gap = tracklets.first - tracklets.last[:, np.newaxis]
    before, after = np.nonzero((gap > 0) & (gap <= LONGEST * rate))
    evidence = np.zeros(len(before))
    deviation = _error_deviation(points, tracklets, rate)
    if deviation is None:
        return before, after, evidence
    for start in range(0, len(before), PAIRS_AT_ONCE):
        part = slice(start, start + PAIRS_AT_ONCE)
        i, j = before[part], after[part]
        distance = _missed(points, tracklets, (i, j), (tracklets.last[i], tracklets.first[j]))
        known = ~np.isnan(distance)
        sigma = deviation(gap[i[known], j[known]] / rate)
        wide, distance = np.sqrt(sigma**2 + spacing**2), distance[known]
        ratio = 3.0 * np.log(wide / sigma) - _tail(distance / sigma) + _tail(distance / wide)
        evidence[start + np.flatnonzero(known)] = ratio
    return before, after, evidence


def _missed(points: Floats, tracklets: TrackletPoints, which: tuple[Ints, Ints], frames: tuple[Ints, Ints]) -> Floats:
    """Distance [mm] of tracklets j from where neighbours carry tracklets i; NaN where neighbours are too few."""
    used = np.unique(np.concatenate(frames))
    poses = tracklets.positions_at(points, used)
    source, target = (poses[np.searchsorted(used, frame)] for frame in frames)
    row = np.arange(len(which[0]))
    begin, end = source[row, which[0]].copy(), target[row, which[1]].copy()
    away = np.linalg.norm(source - begin[:, np.newaxis], axis=2)
    away[np.isnan(target[..., 0]) | np.isnan(away)] = np.inf
    away[row, which[0]] = away[row, which[1]] = np.inf
    count = min(NEIGHBOURS, away.shape[1])
    nearest = np.argpartition(away, count - 1, axis=1)[:, :count]
    valid = np.isfinite(np.take_along_axis(away, nearest, axis=1))
    source, target = (np.take_along_axis(place, nearest[..., np.newaxis], axis=1) for place in (source, target))
    carried = fit_transform(np.where(valid[..., np.newaxis], source, 0.0), target, valid)
    expected = np.einsum("nij,nj->ni", carried[:, :3, :3], begin) + carried[:, :3, 3]
    missed = np.linalg.norm(end - expected, axis=1)
    missed[valid.sum(axis=1) < LEAST_NEIGHBOURS] = np.nan
    return np.asarray(missed)


class _ErrorDeviation:
    """Deviation of a coordinate of the predictions [mm] by the time over which they reach [s]."""

    def __init__(self, times: Floats, deviations: Floats) -> None:
        self._times, self._deviations = times, np.maximum.accumulate(deviations)

    def __call__(self, time: Floats) -> Floats:
        return np.asarray(np.interp(time, self._times, self._deviations))


def _error_deviation(points: Floats, tracklets: TrackletPoints, rate: float) -> _ErrorDeviation | None:
    """Measure how far predictions err, on tracklets that are seen before and after; None if there are none."""
    times, deviations = [], []
    for part in TRIED_GAPS:
        gap = max(1, round(part * LONGEST * rate))
        first = np.unique(np.linspace(0, max(0, tracklets.n_frames - 1 - gap), TRIED_FRAMES).astype(np.intp))
        both = (
            (tracklets.indices_at(first) >= 0) & (tracklets.indices_at(first + gap) >= 0)
            if tracklets.n_frames > gap
            else None
        )
        if both is None or not both.any():
            continue
        frame, which = np.nonzero(both)
        missed = _missed(points, tracklets, (which, which), (first[frame], first[frame] + gap))
        if not np.isnan(missed).all():
            times.append(gap / rate)
            deviations.append(max(float(np.nanmedian(missed)) / CHI_MEDIAN, np.finfo(np.float64).eps))
    return _ErrorDeviation(np.array(times), np.array(deviations)) if times else None


def _tail(ratio: Floats) -> Floats:
    """Minus the logarithm of Student's distribution in three dimensions, but for a constant."""
    return np.asarray((FREEDOM + 3.0) / 2 * np.log1p(ratio**2 / FREEDOM))
