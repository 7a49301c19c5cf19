"""A limb as the search for joints sees it: its points, its rigid shape with poses, and how far these may be wrong.

A joint between two limbs is compared with the noise of their poses: the gap of a true joint is explained by it, whether
its limbs carry three markers near to each other or ten far apart, and whether the joint is near or far from them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.geometry.rotations import N_POSE, cross_matrix, moved_points
from skelgen.kinematics.rigid_bodies import LimbShape, distinct_rows, fit_shape
from skelgen.model import Limbs
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread
from skelgen.stages.joints.parameters import JointParameters

LEAST_FREEDOMS = 30
"""Residual coordinates, beyond what the poses and the shape use up, from which a limb's noise is estimated."""

POSE_POINTS = 3
"""Points that fix a pose, where a limb has as many."""

ENOUGH_FRAMES = 50
"""Frames with both limbs below which more are looked for, in the whole take and by other methods."""

BLOCK_FRAMES = 16_384
"""Frames that are looked at at once: the poses of all limbs take 2 KB each. Takes up to this length are one block."""

THIN_FRAMES = 6_000
"""Frames of longer takes from which the tree is found, beside those that show limbs which these hardly show."""


@dataclass(frozen=True, eq=False)
class PoseNoise:
    """Errors of a limb's poses.

    Attributes
    ----------
    variance : float, mm^2
        Of each coordinate of a marker about its place on the limb; NaN where there are too few residuals.
    covariances : ndarray, shape (n_patterns, 6, 6)
        Of translation and rotation in the limb's frame for unit noise, for each set of points that is seen together.
    pattern : ndarray of intp, shape (n_frames,)
        Which of these sets a frame shows; -1 without a pose.
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
        """Part of the weights [(n_frames,)] that each set of points has, shape (n_patterns,); 0 without a pose."""
        counted = np.bincount(self.pattern + 1, weights, len(self.covariances) + 1)
        return np.asarray(counted[1:] / weights.sum())

    def of_rotation(self, shares: Floats) -> float:
        """Mean variance [rad^2] of a rotation about each axis for unit noise, given the `shares` of frames."""
        return float(shares @ np.trace(self.covariances[:, 3:, 3:], axis1=1, axis2=2)) / 3

    def of_rotation_across(self, axis: Floats, shares: Floats) -> float:
        """Mean variance [rad^2] of rotations about the two axes across one, together.

        Parameters
        ----------
        axis : ndarray, shape (3,)
            Unit vector in the limb's frame.
        shares : ndarray, shape (n_patterns,)
            Parts of the frames, from `shares`.
        """
        turns = self.covariances[:, 3:, 3:]
        return float(shares @ (np.trace(turns, axis1=1, axis2=2) - turns @ axis @ axis))

    def at(self, frames: Ints) -> PoseNoise:
        """Return the errors in some frames."""
        return PoseNoise(self.variance, self.covariances, self.pattern[frames])


@dataclass(frozen=True, eq=False)
class Segment:
    """A limb: its markers, the joints found so far, and the rigid shape of both.

    Attributes
    ----------
    points : ndarray, shape (n_frames, n_points, 3), mm
        World positions, NaN where unseen.
    n_markers : int
        The first points are markers, the rest are joints.
    shape : LimbShape
        Rigid shape and poses, where the points suffice.
    noise : PoseNoise
        Errors of the poses.
    """

    points: Floats
    n_markers: int
    shape: LimbShape
    noise: PoseNoise

    @property
    def markers(self) -> Floats:
        """World positions of the markers [mm], shape (n_frames, n_markers, 3)."""
        return self.points[:, : self.n_markers]

    @cached_property
    def centre(self) -> Floats:
        """Centroid of the markers in the limb's frame [mm]; undetermined joints are drawn there."""
        return np.asarray(self.shape.points[: self.n_markers].mean(axis=0))

    @cached_property
    def middle(self) -> Floats:
        """Where that centroid is in the world [mm], shape (n_frames, 3); NaN without a pose."""
        return np.asarray(self.shape.world_from_limb[:, :3, :3] @ self.centre + self.shape.world_from_limb[:, :3, 3])

    @cached_property
    def lacks_poses(self) -> bool:
        """Whether too few frames determine its pose for more than a start."""
        return int(self.shape.posed.sum()) < min(ENOUGH_FRAMES, int(self.is_seen.sum()))

    @property
    def is_known(self) -> Bools:
        """Frames that show the limb: its pose, or any marker where it never has one, shape (n_frames,)."""
        posed = self.shape.posed
        return posed if posed.any() else self.is_seen

    @cached_property
    def is_seen(self) -> Bools:
        """Frames that show any of its points, shape (n_frames,)."""
        return np.asarray(~np.isnan(self.points[:, :, 0]).all(axis=1))

    def with_joint(self, joint: Floats, frames: Ints) -> Segment:
        """Return the segment with one more joint among its points.

        Parameters
        ----------
        joint : ndarray, shape (n_frames, 3), mm
            World positions of the joint, NaN where unknown.
        frames : ndarray of intp
            Frames from which the shape is estimated.
        """
        return _segment(np.concatenate([self.points, joint[:, np.newaxis]], axis=1), self.n_markers, frames)

    def at(self, frames: Ints) -> Segment:
        """Return the segment in some frames."""
        shape = LimbShape(self.shape.points, self.shape.world_from_limb[frames])
        return Segment(self.points[frames], self.n_markers, shape, self.noise.at(frames))


