"""One camera alone, the board's geometry, coverage."""

import numpy as np
import pytest

pytest.importorskip("cv2")

from skelgen.capture.calibration.bundle_adjustment import BoardBundle
from skelgen.capture.calibration.chessboard import (
    Board,
    board_from_text,
    coverage,
    find_board,
    uncovered,
)
from skelgen.capture.calibration.lens import AUTO, adjust_lens, guess_camera
from skelgen.capture.reference_rig import reference_rig
from skelgen.errors import InputError, ParameterError
from skelgen.geometry.rotations import matrix_from_vector


def drawn_board(board: Board, side: int = 30) -> np.ndarray:
    """A board straight on, with a white border of two squares; the first corner lies 3 squares in."""
    down, across = np.indices(((board.rows + 5) * side, (board.columns + 5) * side)) // side
    inside = (down >= 2) & (down < board.rows + 3) & (across >= 2) & (across < board.columns + 3)
    return np.where(inside & ((down + across) % 2 == 0), 0, 255).astype(np.uint8)


def test_corners_of_a_drawn_board_lie_between_its_pixels(board):
    view = find_board(drawn_board(board), board)
    grid = 90.0 - 0.5 + 30.0 * board.points[:, :2] / board.square
    assert np.abs(np.sort(view.corners, axis=0) - np.sort(grid, axis=0)).max() < 0.02


def test_edges_of_a_blurred_board_are_wider_whatever_the_direction_of_the_blur(board):
    import cv2

    image = drawn_board(board)
    sharp = find_board(image, board).edge
    for blurred in (cv2.GaussianBlur(image, (0, 0), 2.5), cv2.blur(image, (9, 1)), cv2.blur(image, (1, 9))):
        assert find_board(blurred, board).edge > 1.5 * sharp


def calibrated(views, board, lens=AUTO):
    corners = np.stack([view.corners for view in views])
    camera, poses = guess_camera(corners, board, (640, 480))
    bundle = BoardBundle((camera,), corners[:, np.newaxis], board.points, poses)
    return adjust_lens(bundle, np.ones(len(views), dtype=np.bool_), lens)


def test_one_camera_is_found_without_the_view_that_does_not_fit(seen_pairs, board):
    views = [left for left, _ in seen_pairs(10, noise=0.1)]
    views[3].corners[:5] += 4.0  # five corners that slipped
    found = calibrated(views, board)
    truth = reference_rig().left
    assert np.flatnonzero(~found.kept).tolist() == [3]
    error = (found.adjusted.bundle.cameras[0].matrix - truth.matrix)[[0, 1, 0, 1], [0, 1, 2, 2]]
    assert (np.abs(error) < 5 * np.sqrt(np.diag(found.adjusted.covariance))[:4]).all()


def test_a_lens_of_no_known_name_is_refused(seen_pairs, board):
    views = [left for left, _ in seen_pairs(4, noise=0.1)]
    with pytest.raises(ParameterError, match="auto, radial, tangential, full"):
        calibrated(views, board, "fisheye")


def test_views_without_perspective_are_refused(board):
    """OpenCV explains them by focal lengths of 1e9 px."""
    turns = matrix_from_vector(np.random.default_rng(0).normal(0, 0.4, (6, 3)))
    corners = (board.points @ turns.swapaxes(1, 2))[..., :2] + [320.0, 240.0]
    with pytest.raises(InputError, match="no camera explains these views of the board"):
        guess_camera(corners, board, (640, 480))


def test_two_views_are_too_few(seen_pairs, board):
    with pytest.raises(InputError, match="at least 3"):
        calibrated([left for left, _ in seen_pairs(2, noise=0.1)], board)


def test_boards_are_read_from_text():
    assert board_from_text("9x6", 25.0) == Board(9, 6, 25.0)
    with pytest.raises(ParameterError, match="as in 9x6"):
        board_from_text("nine by six", 25.0)
    with pytest.raises(ParameterError, match="too small"):
        board_from_text("2x6", 25.0)
    with pytest.raises(ParameterError, match="above 0"):
        board_from_text("9x6", 0.0)


def test_orders_of_a_board_are_its_turns():
    assert [order.tolist() for order in Board(4, 3, 1.0).orders] == [list(range(12)), list(range(11, -1, -1))]
    assert len(Board(4, 4, 1.0).orders) == 4


def test_parts_of_an_image_that_no_corner_was_in_are_named():
    corners = np.stack(np.meshgrid(np.linspace(0, 639, 20), np.linspace(0, 300, 10)), axis=-1).reshape(-1, 2)
    assert uncovered([corners], (640, 480)) == ["lower left", "lower middle", "lower right"]
    assert coverage([corners], (640, 480)).sum() == len(corners)
    assert len(uncovered([], (640, 480))) == 9
