"""Values of a series where it is not known, from time and from features that are known everywhere.

The series is taken as a Gaussian process whose covariance is a sum of fixed shapes: decays and damped waves in time,
products of features, bells over features, and noise. How much each contributes is estimated by a few iterations for
variance components (Zhou, Hu, Qiao, Cho and Lange 2019, *MM algorithms for variance components models*),
so that the data say whether a marker follows the joints, its neighbours or its own swing. Given these, values are the
best linear prediction from known frames near the gap and over the whole take, with their standard deviation
(Rasmussen and Williams 2006, *Gaussian processes for machine learning*, 2.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri

from skelgen.model.arrays import Floats, Ints

_DECAYS = (0.05, 0.2, 1.0, 5.0)  # s: from the jitter of labels to a slow drift
_PERIODS = (0.5, 0.65, 0.85, 1.1, 1.5, 2.0, 2.8)  # s: skin swings with steps and reaches, 0.35 to 2 Hz
_DAMPING = 1.5  # periods after which a wave has lost its phase
_WIDTHS = (0.5, 1.0)  # of bells over features, whose mean square length is 1
_VANISHED = 12.0  # longest decay times, after which nothing is left of it
_ROUNDS = 12  # of the iteration: few, so that shapes that hardly matter keep a small part
_LEARNT_FRAMES = 126  # that variances rest on: the work grows with their cube
_ANYWHERE_FRAMES = 130  # all over the take, that predictions rest on
_CLUSTER = (0, 1, 3, 7, 15, 31)  # frames that are looked at together, to see short and long times
_NEAREST, _NEARER, _EVERY = 30, 120, 3  # known frames about a gap: all of the nearest, then every third
_TOGETHER_SECONDS = 2.0  # gaps within this time are predicted together
_RIDGE = 1e-9  # of the variance, keeps the equations of noiseless series solvable
_LEAST_VARIANCE = 1e-12  # mm^2, so that a constant series is no division by zero
_STILL = 1e-9  # features that vary less say nothing
_PRIOR_VALUES = 30.0  # values that the take as a whole counts for beside those near a gap, where deviations are checked
_CHECKED = 70  # known frames nearest to a gap on which the deviation is checked


@dataclass(frozen=True, eq=False)
class Features:
    """What is known in every frame.

    Attributes
    ----------
    linear : tuple of ndarray, shape (n_frames, n_values)
        Groups of values that the series may follow in proportion.
    smooth : tuple of ndarray, shape (n_frames, n_values)
        Groups that it may follow along any smooth curve.
    """

    linear: tuple[Floats, ...] = ()
    smooth: tuple[Floats, ...] = ()

    def at(self, frames: Ints) -> Features:
        """These features in some frames."""
        return Features(tuple(x[frames] for x in self.linear), tuple(x[frames] for x in self.smooth))

    def scaled(self, known: Ints) -> Features:
        """Each group centred and of mean square length 1 over the known rows."""
        return Features(tuple(_scaled(x, known) for x in self.linear), tuple(_scaled(x, known) for x in self.smooth))


@dataclass(frozen=True, eq=False)
class Series:
    """Values over time with what goes with them, in those frames that matter.

    Attributes
    ----------
    frames : ndarray of intp, shape (n,), rising
        Frames of the rows.
    values : ndarray, shape (n, n_axes), mm
        Finite; what is not known is ignored.
    features : Features
        In the same rows.
    """

    frames: Ints
    values: Floats
    features: Features


class TimeCovariance:
    """Covariances of two values by the time between them, one row per shape.

    Parameters
    ----------
    n_frames : int
        Frames of the take.
    rate : float, Hz
        Its frame rate.
    """

    def __init__(self, n_frames: int, rate: float) -> None:
        longest = int(_VANISHED * _DECAYS[-1] * rate) + 2
        lags = np.arange(min(n_frames, longest)) / rate
        rows = []
        for decay in _DECAYS:
            ratio = lags / decay
            rows += [np.exp(-ratio), (1.0 + ratio) * np.exp(-ratio)]
        for period in _PERIODS:
            rows.append(np.cos(2 * np.pi * lags / period) * np.exp(-0.5 * (lags / (_DAMPING * period)) ** 2))
        self.rate = rate
        self._rows = np.array(rows)

    def shapes(self, first: Ints, second: Ints) -> Floats:
        """Return each shape between all pairs of frames, shape (n_shapes, n_first, n_second).

        Parameters
        ----------
        first, second : ndarray of intp, shapes (n_first,) and (n_second,)
            Frames.
        """
        return np.asarray(self._rows[:, self._lags(first, second)])

    def sum(self, variances: Floats, first: Ints, second: Ints) -> Floats:
        """Return the sum of the shapes, each times its variance, shape (n_first, n_second).

        Parameters
        ----------
        variances : ndarray, shape (n_shapes,), mm^2
            From `fit_variances`.
        first, second : ndarray of intp, shapes (n_first,) and (n_second,)
            Frames.
        """
        return np.asarray((variances @ self._rows)[self._lags(first, second)])

    @property
    def n_shapes(self) -> int:
        """Number of shapes."""
        return len(self._rows)

    def _lags(self, first: Ints, second: Ints) -> Ints:
        return np.asarray(np.minimum(np.abs(first[:, np.newaxis] - second), self._rows.shape[1] - 1))


def needed_frames(known: Ints, targets: Ints, rate: float) -> Ints:
    """Return the frames that a prediction rests on or is made for, rising: a small part of a long take.

    Parameters
    ----------
    known, targets : ndarray of intp, rising
        Frames with a value, and those to predict.
    rate : float, Hz
        Frame rate.
    """
    near = [_around(known, targets[part]) for part in _gaps_together(targets, rate)]
    return np.unique(np.concatenate([learnt_frames(known), learnt_frames(known, _ANYWHERE_FRAMES), targets, *near]))


def learnt_frames(known: Ints, most: int = _LEARNT_FRAMES) -> Ints:
    """Return known frames in clusters all over the take.

    Parameters
    ----------
    known : ndarray of intp, rising
        Frames with a value.
    most : int
        Number of frames at most.
    """
    if len(known) <= most:
        return known
    starts = np.linspace(0, len(known) - 1 - _CLUSTER[-1], most // len(_CLUSTER)).astype(np.intp)
    return np.unique(known[starts[:, np.newaxis] + np.array(_CLUSTER)])


def fit_variances(series: Series, rows: Ints, time_covariance: TimeCovariance) -> Floats:
    """Estimate how much of a series' variance each shape contributes.

    Parameters
    ----------
    series : Series
        With scaled features.
    rows : ndarray of intp
        Known rows to learn from.
    time_covariance : TimeCovariance
        That of the take.

    Returns
    -------
    ndarray, shape (n_shapes,), mm^2
        Those of time, of features, and the noise last.
    """
    values = series.values[rows] - series.values[rows].mean(axis=0)
    variance = float((values**2).mean())
    inner, frames = series.features.at(rows), series.frames[rows]
    flat = time_covariance.shapes(frames, frames).reshape(time_covariance.n_shapes, -1)
    if inner.linear or inner.smooth:
        flat = np.concatenate([flat, _shapes(inner, inner).reshape(-1, flat.shape[1])])
    variances = np.full(len(flat) + 1, variance / (len(flat) + 1))
    if variance == 0.0:
        return variances
    diagonal = np.arange(len(rows))
    for _ in range(_ROUNDS):
        covariance = (variances[:-1] @ flat).reshape(len(rows), len(rows))
        covariance[diagonal, diagonal] += variances[-1] + _RIDGE * variance
        inverse = _inverse(covariance)
        weights = inverse @ values
        found = np.append(flat @ (weights @ weights.T).ravel(), (weights**2).sum()) / values.shape[1]
        expected = np.append(flat @ inverse.ravel(), np.trace(inverse))
        variances = variances * np.sqrt(np.maximum(found, 0.0) / np.maximum(expected, np.finfo(float).tiny))
    return variances


def predict(
    series: Series, known: Ints, targets: Ints, time_covariance: TimeCovariance, variances: Floats
) -> tuple[Floats, Floats]:
    """Predict a series in frames where it is not known.

    The deviation of the model is scaled by the errors that it makes where known values near the gap are predicted from
    all others.

    Parameters
    ----------
    series : Series
        With scaled features.
    known, targets : ndarray of intp, rising
        Frames with a value, and those to predict; those of `needed_frames` must be in the series.
    time_covariance : TimeCovariance
        That of the take.
    variances : ndarray, shape (n_shapes,), mm^2
        From `fit_variances`.

    Returns
    -------
    tuple of ndarray, shape (n_targets, n_axes), mm, and ndarray, shape (n_targets,), mm
        The values, and the standard deviation of each coordinate of what would have been measured.
    """
    values, deviation = np.empty((len(targets), series.values.shape[1])), np.empty(len(targets))
    anywhere = learnt_frames(known, _ANYWHERE_FRAMES)
    for part in _gaps_together(targets, time_covariance.rate):
        frames = np.union1d(_around(known, targets[part]), anywhere)
        rows, aims = np.searchsorted(series.frames, frames), np.searchsorted(series.frames, targets[part])
        values[part], deviation[part] = _predict_from(series, rows, aims, time_covariance, variances)
    return values, deviation


def left_out_errors(precision: Floats, values: Floats) -> Floats:
    """Return prediction errors in units of their predicted deviations, a few neighbouring values left out at a time.

    Parameters
    ----------
    precision : ndarray, shape (n, n), 1 / mm^2
        Inverse of the covariance of the values.
    values : ndarray, shape (n, n_axes), mm
        Their mean taken off.

    Returns
    -------
    ndarray, shape (n, n_axes)
    """
    weighted, size = precision @ values, len(_CLUSTER)
    whole = len(values) // size * size
    rows = np.arange(whole).reshape(-1, size)
    parts = [rows, np.arange(whole, len(values))[np.newaxis]] if whole < len(values) else [rows]
    found = np.empty_like(values)
    for part in parts:  # blocks of one size are inverted together
        inner = np.linalg.inv(precision[part[:, :, np.newaxis], part[:, np.newaxis]])
        spread = np.sqrt(np.diagonal(inner, axis1=1, axis2=2))
        found[part] = (inner @ weighted[part]) / spread[..., np.newaxis]
    return found


def _predict_from(
    series: Series, rows: Ints, targets: Ints, time_covariance: TimeCovariance, variances: Floats
) -> tuple[Floats, Floats]:
    frames, aims, n_times = series.frames[rows], series.frames[targets], time_covariance.n_shapes
    there, own = series.features.at(rows), series.features.at(targets)
    mean = series.values[rows].mean(axis=0)
    values = series.values[rows] - mean
    of_features, noise = variances[n_times:-1], float(variances[-1])
    among = time_covariance.sum(variances[:n_times], frames, frames) + _sum(of_features, there, there)
    diagonal = np.arange(len(rows))
    among[diagonal, diagonal] += noise + _RIDGE * max(float(variances.sum()), _LEAST_VARIANCE)
    towards = time_covariance.sum(variances[:n_times], aims, frames) + _sum(of_features, own, there)
    precision = _inverse(among)
    weights = precision @ towards.T
    groups = own.linear + own.smooth
    linear = sum(variance * (x**2).sum(axis=1) for variance, x in zip(of_features, groups, strict=False))
    total = variances[:n_times].sum() + (linear + of_features[len(groups) :].sum()) + noise
    variance = np.maximum(total - (weights * towards.T).sum(axis=0), noise)
    # How much larger errors near the gap are than predicted; where few values are near, the whole take counts.
    squares = (left_out_errors(precision, values) ** 2).mean(axis=1)
    away = np.maximum(np.maximum(aims[0] - frames, frames - aims[-1]), 0)
    near = squares[np.argsort(away, kind="stable")[:_CHECKED]]
    usual = max(float(squares.mean()), 1.0)
    factor = float(np.sqrt((_PRIOR_VALUES * usual + near.sum()) / (_PRIOR_VALUES + len(near))))
    return mean + weights.T @ values, factor * np.sqrt(variance)


def _inverse(covariance: Floats) -> Floats:
    """Inverse of a symmetric matrix: by Cholesky's factor if it is positive definite, which takes half the time."""
    factor, failed = dpotrf(covariance, lower=True)
    if failed:
        return np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    below, _ = dpotri(factor, lower=True)  # zeros above
    inverse = below + below.T
    inverse[np.diag_indices(len(below))] /= 2
    return np.asarray(inverse)


