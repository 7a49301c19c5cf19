"""Bundle adjustment of cameras that look at a board or a wand: lenses, and all places at once.

Gauss and Newton's method with exact derivatives, damped (Levenberg and Marquardt). A board has six numbers in each
frame, its pose, a wand five, so that known distances hold exactly and give the scale. Frames share no numbers but the
cameras': they are eliminated one by one (Schur complement), and what is left to solve has fifteen numbers a camera. At
the minimum its inverse gives the standard deviations of all cameras, with the noise from what remains; where that is
normal they are the bound of Cramer and Rao (Gaschler 2011, equations 4.8, 4.9).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Generic, Self, TypeVar

import numpy as np

from skelgen.capture.optics import distortion_jacobian
from skelgen.errors import InputError
from skelgen.geometry.rotations import N_POSE, cross_matrix, moved_points, moved_pose, slopes_by_motion
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import N_CAMERA_STD, N_DISTORTION, Camera

N_MATRIX = 4
"""Numbers of a camera's matrix: fx, fy, cx, cy."""

N_INTRINSIC = N_MATRIX + N_DISTORTION
MAX_STEPS = 60
STANDS_STILL, ROUNDING = 1e-12, 1e-9
"""Gain as a part of the sum of squares, and by distance [px] of each corner, below which the minimum is reached."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e8
LEVEL = 1e-9
"""Added to the information of each frame: wands that fit nothing would run away without it."""

LEAST_EIGENVALUE = 1e-13
"""Of the cameras' normal matrix, its diagonal scaled to 1: below it some numbers are not determined."""


def pixels_and_slopes(camera: Camera, inside: Floats) -> tuple[Floats, Floats, Floats]:
    """Return pixels of points in a camera's frame, with their derivatives by the intrinsic numbers and by the point.

    Unlike `project`, this knows no fold of the lens: on the way to the minimum any lens may occur.

    Parameters
    ----------
    camera : Camera
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
    bent = flat + basis @ camera.distortion
    focal = np.diag(camera.matrix)[:2]
    by_intrinsic = np.zeros((*flat.shape, N_INTRINSIC))
    for axis in (0, 1):
        by_intrinsic[..., axis, axis], by_intrinsic[..., axis, 2 + axis] = bent[..., axis], 1.0
    by_intrinsic[..., N_MATRIX:] = focal[:, np.newaxis] * basis
    by_point = np.zeros((*flat.shape, 3))
    by_point[..., :2] = distortion_jacobian(camera, flat) * focal[:, np.newaxis]
    by_point[..., 2] = -(by_point[..., :2] @ flat[..., np.newaxis])[..., 0]
    by_point /= inside[..., 2, np.newaxis, np.newaxis]
    return bent * focal + camera.matrix[:2, 2], by_intrinsic, by_point


def slopes_of_camera(camera: Camera, points: Floats) -> tuple[Floats, Floats]:
    """Return how pixels follow the numbers of a camera, shape (n, 2, 15), and the points, shape (n, 2, 3).

    Parameters
    ----------
    camera : Camera
        Its `camera_from_world` is its place relative to the first camera's frame.
    points : ndarray, shape (n, 3), mm
        In the first camera's frame.
    """
    inside = moved_points(camera.camera_from_world, points)
    _, by_intrinsic, by_point = pixels_and_slopes(camera, inside)
    by_pose = slope_by_pose(by_point, inside - camera.camera_from_world[:3, 3])
    return np.concatenate([by_intrinsic, by_pose], axis=-1), np.asarray(by_point @ camera.camera_from_world[:3, :3])


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


@dataclass(frozen=True, eq=False)
class Bundle(ABC):
    """Cameras that see a rigid thing in many frames.

    Attributes
    ----------
    cameras : tuple of Camera
        All of them; the frame of the first one, which stays where it is, is the world.
    seen : ndarray, shape (n_frames, n_cameras, n_points, 2), px
        Where its points were seen; NaN where one was not.
    """

    cameras: tuple[Camera, ...]
    seen: Floats

    n_own, fewest_cameras = 0, 1
    """Numbers of the thing in each frame, and cameras that determine them."""

    advice: ClassVar[str] = ""
    """What makes the views determine the cameras."""

    @property
    @abstractmethod
    def places(self) -> Floats:
        """Places of its points, shape (n_frames, n_points, 3), mm."""

    @abstractmethod
    def slopes(self) -> Floats:
        """Return how places change with the numbers of their frame, shape (n_frames, n_points, 3, n_own)."""

    @abstractmethod
    def moved(self, steps: Floats) -> Self:
        """Return the bundle after steps of each frame's numbers, shape (n_frames, n_own)."""

    @abstractmethod
    def of(self, frames: Bools) -> Self:
        """Return the bundle of some frames."""


