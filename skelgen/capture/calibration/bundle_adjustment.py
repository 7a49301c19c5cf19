"""Bundle adjustment of one camera or two that look at one board in several poses (Gaschler 2011, equations 4.8, 4.9).

Gauss and Newton's method with exact derivatives, damped where the views hardly determine the cameras. At the minimum
the normal matrix gives the standard deviations of all parameters, with the noise of the corners from what remains.
Views that do not fit are left out: those that are blurred, moved between exposures, or have mistaken corners.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from skelgen.capture.optics import distortion_jacobian
from skelgen.errors import InputError
from skelgen.geometry.rotations import N_POSE, cross_matrix, moved_points, moved_pose
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import N_DISTORTION, Camera

N_MATRIX = 4
"""Numbers of a camera's matrix: fx, fy, cx, cy."""

N_INTRINSIC = N_MATRIX + N_DISTORTION
MAX_STEPS = 40
STANDS_STILL, ROUNDING = 1e-14, 1e-9
"""Gain as a part of the sum of squares, and by distance [px] of each corner, below which no step is taken."""

LEAST_DAMPING = 1e-6
"""Of the scaled normal matrix, when a full step has made the sum of squares larger (Levenberg and Marquardt)."""

LEAST_EIGENVALUE = 1e-12
"""Of the normal matrix, with its diagonal scaled to 1: below it some numbers are not determined. Ten good views of
one board are at 1e-6, three at 1e-8."""

UNDETERMINED = (
    "the views do not determine the cameras: turn the board about different axes by 20 to 45 degrees, move it through "
    "the whole image, and take 10 to 20 views"
)


