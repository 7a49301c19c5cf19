"""Values between the known ones of a series, as the mean of a Gaussian process, with their standard deviation.

The covariance is a sum of Ornstein-Uhlenbeck processes of many correlation times, rough and once smoothed (Matérn 1/2
and 3/2), fitted to the series' own variogram. A known value therefore counts for as long as the series remembers: near
the ends of a gap its neighbours are carried into it, averaged over their noise, and in the middle of a long gap the
mean of the series is left, with the deviation of the series. Smoother processes were tried: their curves swing out of
gaps with a deviation far too small. (Simple kriging: Matheron 1963, *Principles of geostatistics*; Rasmussen and
Williams 2006, *Gaussian processes for machine learning*, 2.2.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from skelgen.model.arrays import Bools, Floats, Ints

_LAG_GROWTH = 1.35  # of neighbouring lags and correlation times: finer than variograms bend
_LONGEST_LAG = 0.5  # of the series: beyond, too few pairs tell of the variogram
_FEWEST_PAIRS = 10
_KNOT_STEPS = (0, 1, 2, 3, 5, 8, 13, 21, 34, 55)  # known frames before and after a gap: dense where they count most
_JITTER = 1e-9  # of the variance, keeps the equations of noiseless processes solvable
_FAR = 1e12  # times the variance: noise of a knot that is not there
_OUTLIER = 10.0  # times the median deviation: labels that belong elsewhere


@dataclass(frozen=True, eq=False)
class Memory:
    """What a series is known to do.

    Attributes
    ----------
    mean : ndarray, shape (n_axes,)
        Its mean.
    covariance : ndarray, shape (n_frames,)
        Covariance of two values by the number of frames between them, noise left out; one for all axes.
    noise : float
        Variance of what changes from each frame to the next.
    """

    mean: Floats
    covariance: Floats
    noise: float

    @property
    def variance(self) -> float:
        """Variance of one value."""
        return float(self.covariance[0]) + self.noise


def fit_memory(series: Floats, known: Bools) -> Memory:
    """Estimate mean and covariance of a series with gaps.

    Parameters
    ----------
    series : ndarray, shape (n_frames, n_axes), mm
        Values; those not `known` are ignored.
    known : ndarray of bool, shape (n_frames,)
        Which frames have a value; at least one.
    """
    n_frames = len(series)
    mean = series[known].mean(axis=0)
    variance = float(((series[known] - mean) ** 2).mean())
    lags = _growing(max(int(n_frames * _LONGEST_LAG), 1))
    halves, counts = _variogram(series, known, lags)
    lags, halves = lags[counts >= _FEWEST_PAIRS], halves[counts >= _FEWEST_PAIRS]
    if variance == 0.0 or len(lags) == 0:
        return Memory(mean, np.concatenate([[variance], np.zeros(n_frames - 1)]), 0.0)
    scales = lags.astype(np.float64)
    shapes = _shapes(lags, scales)
    rows = np.vstack([1.0 - shapes, np.ones(shapes.shape[1])])
    rows = np.column_stack([rows, np.ones(len(rows))])
    wanted = np.maximum(np.append(halves, variance), _JITTER * variance)
    shares, _ = nnls(rows / wanted[:, np.newaxis], np.ones(len(wanted)))
    return Memory(mean, _shapes(np.arange(n_frames), scales) @ shares[:-1], float(shares[-1]))


def bridge(series: Floats, known: Bools, targets: Ints, memory: Memory) -> tuple[Floats, Floats]:
    """Predict a series in frames where it is not known.

    Parameters
    ----------
    series : ndarray, shape (n_frames, n_axes), mm
        Values; those not `known` are ignored.
    known : ndarray of bool, shape (n_frames,)
        Which frames have a value.
    targets : ndarray of intp, shape (n_targets,)
        Frames to predict.
    memory : Memory
        From `fit_memory`.

    Returns
    -------
    tuple of ndarray, shape (n_targets, n_axes), mm, and ndarray, shape (n_targets,), mm
        The values, and the standard deviation of each coordinate of what would have been measured.
    """
    knots, there = _knots(np.flatnonzero(known), targets)
    among = memory.covariance[np.abs(knots[:, :, np.newaxis] - knots[:, np.newaxis, :])]
    noise = np.where(there, memory.noise + _JITTER * memory.variance, _FAR * memory.variance)
    diagonal = np.arange(knots.shape[1])
    among[:, diagonal, diagonal] += np.where(noise > 0, noise, 1.0)
    towards = memory.covariance[np.abs(knots - targets[:, np.newaxis])]
    weights = np.linalg.solve(among, towards[..., np.newaxis])[..., 0]
    values = np.where(there[..., np.newaxis], series[knots] - memory.mean, 0.0)
    variance = memory.variance - (weights * towards).sum(axis=1)
    deviation = np.sqrt(np.maximum(variance, memory.noise))
    return memory.mean + np.einsum("tk,tka->ta", weights, values), deviation


def without_outliers(series: Floats, known: Bools) -> Bools:
    """Return which known values are not far off all others, shape (n_frames,)."""
    if not known.any():
        return known
    distance = np.linalg.norm(series - np.median(series[known], axis=0), axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(known & (distance <= _OUTLIER * np.median(distance[known])))


def _growing(longest: int) -> Ints:
    """Whole numbers from 1, each a bit larger than the one before."""
    count = int(np.log(longest) / np.log(_LAG_GROWTH)) + 1
    return np.unique(np.round(_LAG_GROWTH ** np.arange(count)).astype(np.intp))


def _variogram(series: Floats, known: Bools, lags: Ints) -> tuple[Floats, Ints]:
    """Half the mean square of the change over each lag, and over how many pairs of frames."""
    filled = np.where(known[:, np.newaxis], series, 0.0)
    halves, counts = np.zeros(len(lags)), np.zeros(len(lags), dtype=np.intp)
    for index, lag in enumerate(lags.tolist()):
        both = known[lag:] & known[:-lag]
        counts[index] = both.sum()
        changes = (filled[lag:] - filled[:-lag])[both]
        halves[index] = 0.5 * (changes**2).mean() if len(changes) else 0.0
    return halves, counts


def _shapes(lags: Ints, scales: Floats) -> Floats:
    """Correlations of the processes on offer, shape (n_lags, 2 n_scales)."""
    ratio = lags[:, np.newaxis] / scales
    decay = np.exp(-ratio)
    return np.hstack([decay, (1.0 + ratio) * decay])


def _knots(known: Ints, targets: Ints) -> tuple[Ints, Bools]:
    """Known frames around each target, nearest first, shape (n_targets, n_knots), and which are there at all."""
    steps = np.array(_KNOT_STEPS)
    right = np.searchsorted(known, targets)[:, np.newaxis]
    places = np.hstack([right - 1 - steps, right + steps])
    there = (places >= 0) & (places < len(known))
    return known[np.clip(places, 0, len(known) - 1)], there