@dataclass(frozen=True, eq=False)
class BoardBundle(Bundle):
    """A board: its pose in each frame.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        Corners in the board's frame.
    poses : ndarray, shape (n_frames, 4, 4), mm
        world_from_board.
    """

    points: Floats
    poses: Floats

    n_own = N_POSE
    advice = (
        "turn the board about different axes by 20 to 45 degrees, move it through the whole image of each camera, and "
        "take 10 to 20 views"
    )

    @property
    def places(self) -> Floats:
        """Places of all corners, shape (n_frames, n_points, 3), mm."""
        return moved_points(self.poses, self.points)

    def slopes(self) -> Floats:
        """Return how corners change with a turn and a shift of the board."""
        return slopes_by_motion(self.points @ np.swapaxes(self.poses[:, :3, :3], 1, 2))

    def moved(self, steps: Floats) -> Self:
        """Return the bundle after a turn and a shift of each board."""
        return replace(self, poses=moved_pose(self.poses, steps))

    def of(self, frames: Bools) -> Self:
        """Return the bundle of some frames."""
        return replace(self, poses=self.poses[frames], seen=self.seen[frames])


_B = TypeVar("_B", bound=Bundle)


@dataclass(frozen=True, eq=False)
class Adjusted(Generic[_B]):
    """The most likely bundle.

    Attributes
    ----------
    bundle : Bundle
        With adjusted cameras and places.
    noise : float, px
        Standard deviation of a point along one axis, from the residuals and the degrees of freedom.
    covariance : ndarray, shape (15 n_cameras, 15 n_cameras)
        Of fx, fy, cx, cy, k1, k2, p1, p2, k3, turn [rad] and shift [mm] of all cameras; zero where a number was held.
    residuals : ndarray, shape (n_frames, n_cameras, n_points, 2), px
        Seen minus expected; NaN where a point was not seen.
    """

    bundle: _B
    noise: float
    covariance: Floats
    residuals: Floats

    @property
    def rms(self) -> float:
        """Root mean square distance [px] of the points from where they are expected, over all images."""
        return float(np.sqrt(np.nanmean((self.residuals**2).sum(axis=-1))))

    @property
    def view_rms(self) -> Floats:
        """The same for each image, shape (n_cameras, n_frames), px."""
        return np.asarray(np.sqrt(np.nanmean((self.residuals**2).sum(axis=-1), axis=-1)).T)


def free_numbers(n_cameras: int, intrinsic: tuple[int, ...]) -> Bools:
    """Return which numbers of the cameras are adjusted, shape (15 n_cameras,): all poses but the first one's.

    Parameters
    ----------
    n_cameras : int
        How many.
    intrinsic : tuple of int
        Which of fx, fy, cx, cy, k1, k2, p1, p2, k3.
    """
    free = np.zeros((n_cameras, N_CAMERA_STD), dtype=np.bool_)
    free[:, list(intrinsic)] = True
    free[1:, N_INTRINSIC:] = True
    return free.ravel()


