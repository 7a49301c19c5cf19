"""One joint between two limbs: by the strongest method that the limbs' markers allow.

Two limbs with poses have a closed form. A limb with too few markers for a pose is seen from the other as points on
spheres. Two such limbs are left to the joint cost and its conjugate gradients, with a joint position in every frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import Rotator, rotation_by_quaternion
from skelgen.kinematics.ball import fit_fixed_point
from skelgen.kinematics.shape import LimbShape, fit_shape
from skelgen.kinematics.sphere import fit_sphere
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.joints.conjugate_gradient import minimise
from skelgen.stages.joints.cost import joint_cost, local_optimum, mean_distances
from skelgen.stages.joints.parameters import JointParameters

FREE_COORDINATES = 3
"""A joint that is free in every frame explains three of its distances to markers by itself."""

MIN_COMMON = 5
"""Frames that must show both limbs before a joint between them can be judged."""

NEARLY_COINCIDENT = 4.0
"""Half the images' distance squared: the midpoint of two images is off each by half their gap."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A limb with what is known of it: its markers, then the joints found so far.

    Attributes
    ----------
    points : ndarray, shape (n_frames, n_points, 3), mm
        World positions, NaN where unseen.
    n_markers : int
        The first points are markers, the rest are joints.
    shape : LimbShape
        Rigid shape and poses, where the points suffice.
    """

    points: Floats
    n_markers: int
    shape: LimbShape

    @property
    def markers(self) -> Floats:
        """World positions of the markers, shape (n_frames, n_markers, 3)."""
        return self.points[:, : self.n_markers]

    @property
    def centre(self) -> Floats:
        """Centroid of the markers in the limb's frame [mm]; undetermined joints lean there."""
        return np.asarray(self.shape.points[: self.n_markers].mean(axis=0))

    def with_joint(self, joint: Floats, frames: Ints, rotator: Rotator = rotation_by_quaternion) -> Segment:
        """Return the segment with the world positions of one more joint, shape (n_frames, 3), among its points."""
        points = np.concatenate([self.points, joint[:, np.newaxis]], axis=1)
        return Segment(points, self.n_markers, fit_shape(points, frames, rotator))


def make_segment(markers: Floats, frames: Ints, rotator: Rotator = rotation_by_quaternion) -> Segment:
    """Make a segment of a limb's markers, shape (n_frames, n_markers, 3)."""
    return Segment(markers, markers.shape[1], fit_shape(markers, frames, rotator))


@dataclass(frozen=True, eq=False)
class JointGuess:
    """A joint between two segments.

    Attributes
    ----------
    positions : ndarray, shape (n_frames, 3), mm
        World positions, NaN where neither limb tells.
    cost : float, mm^2
        Comparable between pairs: how far the joint is from being fixed in both limbs, plus alpha times its mean
        distance from the markers; infinite if the limbs are never seen together.
    n_iterations : int
        Iterations of the descent, 0 for closed forms.
    """

    positions: Floats
    cost: float
    n_iterations: int = 0


def guess_joint(first: Segment, second: Segment, alpha: float, parameters: JointParameters, seed: int) -> JointGuess:
    """Find the joint between two segments; the solver is the parameters' choice where both limbs have poses."""
    guess = None
    if parameters.solver == "closed-form":
        guess = _from_poses(first, second) or _from_sphere(first, second) or _from_sphere(second, first)
    if guess is None:
        guess = _from_descent(first, second, alpha, parameters, seed)
    if not np.isfinite(guess.cost):
        return guess
    markers = np.concatenate([first.markers, second.markers], axis=1)
    distances, _ = mean_distances(guess.positions, markers)
    return JointGuess(guess.positions, guess.cost + alpha * float(distances.mean()), guess.n_iterations)


def images(shape: LimbShape, point: Floats) -> Floats:
    """World positions of a point of a limb's frame, shape (n_frames, 3); NaN without a pose."""
    poses = shape.world_from_limb
    return np.asarray(poses[:, :3, :3] @ point + poses[:, :3, 3])


def _from_poses(first: Segment, second: Segment) -> JointGuess | None:
    fit = fit_fixed_point(first.shape.world_from_limb, second.shape.world_from_limb, first.centre, second.centre)
    if fit is None:
        return None
    both = np.stack([images(first.shape, fit.in_first), images(second.shape, fit.in_second)])
    return JointGuess(_mean_of_known(both), fit.gap / NEARLY_COINCIDENT)


def _from_sphere(body: Segment, other: Segment) -> JointGuess | None:
    if not body.shape.has_pose:
        return None
    fit = fit_sphere(body.shape.world_from_limb, other.points, body.centre)
    return None if fit is None else JointGuess(images(body.shape, fit.centre), fit.variance)


def _from_descent(first: Segment, second: Segment, alpha: float, parameters: JointParameters, seed: int) -> JointGuess:
    points = np.concatenate([first.points, second.points], axis=1)
    centres = np.stack([_centroid(first.points), _centroid(second.points)])
    usable = ~np.isnan(centres[:, :, 0]).any(axis=0)
    nowhere = np.full((len(points), 3), np.nan)
    if usable.sum() < MIN_COMMON:
        return JointGuess(nowhere, np.inf)
    start = np.asarray(centres[:, usable].mean(axis=0))
    found = minimise(joint_cost(points[usable], alpha), start, parameters, seed)
    refined = local_optimum(found.point, points[usable], parameters)
    _, spread = mean_distances(refined, points[usable])
    n_points = points.shape[1]
    nowhere[usable] = refined
    freedom = n_points / max(n_points - FREE_COORDINATES, 0.5)
    return JointGuess(nowhere, float((spread**2).mean()) * freedom, found.n_iterations)


def _centroid(points: Floats) -> Floats:
    seen = ~np.isnan(points[:, :, :1])
    count = seen.sum(axis=1)
    total = np.where(seen, points, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _mean_of_known(both: Floats) -> Floats:
    known = ~np.isnan(both[:, :, :1])
    count = known.sum(axis=0)
    total = np.where(known, both, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
