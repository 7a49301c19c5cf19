"""Calibration of the cameras of a room with a wand or a board: from what all see to the rig, its errors, a verdict.

The errors of the rig say what becomes of points: to first order, and up to a motion of the whole room.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import Adjusted, Bundle, free_numbers, pixels_and_slopes
from skelgen.capture.calibration.chessboard import uncovered
from skelgen.capture.calibration.verdict import GOOD, REPEAT, USABLE, Verdict
from skelgen.capture.optics import in_image
from skelgen.capture.room.boards import AnyBoard, board_start
from skelgen.capture.room.bundles import adjust_room
from skelgen.capture.room.points import Views
from skelgen.capture.room.start import LEAST_SHARED, LENS, placed_in, start_values
from skelgen.capture.room.wand_and_ground import FEWEST_CAMERAS, TWO, check_wand, find_wand, with_equal_ends
from skelgen.errors import InputError
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import N_CAMERA_STD, Camera, CameraRig

GOOD_NOISE, USABLE_NOISE = 0.3, 1.0
"""px; what is left after the adjustment: sharp balls leave less than 0.1, a whole pixel is a mistake."""

LEAST_NOISE = 0.05
"""px; balls that are half hidden or touch err more than those of a wand."""

GOOD_SCALE, USABLE_SCALE = 0.0005, 0.005
"""Relative deviations of the distances between cameras."""

ENOUGH_VIEWS, ENOUGH_OF_BOARD = 200, 15
"""Views of each camera that are enough: of a wand in new places, two seconds at 100 Hz; of a board."""

MUCH_LEFT_OUT = 0.05
"""Part of the balls or corners that fit nothing above which a notice says so."""


@dataclass(frozen=True, eq=False)
class WandCalibration:
    """Calibrated cameras with their deviations, and what they rest on.

    Attributes
    ----------
    rig : CameraRig
        The world is the first camera's frame; see `on_ground`. Its noise is what the adjustment left,
        at least `LEAST_NOISE`.
    covariance : ndarray, shape (15 n_cameras, 15 n_cameras)
        Of all numbers, in the order of `CameraRig.std`.
    n_views : ndarray of intp, shape (n_cameras,)
        Views of the wand that were used.
    scale_std : float
        Relative standard deviation of the largest distance between cameras.
    point_std : float, mm
        Deviation of points where the wand was by the errors of the calibration, over all axes together.
    room : ndarray, shape (n, 3), mm
        Where the wand was, in the rig's world.
    verdict : Verdict
        Whether it is good, and what would make it better, in words.
    """

    rig: CameraRig
    covariance: Floats
    n_views: Ints
    scale_std: float
    point_std: float
    room: Floats
    verdict: Verdict


def calibrate_wand(
    frames: Sequence[Views], distances: Sequence[float], sizes: Sequence[tuple[int, int]], names: Sequence[str] = ()
) -> WandCalibration:
    """Return the cameras that saw a wand that was waved through the room.

    Parameters
    ----------
    frames : sequence of views
        What all cameras see, frame by frame; a camera without an image has no balls.
    distances : sequence of float, mm
        Where the two or three balls are along the wand; a middle one not in the middle.
    sizes : sequence of tuple of int, px
        Width and height of each camera's images.
    names : sequence of str
        What the cameras are called; by default they are numbered.

    Raises
    ------
    InputError
        If the wand's ends look alike, a camera shares no views with others, its images are mirrored, or the waves do
        not determine the cameras.
    """
    wand = check_wand(distances)
    called = list(names) or [f"camera {number + 1}" for number in range(len(sizes))]
    if not frames:
        raise InputError("there are no frames; wave the wand for a minute")
    seen = np.array([[find_wand(balls.centres, wand) for balls in views] for views in frames])
    seen = with_equal_ends(seen, LEAST_SHARED) if len(wand) == TWO else seen
    start = start_values(seen, wand, list(sizes), called)
    placed = np.isfinite(start.first[:, 0])
    return _calibration(start.of(placed), called, _WAND)


def calibrate_boards(
    seen: Floats, board: AnyBoard, sizes: Sequence[tuple[int, int]], names: Sequence[str] = ()
) -> WandCalibration:
    """Return the cameras that saw a board, some of them at a time.

    Parameters
    ----------
    seen : ndarray, shape (n_frames, n_cameras, n_corners, 2), px
        Where images show its corners; NaN where they do not. See `skelgen.capture.room.boards.corners_in`.
    board : Board or CharucoBoard
        What was seen.
    sizes : sequence of tuple of int, px
        Width and height of each camera's images.
    names : sequence of str
        What the cameras are called; by default they are numbered.

    Raises
    ------
    InputError
        If a camera sees too little of the board, or shares too few views with others.
    """
    called = list(names) or [f"camera {number + 1}" for number in range(len(sizes))]
    return _calibration(board_start(seen, board, sizes, called), called, _BOARD)


class _Words(NamedTuple):
    """What the verdict speaks of."""

    parts: str
    thing: str
    better: str
    fits_nothing: str
    enough: int


_WAND = _Words("balls", "wand", "wave it", "cover what shines besides the wand", ENOUGH_VIEWS)
_BOARD = _Words(
    "corners", "board", "hold it", "hold it still, and see that it is flat and counted right", ENOUGH_OF_BOARD
)


def _calibration(start: Bundle, names: Sequence[str], words: _Words) -> WandCalibration:
    adjusted = adjust_room(start, free_numbers(len(names), LENS))
    bundle = adjusted.bundle
    cameras = [replace(camera, name=name) for camera, name in zip(bundle.cameras, names, strict=True)]
    covariance = _of_places(adjusted.covariance, cameras)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(-1, N_CAMERA_STD)
    rig = CameraRig(cameras, max(adjusted.noise, LEAST_NOISE), std)
    shows = np.asarray(np.isfinite(bundle.seen[..., 0]).any(axis=2))
    scale_std = _scale_std(rig, covariance)
    balls = bundle.places.reshape(-1, 3)
    calibrated = point_covariances(rig, covariance, room_grid(balls))[0]
    point_std = float(np.sqrt(3.0 * np.diag(calibrated).mean()))
    n_views = shows.sum(axis=0)
    n_seen = int(np.isfinite(start.seen[..., 0]).sum())
    verdict = _judge(rig, adjusted, (scale_std, point_std), n_views, n_seen, words)
    return WandCalibration(rig, covariance, n_views, scale_std, point_std, balls, verdict)


def _of_places(covariance: Floats, cameras: Sequence[Camera]) -> Floats:
    """The covariance with each camera's place along its own axes instead of the shift of camera_from_world.

    With R, t its pose, the place is -R^T t; a turn w and a shift s move it by -(s + [t]x w) along the camera's axes.
    """
    change = np.eye(len(covariance))
    for index, camera in enumerate(cameras):
        turn, place = (slice(N_CAMERA_STD * index + first, N_CAMERA_STD * index + first + 3) for first in (9, 12))
        change[place, place] = -np.eye(3)
        change[place, turn] = -cross_matrix(camera.camera_from_world[:3, 3])
    return np.asarray(change @ covariance @ change.T)


def _scale_std(rig: CameraRig, covariance: Floats) -> float:
    """Relative deviation of the distance of the first camera from the farthest one."""
    gaps = rig.places - rig.places[0]
    far = int(np.linalg.norm(gaps, axis=1).argmax())
    distance = float(np.linalg.norm(gaps[far]))
    along = rig.cameras[far].camera_from_world[:3, :3] @ gaps[far] / distance
    block = slice(N_CAMERA_STD * far + 12, N_CAMERA_STD * far + 15)
    return float(np.sqrt(along @ covariance[block, block] @ along)) / distance


def _judge(
    rig: CameraRig, adjusted: Adjusted[Bundle], stated: tuple[float, float], n_views: Ints, n_seen: int, words: _Words
) -> Verdict:
    (scale_std, point_std), extent = stated, extent_of(adjusted.bundle.places.reshape(-1, 3))
    is_good = adjusted.noise <= GOOD_NOISE and scale_std <= GOOD_SCALE and n_views.min() >= words.enough
    is_usable = adjusted.noise <= USABLE_NOISE and scale_std <= USABLE_SCALE
    grade = GOOD if is_good else USABLE if is_usable else REPEAT
    sentences = [
        f"{grade.capitalize()}: {words.parts} lie {adjusted.noise:.2f} px from where they are expected along each "
        f"axis, in {int(n_views.min())} to {int(n_views.max())} views a camera; points are known to "
        f"{point_std:.2g} mm, lengths to {100 * scale_std:.2g} %; the {words.thing} was in {extent} m."
    ]
    if adjusted.noise > USABLE_NOISE:
        sentences.append(
            "Errors of more than a pixel are no noise: are all images of one moment, and the distances right?"
        )
    n_used = int(np.isfinite(adjusted.bundle.seen[..., 0]).sum())
    if n_seen - n_used > MUCH_LEFT_OUT * n_used:
        sentences.append(f"{100 * (1 - n_used / n_seen):.0f} % of the {words.parts} fit nothing: {words.fits_nothing}.")
    for camera, count in zip(rig.cameras, n_views.tolist(), strict=True):
        if count < words.enough:
            sentences.append(
                f"{camera.name} has only {count} views of the {words.thing}: {words.better} where it looks."
            )
    for index, camera in enumerate(rig.cameras):
        seen = adjusted.bundle.seen[:, index].reshape(-1, 2)
        gaps = uncovered([seen[np.isfinite(seen[:, 0])]], camera.size)
        if gaps:
            sentences.append(f"{camera.name} has not seen the {words.thing} in the {', '.join(gaps)} of its image.")
    return Verdict(grade, tuple(sentences))


def extent_of(room: Floats) -> str:
    """Return how long the sides of the volume are in which points were, in words: ``4.1 x 3.0 x 1.9``, m."""
    sides = np.ptp(np.quantile(room, (0.02, 0.98), axis=0), axis=0) / 1000
    return " x ".join(f"{side:.1f}" for side in sorted(sides, reverse=True))


def on_ground(calibration: WandCalibration, first_from_ground: Floats) -> WandCalibration:
    """Return a calibration whose world is the ground; deviations stay, as they are along the cameras' own axes.

    Parameters
    ----------
    calibration : WandCalibration
        In any world.
    first_from_ground : ndarray, shape (4, 4), mm
        The ground in that world; see `skelgen.capture.room.wand_and_ground`.
    """
    rig = calibration.rig
    cameras = [placed_in(camera, first_from_ground) for camera in rig.cameras]
    turn, shift = first_from_ground[:3, :3], first_from_ground[:3, 3]
    return replace(calibration, rig=replace(rig, cameras=cameras), room=(calibration.room - shift) @ turn)


def point_covariances(rig: CameraRig, covariance: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return the covariances of points by errors of the calibration and of balls, seen by all cameras that can.

    Parameters
    ----------
    rig : CameraRig
        The cameras; its noise is that of the balls.
    covariance : ndarray, shape (15 n_cameras, 15 n_cameras)
        Of their numbers, in the order of `CameraRig.std`.
    points : ndarray, shape (n, 3), mm
        In the rig's world.

    Returns
    -------
    calibrated : ndarray, shape (3 m, 3 m), mm^2
        Covariance of those of the points that two cameras see, by the errors of the calibration alone, up to a
        motion of all points as one.
    noisy : ndarray, shape (m, 3, 3), mm^2
        Covariance of each by the noise of the balls alone.
    """
    normal = np.zeros((len(points), 3, 3))
    change = np.zeros((len(points), 3, N_CAMERA_STD * len(rig.cameras)))
    count = np.zeros(len(points), dtype=np.intp)
    for index, camera in enumerate(rig.cameras):
        turn = camera.camera_from_world[:3, :3]
        inside = points @ turn.T + camera.camera_from_world[:3, 3]
        with np.errstate(all="ignore"):
            pixels, by_intrinsic, by_point = pixels_and_slopes(camera, inside)
        seen = in_image(camera, pixels) & (inside[:, 2] > 0)
        by_camera = np.concatenate([by_intrinsic, -by_point @ cross_matrix(inside), -by_point], axis=-1)
        slope = (by_point @ turn) * seen[:, np.newaxis, np.newaxis]
        normal += np.swapaxes(slope, 1, 2) @ slope
        change[..., index * N_CAMERA_STD : (index + 1) * N_CAMERA_STD] = np.swapaxes(slope, 1, 2) @ by_camera
        count += seen
    usable = count >= FEWEST_CAMERAS
    inverse = np.linalg.inv(normal[usable])
    slopes = _without_motion((-inverse @ change[usable]).reshape(-1, change.shape[2]), points[usable])
    return slopes @ covariance @ slopes.T, np.asarray(rig.noise**2 * inverse, dtype=np.float64)


def _without_motion(slopes: Floats, points: Floats) -> Floats:
    """Remove from derivatives of points, shape (3 m, n), the part that moves all points rigidly."""
    about = points - points.mean(axis=0)
    motions = np.concatenate([np.tile(np.eye(3), (len(points), 1)), cross_matrix(about).reshape(-1, 3)], axis=1)
    basis = np.linalg.qr(motions)[0]
    return np.asarray(slopes - basis @ (basis.T @ slopes))


GRID_STEPS = 6
"""Points along each side of `room_grid`."""


def room_grid(room: Floats) -> Floats:
    """Return a grid of points in the middle of the volume in which points were, shape (n_points, 3), mm.

    Parameters
    ----------
    room : ndarray, shape (n, 3), mm
        Where it was.
    """
    low, high = np.quantile(room, 0.1, axis=0), np.quantile(room, 0.9, axis=0)
    sides = [np.linspace(*pair, GRID_STEPS) for pair in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)
