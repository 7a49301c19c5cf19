r"""One joint the classic way: conjugate gradients on the joint cost, then each frame on its own (Schönauer 2007, 4.4).

The joint cost says how constant the distances from a joint to the markers of its two limbs are (Schönauer 2007, 3.5):

.. math::
    jc = \frac1n \sum_m \left[ \frac1{|F_m|} \sum_{f \in F_m} (d_{mf} - \bar d_m)^2 + \alpha\, \bar d_m \right],
    \qquad d_{mf} = |c_f - x_{mf}|

with one joint position :math:`c_f` per frame, the n markers of both limbs, and the frames :math:`F_m` that show
marker m. `conjugate_gradients` minimises it over all frames; `local_optimum` places the joint frame by frame.

With four or five markers the descent may end where all frames agree on wrong distances. A joint whose distances vary by
more than noise is sought again, from distances that fit all frames (`lateration`); the better end counts.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.ball_joint import joint_cost as cost_and_gradient
from skelgen._kernels.ball_joint import mean_distances, multilaterated
from skelgen.model.arrays import Bools, Floats
from skelgen.stages.classic.conjugate_gradients import (
    DescentParameters,
    Objective,
    Precondition,
    Scaling,
    brent_step,
    minimise,
)
from skelgen.stages.classic.lateration import common_distances

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


TINY = 1e-12
"""mm; keeps the gradient finite for a joint that sits on a marker."""

LOCAL_STEPS = 30
FLATNESS = 1e-4
"""Of the markers' scatter: flatter ones do not say how far from their plane a joint is."""

STIFFNESS = 0.03
"""Of a frame's mean curvature: what is added along directions in which its markers hardly hold the joint."""


def joint_cost(markers: Floats, alpha: float) -> Objective:
    """Return the joint cost as a function of the joint's positions.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    alpha : float
        Weight of the mean distance [mm].

    Returns
    -------
    callable
        Takes positions [mm], shape (n_frames, 3); returns cost [mm^2] and gradient [mm], shape (n_frames, 3).
    """
    seen = ~np.isnan(markers[:, :, 0])
    filled, weights = contiguous(np.where(seen[..., np.newaxis], markers, 0.0), seen / np.maximum(seen.sum(axis=0), 1))

    def cost(joint: Floats) -> tuple[float, Floats]:
        gradient = np.empty(joint.shape)
        (place,) = contiguous(joint)
        return cost_and_gradient(place, filled, weights, float(alpha), gradient), gradient

    return cost


def joint_curvature(markers: Floats) -> Precondition:
    """Return what scales the gradient of the joint cost: each frame's own curvature, the means held.

    Frames are coupled by the mean distances alone: scaled like this, the cost is a bowl but for one direction a marker.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.

    Returns
    -------
    callable
        Takes positions [mm], shape (n_frames, 3); returns a function that scales a gradient of that shape.
    """
    seen = ~np.isnan(markers[:, :, 0])
    filled = np.where(seen[..., np.newaxis], markers, 0.0)
    weight = 2 * seen / np.maximum(seen.sum(axis=0), 1) / max(int(seen.any(axis=0).sum()), 1)

    def scaling(joint: Floats) -> Scaling:
        offset = joint[:, np.newaxis] - filled
        unit = offset / (np.linalg.norm(offset, axis=2, keepdims=True) + TINY)
        curvature = np.einsum("fm,fmi,fmj->fij", weight, unit, unit)
        mean = np.trace(curvature, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] / 3
        inverse = np.linalg.inv(curvature + (STIFFNESS * mean + TINY) * np.eye(3))
        return lambda gradient: np.einsum("fij,fj->fi", inverse, gradient)

    return scaling


