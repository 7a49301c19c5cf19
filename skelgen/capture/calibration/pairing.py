"""Where the right camera stands, from poses of the board in both: by the pair that most others agree with.

A pair whose images show the board at different places, or whose corners a detector has numbered from the other end,
must not spoil the guess: the least median of errors (Rousseeuw 1984) is not touched by up to half of the pairs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from skelgen.capture.calibration.board import Board
from skelgen.capture.optics.projection import project
from skelgen.geometry.orientation import fit_transform
from skelgen.geometry.rotations import nearest_rotation, transform_from
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import Camera


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


def pair_cameras(
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
    orders = np.stack(board.orders)
    every = np.ones(len(board.points), dtype=np.bool_)
    turned = [fit_transform(board.points, board.points[order], every) for order in orders]
    guesses = (
        _judged(right, right_pose @ turn @ np.linalg.inv(left_pose), left_poses, right_corners, orders, board)
        for left_pose, right_pose in zip(left_poses, right_poses, strict=True)
        for turn in turned
    )
    return min(guesses, key=lambda guess: float(np.median(guess.error)))


def _judged(
    right: Camera, right_from_left: Floats, left_poses: Floats, corners: Floats, orders: Ints, board: Board
) -> Pairing:
    """A guess from one pair, with each pair's error in the order that fits it best; infinite behind the camera."""
    eye = replace(right, camera_from_world=_clean(right_from_left))
    in_left = board.points @ np.swapaxes(left_poses[:, :3, :3], 1, 2) + left_poses[:, np.newaxis, :3, 3]
    expected = project(eye, in_left)
    shifts = corners[:, orders] - expected[:, np.newaxis]
    errors = np.nan_to_num(np.sqrt((shifts**2).sum(axis=-1).mean(axis=-1)), nan=np.inf)
    best = errors.argmin(axis=1)
    return Pairing(eye.camera_from_world, orders[best], errors.min(axis=1))


def _clean(pose: Floats) -> Floats:
    """A product of poses, with the rounding taken off its rotation."""
    return transform_from(nearest_rotation(pose[:3, :3]), pose[:3, 3])
