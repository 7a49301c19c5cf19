"""Distances of markers in frames that hide one of them, from few ways in which all distances vary.

Frames that show two markers are no random sample: a hand that the trunk hides in each stride is seen in the rest of it
only, so that each pair tells of other moments. Postures change all distances together, though, so that what is seen in
a frame tells its posture, and the posture what is hidden: principal components with missing values, found by turns of
ridge regressions (Tipping and Bishop, J. R. Statist. Soc. B 61 (1999) 611-622; Ilin and Raiko, J. Mach. Learn. Res. 11
(2010) 1957-2000). Hidden distances of a rigid limb are its usual ones.
"""

import numpy as np

from skelgen.model.arrays import Bools, Floats

WAYS, TURNS = 3, 12
"""Ways in which distances vary, and turns in which ways and postures are found."""

LEAST_FRAMES = 3 * WAYS
"""Of fewer frames nothing is found."""

LOADING = 0.1
"""Standard deviation of what a way does to the logarithm of a distance: what a person's postures do."""

RESIDUAL, COUNTS = 0.03, 3
"""Standard deviation of what ways leave of the logarithm of a distance, and how many frames that is worth: of the few
frames that show both, ways explain more than of others."""

STEADY = 1e-4
"""Standard deviation of scores that are alike in all frames."""


def with_hidden(lengths: Floats) -> tuple[Floats, Floats]:
    """Return distances with those that are hidden, and the variance of what is not known of each pair's.

    Parameters
    ----------
    lengths : ndarray, shape (n_frames, n_pairs), mm
        More than zero; NaN where a frame hides one of both.

    Returns
    -------
    lengths : ndarray, shape (n_frames, n_pairs), mm
        NaN for pairs that no frame shows, and where frames are too few to tell.
    variances : ndarray, shape (n_pairs,)
        Of the logarithms of those that are hidden, about what is returned.
    """
    seen = np.isfinite(lengths)
    if len(lengths) < LEAST_FRAMES:
        return lengths, np.zeros(lengths.shape[1])
    logarithms = np.log(np.where(seen, lengths, 1.0))
    usual, variances = _explained(logarithms, seen)
    completed = np.where(seen | ~seen.any(axis=0), lengths, np.exp(usual))
    return completed, variances


def _explained(logarithms: Floats, seen: Bools) -> tuple[Floats, Floats]:
    """What ways explain of logarithms, shape (n_frames, n_pairs), and the variance of what they leave (n_pairs,)."""
    weight, count = seen.astype(np.float64), np.maximum(seen.sum(axis=0), 1)
    values = logarithms * weight
    postures = _first_postures(np.where(seen, logarithms - values.sum(axis=0) / count, 0.0))
    variances = np.full(len(count), RESIDUAL**2)
    prior = np.diag([0.0] + [LOADING**-2.0] * WAYS)
    for _ in range(TURNS):
        known = np.column_stack([np.ones(len(postures)), postures])
        ways = _solved(weight.T @ _squares(known) + variances[:, np.newaxis] * prior.ravel(), values.T @ known)
        left = values - (known @ ways.T) * weight
        variances = ((left**2).sum(axis=0) + COUNTS * RESIDUAL**2) / (count + COUNTS)
        loadings, away = ways[:, 1:] / variances[:, np.newaxis], (values - ways[:, 0] * weight)
        information = weight @ _squares(ways[:, 1:] / np.sqrt(variances)[:, np.newaxis])
        postures = _standardised(_solved(information + np.eye(WAYS).ravel(), away @ loadings))
    return np.column_stack([np.ones(len(postures)), postures]) @ ways.T, variances


def _first_postures(away: Floats) -> Floats:
    """Scores of the largest principal components where what is hidden is as usual, shape (n_frames, WAYS)."""
    vectors = np.linalg.eigh(away @ away.T)[1]
    return np.asarray(vectors[:, : -WAYS - 1 : -1] * np.sqrt(len(away)))


def _squares(rows: Floats) -> Floats:
    """Each row times itself, shape (n_rows, n * n)."""
    return np.asarray((rows[:, :, np.newaxis] * rows[:, np.newaxis]).reshape(len(rows), -1))


def _solved(information: Floats, right: Floats) -> Floats:
    """Solutions of many small systems, shape (n_systems, n); where nothing is seen they are zero."""
    size = right.shape[1]
    matrices = information.reshape(-1, size, size)
    matrices[:, np.arange(size), np.arange(size)] += np.where(matrices[:, 0, 0] > 0, 0.0, 1.0)[:, np.newaxis]
    return np.asarray(np.linalg.solve(matrices, right[..., np.newaxis])[..., 0])


def _standardised(postures: Floats) -> Floats:
    """Postures of mean zero and variance one in each way."""
    centred = postures - postures.mean(axis=0)
    return np.asarray(centred / np.maximum(centred.std(axis=0), STEADY))