def _shapes(first: Features, second: Features) -> Floats:
    """Shapes of features: products of all groups, then bells over the smooth ones."""
    found = [a @ b.T for a, b in zip(first.linear + first.smooth, second.linear + second.smooth, strict=True)]
    for a, b in zip(first.smooth, second.smooth, strict=True):
        square = _squares(a, b)
        found += [np.exp(-0.5 * square / width**2) for width in _WIDTHS]
    return np.array(found)


def _sum(variances: Floats, first: Features, second: Features) -> Floats | float:
    """Sum of the shapes of features, each times its variance."""
    if not len(variances):
        return 0.0
    n_groups = len(first.linear + first.smooth)
    weighted = [variance * x for variance, x in zip(variances, first.linear + first.smooth, strict=False)]
    total = np.hstack(weighted) @ np.hstack(second.linear + second.smooth).T
    for index, (a, b) in enumerate(zip(first.smooth, second.smooth, strict=True)):
        square = _squares(a, b)
        for variance, width in zip(variances[n_groups + index * len(_WIDTHS) :], _WIDTHS, strict=False):
            if variance > 0.0:
                total += variance * np.exp(square / -(width**2) / 2)
    return np.asarray(total)


def _squares(first: Floats, second: Floats) -> Floats:
    square = (first**2).sum(axis=1)[:, np.newaxis] + (second**2).sum(axis=1) - 2 * first @ second.T
    return np.asarray(np.maximum(square, 0.0))


def _scaled(values: Floats, known: Ints) -> Floats:
    centred = values - values[known].mean(axis=0)
    size = float(np.sqrt((centred[known] ** 2).sum(axis=1).mean()))
    return np.asarray(centred / size if size > _STILL else np.zeros_like(centred))


def _around(known: Ints, targets: Ints) -> Ints:
    """Known frames about targets: all of the nearest, fewer of those farther away."""
    right = np.clip(np.searchsorted(targets, known), 1, max(len(targets) - 1, 1))
    away = np.abs(known - targets[np.minimum(right, len(targets) - 1)])
    away = np.minimum(away, np.abs(known - targets[right - 1]))
    order = np.argsort(away, kind="stable")[:_NEARER]
    return np.asarray(known[np.sort(np.concatenate([order[:_NEAREST], order[_NEAREST::_EVERY]]))])


def _gaps_together(targets: Ints, rate: float) -> list[slice]:
    """Cut targets into parts that span little time."""
    longest = max(int(_TOGETHER_SECONDS * rate), 1)
    parts, start = [], 0
    for index in range(1, len(targets) + 1):
        if index == len(targets) or targets[index] - targets[start] > longest:
            parts.append(slice(start, index))
            start = index
    return parts
