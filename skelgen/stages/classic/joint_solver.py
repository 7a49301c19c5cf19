"""One joint the classic way: conjugate gradients on the joint cost, then each frame on its own (Schönauer 2007, 4.4).

With four or five markers the descent may end where all frames agree on wrong distances. A joint whose distances vary by
more than noise is sought again, from distances that fit all frames (`lateration`); the better end counts.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.ball_joint import mean_distances
from skelgen.model.arrays import Floats
from skelgen.stages.classic.conjugate_gradients import minimise
from skelgen.stages.classic.joint_cost import (
    joint_cost,
    joint_curvature,
    local_optimum,
    place_at_distances,
    place_between,
)
from skelgen.stages.classic.lateration import common_distances
from skelgen.stages.classic.line_search import brent_step
from skelgen.stages.classic.parameters import DescentParameters

STUCK = 2.0
"""Times the noise: a larger mean variance of the distances says that the descent is stuck or that there is none."""

HOLDING = 4
"""Markers that hold a joint in place (Schönauer 2007, 3.5)."""

LEAST_HELD = 20
"""Frames with so many markers, or all frames are used."""

N_RESTARTS = 2
"""Sets of distances from which a stuck joint is sought again."""


@dataclass(frozen=True, eq=False)
class JointSolution:
    """A joint in every frame.

    Attributes
    ----------
    positions : ndarray, shape (n_frames, 3), mm
        World positions.
    distances, spreads : ndarray, shape (n_markers,), mm
        Mean and standard deviation of the distance to each marker of both limbs.
    n_iterations : int
        Iterations of all descents.
    """

    positions: Floats
    distances: Floats
    spreads: Floats
    n_iterations: int

    @property
    def variance(self) -> float:
        """Mean variance of the distances [mm^2]."""
        return float((self.spreads**2).mean())


@dataclass(frozen=True, eq=False)
class JointSolver:
    """How joints are found.

    Attributes
    ----------
    descent : DescentParameters
        The conjugate gradients.
    max_residual : float, mm^2
        Mean squared error of the distances above which a frame is solved again.
    max_fallback : int
        From how many frames back it may start then.
    noise : float, mm^2
        Variance of a marker's coordinate.
    seed : int
        Seed of annealing and of restarts.
    """

    descent: DescentParameters
    max_residual: float
    max_fallback: int
    noise: float
    seed: int

    def solve(self, first: Floats, second: Floats, alpha: float, distances: Floats | None = None) -> JointSolution:
        """Find the joint between two limbs.

        Parameters
        ----------
        first, second : ndarray, shape (n_frames, n_markers, 3), mm
            Markers of both limbs, NaN where unseen; each frame shows some of both.
        alpha : float, mm
            Weight of the mean distance.
        distances : ndarray, shape (n_markers,), mm, optional
            Mean distances to all markers from an earlier solution: local optimisation makes the start of them. Without
            them the descent starts half-way between both limbs.
        """
        markers = np.concatenate([first, second], axis=1)
        # Three distances are met on both sides of their markers: such frames say nothing of the joint
        held = (~np.isnan(markers[:, :, 0])).sum(axis=1) >= min(HOLDING, markers.shape[1])
        if held.all() or held.sum() < LEAST_HELD:
            return self._search(first, second, alpha, distances)
        found = self._search(first[held], second[held], alpha, distances)
        return replace(found, positions=place_between(found.positions, held, markers, found.distances))

    def _search(self, first: Floats, second: Floats, alpha: float, distances: Floats | None) -> JointSolution:
        markers = np.concatenate([first, second], axis=1)
        middle = (np.nanmean(first, axis=1) + np.nanmean(second, axis=1)) / 2
        start = middle if distances is None else place_at_distances(markers, distances)
        found = self._descended(start, markers, alpha)
        if found.variance <= STUCK * self.noise:
            return found
        four, sets = common_distances(first, second, N_RESTARTS, self.seed)
        # Four markers say where the joint is in each frame, and that how far it is from all
        rough = [place_at_distances(markers[:, four], one) for one in sets]
        starts = [place_at_distances(markers, mean_distances(*contiguous(one, markers))[0]) for one in rough]
        again = [self._at(start, markers) for start in starts]
        best = min(again, key=lambda solution: solution.variance, default=found)
        if best.variance >= found.variance:
            return found
        best = self._descended(best.positions, markers, alpha)
        n_iterations = found.n_iterations + best.n_iterations
        return replace(min(found, best, key=lambda solution: solution.variance), n_iterations=n_iterations)

    def _descended(self, start: Floats, markers: Floats, alpha: float) -> JointSolution:
        """Minimise the joint cost from a start, then place each frame on its own."""
        cost, curvature = joint_cost(markers, alpha), joint_curvature(markers)
        found = minimise(cost, start, self.descent, self.seed, search=brent_step, precondition=curvature)
        positions = local_optimum(found.point, markers, self.max_residual, self.max_fallback)
        return self._at(positions, markers, found.n_iterations)

    @staticmethod
    def _at(positions: Floats, markers: Floats, n_iterations: int = 0) -> JointSolution:
        return JointSolution(positions, *mean_distances(*contiguous(positions, markers)), n_iterations)
