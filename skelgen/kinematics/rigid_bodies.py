r"""Rigid bodies: the shape of a limb and its poses, from markers with gaps, and the shape in a normal form.

Every frame is aligned with a common reference and averaged, until the shape stays (generalised Procrustes analysis).
Its first round, with one frame as the reference, is (Schönauer 2007, 3.8.1).

The points and the poses of all frames minimise :math:`\sum_f \|P_f - T_f M\|^2` (Gaschler 2011, 4.2). The frame of a
body is a choice: its normal form has the first point at the origin, the second on the x axis and the third
in the xy plane, from a QR decomposition. The other 3 n - 6 numbers have a covariance of full rank.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.orientation import Rotator, fit_transform, means_in_body, rotation_by_quaternion
from skelgen.geometry.rotations import N_POSE, cross_matrix, moved_points, transform_from
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, check_floats
from skelgen.progress import counted

MAX_ROUNDS = 30
SHAPE_TOLERANCE, NOISE_TOLERANCE = 1e-6, 1e-3
"""Rounds stop when no point moves by more than this: in mm, or, if that is more, as a part of the deviations of the
first round, which is less than the standard error of a mean over a million frames."""

MOST_COUNTED = 16
"""Most points whose visible sets are counted in a table of all sets."""

FLATNESS = 0.02
"""Points whose second extent is below this part of the first are on one line, about which no rotation is determined."""

_ROUNDING = float(np.finfo(np.float64).eps)
FEWEST_POINTS = 3


@dataclass(frozen=True, eq=False)
class LimbShape:
    """A rigid limb: its points and where it is.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points in the limb's frame, whose origin is their centroid.
    world_from_limb : ndarray, shape (n_frames, 4, 4)
        Poses; NaN in frames that do not determine one.
    """

    points: Floats
    world_from_limb: Floats

    @cached_property
    def posed(self) -> Bools:
        """Frames with a pose, shape (n_frames,)."""
        return np.asarray(~np.isnan(self.world_from_limb[:, 0, 0]))

    @property
    def has_pose(self) -> bool:
        """Whether any frame determines a pose."""
        return bool(self.posed.any())


def fit_shape(
    positions: Floats, frames: Ints, rotator: Rotator = rotation_by_quaternion, flatness: float = FLATNESS
) -> LimbShape:
    """Estimate the shape of a limb and its poses.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_points, 3), mm
        World positions of the limb's points, NaN where unseen.
    frames : ndarray of intp
        Frames from which the shape is estimated; poses are computed for all.
    rotator : callable
        Closed form of absolute orientation.
    flatness : float
        Points whose second extent is below this part of the first are on one line and fix no pose.

    Returns
    -------
    LimbShape
        Without any pose if the limb has fewer than three points that are not on one line.
    """
    n_frames, n_points = positions.shape[:2]
    nowhere = np.full((n_frames, 4, 4), np.nan)
    if n_points < 3:
        return LimbShape(np.zeros((n_points, 3)), nowhere)
    points = _average_shape(positions[frames], rotator, flatness)
    known = ~np.isnan(points[:, 0])
    seen = ~np.isnan(positions[:, :, 0]) & known
    points = np.where(known[:, np.newaxis], points, 0.0)
    determined = determines_pose(points, seen, flatness)
    poses = nowhere
    if determined.any():
        poses[determined] = fit_transform(points, positions[determined], seen[determined], rotator)
    return LimbShape(points, poses)


def determines_pose(points: Floats, seen: Bools, flatness: float = FLATNESS) -> Bools:
    """Return in which frames the seen points of a limb fix its pose: three that are not on one line.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points in the limb's frame.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which are seen.
    flatness : float
        Points whose second extent is below this part of the first are on one line.
    """
    patterns, inverse = distinct_rows(seen)
    return np.asarray(_span_space(points, patterns, flatness)[inverse])


def _span_space(points: Floats, patterns: Bools, flatness: float) -> Bools:
    """Which sets of points, shape (n_sets, n_points), are three and more that are not on one line."""
    spans = patterns.sum(axis=1) >= 3
    counted = patterns[spans].astype(np.float64)
    middles = counted @ points / counted.sum(axis=1, keepdims=True)
    arms = (points - middles[:, np.newaxis]) * counted[..., np.newaxis]
    extents = np.linalg.eigvalsh(arms.swapaxes(1, 2) @ arms)
    spans[spans] = extents[:, 1] > max(flatness**2, _ROUNDING) * extents[:, 2]
    return np.asarray(spans)


def distinct_rows(seen: Bools) -> tuple[Bools, Ints]:
    """Return the distinct rows of a table of booleans, rising, and which of them each row is.

    Rows are compared as whole numbers, as most limbs show few sets of points.

    Parameters
    ----------
    seen : ndarray of bool, shape (n_rows, n_columns)
        The table.

    Returns
    -------
    rows : ndarray of bool, shape (n_distinct, n_columns)
        Each that occurs, once.
    index : ndarray of intp, shape (n_rows,)
        Which of them each row is.
    """
    n_columns = seen.shape[1]
    if n_columns > MOST_COUNTED:
        rows, inverse = np.unique(seen, axis=0, return_inverse=True)
        return rows, inverse.ravel()
    code = seen @ (1 << np.arange(n_columns)[::-1])
    found = np.flatnonzero(np.bincount(code, minlength=1))
    place = np.zeros(1 << n_columns, dtype=np.intp)
    place[found] = np.arange(len(found))
    return (found[:, np.newaxis] >> np.arange(n_columns)[::-1] & 1).astype(bool), place[code]


def _average_shape(positions: Floats, rotator: Rotator, flatness: float) -> Floats:
    """Centred points, NaN for those that never appear together with three others."""
    seen = ~np.isnan(positions[:, :, 0])
    reference = int(np.argmax(seen.sum(axis=1)))
    points = positions[reference] - np.nanmean(positions[reference], axis=0) if seen[reference].any() else positions[0]
    before, used, tolerance = np.zeros((0,), dtype=bool), np.zeros((0,), dtype=bool), 0.0
    for _ in range(MAX_ROUNDS):
        known = ~np.isnan(points[:, 0])
        is_new = not np.array_equal(known, before)
        if is_new:
            shown, before = seen & known, known
            patterns, inverse = distinct_rows(shown)
        filled = np.where(known[:, np.newaxis], points, 0.0)
        usable = _span_space(filled, patterns, flatness)[inverse]
        if is_new or not np.array_equal(usable, used):
            frames, used = np.flatnonzero(usable), usable
            places, fitted, averaged = positions[frames], shown[frames], seen[frames]
        if not len(frames):
            break
        poses = fit_transform(filled, places, fitted, rotator)
        mean = means_in_body(poses, places, averaged)
        tolerance = tolerance or max(SHAPE_TOLERANCE, NOISE_TOLERANCE * _deviation(poses, places, mean))
        average = mean - mean[~np.isnan(mean[:, 0])].mean(axis=0)
        moved = np.fmax.reduce(np.abs(average - points), axis=None, initial=0.0)
        gained = bool((np.isnan(points) & ~np.isnan(average)).any())
        points = average
        if moved < tolerance and not gained:
            break
    return np.asarray(points)


def _deviation(poses: Floats, places: Floats, points: Floats) -> float:
    """Root mean square [mm] of how far coordinates of places are off the points of a posed body."""
    return float(np.sqrt(np.nanmean((places - moved_points(poses, points)) ** 2)))


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A calibrated rigid body.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points in the normal form.
    covariance : ndarray, shape (n_points, 3, n_points, 3), mm^2
        Of the points' coordinates; 0 for those that the normal form fixes.
    noise : float, mm
        Standard deviation of one measured coordinate, freedoms taken off.
    world_from_body : ndarray, shape (n_frames, 4, 4)
        Poses of the normal form; NaN in frames that do not determine one.
    """

    points: Floats
    covariance: Floats
    noise: float
    world_from_body: Floats

    @property
    def std(self) -> Floats:
        """Standard deviation [mm] of each coordinate, shape (n_points, 3)."""
        size = self.points.size
        return np.sqrt(np.diag(self.covariance.reshape(size, size))).reshape(self.points.shape)


