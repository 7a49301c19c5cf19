r"""The number of clusters from the alignment of eigenvectors (Zelnik-Manor and Perona 2004, self-tuning clustering).

With the right number k the rows of the k leading eigenvectors X, turned by a rotation R, lie on the axes: each has one
entry that is not zero. The rotation minimises

.. math::
    J = \sum_{i,c} \frac{Z_{ic}^2}{\max_c Z_{ic}^2}, \qquad Z = X R,

which is n for perfect alignment. R is a product of rotations in the planes of two axes; they are improved one after the
other, and k + 1 starts from the alignment of k. The largest k whose alignment is all but the best is the number.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from skelgen.model.arrays import Floats

AS_GOOD = 0.001
"""Alignments that differ by less are alike; the paper's value."""

SWEEPS = 3
"""Turns through all planes for each k: the start is near, more change nothing."""

ANGLES = np.linspace(-np.pi / 4, np.pi / 4, 17)
"""Rotations tried in a plane, rad: beyond an eighth of a turn the axes only change places."""

TINY = 1e-300


def aligned_count(vectors: Floats) -> int:
    """Return the number of clusters that aligns eigenvectors best.

    Parameters
    ----------
    vectors : ndarray, shape (n_markers, n_vectors)
        Eigenvectors of the normalised affinity, the leading one first.
    """
    n_markers, largest = len(vectors), max(1, min(vectors.shape[1], len(vectors) // 2))
    quality = [1.0 - _spread(vectors[:, :1]) / n_markers]
    turned = vectors[:, :1]
    for k in range(2, largest + 1):
        turned = _turned(np.column_stack([turned, vectors[:, k - 1]]))
        quality.append(1.0 - (_spread(turned) / n_markers - 1.0) / k)
    best = max(quality[1:], default=0.0)
    good = [k for k in range(2, largest + 1) if quality[k - 1] > best - AS_GOOD]
    return max(good, default=1)


def _turned(columns: Floats) -> Floats:
    """Turn columns in all planes so that each row has one large entry."""
    columns = columns.copy()
    for _ in range(SWEEPS):
        squares = columns**2
        for first, second in combinations(range(columns.shape[1]), 2):
            others = np.delete(squares, (first, second), axis=1)
            rest, largest = others.sum(axis=1), others.max(axis=1, initial=0.0)
            pair = columns[:, [first, second]]
            angle = _best_angle(pair, rest, largest)
            if angle != 0.0:
                columns[:, [first, second]] = pair @ _rotation(angle)
                squares[:, [first, second]] = columns[:, [first, second]] ** 2
    return columns


def _best_angle(pair: Floats, rest: Floats, largest: Floats) -> float:
    """Angle that aligns two columns best, given the sum and the largest of the other squares in each row."""
    scale = (pair**2).sum(axis=1) + rest
    one = (pair[:, :1] * np.cos(ANGLES) + pair[:, 1:] * np.sin(ANGLES)) ** 2
    two = (pair**2).sum(axis=1, keepdims=True) - one
    peak = np.maximum(np.maximum(one, two), largest[:, np.newaxis])
    costs = (scale[:, np.newaxis] / np.maximum(peak, TINY)).sum(axis=0)
    best = int(np.argmin(costs))
    gain = costs[len(ANGLES) // 2] - costs[best]
    return float(ANGLES[best]) if gain > 0 else 0.0


def _rotation(angle: float) -> Floats:
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def _spread(columns: Floats) -> float:
    squares = columns**2
    return float((squares.sum(axis=1) / np.maximum(squares.max(axis=1), TINY)).sum())
