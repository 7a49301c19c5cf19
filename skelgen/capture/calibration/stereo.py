"""Calibration of two cameras from pairs of images of a chessboard (Bouguet; Gaschler 2011, chapter 4.1).

Each camera is guessed alone, the second is placed by the pair that most others agree with, and then everything is
adjusted together: lenses, the cameras' places, the poses of the board.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import N_INTRINSIC, Adjusted, BoardBundle
from skelgen.capture.calibration.chessboard import Board, BoardView, board_that_is_there, find_board, turned_boards
from skelgen.capture.calibration.lens import AUTO, LEAST_VIEWS, adjust_lens, guess_camera
from skelgen.capture.calibration.verdict import PairSeen, Verdict, judge
from skelgen.capture.images import read_image
from skelgen.capture.optics import project, triangulate
from skelgen.capture.values import Image
from skelgen.errors import InputError
from skelgen.geometry.rotations import moved_points, nearest_rotation, transform_from, vector_from_matrix
from skelgen.kinematics.joints.angles import rotation_vector_deviations
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import N_CAMERA_STD, TYPICAL_NOISE, Camera, StereoRig
from skelgen.progress import SILENT, Monitor, with_progress

Picture = Image | Path | str
"""An image, or the file that holds it."""

DISAGREEMENT = 10.0
"""A pair is left out at first if its corners are so many times as far from the guess as those of the median pair."""


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """Two calibrated cameras with their deviations, and the images that they were found from.

    Attributes
    ----------
    rig : StereoRig
        The world is the left camera's frame. Its noise is that of the corners along one axis, at least the default.
    rms : float, px
        Root mean square distance of the corners from where they are expected, over both images of all used pairs.
    left_std, right_std : ndarray, shape (9,)
        Standard deviations of fx, fy, cx, cy [px], k1, k2, p1, p2, k3; zero where a number was held at zero.
    rotation_std : ndarray, shape (3,), rad
        Of the rotation vector of right_from_left.
    turn_std : float, rad
        Of the angle of that turn.
    translation_std : ndarray, shape (3,), mm
        Of right_from_left's translation.
    baseline_std : float, mm
        Of the distance between the cameras.
    pairs : tuple of PairSeen
        All pairs of images, the used and the others, with the reason.
    verdict : Verdict
        Whether it is good, and what would make it better, in words.
    """

    rig: StereoRig
    rms: float
    left_std: Floats
    right_std: Floats
    rotation_std: Floats
    turn_std: float
    translation_std: Floats
    baseline_std: float
    pairs: tuple[PairSeen, ...]
    verdict: Verdict


def calibrate_stereo(
    left_images: Sequence[Picture],
    right_images: Sequence[Picture],
    board: tuple[int, int] = (9, 6),
    square: float = 25.0,
    lens: str = AUTO,
    monitor: Monitor = SILENT,
) -> StereoCalibration:
    """Return the rig that took pairs of images of a chessboard.

    Parameters
    ----------
    left_images, right_images : sequence of ndarray of uint8 or path
        The n-th of both were taken at one moment.
    board : tuple of int
        Inner corners in a row and in a column.
    square : float, mm
        Side of a square.
    lens : str
        ``auto``, ``radial``, ``tangential`` or ``full``; see `skelgen.capture.calibration.lens`.
    monitor : Monitor
        Reports each pair.

    Raises
    ------
    InputError
        If images are missing, differ in size, show no board, or if no rig explains them.
    """
    what = Board(board[0], board[1], square)
    n_left, n_right = len(left_images), len(right_images)
    if n_left != n_right:
        raise InputError(f"{n_left} left and {n_right} right images; each left one needs the right one of its moment")
    if not n_left:
        raise InputError("no images; give the left and the right ones of 10 to 20 poses of a chessboard")
    size = _common_size(left_images, right_images)
    monitor.begin("boards")
    views = [
        (find_board(_grey(left), what), find_board(_grey(right), what))
        for left, right in with_progress(zip(left_images, right_images, strict=True), n_left, monitor, every=1)
    ]
    names = [_name(picture, index) for index, picture in enumerate(left_images)]
    if not any(view is not None for pair in views for view in pair):
        raise InputError(absence([_grey(left_images[0]), _grey(right_images[0])], what))
    return calibrate_views(names, views, what, size, lens)


def calibrate_views(
    names: Sequence[str],
    views: Sequence[tuple[BoardView | None, BoardView | None]],
    board: Board,
    size: tuple[int, int],
    lens: str = AUTO,
) -> StereoCalibration:
    """Return the rig from boards that were found already; errors as of `calibrate_stereo`.

    Parameters
    ----------
    names : sequence of str
        What the pairs are called in messages.
    views : sequence of tuple of BoardView or None
        What both images of each pair show.
    board : Board
        What was looked for.
    size : tuple of int, px
        Width and height of all images.
    lens : str
        Model of the lens.
    """
    pairs = [(left, right) for left, right in views if left is not None and right is not None]
    if len(pairs) < LEAST_VIEWS:
        n_left, n_right = (sum(pair[side] is not None for pair in views) for side in (0, 1))
        raise InputError(
            f"the board was found in both images of {len(pairs)} pairs ({n_left} left, {n_right} right images of "
            f"{len(views)}); at least {LEAST_VIEWS} pairs are needed, 10 to 20 are better: keep the whole board in "
            "both images"
        )
    corners = np.stack([np.stack([pair[side].corners for pair in pairs]) for side in (0, 1)])
    found = adjust_lens(*_first_guess(corners, board, size), lens)
    both = np.array([left is not None and right is not None for left, right in views])
    kept, errors = np.zeros(len(views), dtype=np.bool_), np.full((2, len(views)), np.nan)
    kept[both], errors[:, both] = found.kept, found.view_rms
    seen = tuple(
        PairSeen(name, left, right, float(left_rms), float(right_rms), bool(is_used))
        for name, (left, right), left_rms, right_rms, is_used in zip(names, views, *errors, kept, strict=True)
    )
    return _with_deviations(found.adjusted, seen)


def _first_guess(corners: Floats, board: Board, size: tuple[int, int]) -> tuple[BoardBundle, Bools]:
    """Both cameras alone, the right one placed by the pairs that agree, its corners numbered as the left one's.

    The pairs that agree are the second value.
    """
    (left, left_poses), (right, right_poses) = (guess_camera(side, board, size) for side in corners)
    pairing = _pair_cameras(right, left_poses, right_poses, corners[1], board)
    ordered = np.take_along_axis(corners[1], pairing.orders[..., np.newaxis], axis=1)
    right = replace(right, camera_from_world=pairing.right_from_left)
    agrees = pairing.error <= DISAGREEMENT * np.median(pairing.error)
    return BoardBundle((left, right), np.stack([corners[0], ordered], axis=1), board.points, left_poses), agrees


def _with_deviations(adjusted: Adjusted[BoardBundle], seen: tuple[PairSeen, ...]) -> StereoCalibration:
    """The calibration with its standard deviations and the verdict."""
    left, right = (
        replace(camera, name=name) for camera, name in zip(adjusted.bundle.cameras, ("left", "right"), strict=True)
    )
    rig = StereoRig(left, right, max(TYPICAL_NOISE, adjusted.noise), adjusted.covariance)
    of_left, of_right = np.sqrt(np.diag(adjusted.covariance)).reshape(-1, N_CAMERA_STD)
    left_std, right_std, translation_std = of_left[:N_INTRINSIC], of_right[:N_INTRINSIC], of_right[-3:]
    turn, turn_covariance = rig.right_from_left[:3, :3], adjusted.covariance[-6:-3, -6:-3]
    rotation_std = rotation_vector_deviations(turn[np.newaxis], turn_covariance[np.newaxis])[0]
    turn_std = _deviation_along(vector_from_matrix(turn), turn_covariance)
    baseline_std = _deviation_along(rig.right_from_left[:3, 3], adjusted.covariance[-3:, -3:])
    verdict = judge(rig, adjusted, baseline_std, seen)
    return StereoCalibration(
        rig, adjusted.rms, left_std, right_std, rotation_std, turn_std, translation_std, baseline_std, seen, verdict
    )


def _deviation_along(vector: Floats, covariance: Floats) -> float:
    """Standard deviation of a vector's length; without a direction that of its worst component."""
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        return float(np.sqrt(np.diag(covariance).max()))
    return float(np.sqrt(vector @ covariance @ vector)) / length