def make_segments(markers: list[Floats], frames: Ints) -> list[Segment]:
    """Return the limbs as segments.

    Parameters
    ----------
    markers : list of ndarray, shape (n_frames, n_markers, 3), mm
        Markers of each limb, NaN where unseen.
    frames : ndarray of intp
        Sampled frames, from which shapes are estimated; others where these hardly show a limb.
    """
    return [_segment(own, own.shape[1], _frames_that_show(own, frames)) for own in markers]


def _segment(points: Floats, n_markers: int, frames: Ints) -> Segment:
    shape = fit_shape(points, frames)
    return Segment(points, n_markers, shape, _pose_noise(shape, points, frames))


def _frames_that_show(markers: Floats, frames: Ints) -> Ints:
    """Sampled frames, or, where they hardly show a limb, as many of all frames that do."""
    shows = (~np.isnan(markers[:, :, 0])).sum(axis=1) >= min(markers.shape[1], POSE_POINTS)
    if shows[frames].sum() >= min(ENOUGH_FRAMES, shows.sum()):
        return frames
    return evenly_spread(np.flatnonzero(shows), len(frames))


def _pose_noise(shape: LimbShape, points: Floats, frames: Ints) -> PoseNoise:
    posed = shape.posed
    pattern = np.full(len(points), -1, dtype=np.intp)
    if not posed.any():
        return PoseNoise(np.nan, np.zeros((0, 6, 6)), pattern)
    sets, pattern[posed] = distinct_rows(~np.isnan(points[posed, :, 0]))
    slopes = np.concatenate([np.tile(np.eye(3), (len(shape.points), 1, 1)), -cross_matrix(shape.points)], axis=2)
    information = np.tensordot(sets.astype(np.float64), slopes.swapaxes(1, 2) @ slopes, 1)
    return PoseNoise(_marker_variance(shape, points, frames), np.linalg.inv(information), pattern)


def _marker_variance(shape: LimbShape, points: Floats, frames: Ints) -> float:
    """Variance [mm^2] of a coordinate of a point about its place on the limb; NaN where too few residuals are left."""
    frames = frames[shape.posed[frames]]
    poses, sampled = shape.world_from_limb[frames], points[frames]
    seen = ~np.isnan(sampled[:, :, 0])
    modelled = moved_points(poses, shape.points)
    squares = ((sampled - modelled)[seen] ** 2).sum()
    known_points = int(seen.any(axis=0).sum())
    freedoms = 3 * int(seen.sum()) - N_POSE * len(seen) - (3 * known_points - N_POSE)
    return float(squares / freedoms) if freedoms >= LEAST_FREEDOMS else np.nan


def typical_variance(segments: Iterable[Segment]) -> float:
    """Median over limbs of the variance [mm^2] of their markers' coordinates; 0 if no limb has residuals enough."""
    known = [segment.noise.variance for segment in segments if not np.isnan(segment.noise.variance)]
    return float(np.median(known)) if known else 0.0


def markers_of_limbs(positions: Floats, limbs: Limbs, samples: int) -> list[Floats]:
    """Return each limb's markers in the frames from which the tree is found: all, or of a long take some.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        All markers, NaN where unseen.
    limbs : Limbs
        Which marker is on which limb.
    samples : int
        Of a long take, so many frames that show each limb are among those chosen, if there are as many.
    """
    markers = [limbs.markers_of(limb) for limb in range(limbs.n_limbs)]
    if len(positions) <= BLOCK_FRAMES:
        return [positions[:, own] for own in markers]
    seen = ~np.isnan(positions[:, :, 0])
    chosen = [np.linspace(0, len(positions) - 1, THIN_FRAMES).astype(np.intp)]
    for own in markers:
        shows = np.flatnonzero(seen[:, own].sum(axis=1) >= min(len(own), POSE_POINTS))
        chosen.append(evenly_spread(shows, samples))
    frames = np.unique(np.concatenate(chosen))
    return [positions[np.ix_(frames, own)] for own in markers]


def sample_frames(n_frames: int, parameters: JointParameters) -> Ints:
    """Return the frames at which all pairs of limbs are tried, rising.

    Parameters
    ----------
    n_frames : int
        Frames in the take.
    parameters : JointParameters
        Their `sampling` and `samples`.
    """
    step = max(1.0, n_frames / parameters.samples) if parameters.sampling < 0 else max(parameters.sampling, 1)
    return np.unique(np.arange(0, n_frames, step).astype(np.intp).clip(max=n_frames - 1))  # rounding may reach the end
