"""What following points needs to know of a take, and learns from a trial.

Of the take: how far apart points are, when frames were, how good points are. From the trial: how far points lie from
where tracks expect them, how often tracks are lost, and begin. The rules of following come from these, without a number
from the user: innovations of Student's t distribution in three dimensions, its scale for each number of unseen steps,
and the odds of a link against a lost track and a new point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import fdtri, gammaln

from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen.progress import SILENT, Monitor, counted

MIDDLE, FAR = 0.5, (0.95, 0.99)
"""Quantiles of the innovations from which the tail is found; the heavier counts. Farther out, wrong links dominate."""

TAILS = np.geomspace(1.5, 30.0, 40)
"""Degrees of freedom that are tried: below 1.5 not even the mean is known, above 30 the distribution is normal."""

NEIGHBOUR_FRAMES = 200
"""Frames in which neighbours are compared."""

LEAST_INNOVATIONS = 100
"""Fewer innovations do not show a tail."""

WIDENING = 5.0
"""nats by which links are favoured where tracks break too often: a factor of a hundred and fifty."""

INDEPENDENT = 2.0
"""Mean squared difference of two independent innovations, in units of their own mean square."""

SETTLED_AGE = 3
"""Points from which on a track's slope is its own: the second gave the first difference."""

LEAST_SCALE = 1e-6
"""Of the typical spacing: the least scale, as exact takes that stand still differ by rounding alone."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Points that were followed for a trial.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points, frame after frame.
    starts : ndarray of intp, shape (n_frames + 1,)
        Where frames begin.
    steps : ndarray of intp, shape (n_frames,)
        Steps of time since the frame before.
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    slopes : ndarray, shape (n_points, 3), mm
        Step per frame that the track had after this point; NaN at a track's first point.
    recent_errors : ndarray, shape (n_points, 2)
        The track's fading sum of squared innovations per coordinate [mm^2] after this point, and of their number.
    """

    points: Floats
    starts: Ints
    steps: Ints
    track_of_point: Ints
    slopes: Floats
    recent_errors: Floats


@dataclass(frozen=True, eq=False)
class Innovations:
    """Statistics of links, for tracks that were seen more than once (row 0), once (1), or once without neighbours (2).

    Attributes
    ----------
    tails : ndarray, shape (3,)
        Degrees of freedom of the innovations' t distribution.
    relative : float
        Median squared innovation of a track relative to its neighbour, in its own: 2 where neighbours move for
        themselves, less where they accelerate together.
    prior_weight : float
        Weight of the take's scale against a track's recent innovations, as a number of innovations.
    scales : ndarray, shape (3, n_steps + 1), mm
        Scale per coordinate for each number of steps since the track was last seen; column 0 is not used.
    odds : ndarray, shape (3, n_steps + 1), nats
        Log odds of a point exactly where it was expected against a lost track and a new point there.
    """

    tails: Floats
    relative: float
    prior_weight: float
    scales: Floats
    odds: Floats

    def reaches(self, evidence: float) -> Floats:
        """Distance [mm] beyond which the odds fall below `evidence`, shape (3, n_steps + 1)."""
        tails = self.tails[:, np.newaxis]
        loss = np.maximum(self.odds - evidence, 0.0) * 2.0 / (tails + 3.0)
        return np.asarray(self.scales * np.sqrt(tails * np.expm1(loss)))

    def widened(self) -> Innovations:
        """Return innovations with a heavier tail, and odds that many more nats favour links."""
        tails = np.maximum(self.tails / 2.0, TAILS[0])
        return replace(self, tails=tails, odds=self.odds + WIDENING)


def supposed_innovations(reach: float, quantile: float, n_steps: int, newborn: float) -> Innovations:
    """Return innovations with the heaviest tail, for a take of which nothing is known.

    Parameters
    ----------
    reach : float, mm
        What the part `quantile` of the innovations stays below.
    quantile : float
        That part.
    n_steps : int
        Largest number of time steps over which tracks are followed.
    newborn : float
        How many times larger innovations are of tracks that were seen once.
    """
    tail = float(TAILS[0])
    scales = np.full((3, n_steps + 1), reach / np.sqrt(3.0 * fdtri(3.0, tail, quantile)))
    scales[1:] *= newborn
    return Innovations(np.full(3, tail), INDEPENDENT, tail / 3.0, scales, np.zeros_like(scales))


