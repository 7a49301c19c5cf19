"""How far a limb's pose may be wrong: from what its markers leave unexplained, frame by frame of what is seen of them.

A joint between two limbs is judged against this noise: the gap of a true joint is explained by it, whether its limbs
carry three markers near to each other or ten far apart, and whether the joint is near or far from them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import Rotator, rotation_by_quaternion
from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.bodies.shape import LimbShape, distinct_rows, fit_shape
from skelgen.model.arrays import Bools, Floats, Ints

LEAST_FREEDOMS = 30
"""Residual coordinates, beyond what the poses and the shape use up, from which a limb's noise is told."""

FREE_OF_POSE = 6

ENOUGH_FRAMES = 50
"""Frames with both limbs below which more are looked for, in the whole take and by other ways."""


@dataclass(frozen=True, eq=False)
class PoseNoise:
    """What is known of the errors of a limb's poses.

    Attributes
    ----------
    variance : float, mm^2
        Of each coordinate of a marker about its place on the limb; NaN where too few residuals tell.
    covariances : ndarray, shape (n_patterns, 6, 6)
        Of shift and turn in the limb's frame for unit noise, for each set of points that is seen together.
    pattern : ndarray of intp, shape (n_frames,)
        Which of these a frame shows; -1 without a pose.
    """

    variance: float
    covariances: Floats
    pattern: Ints

    def of_point(self, point: Floats) -> Floats:
        """Variance of a coordinate, for unit noise, of the world position of a point of the limb, shape (n_frames,).

        NaN in frames without a pose.
        """
        x, y, z = point.tolist()
        slopes = np.array([[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, x], [0, 0, 1, y, -x, 0]], dtype=np.float64)
        return np.append(((slopes @ self.covariances) * slopes).sum(axis=(1, 2)) / 3, np.nan)[self.pattern]

    def shares(self, weights: Floats) -> Floats:
        """Parts of the weights of frames that each set of points has, shape (n_patterns,); 0 without a pose."""
        counted = np.bincount(self.pattern + 1, weights, len(self.covariances) + 1)
        return np.asarray(counted[1:] / weights.sum())

    def of_turn(self, shares: Floats) -> float:
        """Mean variance [rad^2] of a turn about each axis for unit noise, of `shares` of frames."""
        return float(shares @ np.trace(self.covariances[:, 3:, 3:], axis1=1, axis2=2)) / 3

    def of_turn_across(self, axis: Floats, shares: Floats) -> float:
        """Mean variance [rad^2] of turns about the two axes across one, together, of `shares` of frames."""
        turns = self.covariances[:, 3:, 3:]
        return float(shares @ (np.trace(turns, axis1=1, axis2=2) - turns @ axis @ axis))

    def at(self, frames: Ints) -> PoseNoise:
        """These poses in some frames."""
        return PoseNoise(self.variance, self.covariances, self.pattern[frames])


def pose_noise(shape: LimbShape, points: Floats, frames: Ints) -> PoseNoise:
    """Return the noise of a limb's poses.

    Parameters
    ----------
    shape : LimbShape
        The limb's shape and poses.
    points : ndarray, shape (n_frames, n_points, 3), mm
        The points to which the poses were fitted, NaN where unseen.
    frames : ndarray of intp
        Frames that tell the noise.
    """
    posed = shape.posed
    pattern = np.full(len(points), -1, dtype=np.intp)
    if not posed.any():
        return PoseNoise(np.nan, np.zeros((0, 6, 6)), pattern)
    seen = ~np.isnan(points[posed, :, 0])
    sets, pattern[posed] = distinct_rows(seen)
    slopes = np.concatenate([np.tile(np.eye(3), (len(shape.points), 1, 1)), -cross_matrix(shape.points)], axis=2)
    information = np.tensordot(sets.astype(np.float64), slopes.swapaxes(1, 2) @ slopes, 1)
    return PoseNoise(_variance(shape, points, frames), np.linalg.inv(information), pattern)


def _variance(shape: LimbShape, points: Floats, frames: Ints) -> float:
    frames = frames[shape.posed[frames]]
    poses, sampled = shape.world_from_limb[frames], points[frames]
    seen = ~np.isnan(sampled[:, :, 0])
    modelled = shape.points @ poses[:, :3, :3].swapaxes(1, 2) + poses[:, np.newaxis, :3, 3]
    squares = ((sampled - modelled)[seen] ** 2).sum()
    known_points = int(seen.any(axis=0).sum())
    freedoms = 3 * int(seen.sum()) - FREE_OF_POSE * len(seen) - (3 * known_points - FREE_OF_POSE)
    return float(squares / freedoms) if freedoms >= LEAST_FREEDOMS else np.nan


def typical_variance(noises: Iterable[PoseNoise]) -> float:
    """Median over limbs of the variance [mm^2] of their markers' coordinates; 0 if none tells."""
    told = [noise.variance for noise in noises if not np.isnan(noise.variance)]
    return float(np.median(told)) if told else 0.0


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
    noise : PoseNoise
        How far the poses may be wrong.
    """

    points: Floats
    n_markers: int
    shape: LimbShape
    noise: PoseNoise

    @property
    def markers(self) -> Floats:
        """World positions of the markers, shape (n_frames, n_markers, 3)."""
        return self.points[:, : self.n_markers]

    @property
    def centre(self) -> Floats:
        """Centroid of the markers in the limb's frame [mm]; undetermined joints lean there."""
        return np.asarray(self.shape.points[: self.n_markers].mean(axis=0))

    @property
    def lacks_poses(self) -> bool:
        """Whether too few frames determine its pose for more than a start."""
        return int(self.shape.posed.sum()) < min(ENOUGH_FRAMES, int(self.is_seen.sum()))

    @property
    def is_known(self) -> Bools:
        """Frames that show the limb: its pose, or any marker where it never has one, shape (n_frames,)."""
        posed = self.shape.posed
        return posed if posed.any() else self.is_seen

    @property
    def is_seen(self) -> Bools:
        """Frames that show any of its points, shape (n_frames,)."""
        return np.asarray(~np.isnan(self.points[:, :, 0]).all(axis=1))

    def with_joint(self, joint: Floats, frames: Ints, rotator: Rotator = rotation_by_quaternion) -> Segment:
        """Return the segment with the world positions of one more joint, shape (n_frames, 3), among its points."""
        points = np.concatenate([self.points, joint[:, np.newaxis]], axis=1)
        return _segment(points, self.n_markers, frames, rotator)

    def at(self, frames: Ints) -> Segment:
        """Return the segment in some frames."""
        shape = LimbShape(self.shape.points, self.shape.world_from_limb[frames])
        return Segment(self.points[frames], self.n_markers, shape, self.noise.at(frames))


def make_segment(markers: Floats, frames: Ints, rotator: Rotator = rotation_by_quaternion) -> Segment:
    """Make a segment of a limb's markers, shape (n_frames, n_markers, 3); `frames` tell its shape."""
    return _segment(markers, markers.shape[1], frames, rotator)


def _segment(points: Floats, n_markers: int, frames: Ints, rotator: Rotator) -> Segment:
    shape = fit_shape(points, frames, rotator)
    return Segment(points, n_markers, shape, pose_noise(shape, points, frames))