@dataclass(frozen=True, eq=False)
class Bundle:
    """What is adjusted, and what it is adjusted to.

    Attributes
    ----------
    cameras : tuple of Camera
        One or two; their `camera_from_world` is their place relative to the first one's frame.
    first_from_board : ndarray, shape (n_views, 4, 4), mm
        Poses of the board.
    board : ndarray, shape (n_corners, 3), mm
        Corners in the board's frame.
    corners : ndarray, shape (n_cameras, n_views, n_corners, 2), px
        Where they were seen.
    """

    cameras: tuple[Camera, ...]
    first_from_board: Floats
    board: Floats
    corners: Floats


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The most likely bundle.

    Attributes
    ----------
    bundle : Bundle
        With adjusted cameras and poses.
    noise : float, px
        Standard deviation of a corner along one axis, from the residuals and the degrees of freedom.
    covariance : ndarray, shape (n_shared, n_shared)
        Of the numbers that all views share: nine for each camera, then the six of the second camera's pose if there is
        one. Zero where a number was held.
    residuals : ndarray, shape (n_cameras, n_views, n_corners, 2), px
        Seen minus expected.
    """

    bundle: Bundle
    noise: float
    covariance: Floats
    residuals: Floats

    @property
    def rms(self) -> float:
        """Root mean square distance [px] of the corners from where they are expected, over all images."""
        return float(np.sqrt((self.residuals**2).sum(axis=-1).mean()))

    @property
    def view_rms(self) -> Floats:
        """The same for each image, shape (n_cameras, n_views), px."""
        return np.asarray(np.sqrt((self.residuals**2).sum(axis=-1).mean(axis=-1)))


def _adjust(bundle: Bundle, free: Bools) -> Adjusted:
    """Return the most likely cameras and poses.

    Parameters
    ----------
    bundle : Bundle
        Near the solution: a guess from the closed form.
    free : ndarray of bool, shape (n_shared,)
        Which of the numbers that all views share are adjusted, in the order of `Adjusted.covariance`; the poses of the
        board always are.
    """
    damping = 0.0
    for _ in range(MAX_STEPS):
        residuals, slope = _linearised(bundle, free)
        squares = float(residuals @ residuals)
        step = _inverse(slope, damping) @ (slope.T @ residuals)
        if step @ (slope.T @ residuals) <= STANDS_STILL * squares + residuals.size * ROUNDING**2:
            break
        moved = _step_if_better(bundle, free, step, squares)
        damping = max(10.0 * damping, LEAST_DAMPING) if moved is None else damping / 10.0
        bundle = bundle if moved is None else moved
    residuals = _residuals_of(bundle)
    noise = float(np.sqrt((residuals**2).sum() / max(slope.shape[0] - slope.shape[1], 1)))
    inverse = _inverse(slope, 0.0)
    covariance = np.zeros((len(free), len(free)))
    n_free = int(free.sum())
    covariance[np.ix_(free, free)] = noise**2 * inverse[:n_free, :n_free]
    return Adjusted(bundle, noise, covariance, residuals)


def _residuals_of(bundle: Bundle) -> Floats:
    """Return seen minus expected corners, shape (n_cameras, n_views, n_corners, 2), px."""
    in_first = moved_points(bundle.first_from_board, bundle.board)
    expected = [pixels_and_slopes(eye, moved_points(eye.camera_from_world, in_first))[0] for eye in bundle.cameras]
    return np.asarray(bundle.corners - np.stack(expected))


def pixels_and_slopes(eye: Camera, inside: Floats) -> tuple[Floats, Floats, Floats]:
    """Return pixels of points in a camera's frame, with their derivatives by the intrinsic numbers and by the point.

    Unlike `project`, this knows no fold of the lens: on the way to the minimum any lens may occur.

    Parameters
    ----------
    eye : Camera
        Its place does not matter.
    inside : ndarray, shape (..., 3), mm
        Points in its frame.

    Returns
    -------
    ndarray, shape (..., 2), px
        Pixels.
    ndarray, shape (..., 2, 9)
        By fx, fy, cx, cy, k1, k2, p1, p2, k3.
    ndarray, shape (..., 2, 3), px/mm
        By the point.
    """
    flat = inside[..., :2] / inside[..., 2:]
    basis = _lens_basis(flat)
    bent = flat + basis @ eye.distortion
    focal = np.diag(eye.matrix)[:2]
    by_intrinsic = np.zeros((*flat.shape, N_INTRINSIC))
    for axis in (0, 1):
        by_intrinsic[..., axis, axis], by_intrinsic[..., axis, 2 + axis] = bent[..., axis], 1.0
    by_intrinsic[..., N_MATRIX:] = focal[:, np.newaxis] * basis
    by_point = np.zeros((*flat.shape, 3))
    by_point[..., :2] = distortion_jacobian(eye, flat) * focal[:, np.newaxis]
    by_point[..., 2] = -(by_point[..., :2] @ flat[..., np.newaxis])[..., 0]
    by_point /= inside[..., 2, np.newaxis, np.newaxis]
    return bent * focal + eye.matrix[:2, 2], by_intrinsic, by_point


def slopes_of_camera(eye: Camera, points: Floats) -> tuple[Floats, Floats]:
    """Return how pixels follow the numbers of a camera, shape (n, 2, 15), and the points, shape (n, 2, 3).

    Parameters
    ----------
    eye : Camera
        Its `camera_from_world` is its place relative to the first camera's frame.
    points : ndarray, shape (n, 3), mm
        In the first camera's frame.
    """
    inside = moved_points(eye.camera_from_world, points)
    _, by_intrinsic, by_point = pixels_and_slopes(eye, inside)
    by_pose = slope_by_pose(by_point, inside - eye.camera_from_world[:3, 3])
    return np.concatenate([by_intrinsic, by_pose], axis=-1), np.asarray(by_point @ eye.camera_from_world[:3, :3])


def _lens_basis(flat: Floats) -> Floats:
    """The shift of a normalised point by each coefficient of the lens, shape (..., 2, 5)."""
    x, y = flat[..., 0], flat[..., 1]
    square = x * x + y * y
    basis = np.empty((*flat.shape, N_DISTORTION))
    for column, power in ((0, 1), (1, 2), (4, 3)):
        basis[..., column] = flat * square[..., np.newaxis] ** power
    basis[..., 0, 2] = basis[..., 1, 3] = 2.0 * x * y
    basis[..., 1, 2], basis[..., 0, 3] = square + 2.0 * y * y, square + 2.0 * x * x
    return basis


def _linearised(bundle: Bundle, free: Bools) -> tuple[Floats, Floats]:
    """Residuals, shape (n,), and the derivative of the expected pixels by the free numbers and all poses."""
    n_cameras, (n_views, n_corners) = len(bundle.cameras), bundle.corners.shape[1:3]
    n_shared = len(free)
    slope = np.zeros((n_cameras, n_views, n_corners, 2, n_shared + N_POSE * n_views))
    residuals = np.empty(bundle.corners.shape)
    turned = bundle.board @ np.swapaxes(bundle.first_from_board[:, :3, :3], 1, 2)
    in_first = turned + bundle.first_from_board[:, np.newaxis, :3, 3]
    for index, eye in enumerate(bundle.cameras):
        inside = moved_points(eye.camera_from_world, in_first)
        pixels, by_intrinsic, by_point = pixels_and_slopes(eye, inside)
        residuals[index] = bundle.corners[index] - pixels
        slope[index, ..., N_INTRINSIC * index : N_INTRINSIC * (index + 1)] = by_intrinsic
        if index == 1:
            slope[index, ..., n_shared - N_POSE : n_shared] = slope_by_pose(
                by_point, inside - eye.camera_from_world[:3, 3]
            )
        by_view = slope_by_pose(by_point @ eye.camera_from_world[:3, :3], turned)
        for view in range(n_views):
            start = n_shared + N_POSE * view
            slope[index, view, ..., start : start + N_POSE] = by_view[view]
    kept = np.concatenate([free, np.ones(N_POSE * n_views, dtype=np.bool_)])
    return residuals.ravel(), slope.reshape(-1, len(kept))[:, kept]


def slope_by_pose(by_point: Floats, turned: Floats) -> Floats:
    """Return the derivative by a turn and a shift of what was turned already, shape (..., 2, 6).

    Parameters
    ----------
    by_point : ndarray, shape (..., 2, 3), px/mm
        Derivative by the point.
    turned : ndarray, shape (..., 3), mm
        Points after the rotation, before the shift.
    """
    return np.concatenate([-by_point @ cross_matrix(turned), by_point], axis=-1)


def _inverse(slope: Floats, damping: float) -> Floats:
    """The inverse of the normal matrix, damped."""
    scale = 1.0 / np.sqrt((slope * slope).sum(axis=0))
    if not np.isfinite(scale).all():
        raise InputError(UNDETERMINED)
    scaled = slope * scale
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    if values[0] < LEAST_EIGENVALUE:
        raise InputError(UNDETERMINED)
    return np.asarray((vectors / (values + damping)) @ vectors.T * np.outer(scale, scale))


def _step_if_better(bundle: Bundle, free: Bools, step: Floats, squares: float) -> Bundle | None:
    """The bundle after a step, or None if that is no camera or fits worse than `squares`."""
    try:
        moved = _moved(bundle, free, step)
    except InputError:
        return None
    return moved if float((_residuals_of(moved) ** 2).sum()) < squares else None


def _moved(bundle: Bundle, free: Bools, step: Floats) -> Bundle:
    """The bundle after a step."""
    shared = np.zeros(len(free))
    n_free = int(free.sum())
    shared[free] = step[:n_free]
    cameras = tuple(_moved_camera(eye, index, shared) for index, eye in enumerate(bundle.cameras))
    return replace(
        bundle, cameras=cameras, first_from_board=moved_pose(bundle.first_from_board, step[n_free:].reshape(-1, 6))
    )


def _moved_camera(eye: Camera, index: int, shared: Floats) -> Camera:
    own = shared[N_INTRINSIC * index : N_INTRINSIC * (index + 1)]
    matrix = eye.matrix.copy()
    matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += own[:N_MATRIX]
    pose = moved_pose(eye.camera_from_world, shared[-N_POSE:]) if index == 1 else eye.camera_from_world
    return replace(eye, matrix=matrix, distortion=eye.distortion + own[N_MATRIX:], camera_from_world=pose)


OUTLIER_RATIO = 3.0
"""A view is left out whose error is so many times the median view's: those of one recording differ by less than two,
and a view that errs three times as much would weigh as much as nine others."""

MAX_ROUNDS = 10
LEAST_VIEWS = 3
"""Two views leave a camera undetermined in practice; three determine it without redundancy, and the verdict says so."""


class Robust(NamedTuple):
    """An adjustment and the views that it was made from.

    Attributes
    ----------
    adjusted : Adjusted
        Of the kept views.
    kept : ndarray of bool, shape (n_views,)
        Which they are.
    view_rms : ndarray, shape (n_cameras, n_views), px
        Error of all views; those left out with their pose fitted to the others' cameras.
    """

    adjusted: Adjusted
    kept: Bools
    view_rms: Floats


def adjust_robustly(bundle: Bundle, free: Bools, inliers: Bools | None = None) -> Robust:
    """Return the most likely cameras by the views that fit each other; a view may come back once the others agree.

    Parameters
    ----------
    bundle : Bundle
        All views.
    free : ndarray of bool
        See `_adjust`.
    inliers : ndarray of bool, shape (n_views,), optional
        Views to begin with; all if not given.

    Raises
    ------
    InputError
        If fewer than three views fit each other, or they do not determine the cameras.
    """
    kept = np.ones(len(bundle.first_from_board), dtype=np.bool_) if inliers is None else inliers
    for _ in range(MAX_ROUNDS):
        adjusted = _adjust(bundle_of(bundle, kept), free)
        view_rms = _rms_of_all(bundle, adjusted, kept)
        limit = OUTLIER_RATIO * np.median(view_rms[:, kept], axis=1)
        fits = np.asarray((view_rms <= limit[:, np.newaxis]).all(axis=0))
        if (fits == kept).all():
            break
        if fits.sum() < LEAST_VIEWS:
            raise InputError(
                f"only {int(fits.sum())} views of the board fit each other; at least {LEAST_VIEWS} are needed, 10 to "
                "20 are better: hold the board still, or trigger both cameras together"
            )
        kept = fits
    return Robust(adjusted, kept, view_rms)


def bundle_of(bundle: Bundle, kept: Bools) -> Bundle:
    """Return the bundle of some views.

    Parameters
    ----------
    bundle : Bundle
        Of all views.
    kept : ndarray of bool, shape (n_views,)
        Which to keep.
    """
    return replace(bundle, first_from_board=bundle.first_from_board[kept], corners=bundle.corners[:, kept])


def _rms_of_all(bundle: Bundle, adjusted: Adjusted, kept: Bools) -> Floats:
    out = np.full(bundle.corners.shape[:2], np.inf)
    out[:, kept] = adjusted.view_rms
    held = np.zeros(len(adjusted.covariance), dtype=np.bool_)
    for view in np.flatnonzero(~kept):
        alone = bundle_of(bundle, np.arange(len(kept)) == view)
        try:
            posed = _adjust(replace(alone, cameras=adjusted.bundle.cameras), held)
        except InputError:  # no pose fits: as far out as can be
            continue
        out[:, view] = posed.view_rms[:, 0]
    return out
