"""One joint between two limbs, by the strongest method that their markers allow.

Two limbs with poses have a closed form. A limb with too few markers for a pose is seen from the other as points on
spheres. Two such limbs are left to the joint cost of the thesis, minimised by conjugate gradients, with a joint
position in every frame.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.ball_joint import both_images, mean_distances, spread_of_directions
from skelgen.geometry.statistics import quantile_of
from skelgen.kinematics.joints.closed_form import FixedPoint, fit_fixed_point, fit_sphere
from skelgen.model.arrays import Bools, Floats
from skelgen.stages.classic.conjugate_gradients import minimise
from skelgen.stages.classic.joint_solver import JointSolver, joint_cost, local_optimum
from skelgen.stages.joints.parameters import JointParameters
from skelgen.stages.joints.segments import ENOUGH_FRAMES, Segment

FREE_COORDINATES = 3
"""A joint that is free in every frame explains three of its distances to markers by itself."""


LEAST_TURN = 0.02
"""rad, each axis; limbs that turn less against each other hardly turn."""

LEAST_TURN_NOISE = 1e-12
"""rad^2; what rounding leaves of exact rotations."""

TYPICAL_TURN = 0.2
"""rad, each axis; what limbs of a moving body turn against each other."""

MIN_COMMON = 5
"""Frames that must show both limbs for a joint between them."""

LEAST_VARIANCE = 1e-4
"""mm^2; what rounding and the ridge of the closed forms leave of exact takes."""

LEAST_DESCENT_VARIANCE = 1e-8
"""mm^2; what rounding of files leaves of the distances to a joint of exact takes."""

KEPT_PART = 0.95
"""Part of the frames, those with the smallest gap for their noise, that a joint rests on: labels may jump."""

NO_JOINT = 25.0
"""Times what noise lets expect: a joint whose images have a larger mean square gap is none, or soft tissue moves it."""


@dataclass(frozen=True, eq=False)
class JointGuess:
    """A joint between two segments.

    Attributes
    ----------
    positions : ndarray, shape (n_frames, 3), mm
        World positions, NaN where neither limb gives one.
    square : float, mm^2
        How far the joint is from being fixed in both limbs: mean square per coordinate of the distance of its two
        images, or mean variance of distances; infinite if the limbs are never seen together.
    expected : float, mm^2
        Its expectation from the noise of both limbs.
    distance : float, mm
        Mean distance from the markers of both limbs.
    turn : float, rad
        Root mean square of how far the limbs turn about the joint beyond noise, each axis; NaN without poses.
    wobble : float
        Mean square of the rotations across the axis that turns most, in units of its expectation from noise; NaN
        without poses.
    n_frames : int
        Frames that it rests on.
    n_iterations : int
        Iterations of the descent, 0 for closed forms.
    radii : ndarray, shape (n_markers,), mm
        Mean distances to the markers of both limbs; empty if the limbs are never seen together.
    axis_in_first : ndarray, shape (3,)
        Direction in the first limb about which the limbs turn most; NaN without poses.
    """

    positions: Floats
    square: float
    expected: float = np.nan
    distance: float = np.nan
    turn: float = np.nan
    wobble: float = np.nan
    n_frames: int = 0
    n_iterations: int = 0
    radii: Floats = field(default_factory=lambda: np.zeros(0))
    axis_in_first: Floats = field(default_factory=lambda: np.full(3, np.nan))

    @property
    def hidden_part(self) -> float:
        """Standard deviation of the mean square gap, as a part of it: what noise could hide."""
        return float(np.sqrt(2 / (3 * max(self.n_frames, 1))))

    @property
    def is_unexplained(self) -> bool:
        """Whether noise does not explain the gap."""
        return bool(np.isfinite(self.square) and self.square > NO_JOINT * self.expected)

    @property
    def doubt(self) -> float:
        """Mean square gap, and what noise adds where limbs turn little [mm^2]: a surer guess has a lower one."""
        return self.square + self.hidden_part * self.expected * (TYPICAL_TURN / max(self.turn, LEAST_TURN)) ** 2

    def cost(self, alpha: float) -> float:
        """Cost [mm^2] with the weight `alpha` [mm] of the mean distance; NaN if the limbs are never seen together."""
        return self.square + alpha * self.distance if np.isfinite(self.square) else np.nan


@dataclass(frozen=True)
class Guessing:
    """How joints are guessed: the parameters of the stage, and the seed of the annealing jitter."""

    parameters: JointParameters
    seed: int


def guess_joint(first: Segment, second: Segment, how: Guessing, typical: float, alpha: float) -> JointGuess:
    """Find the joint between two segments; the solver is the parameters' choice where both limbs have poses.

    Parameters
    ----------
    first, second : Segment
        Both limbs.
    how : Guessing
        Parameters and seed.
    typical : float, mm^2
        Variance of a marker's coordinate, for limbs whose own is not known.
    alpha : float, mm
        Weight of the mean distance in the joint cost, for limbs without poses.
    """
    if how.parameters.solver == "conjugate-gradient":
        return classic_joint(first, second, how, typical, alpha)
    if first.shape.has_pose or second.shape.has_pose:
        return _with_distances(_closed_form(first, second, typical), first, second)
    return drawn_joint(first, second, how, typical, alpha)


def drawn_joint(first: Segment, second: Segment, how: Guessing, typical: float, alpha: float) -> JointGuess:
    """Find the joint between two segments by the least joint cost of all their points, which draws it towards them.

    Parameters
    ----------
    first, second, how, typical, alpha
        As for `guess_joint`.
    """
    parameters = how.parameters
    points = np.concatenate([first.points, second.points], axis=1)
    centres = np.stack([_centroid(first.points), _centroid(second.points)])
    usable = np.asarray(~np.isnan(centres[:, :, 0]).any(axis=0))
    if usable.sum() < MIN_COMMON:
        return JointGuess(np.full((len(points), 3), np.nan), np.inf)
    start = np.asarray(centres[:, usable].mean(axis=0))
    found = minimise(joint_cost(points[usable], alpha), start, parameters, how.seed)
    refined = local_optimum(found.point, points[usable], parameters.max_residual, parameters.max_fallback)
    _, spread = mean_distances(*contiguous(refined, points[usable]))
    guess = _of_frames(refined, usable, float((spread**2).mean()), points.shape[1], typical)
    return _with_distances(replace(guess, n_iterations=found.n_iterations), first, second)


def classic_joint(
    first: Segment, second: Segment, how: Guessing, typical: float, alpha: float, radii: Floats | None = None
) -> JointGuess:
    """Find the joint between two segments by their markers alone, as the thesis does.

    Parameters
    ----------
    first, second, how, typical, alpha
        As for `guess_joint`.
    radii : ndarray, shape (n_markers,), mm, optional
        Mean distances to the markers of both limbs, found from other frames, that make the start.
    """
    usable = first.is_seen & second.is_seen
    if usable.sum() < MIN_COMMON:
        return JointGuess(np.full((len(usable), 3), np.nan), np.inf)
    noise, parameters = max(typical, LEAST_DESCENT_VARIANCE), how.parameters
    solver = JointSolver(parameters, parameters.max_residual, parameters.max_fallback, noise, how.seed)
    found = solver.solve(first.markers[usable], second.markers[usable], alpha, radii)
    guess = _of_frames(found.positions, usable, found.variance, len(found.distances), typical)
    return _with_distances(replace(guess, n_iterations=found.n_iterations), first, second)


def _of_frames(positions: Floats, usable: Bools, variance: float, n_points: int, typical: float) -> JointGuess:
    """A joint that was placed in the usable frames, by the mean variance of its distances to all points [mm^2]."""
    everywhere = np.full((len(usable), 3), np.nan)
    everywhere[usable] = positions
    freedom = n_points / max(n_points - FREE_COORDINATES, 0.5)
    return JointGuess(everywhere, variance * freedom, typical, n_frames=int(usable.sum()))


def _with_distances(guess: JointGuess, first: Segment, second: Segment) -> JointGuess:
    """Add the mean distances to the markers."""
    if not np.isfinite(guess.square):
        return guess
    markers = np.concatenate([first.markers, second.markers], axis=1)
    distances, _ = mean_distances(*contiguous(guess.positions, markers))
    return replace(guess, distance=float(distances.mean()), radii=distances)


def _closed_form(first: Segment, second: Segment, typical: float) -> JointGuess:
    """Find a joint from the poses of both limbs; where few frames have both, from those of one, if that is surer."""
    by_poses = _from_poses(first, second, typical)
    if by_poses is not None and by_poses.n_frames >= ENOUGH_FRAMES:
        return by_poses
    by_spheres = (_from_sphere(first, second, typical), _from_sphere(second, first, typical))
    found = [guess for guess in (by_poses, *by_spheres) if guess is not None]
    if not found:
        return JointGuess(np.full((len(first.points), 3), np.nan), np.inf)
    return min(found, key=lambda guess: guess.doubt)


def _from_poses(first: Segment, second: Segment, typical: float) -> JointGuess | None:
    """Fit twice: the first fit gives the weight of each frame, and which frames are in error."""
    poses, near = (first.shape.world_from_limb, second.shape.world_from_limb), (first.centre, second.centre)
    fit = fit_fixed_point(*poses, *near)
    if fit is None or fit.n_frames < MIN_COMMON:
        return None
    weights = _weights(first, second, fit, typical)
    fit = fit_fixed_point(*poses, *near, weights) or fit
    shares = first.noise.shares(weights), second.noise.shares(weights)
    levels = pose_noise(first, typical), pose_noise(second, typical)
    shaking = levels[0] * first.noise.of_rotation(shares[0]) + levels[1] * second.noise.of_rotation(shares[1])
    across = levels[0] * first.noise.of_rotation_across(fit.axis_in_first, shares[0])
    across += levels[1] * second.noise.of_rotation_across(fit.axis_in_second, shares[1])
    positions, _ = _images(first, second, fit)
    n_frames = int((weights > 0).sum())
    freedom = n_frames / max(n_frames - 2, 0.5)
    return JointGuess(
        positions,
        freedom * fit.gap / 3,
        float(np.nansum(weights * _expected_gaps(first, second, fit, typical)) / weights.sum()),
        turn=float(np.sqrt(max(fit.determinacy.sum() / 6 - shaking, 0.0))),
        wobble=float(fit.determinacy[0] / max(across, LEAST_TURN_NOISE)),
        n_frames=n_frames,
        axis_in_first=fit.axis_in_first,
    )


def _images(first: Segment, second: Segment, fit: FixedPoint) -> tuple[Floats, Floats]:
    """Where a joint is in the world, and the square of its gap [mm^2]; see `ball_joint.both_images`."""
    poses = first.shape.world_from_limb, second.shape.world_from_limb
    found: tuple[Floats, Floats] = both_images(*contiguous(*poses, fit.in_first, fit.in_second))
    return found


def _weights(first: Segment, second: Segment, fit: FixedPoint, typical: float) -> Floats:
    expected = _expected_gaps(first, second, fit, typical)
    _, gaps = _images(first, second, fit)
    known = ~np.isnan(gaps)
    surprise = gaps / expected
    return np.where(known & (surprise <= quantile_of(surprise[known], KEPT_PART)), 1.0 / expected, 0.0)


def _expected_gaps(first: Segment, second: Segment, fit: FixedPoint, typical: float) -> Floats:
    """Variance of a coordinate of the gap in every frame [mm^2]."""
    return expected_error(first, fit.in_first, typical) + expected_error(second, fit.in_second, typical)


def expected_error(segment: Segment, point: Floats, typical: float) -> Floats:
    """Return the variance of a coordinate of a point of a limb by errors of its poses [mm^2], shape (n_frames,).

    Parameters
    ----------
    segment : Segment
        The limb.
    point : ndarray, shape (3,), mm
        In its frame.
    typical : float, mm^2
        Variance of a marker's coordinate, if the limb's own is not known.
    """
    return pose_noise(segment, typical) * segment.noise.of_point(point)


def pose_noise(segment: Segment, typical: float) -> float:
    """Return the variance of a coordinate of a limb's markers about their places [mm^2].

    Parameters
    ----------
    segment : Segment
        The limb.
    typical : float, mm^2
        The same of the take, where the limb's own is not known.
    """
    return max(typical if np.isnan(segment.noise.variance) else segment.noise.variance, LEAST_VARIANCE)


def _from_sphere(body: Segment, other: Segment, typical: float) -> JointGuess | None:
    if not body.shape.has_pose:
        return None
    counts = (~np.isnan(other.points[:, :, 0]) & body.shape.posed[:, np.newaxis]).sum(axis=0)
    points = other.points[:, counts >= MIN_COMMON]
    fit = fit_sphere(body.shape.world_from_limb, points, body.centre) if points.shape[1] else None
    if fit is None:
        return None
    of_body = expected_error(body, fit.centre, typical)
    used = ~np.isnan(of_body) & ~np.isnan(points[:, :, 0]).all(axis=1)
    n_values = int(counts[counts >= MIN_COMMON].sum())
    freedom = n_values / max(n_values - points.shape[1] - 3, 0.5)
    expected = float(of_body[used].mean()) + max(typical, LEAST_VARIANCE)
    turn = _turn(body, points, fit.centre)
    # World positions of a point of a limb's frame, shape (n_frames, 3); NaN without a pose
    poses = body.shape.world_from_limb
    positions = poses[:, :3, :3] @ fit.centre + poses[:, :3, 3]
    return JointGuess(positions, freedom * fit.variance, expected, turn=turn, n_frames=int(used.sum()) // 3 + 1)


def _turn(body: Segment, points: Floats, centre: Floats) -> float:
    """How far the directions from a joint to points turn in the body's frame [rad], each axis."""
    spread = spread_of_directions(*contiguous(body.shape.world_from_limb, points, centre))
    return float(np.sqrt(max(spread / 2, 0.0)))  # below 0 by rounding


def _centroid(points: Floats) -> Floats:
    seen = ~np.isnan(points[:, :, :1])
    count = seen.sum(axis=1)
    total = np.where(seen, points, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