def find_innovations(trial: Trial, spacing: float, n_steps: int) -> Innovations | None:
    """Learn from a trial; None if it shows too little.

    Parameters
    ----------
    trial : Trial
        Points that were followed with wide gates.
    spacing : float, mm
        Typical distance of neighbouring points.
    n_steps : int
        Largest number of steps over which tracks are followed.
    """
    runs = _Runs.of(trial)
    sizes, _ = runs.innovations(trial, 1)
    if len(sizes) < LEAST_INNOVATIONS:
        return None
    least = LEAST_SCALE * spacing
    mixed, usual = _fit_t(sizes, least)
    prior_weight = mixed / 3.0
    # Scale of each track in units of the take's, after each of its points.
    own = np.sqrt((prior_weight + trial.recent_errors[:, 0] / usual**2) / (prior_weight + trial.recent_errors[:, 1]))
    by_step = []
    for step in range(1, n_steps + 1):
        steps, origins = runs.innovations(trial, step)
        by_step.append(steps / own[origins])
    tail, scale = _fit_t(by_step[0], least)
    middle = np.array([np.median(ratios) if len(ratios) else np.nan for ratios in by_step])
    growth = np.fmax.accumulate(middle) / max(middle[0], least)
    newborn, beside, alone = _by_neighbours(trial, runs, own)
    newborn_tail, newborn_scale = _fit_t(newborn, least) if len(newborn) else (tail, scale)
    lone_tail, lone_scale = _fit_t(alone, least) if len(alone) else (tail, scale)
    relative = (max(float(np.median(beside)), least) / max(middle[0], least)) ** 2 if len(beside) else INDEPENDENT
    grown = scale * np.maximum(growth, 1.0)
    factors = np.array([1.0, newborn_scale / scale, lone_scale / scale])
    scales = np.column_stack([np.full(3, usual), factors[:, np.newaxis] * grown])
    tails = np.array([tail, newborn_tail, lone_tail])
    constant = gammaln((tails + 3.0) / 2.0) - gammaln(tails / 2.0) - 1.5 * np.log(tails * np.pi)
    # Part of the points that are new in a frame, and part that is lost, from changes of the number of points
    counts = np.diff(trial.starts)
    change = np.diff(counts)[trial.steps[1:] == 1]
    n_points = max(1, int(counts.sum())) + 2.0
    births, losses = float((change[change > 0].sum() + 1) / n_points), float((-change[change < 0].sum() + 1) / n_points)
    seen = runs.log_odds(n_steps)
    seen[0, :2] = np.log((1.0 - losses) / losses)
    # Half of the points have another one nearer than the spacing: that is their density [1/mm^3].
    log_density = float(np.log(np.log(2.0) / (4.0 / 3.0 * np.pi * spacing**3)))
    odds = constant[:, np.newaxis] - 3.0 * np.log(scales) - np.log(births) - log_density + seen
    return Innovations(tails, relative, prior_weight, scales, odds)


def _fit_t(sizes: Floats, least: float) -> tuple[float, float]:
    """Degrees of freedom and scale [mm] of distances: their squares, a third each, follow an F distribution."""
    middle, *far = np.maximum(np.quantile(sizes, [MIDDLE, *FAR]), least)
    tails = []
    for quantile, size in zip(FAR, far, strict=True):
        ratios = np.sqrt(fdtri(3.0, TAILS, quantile) / fdtri(3.0, TAILS, MIDDLE))
        tails.append(float(TAILS[np.argmin(np.abs(np.log(ratios * middle / size)))]))
    tail = min(tails)
    return tail, float(middle / np.sqrt(3.0 * fdtri(3.0, tail, MIDDLE)))