def calibrate_rigid_body(positions: Floats) -> RigidBody:
    """Estimate the points of a rigid body from many frames.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_points, 3), mm
        Measured points, the same order in every frame; NaN where unseen.

    Raises
    ------
    InputError
        If fewer than three points off a line are seen together, or the first three points are on one line.
    """
    positions = check_floats(positions, (None, None, 3), "positions of a rigid body")
    if positions.shape[1] < FEWEST_POINTS:
        raise InputError(
            f"a rigid body of {counted(positions.shape[1], 'point')} has no shape; it needs {FEWEST_POINTS}"
        )
    shape = fit_shape(positions, np.arange(len(positions)))
    if not shape.has_pose:
        raise InputError("no frame shows three points of the body that are off a line, so that it has no shape")
    points, body_from_limb = normal_form(shape.points)
    poses = shape.world_from_limb @ np.linalg.inv(body_from_limb)
    seen = ~np.isnan(positions[:, :, 0]) & shape.posed[:, np.newaxis]
    carried = moved_points(poses, points)
    squares = float((np.where(seen[..., np.newaxis], positions - carried, 0.0) ** 2).sum())
    n_poses = int(seen.any(axis=1).sum())
    freedoms = 3 * int(seen.sum()) - N_POSE * n_poses - (3 * len(points) - N_POSE)
    noise = float(np.sqrt(squares / max(freedoms, 1)))
    return RigidBody(points, noise**2 * _unit_covariance(points, seen), noise, poses)