def _grey(picture: Picture) -> Image:
    return picture if isinstance(picture, np.ndarray) else read_image(Path(picture))


def _name(picture: Picture, index: int) -> str:
    return str(index + 1) if isinstance(picture, np.ndarray) else Path(picture).name


def _common_size(left: Sequence[Picture], right: Sequence[Picture]) -> tuple[int, int]:
    """Width and height of all images, or an error that names two that differ."""
    sizes: dict[tuple[int, int], str] = {}
    for side, pictures in (("left", left), ("right", right)):
        for index, picture in enumerate(pictures):
            height, width = _grey(picture).shape
            sizes.setdefault((width, height), f"{side} image {_name(picture, index)}")
    if len(sizes) > 1:
        (size, where), (other, elsewhere) = list(sizes.items())[:2]
        raise InputError(
            f"{where} has {size[0]} x {size[1]} pixels and {elsewhere} {other[0]} x {other[1]}; set both cameras "
            "to one size and take all images again"
        )
    return next(iter(sizes))


def absence(images: Sequence[Image], board: Board) -> str:
    """Return in one sentence why images show no whole board, and what to do.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width)
        Examples; another board is looked for in them.
    board : Board
        What was looked for.
    """
    what = f"no image shows a whole board of {board.columns}x{board.rows} inner corners"
    other = board_that_is_there(images, board)
    if other is not None:
        return f"{what}, but one of {other.columns}x{other.rows} is there: count the corners where four squares meet"
    return (
        f"{what}; count the corners where four squares meet, light the board evenly without reflections, and keep it "
        "whole, with its white border, in both images"
    )


