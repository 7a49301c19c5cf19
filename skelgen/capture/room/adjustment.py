"""Bundle adjustment of cameras around a room that look at a wand or a board: lenses, and all places at once.

Gauss and Newton's method with exact derivatives, damped (Levenberg and Marquardt). A wand has five numbers in each
frame, its first ball and its direction, a board six, so that known distances hold exactly and give the scale. Frames
share no numbers but the cameras': they are eliminated one by one (Schur complement), and what is left to solve
has fifteen numbers a camera. Its inverse gives the standard deviations of all cameras; where the noise is normal that
is the bound of Cramer and Rao.
"""

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import N_INTRINSIC, pixels_and_slopes, slope_by_pose
from skelgen.capture.room.bundles import RoomBundle
from skelgen.errors import InputError
from skelgen.geometry.rotations import N_POSE, moved_points, moved_pose
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera

N_CAMERA = N_INTRINSIC + N_POSE
MAX_STEPS, MAX_ROUNDS = 60, 6
STANDS_STILL = 1e-9
"""Gain as a part of the sum of squares below which the minimum is reached."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e8
OUTLIER = 5.0
"""Standard deviations beyond which a ball is left out: of a million true ones one is."""

LEVEL = 1e-9
"""Added to the information of each wand: wands that fit nothing would run away without it."""

LEAST_EIGENVALUE = 1e-13
"""Of the cameras' normal matrix, its diagonal scaled to 1: below it some numbers are not determined."""

UNDETERMINED = (
    "the views do not determine the cameras: move the wand or the board longer, in all parts of the room, near and far "
    "from each camera, upright and level"
)

_B = TypeVar("_B", bound=RoomBundle)


@dataclass(frozen=True, eq=False)
class AdjustedRoom(Generic[_B]):
    """The most likely bundle.

    Attributes
    ----------
    bundle : RoomBundle
        With adjusted cameras and wands; balls that were left out are NaN in `seen`.
    noise : float, px
        Standard deviation of a ball along one axis, from the residuals and the degrees of freedom.
    covariance : ndarray, shape (15 n_cameras, 15 n_cameras)
        Of fx, fy, cx, cy, k1, k2, p1, p2, k3, turn [rad] and shift [mm] of all cameras; zero where a number was held.
    residuals : ndarray, shape (n_frames, n_cameras, n_balls, 2), px
        Seen minus expected; NaN where a ball was not seen or is left out.
    n_left_out : int
        Balls that fitted nothing.
    """

    bundle: _B
    noise: float
    covariance: Floats
    residuals: Floats
    n_left_out: int = 0


def free_numbers(n_cameras: int, intrinsic: tuple[int, ...]) -> Bools:
    """Return which numbers of the cameras are adjusted, shape (15 n_cameras,): all poses but the first one's.

    Parameters
    ----------
    n_cameras : int
        How many.
    intrinsic : tuple of int
        Which of fx, fy, cx, cy, k1, k2, p1, p2, k3.
    """
    free = np.zeros((n_cameras, N_CAMERA), dtype=np.bool_)
    free[:, list(intrinsic)] = True
    free[1:, N_INTRINSIC:] = True
    return free.ravel()


def adjust_room(bundle: _B, free: Bools) -> AdjustedRoom[_B]:
    """Return the most likely cameras and wands, without the balls that fit nothing.

    Parameters
    ----------
    bundle : RoomBundle
        Near the solution.
    free : ndarray of bool, shape (15 n_cameras,)
        Which numbers are adjusted; see `free_numbers`.

    Raises
    ------
    InputError
        If the waves do not determine the cameras.
    """
    n_seen = int(np.isfinite(bundle.seen[..., 0]).sum())
    for _ in range(MAX_ROUNDS):
        bundle = _minimised(bundle, free)
        residuals = residuals_of(bundle)
        spread = float(SIGMA_OF_MEDIAN * np.nanmedian(np.abs(residuals))) or 1.0  # px, of most residuals
        with np.errstate(invalid="ignore"):
            is_out = (residuals**2).sum(axis=-1) > 2.0 * (OUTLIER * spread) ** 2
        if not is_out.any():
            break
        seen = bundle.seen.copy()
        seen[is_out] = np.nan
        bundle = _with_enough(replace(bundle, seen=seen))
    residuals = residuals_of(bundle)
    normal, _, _ = _reduced(bundle, free, 0.0)
    n_numbers = len(normal) + bundle.n_own * len(bundle.seen)
    n_values = int(np.isfinite(residuals).sum())
    noise = float(np.sqrt(np.nansum(residuals**2) / max(n_values - n_numbers, 1)))
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = noise**2 * _inverse(normal)
    return AdjustedRoom(bundle, noise, covariance, residuals, n_seen - int(np.isfinite(bundle.seen[..., 0]).sum()))


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
        step = _solved(normal, gradient)
        moved = _moved(bundle, free, step, parts)
        after = np.inf if moved is None else float(np.nansum(residuals_of(moved) ** 2))
        if moved is not None and after < squares:
            gain, bundle, squares = squares - after, moved, after
            damping = max(damping / 10.0, LEAST_DAMPING)
            if gain <= STANDS_STILL * squares:
                break
        else:
            damping *= 10.0
            if damping > MOST_DAMPING:
                break
    return bundle


def residuals_of(bundle: RoomBundle) -> Floats:
    """Return seen minus expected, shape (n_frames, n_cameras, n_balls, 2), px."""
    balls = bundle.places
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        expected = [pixels_and_slopes(eye, moved_points(eye.camera_from_world, balls))[0] for eye in bundle.cameras]
        return np.asarray(bundle.seen - np.stack(expected, axis=1))


