"""k-means by local search: centres are swapped for points, with or without Lloyd's steps after each swap.

The heuristics of kmlocal, which the thesis uses (Kanungo et al. 2002, A local search approximation algorithm for
k-means clustering; Schönauer 2007, 4.3 and table 4.15).
"""

import numpy as np

from skelgen.model.arrays import Floats, Ints

HEURISTICS = ("swap", "hybrid", "local-hybrid")

N_SWAPS = 500
"""Swaps that are tried: some ten for each marker of a body."""

LLOYD_STEPS = 10
FIRST_TEMPERATURE = 0.1
"""Of the distortion: what a swap of the hybrid may make worse in the beginning."""


def local_kmeans(rows: Floats, k: int, heuristic: str, seed: int) -> Ints:
    """Cluster points by k centres, improved by swaps.

    Parameters
    ----------
    rows : ndarray, shape (n_points, n_dimensions)
        The points.
    k : int
        Number of clusters.
    heuristic : str
        ``swap`` keeps swaps that lower the distortion; ``local-hybrid`` moves all centres by Lloyd's steps after each
        swap; ``hybrid`` does that too, and accepts worse ones at first, less and less.
    seed : int
        Of the swaps.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Cluster of each point.
    """
    random = np.random.default_rng(seed)
    centres = rows[random.choice(len(rows), k, replace=False)]
    distortion = _distortion(rows, centres)
    best, least = centres, distortion
    for swap in range(N_SWAPS):
        tried = centres.copy()
        tried[random.integers(k)] = rows[random.integers(len(rows))]
        if heuristic != "swap":
            tried = _lloyd(rows, tried)
        new = _distortion(rows, tried)
        worse = new - distortion
        allowed = FIRST_TEMPERATURE * least * (1 - swap / N_SWAPS) if heuristic == "hybrid" else 0.0
        if worse <= 0 or (allowed > 0 and random.random() < np.exp(-worse / allowed)):
            centres, distortion = tried, new
        if distortion < least:
            best, least = centres, distortion
    return _nearest(rows, best)


def _lloyd(rows: Floats, centres: Floats) -> Floats:
    """Move each centre to the mean of its points, until none moves or the steps are done."""
    for _ in range(LLOYD_STEPS):
        member = _nearest(rows, centres)[:, np.newaxis] == np.arange(len(centres))
        count = member.sum(axis=0)[:, np.newaxis]
        moved = np.where(count > 0, member.T @ rows / np.maximum(count, 1), centres)
        if np.array_equal(moved, centres):
            break
        centres = moved
    return centres


def _nearest(rows: Floats, centres: Floats) -> Ints:
    return np.asarray(_squares(rows, centres).argmin(axis=1), dtype=np.intp)


def _distortion(rows: Floats, centres: Floats) -> float:
    return float(_squares(rows, centres).min(axis=1).sum())


def _squares(rows: Floats, centres: Floats) -> Floats:
    return np.asarray(((rows[:, np.newaxis] - centres) ** 2).sum(axis=2))