@dataclass(frozen=True, eq=False)
class _Runs:
    """Points with a track, track after track in order of time, shape (n,) each."""

    index: Ints
    track: Ints
    time: Ints
    age: Ints
    is_last_frame: Bools

    @classmethod
    def of(cls, trial: Trial) -> _Runs:
        counts = np.diff(trial.starts)
        time = np.repeat(np.cumsum(trial.steps), counts)
        pause = np.concatenate([trial.steps[1:] > 1, [True]])
        index = np.flatnonzero(trial.track_of_point >= 0)
        index = index[np.lexsort((time[index], trial.track_of_point[index]))]
        track = trial.track_of_point[index]
        age = 1 + np.arange(len(track)) - np.searchsorted(track, track)
        return cls(index, track, time[index], age, np.repeat(pause, counts)[index])

    def innovations(self, trial: Trial, step: int) -> tuple[Floats, Ints]:
        """Distances [mm] of points from where settled tracks expected them `step` steps before, and from which."""
        same = self.track[step:] == self.track[:-step]
        same &= (self.time[step:] - self.time[:-step] == step) & (self.age[:-step] >= SETTLED_AGE)
        first, last = self.index[:-step][same], self.index[step:][same]
        return np.linalg.norm(trial.points[last] - trial.points[first] - step * trial.slopes[first], axis=1), first

    def later(self) -> Ints:
        """Steps until the track is seen again; 0 for never."""
        wait = np.zeros(len(self.track), dtype=np.intp)
        same = self.track[1:] == self.track[:-1]
        wait[:-1][same] = (self.time[1:] - self.time[:-1])[same]
        return wait

    def log_odds(self, n_steps: int) -> Floats:
        """Log odds that a lost track is seen again after so many steps, shape (3, n_steps + 1)."""
        wait, inside = self.later(), ~self.is_last_frame
        settled, newborn = inside & (self.age > 1), inside & (self.age == 1)
        odds = np.empty((3, n_steps + 1))
        gone = settled & (wait != 1)
        found = gone & (wait > 1)
        unseen = (wait[found] - 1).sum() + (n_steps - 1) * (gone & (wait == 0)).sum()
        odds[:] = _log_odds(int(found.sum()), int(unseen))
        odds[1:, :2] = _log_odds(int((newborn & (wait == 1)).sum()), int(newborn.sum()))
        return odds


def _log_odds(n_true: int, n_all: int) -> float:
    """Log odds of something that was seen so often, with Laplace's rule of succession."""
    return float(np.log((n_true + 1.0) / (max(n_all - n_true, 0) + 1.0)))


def _by_neighbours(trial: Trial, runs: _Runs, own: Floats) -> tuple[Floats, Floats, Floats]:
    """Innovations with the neighbour's slope, innovations relative to the neighbour's, and steps.

    The first two are in units of the tracks' own scales; steps are the innovations of tracks without a neighbour [mm].
    """
    next_point = np.full(len(trial.points), -1, dtype=np.intp)
    follows = (runs.track[1:] == runs.track[:-1]) & (np.diff(runs.time) == 1)
    next_point[runs.index[:-1][follows]] = runs.index[1:][follows]
    is_settled = np.zeros(len(trial.points), dtype=np.bool_)
    is_settled[runs.index] = (runs.age >= SETTLED_AGE) & (next_point[runs.index] >= 0)
    here, near = _neighbours(trial, is_settled)
    steps = trial.points[next_point[here]] - trial.points[here]
    steps_of_near = trial.points[next_point[near]] - trial.points[near]
    newborn = np.linalg.norm(steps - trial.slopes[near], axis=1) / own[near]
    relative = (steps - trial.slopes[here]) - (steps_of_near - trial.slopes[near])
    scale = np.sqrt((own[here] ** 2 + own[near] ** 2) / 2.0)
    return newborn, np.asarray(np.linalg.norm(relative, axis=1) / scale), np.linalg.norm(steps, axis=1)


def _neighbours(trial: Trial, chosen: Bools) -> tuple[Ints, Ints]:
    """Chosen points of some frames, and the chosen point of the same frame that is nearest to each."""
    points, nearest = [np.empty(0, dtype=np.intp)], [np.empty(0, dtype=np.intp)]
    for frame in spread_frames(len(trial.steps), NEIGHBOUR_FRAMES):
        here = trial.starts[frame] + np.flatnonzero(chosen[trial.starts[frame] : trial.starts[frame + 1]])
        if len(here) > 1:
            _, found = cKDTree(trial.points[here]).query(trial.points[here], k=2)
            points.append(here)
            nearest.append(here[found[:, 1]])
    return np.concatenate(points), np.concatenate(nearest)