_Parts = tuple[Floats, Floats, Floats]
"""Coupling of cameras and wands, wands' normal matrices and gradients."""


def _reduced(bundle: RoomBundle, free: Bools, damping: float) -> tuple[Floats, Floats, _Parts]:
    """Normal matrix and gradient of the free numbers of the cameras, the wands eliminated."""
    n_cameras, n_frames, n_own = len(bundle.cameras), len(bundle.seen), bundle.n_own
    balls, by_wand = bundle.places, bundle.slopes()
    own, coupling = np.zeros((n_cameras, N_CAMERA, N_CAMERA)), np.zeros((n_frames, n_cameras, N_CAMERA, n_own))
    gradient, wands = np.zeros((n_cameras, N_CAMERA)), np.zeros((n_frames, n_own, n_own))
    pulls = np.zeros((n_frames, n_own))
    for index, eye in enumerate(bundle.cameras):
        turn, shift = eye.camera_from_world[:3, :3], eye.camera_from_world[:3, 3]
        shown = np.flatnonzero(np.isfinite(bundle.seen[:, index, :, 0]).any(axis=1))
        turned = balls[shown] @ turn.T
        pixels, by_intrinsic, by_point = pixels_and_slopes(eye, turned + shift)
        residual = bundle.seen[shown, index] - pixels
        valid = np.isfinite(residual)
        residual = np.where(valid, residual, 0.0).reshape(len(shown), -1)
        camera = np.concatenate([by_intrinsic, slope_by_pose(by_point, turned)], axis=-1) * valid[..., np.newaxis]
        camera = camera.reshape(len(shown), -1, N_CAMERA)
        wand = ((by_point @ turn) @ by_wand[shown] * valid[..., np.newaxis]).reshape(len(shown), -1, n_own)
        flat = camera.reshape(-1, N_CAMERA)
        own[index] = flat.T @ flat
        gradient[index] = flat.T @ residual.ravel()
        coupling[shown, index] = np.swapaxes(camera, 1, 2) @ wand
        wands[shown] += np.swapaxes(wand, 1, 2) @ wand
        pulls[shown] += (np.swapaxes(wand, 1, 2) @ residual[..., np.newaxis])[..., 0]
    wands[:, range(n_own), range(n_own)] *= 1.0 + damping
    wands[:, range(n_own), range(n_own)] += LEVEL
    whole = coupling.reshape(n_frames, -1, n_own)[:, free]
    normal = np.zeros((len(free), len(free)))
    for index in range(n_cameras):
        block = slice(index * N_CAMERA, (index + 1) * N_CAMERA)
        normal[block, block] = own[index] + damping * np.diag(np.diag(own[index]))
    try:
        root = np.linalg.inv(np.linalg.cholesky(wands))
    except np.linalg.LinAlgError as error:
        raise InputError(UNDETERMINED) from error
    half = (whole @ np.swapaxes(root, 1, 2)).transpose(1, 0, 2).reshape(whole.shape[1], -1)
    reduced = normal[np.ix_(free, free)] - half @ half.T
    pulled = gradient.ravel()[free] - half @ (root @ pulls[..., np.newaxis]).ravel()
    return reduced, pulled, (whole, wands, pulls)


def _scale_of(normal: Floats) -> Floats:
    diagonal = np.diag(normal)
    if not (diagonal > 0).all():
        raise InputError(UNDETERMINED)
    return np.asarray(1.0 / np.sqrt(diagonal))


def _solved(normal: Floats, gradient: Floats) -> Floats:
    scale = _scale_of(normal)
    return np.asarray(scale * np.linalg.lstsq(normal * np.outer(scale, scale), scale * gradient, rcond=None)[0])


def _inverse(normal: Floats) -> Floats:
    scale = _scale_of(normal)
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    if values[0] < LEAST_EIGENVALUE:
        raise InputError(UNDETERMINED)
    return np.asarray((vectors / values) @ vectors.T * np.outer(scale, scale))


def _moved(bundle: _B, free: Bools, step: Floats, parts: _Parts) -> _B | None:
    """Return the bundle after a step of the cameras, the wands following; None if a camera becomes impossible."""
    whole, wands, pulls = parts
    back = np.linalg.solve(wands, (pulls - np.swapaxes(whole, 1, 2) @ step)[..., np.newaxis])[..., 0]
    shared = np.zeros(len(free))
    shared[free] = step
    try:
        cameras = tuple(
            moved_camera(eye, own) for eye, own in zip(bundle.cameras, shared.reshape(-1, N_CAMERA), strict=True)
        )
    except InputError:
        return None
    return replace(bundle.moved(np.asarray(back, dtype=np.float64)), cameras=cameras)


def moved_camera(eye: Camera, step: Floats) -> Camera:
    """Return a camera after a step.

    Parameters
    ----------
    eye : Camera
        Before.
    step : ndarray, shape (15,)
        Of fx, fy, cx, cy [px], k1, k2, p1, p2, k3, its turn about its own axes [rad] and its shift [mm].
    """
    matrix = eye.matrix.copy()
    matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += step[:4]
    pose = moved_pose(eye.camera_from_world, step[N_INTRINSIC:])
    return replace(eye, matrix=matrix, distortion=eye.distortion + step[4:N_INTRINSIC], camera_from_world=pose)
