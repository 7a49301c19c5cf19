"""Which markers explain which points: pairs with scores, few of all that could be."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels.explained_points import explained_points
from skelgen.model.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Explanations:
    """How well markers explain points: those that explain a point at all, point after point.

    Attributes
    ----------
    points, markers : ndarray of intp, shape (n,)
        Pairs in rising order, each at most once.
    scores : ndarray of float32, shape (n,)
        Of each pair, 1 - (distance / gate)^2 or what is stated, above 0.
    n_points, n_markers : int
        Of how many points and markers.
    """

    points: Ints
    markers: Ints
    scores: NDArray[np.float32]
    n_points: int
    n_markers: int

    @property
    def best(self) -> Ints:
        """The marker that explains each point best, -1 for none, shape (n_points,); of equal ones the first."""
        most = np.zeros(self.n_points, dtype=np.float32)
        np.maximum.at(most, self.points, self.scores)
        is_best = np.flatnonzero(self.scores == most[self.points])[::-1]
        best = np.full(self.n_points, -1, dtype=np.intp)
        best[self.points[is_best]] = self.markers[is_best]  # of several the last that is written, the first marker
        return best

    def weighted(self, weights: Floats) -> Explanations:
        """Return them with the scores of each point multiplied by its weight, shape (n_points,)."""
        return replace(self, scores=(self.scores * weights[self.points]).astype(np.float32))

    def kept(self, keep: Bools) -> Explanations:
        """Return those for which `keep` holds, shape (n,)."""
        return replace(self, points=self.points[keep], markers=self.markers[keep], scores=self.scores[keep])

    def with_pairs(self, points: Ints, markers: Ints, score: float) -> Explanations:
        """Return them with pairs added that are not there yet, all with one score.

        Parameters
        ----------
        points, markers : ndarray of intp, shape (n_added,)
            The pairs.
        score : float
            Their score.
        """
        if not len(points):
            return self
        both = np.concatenate([self.points, points]), np.concatenate([self.markers, markers])
        scores = np.concatenate([self.scores, np.full(len(points), score, dtype=np.float32)])
        order = np.argsort(both[0] * self.n_markers + both[1], kind="stable")
        return replace(self, points=both[0][order], markers=both[1][order], scores=scores[order])


def explain_points(points: Floats, frames: Ints, predicted: Floats, gates: Floats) -> Explanations:
    """Find the markers that explain each point: those whose predicted places are within their gates.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Measured points.
    frames : ndarray of intp, shape (n_points,)
        Frame of each.
    predicted : ndarray, shape (n_frames, n_markers, 3), mm
        Where markers must be; NaN where nothing is known.
    gates : ndarray, shape (n_frames, n_markers), mm
        Largest distances that are explained, above 0.
    """
    return Explanations(*explained_points(points, frames, predicted, gates), len(points), predicted.shape[1])