class Pairing(NamedTuple):
    """A first guess of the rig.

    Attributes
    ----------
    right_from_left : ndarray, shape (4, 4), mm
        Of the cameras' frames.
    orders : ndarray of intp, shape (n_pairs, n_corners)
        The right image's corners in the order of the left one's.
    error : ndarray, shape (n_pairs,), px
        How far the right image's corners are from where the left one's pose expects them.
    """

    right_from_left: Floats
    orders: Ints
    error: Floats


def _pair_cameras(
    right: Camera, left_poses: Floats, right_poses: Floats, right_corners: Floats, board: Board
) -> Pairing:
    """Return where the right camera stands.

    Parameters
    ----------
    right : Camera
        In its own frame.
    left_poses, right_poses : ndarray, shape (n_pairs, 4, 4), mm
        camera_from_board of both cameras.
    right_corners : ndarray, shape (n_pairs, n_corners, 2), px
        In the order of the detector.
    board : Board
        What was seen.
    """
    orders, turned = np.stack(board.orders), turned_boards(board.points, board.orders)
    guesses = (
        _guess_of_pair(right, right_pose @ turn @ np.linalg.inv(left_pose), left_poses, right_corners, orders, board)
        for left_pose, right_pose in zip(left_poses, right_poses, strict=True)
        for turn in turned
    )
    return min(guesses, key=lambda guess: float(np.median(guess.error)))


def _guess_of_pair(
    right: Camera, right_from_left: Floats, left_poses: Floats, corners: Floats, orders: Ints, board: Board
) -> Pairing:
    """The guess from one pair, with the error of each pair in its best order; infinite behind the camera."""
    turn = nearest_rotation(right_from_left[:3, :3])  # a product of poses: takes the rounding off
    camera = replace(right, camera_from_world=transform_from(turn, right_from_left[:3, 3]))
    expected = project(camera, moved_points(left_poses, board.points))
    shifts = corners[:, orders] - expected[:, np.newaxis]
    errors = np.nan_to_num(np.sqrt((shifts**2).sum(axis=-1).mean(axis=-1)), nan=np.inf)
    best = errors.argmin(axis=1)
    return Pairing(camera.camera_from_world, orders[best], errors.min(axis=1))