def adjust(bundle: _B, free: Bools) -> Adjusted[_B]:
    """Return the most likely cameras and places.

    Parameters
    ----------
    bundle : Bundle
        Near the solution.
    free : ndarray of bool, shape (15 n_cameras,)
        Which numbers of the cameras are adjusted, see `free_numbers`; those of each frame always are.

    Raises
    ------
    InputError
        If the views do not determine the cameras.
    """
    bundle = _minimised(bundle, free)
    residuals, normal = residuals_of(bundle), _reduced(bundle, free, 0.0)[0]
    n_values, n_numbers = int(np.isfinite(residuals).sum()), len(normal) + bundle.n_own * len(bundle.seen)
    noise = float(np.sqrt(np.nansum(residuals**2) / max(n_values - n_numbers, 1)))
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = noise**2 * _inverse(normal, bundle.advice)
    return Adjusted(bundle, noise, covariance, residuals)


def _with_enough(bundle: _B) -> _B:
    """Keep the frames that have more measured numbers than unknowns."""
    shown = np.isfinite(bundle.seen[..., 0])
    is_enough = (2 * shown.sum(axis=(1, 2)) > bundle.n_own) & (shown.any(axis=2).sum(axis=1) >= bundle.fewest_cameras)
    return bundle.of(np.asarray(is_enough))


def _minimised(bundle: _B, free: Bools) -> _B:
    damping = FIRST_DAMPING
    bundle = _with_enough(bundle)
    squares = float(np.nansum(residuals_of(bundle) ** 2))
    for _ in range(MAX_STEPS):
        normal, gradient, parts = _reduced(bundle, free, damping)
        step = _solved(normal, gradient, bundle.advice)
        moved = _moved(bundle, free, step, parts)
        after = np.inf if moved is None else float(np.nansum(residuals_of(moved) ** 2))
        if moved is not None and after < squares:
            gain, bundle, squares = squares - after, moved, after
            damping = max(damping / 10.0, LEAST_DAMPING)
            if gain <= STANDS_STILL * squares + bundle.seen.size * ROUNDING**2:
                break
        else:
            damping *= 10.0
            if damping > MOST_DAMPING:
                break
    return bundle


def residuals_of(bundle: Bundle) -> Floats:
    """Return seen minus expected, shape (n_frames, n_cameras, n_balls, 2), px."""
    balls = bundle.places
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        expected = [pixels_and_slopes(one, moved_points(one.camera_from_world, balls))[0] for one in bundle.cameras]
        return np.asarray(bundle.seen - np.stack(expected, axis=1))


_Parts = tuple[Floats, Floats, Floats]
"""Coupling of cameras and wands, wands' normal matrices and gradients."""