LONGEST_PAUSE = 1000
"""Time steps that end all tracks; longer ones would be no different."""

LEAST_WEIGHT = 0.01
"""A point that the file calls as bad as can be still has a place, with ten times the usual deviation."""


def typical_spacing(cloud: PointCloud) -> float:
    """Median distance [mm] between a point and its nearest neighbour in the same frame; 1 if there is none.

    A hundred frames spread over the take count alike, however many points they hold.
    """
    nearest = []
    for frame in spread_frames(cloud.n_frames, 100):
        points = cloud.frame(frame)
        if len(points) > 1:
            nearest.append(float(np.median(cKDTree(points).query(points, k=2)[0][:, 1])))
    spacing = float(np.median(nearest)) if nearest else 0.0
    return spacing or 1.0


def points_beside(cloud: PointCloud) -> int:
    """Return how many points the frame of the median point has.

    Frames that show nothing, or ghosts alone, hardly count, as when somebody crosses a volume that is empty else.

    Parameters
    ----------
    cloud : PointCloud
        The take; it has points.
    """
    n_points = np.bincount(cloud.points_per_frame)
    n_points *= np.arange(len(n_points))
    return int(np.searchsorted(2 * np.cumsum(n_points), n_points.sum()))


def time_steps(cloud: PointCloud, monitor: Monitor = SILENT) -> Ints:
    """Return the time since the frame before in whole frame periods, shape (n_frames,).

    Frames are a period apart, however their stamps jitter; dropped frames and pauses count in time. A frame that
    repeats the stamp of the one before counts as one period later, and a notice says so.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    monitor : Monitor
        Receives the notice.
    """
    passed = np.diff(cloud.times)
    n_repeated = int((passed == 0).sum())
    if 0 < n_repeated < len(passed):
        one = "frame repeats the time stamp of the frame before; it counts as one frame later"
        several = "frames repeat the time stamp of the frame before; they count as one frame later"
        monitor.notice(counted(n_repeated, one, several))
    periods = np.minimum(np.round(passed * cloud.rate), LONGEST_PAUSE)
    return np.concatenate([[1], np.maximum(periods, 1)])[: cloud.n_frames].astype(np.intp)


def point_weights(cloud: PointCloud) -> Floats:
    """Return the weight of each point: the usual variance of a point's position over that of this one.

    A position's deviation is taken as proportional to its reprojection error, where that is larger than the take's
    points usually have, and its variance as inverse to the number of blobs, where there are fewer than usual.

    Parameters
    ----------
    cloud : PointCloud
        The take; its attributes ``reprojection_error`` and ``n_blobs`` count.

    Returns
    -------
    ndarray, shape (n_points,)
        Between `LEAST_WEIGHT` and 1; all 1 where the file has neither, or the same for all points. Read-only.
    """
    error, n_blobs = cloud.attributes.get("reprojection_error"), cloud.attributes.get("n_blobs")
    if cloud.n_points == 0 or (error is None and n_blobs is None):
        return np.broadcast_to(np.float64(1.0), cloud.n_points)  # a long take is not filled with ones
    weights = np.ones(cloud.n_points)
    if error is not None:
        weights *= _by_error(np.abs(error))
    if n_blobs is not None:
        # Ratio of each number of blobs to the usual one; a point without any counts as one with half a blob
        usual = float(np.nanmedian(n_blobs))
        if usual > 0.0:
            weights *= np.clip(np.fmin(n_blobs, usual), 0.5, usual) / max(usual, 0.5)
    return np.asarray(np.clip(weights, LEAST_WEIGHT, 1.0))


def _by_error(error: Floats) -> Floats:
    """Squared ratio of the largest usual error, a robust deviation above the median, to each."""
    middle = float(np.nanmedian(error))
    usual = middle + SIGMA_OF_MEDIAN * float(np.nanmedian(np.abs(error - middle)))
    if not usual > 0.0:
        return np.ones(len(error))
    return np.asarray((usual / np.fmax(error, usual)) ** 2)