INTRINSIC = ("fx [px]", "fy [px]", "cx [px]", "cy [px]", "k1", "k2", "p1", "p2", "k3")
"""What the numbers of one camera are called, in the order of `intrinsic` and of the calibration's deviations."""


def camera_rows(found: StereoCalibration) -> list[tuple[str, str, str]]:
    """Return what is measured of both cameras: its name, the left and the right value, each with its deviation."""
    left, right = (
        [_with_std(*pair) for pair in zip(intrinsic(camera), std.tolist(), strict=True)]
        for camera, std in ((found.rig.left, found.left_std), (found.rig.right, found.right_std))
    )
    rows = list(zip(INTRINSIC, left, right, strict=True))
    turn = vector_from_matrix(found.rig.right_from_left[:3, :3])
    turns = zip("xyz", np.degrees(turn).tolist(), np.degrees(found.rotation_std).tolist(), strict=True)
    rows += [(f"rotation {axis} [degrees]", "", _with_std(*rest)) for axis, *rest in turns]
    angle = float(np.degrees(np.linalg.norm(turn)))
    rows.append(("angle between the cameras [degrees]", "", _with_std(angle, math.degrees(found.turn_std))))
    shifts = zip("xyz", found.rig.right_from_left[:3, 3].tolist(), found.translation_std.tolist(), strict=True)
    rows += [(f"translation {axis} [mm]", "", _with_std(*rest)) for axis, *rest in shifts]
    return [*rows, ("baseline [mm]", "", _with_std(found.rig.baseline, found.baseline_std))]


def intrinsic(camera: Camera) -> list[float]:
    """Return the numbers of one camera in the order of `INTRINSIC`."""
    return [*camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), *camera.distortion.tolist()]


def _with_std(value: float, std: float) -> str:
    """Return a value with two digits of its standard deviation, as a text.

    Parameters
    ----------
    value : float
        In any unit.
    std : float
        In the same unit; 0 for a value that was not estimated, which is shown alone.
    """
    if std == 0:
        return f"{value:g}"
    digits = max(0, 1 - math.floor(math.log10(std)))
    return f"{value:.{digits}f} ± {std:.{digits}f}"


def boards_in_space(rig: StereoRig, pairs: Sequence[PairSeen], board: Board) -> tuple[Floats, Ints]:
    """Return the corners of the boards that a calibration rests on, shape (n, 3), mm, and the board of each.

    Parameters
    ----------
    rig : StereoRig
        The calibrated cameras.
    pairs : sequence of PairSeen
        Views of the board; those that were not used are passed over.
    board : Board
        The board.
    """
    corners = [
        _corners_in_space(rig, pair.left.corners, pair.right.corners, board)
        for pair in pairs
        if pair.is_used and pair.left is not None and pair.right is not None
    ]
    points = np.concatenate([np.zeros((0, 3)), *corners])
    groups = np.repeat(np.arange(len(corners), dtype=np.intp), board.columns * board.rows)
    is_known = np.isfinite(points).all(axis=1)
    return points[is_known], groups[is_known]


def _corners_in_space(rig: StereoRig, left: Floats, right: Floats, board: Board) -> Floats:
    """Corners in space; the detector may have begun at another end of the board in one of the images."""
    tried = [triangulate(rig, left, right[order]).points for order in board.orders]
    steps = [np.linalg.norm(np.diff(points.reshape(board.rows, -1, 3), axis=1), axis=-1) for points in tried]
    errors = [float(np.abs(np.nan_to_num(step, nan=np.inf) - board.square).mean()) for step in steps]
    return tried[int(np.argmin(errors))]