def _reduced(bundle: Bundle, free: Bools, damping: float) -> tuple[Floats, Floats, _Parts]:
    """Normal matrix and gradient of the free numbers of the cameras, the wands eliminated."""
    n_cameras, n_frames, n_own = len(bundle.cameras), len(bundle.seen), bundle.n_own
    balls, by_wand = bundle.places, bundle.slopes()
    own, coupling = (
        np.zeros((n_cameras, N_CAMERA_STD, N_CAMERA_STD)),
        np.zeros((n_frames, n_cameras, N_CAMERA_STD, n_own)),
    )
    gradient, wands = np.zeros((n_cameras, N_CAMERA_STD)), np.zeros((n_frames, n_own, n_own))
    pulls = np.zeros((n_frames, n_own))
    for index, camera in enumerate(bundle.cameras):
        turn, shift = camera.camera_from_world[:3, :3], camera.camera_from_world[:3, 3]
        shown = np.flatnonzero(np.isfinite(bundle.seen[:, index, :, 0]).any(axis=1))
        turned = balls[shown] @ turn.T
        pixels, by_intrinsic, by_point = pixels_and_slopes(camera, turned + shift)
        residual = bundle.seen[shown, index] - pixels
        valid = np.isfinite(residual)
        residual = np.where(valid, residual, 0.0).reshape(len(shown), -1)
        by_camera = np.concatenate([by_intrinsic, slope_by_pose(by_point, turned)], axis=-1) * valid[..., np.newaxis]
        by_camera = by_camera.reshape(len(shown), -1, N_CAMERA_STD)
        wand = ((by_point @ turn) @ by_wand[shown] * valid[..., np.newaxis]).reshape(len(shown), -1, n_own)
        flat = by_camera.reshape(-1, N_CAMERA_STD)
        own[index] = flat.T @ flat
        gradient[index] = flat.T @ residual.ravel()
        coupling[shown, index] = np.swapaxes(by_camera, 1, 2) @ wand
        wands[shown] += np.swapaxes(wand, 1, 2) @ wand
        pulls[shown] += (np.swapaxes(wand, 1, 2) @ residual[..., np.newaxis])[..., 0]
    wands[:, range(n_own), range(n_own)] *= 1.0 + damping
    wands[:, range(n_own), range(n_own)] += LEVEL
    whole = coupling.reshape(n_frames, -1, n_own)[:, free]
    normal = np.zeros((len(free), len(free)))
    for index in range(n_cameras):
        block = slice(index * N_CAMERA_STD, (index + 1) * N_CAMERA_STD)
        normal[block, block] = own[index] + damping * np.diag(np.diag(own[index]))
    try:
        root = np.linalg.inv(np.linalg.cholesky(wands))
    except np.linalg.LinAlgError as error:
        raise InputError(_undetermined(bundle.advice)) from error
    half = (whole @ np.swapaxes(root, 1, 2)).transpose(1, 0, 2).reshape(whole.shape[1], n_frames * n_own)
    reduced = normal[np.ix_(free, free)] - half @ half.T
    pulled = gradient.ravel()[free] - half @ (root @ pulls[..., np.newaxis]).ravel()
    return reduced, pulled, (whole, wands, pulls)


def _solved(normal: Floats, gradient: Floats, advice: str) -> Floats:
    scale = _scale_of(normal, advice)
    return np.asarray(scale * np.linalg.lstsq(normal * np.outer(scale, scale), scale * gradient, rcond=None)[0])


def _inverse(normal: Floats, advice: str) -> Floats:
    scale = _scale_of(normal, advice)
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    if values.min(initial=np.inf) < LEAST_EIGENVALUE:
        raise InputError(_undetermined(advice))
    return np.asarray((vectors / values) @ vectors.T * np.outer(scale, scale))


def _scale_of(normal: Floats, advice: str) -> Floats:
    diagonal = np.diag(normal)
    if not (diagonal > 0).all():
        raise InputError(_undetermined(advice))
    return np.asarray(1.0 / np.sqrt(diagonal))


def _undetermined(advice: str) -> str:
    return f"the views do not determine the cameras: {advice}"


def _moved(bundle: _B, free: Bools, step: Floats, parts: _Parts) -> _B | None:
    """Return the bundle after a step of the cameras, the wands following; None if a camera becomes impossible."""
    whole, wands, pulls = parts
    back = np.linalg.solve(wands, (pulls - np.swapaxes(whole, 1, 2) @ step)[..., np.newaxis])[..., 0]
    shared = np.zeros(len(free))
    shared[free] = step
    try:
        cameras = tuple(
            _moved_camera(one, own) for one, own in zip(bundle.cameras, shared.reshape(-1, N_CAMERA_STD), strict=True)
        )
    except InputError:
        return None
    return replace(bundle.moved(np.asarray(back, dtype=np.float64)), cameras=cameras)


def _moved_camera(camera: Camera, step: Floats) -> Camera:
    """The camera after a step of its numbers, shape (15,), in the order of `Adjusted.covariance`."""
    matrix = camera.matrix.copy()
    matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += step[:N_MATRIX]
    pose = moved_pose(camera.camera_from_world, step[N_INTRINSIC:])
    distortion = camera.distortion + step[N_MATRIX:N_INTRINSIC]
    return replace(camera, matrix=matrix, distortion=distortion, camera_from_world=pose)