def local_optimum(joint: Floats, markers: Floats, max_residual: float, max_fallback: int) -> Floats:
    """Move the joint in every frame to where its distances to the markers are nearest to their means.

    This is the local optimisation of Schönauer (2007, 3.5.2). The frames are independent: all are solved at once by
    damped Gauss-Newton steps on three unknowns each. A frame that ends above `max_residual` is tried again from the
    positions of up to `max_fallback` earlier frames.

    Parameters
    ----------
    joint : ndarray, shape (n_frames, 3), mm
        Positions from the global optimisation.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    max_residual : float, mm^2
        Mean squared error of the distances above which a frame is solved again.
    max_fallback : int
        From how many frames back it may start then.
    """
    radii, _ = mean_distances(*contiguous(joint, markers))
    solved, cost = _multilaterate(joint, markers, radii)
    for back in range(1, max_fallback + 1):
        bad = np.flatnonzero(cost > max_residual)
        bad = bad[bad >= back]
        if not len(bad):
            break
        again, new_cost = _multilaterate(solved[bad - back], markers[bad], radii)
        better = new_cost < cost[bad]
        solved[bad[better]], cost[bad[better]] = again[better], new_cost[better]
    return solved


def place_at_distances(markers: Floats, distances: Floats) -> Floats:
    """Place the joint in every frame at given distances from the markers, on the side of them that fits better.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen; each frame shows some.
    distances : ndarray, shape (n_markers,), mm
        Distances to the markers.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
    """
    tried = [_multilaterate(start, markers, distances) for start in _starts_at_distances(markers, distances)]
    points, costs = (np.stack(values) for values in zip(*tried, strict=True))
    best = costs.argmin(axis=0)[np.newaxis, :, np.newaxis]
    return np.asarray(np.take_along_axis(points, best, axis=0)[0])


def place_between(held_positions: Floats, held: Bools, markers: Floats, distances: Floats) -> Floats:
    """Place the joint in the other frames, too: at its distances, nearest to where it is between held frames.

    Parameters
    ----------
    held_positions : ndarray, shape (n_held, 3), mm
        Where the joint is in frames that hold it.
    held : ndarray of bool, shape (n_frames,)
        Which frames these are.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    distances : ndarray, shape (n_markers,), mm
        Distances to the markers.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
    """
    known, every = np.flatnonzero(held), np.arange(len(held))
    between = np.column_stack([np.interp(every, known, column) for column in held_positions.T])
    between[~held], _ = _multilaterate(between[~held], markers[~held], distances)
    return between


def _starts_at_distances(markers: Floats, distances: Floats) -> tuple[Floats, Floats, Floats]:
    """The point at which differences of squared distances fit best, and the two above and below the markers' plane."""
    seen = ~np.isnan(markers[:, :, :1])
    centre = np.nanmean(markers, axis=1)
    offset = np.where(seen, markers - centre[:, np.newaxis], 0.0)
    scatter = offset.swapaxes(1, 2) @ offset
    squares = (offset**2).sum(axis=2) - distances**2
    size = np.trace(scatter, axis1=1, axis2=2)[:, np.newaxis, np.newaxis]
    flat = scatter + (FLATNESS * size + TINY) * np.eye(3)
    point = np.linalg.solve(flat, np.einsum("fmi,fm->fi", offset, squares)[..., np.newaxis])[..., 0] / 2
    normal = np.linalg.eigh(scatter)[1][:, :, 0]
    inside = point - (point * normal).sum(axis=1, keepdims=True) * normal
    away = distances**2 - ((inside[:, np.newaxis] - offset) ** 2).sum(axis=2)
    height = np.sqrt(np.maximum(np.nanmean(np.where(seen[..., 0], away, np.nan), axis=1), 0.0))[:, np.newaxis] * normal
    return centre + point, centre + inside + height, centre + inside - height


def _multilaterate(joint: Floats, markers: Floats, radii: Floats) -> tuple[Floats, Floats]:
    """Positions and mean squared distance error [mm^2] per frame."""
    point = np.array(joint, order="C")
    markers, radii = contiguous(markers, radii)
    return point, multilaterated(point, markers, radii, LOCAL_STEPS)