def limb_bodies(trajectories: Trajectories, limbs: Limbs) -> dict[int, RigidBody]:
    """Calibrate each limb as a rigid body from its markers alone, in the normal form, with covariance.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Which marker is on which limb.

    Returns
    -------
    dict of int to RigidBody
        By limb, points in the order of its markers; limbs whose first three markers are on one line, or that have
        fewer, are not there.
    """
    found = {}
    for limb in range(limbs.n_limbs):
        try:
            found[limb] = calibrate_rigid_body(trajectories.positions[:, limbs.markers_of(limb)])
        except InputError:
            continue
    return found


def normal_form(points: Floats) -> tuple[Floats, Floats]:
    """Move points to their normal form (eq. 4.15, 4.16).

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The first three must not lie on one line.

    Returns
    -------
    tuple of ndarray, shapes (n_points, 3) and (4, 4)
        The points in the normal form, and the transform normal from given.

    Raises
    ------
    InputError
        If the first three points are on one line.
    """
    spans = (points[1:] - points[0]).T
    q, upper = np.linalg.qr(spans)
    size = np.linalg.norm(spans[:, :2])
    if min(abs(upper[0, 0]), abs(upper[1, 1])) <= np.sqrt(np.finfo(np.float64).eps) * size:
        raise InputError("the first three points of the body are on one line; list three others first")
    first, second = np.sign(upper[0, 0]) * q[:, 0], np.sign(upper[1, 1]) * q[:, 1]
    turn = np.stack([first, second, np.cross(first, second)])
    normal = (points - points[0]) @ turn.T
    normal.reshape(-1)[_fixed(len(points))] = 0.0
    return normal, transform_from(turn, -turn @ points[0])


def _fixed(n_points: int) -> Bools:
    """Which coordinates the normal form fixes at 0, shape (3 n_points,)."""
    fixed = np.zeros((n_points, 3), dtype=bool)
    fixed[0], fixed[1, 1:], fixed[2, 2] = True, True, True
    return fixed.ravel()


def _unit_covariance(points: Floats, seen: Bools) -> Floats:
    """Covariance of the points for unit noise, all poses free (eq. 4.19), shape (n_points, 3, n_points, 3)."""
    n_points = len(points)
    motion = np.concatenate([np.tile(np.eye(3), (n_points, 1, 1)), -cross_matrix(points)], axis=2).reshape(-1, 6)
    information = np.zeros((3 * n_points, 3 * n_points))
    patterns, counts = np.unique(seen[seen.any(axis=1)], axis=0, return_counts=True)
    for pattern, count in zip(patterns, counts, strict=True):
        shown = np.repeat(pattern, 3).astype(np.float64)
        moved = motion * shown[:, np.newaxis]
        information += count * (np.diag(shown) - moved @ np.linalg.pinv(moved))
    free = np.flatnonzero(~_fixed(n_points))
    covariance = np.zeros_like(information)
    covariance[np.ix_(free, free)] = np.linalg.pinv(information[np.ix_(free, free)], hermitian=True)
    return covariance.reshape(n_points, 3, n_points, 3)
