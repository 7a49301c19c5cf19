"""A room is calibrated with a board that two cameras see at a time, whichever way round its corners are counted."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.calibration.chessboard import Board
from skelgen.capture.images import opencv
from skelgen.capture.optics import in_image, project
from skelgen.capture.room.boards import CharucoBoard, corners_in, room_board
from skelgen.capture.room.calibrate import calibrate_boards
from skelgen.capture.room.simulated import board_poses, room_rig
from skelgen.errors import InputError, ParameterError

N_CAMERAS, N_FRAMES, NOISE = 4, 60, 0.1
FACING = 0.3  # cosine from which on a board's corners are found


@pytest.fixture(scope="module")
def rig():
    return room_rig(N_CAMERAS)


def seen_by(rig, board):
    """What all cameras see of a board, its corners numbered in any way that looks alike."""
    rng, middle = np.random.default_rng(0), board.points.mean(axis=0)
    views = np.full((N_FRAMES, N_CAMERAS, len(board.points), 2), np.nan)
    for frame, pose in enumerate(board_poses(rig, N_FRAMES)):
        corners = (board.points - middle) @ pose[:3, :3].T + pose[:3, 3]
        for index, (eye, stands) in enumerate(zip(rig.cameras, rig.places, strict=True)):
            pixels, ahead = project(eye, corners), pose[:3, 3] - stands
            shown = in_image(eye, pixels) & (pose[:3, 2] @ ahead > FACING * np.linalg.norm(ahead))
            if isinstance(board, Board) and not shown.all():
                continue
            views[frame, index, shown] = pixels[shown]
            views[frame, index] = views[frame, index][board.orders[rng.integers(len(board.orders))]]
    return views + rng.normal(scale=NOISE, size=views.shape)


@pytest.mark.parametrize(
    "board",
    [Board(9, 6, 90.0), Board(6, 6, 90.0), CharucoBoard(9, 6, 100.0, 75.0)],
    ids=["turned by half", "turned by quarters", "charuco"],
)
def test_cameras_are_where_they_are_within_what_is_stated(rig, board):
    found = calibrate_boards(seen_by(rig, board), board, [eye.size for eye in rig.cameras], rig.names)
    assert found.rig.noise == pytest.approx(NOISE, rel=0.05)
    gaps, true = (np.linalg.norm(one.places[1:] - one.places[0], axis=1) for one in (found.rig, rig))
    assert np.abs(gaps - true).max() < 4.0  # mm
    assert np.abs(gaps / true - 1).max() < 4 * found.scale_std < 0.002
    assert found.verdict.sentences[0].startswith("Good: corners lie 0.10 px")


def test_a_camera_that_shares_no_board_is_named(rig):
    board = Board(9, 6, 90.0)
    seen = seen_by(rig, board)
    seen[N_FRAMES // 2 :, 1:] = np.nan
    seen[: N_FRAMES // 2, 0] = np.nan
    with pytest.raises(InputError, match="camera 2 shares 0 views of the board with camera 1"):
        calibrate_boards(seen, board, [eye.size for eye in rig.cameras], rig.names)
    seen[:, 2] = np.nan
    with pytest.raises(InputError, match="camera 3 shows the board in 0 images"):
        calibrate_boards(seen, board, [eye.size for eye in rig.cameras], rig.names)


def test_a_part_of_a_charuco_board_is_found_in_an_image():
    board = room_board("charuco:7x5:4X4_50", 40.0)
    aruco = opencv().aruco
    drawn = aruco.CharucoBoard((7, 5), 40.0, 30.0, aruco.getPredefinedDictionary(aruco.DICT_4X4_50))
    image = np.pad(drawn.generateImage((700, 500)), 60, constant_values=255)
    whole, part = corners_in(image, board), corners_in(np.ascontiguousarray(image[:, :450]), board)
    np.testing.assert_allclose(whole, board.points[:, :2] * 2.5 + 59.5, atol=0.5)
    assert 6 <= np.isfinite(part[:, 0]).sum() < len(board.points)
    assert np.isnan(corners_in(None, board)).all()


@pytest.mark.parametrize("text", ["charuco:7", "charuco:7x5:9X9_1", "charuco:2x5", "7"])
def test_texts_that_are_no_board_are_refused(text):
    with pytest.raises(ParameterError):
        room_board(text, 40.0)


def test_a_board_that_fits_nothing_is_to_be_held_still(rig):
    board = Board(9, 6, 90.0)
    seen, rng = seen_by(rig, board), np.random.default_rng(1)
    seen[rng.random(seen.shape[:3]) < 0.07] += 8.0  # px
    said = calibrate_boards(seen, board, [eye.size for eye in rig.cameras], rig.names).verdict.sentences
    assert [sentence for sentence in said if "of the corners fit nothing: hold it still" in sentence]
    assert not [sentence for sentence in said if "wand" in sentence]


def test_views_that_no_camera_explains_are_refused_by_the_name_of_the_camera(rig):
    board = Board(9, 6, 90.0)
    seen = seen_by(rig, board)
    on_a_line = np.arange(N_FRAMES)[:, np.newaxis, np.newaxis] + 0.3 * board.points[:, :1] + 200.0
    seen[:, 1] = np.where(np.isfinite(seen[:, 1]), on_a_line, np.nan)
    with pytest.raises(InputError, match="no camera explains what camera 2 sees of the board"):
        calibrate_boards(seen, board, [eye.size for eye in rig.cameras], rig.names)
