"""The simulated chessboard: it is where its truth says, covers both images, and calibrates the rig that sees it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from skelgen.capture.calibration.chessboard import uncovered
from skelgen.capture.simulated_rig.board import SimulatedBoard, board_places
from skelgen.capture.sources import open_source
from skelgen.errors import InputError
from skelgen.model.rig import StereoRig

pytest.importorskip("cv2", reason="OpenCV is not installed: pip install 'skelgen-mocap[capture]'")

from skelgen.capture.calibration.chessboard import Board, find_board
from skelgen.capture.calibration.stereo import calibrate_stereo

N_VIEWS = 12


@pytest.fixture(scope="module")
def source():
    """A board that is elsewhere in every pair."""
    return SimulatedBoard(n_frames=N_VIEWS, rate=1.0)


@pytest.fixture(scope="module")
def rendered(source):
    return [source.render(index) for index in range(N_VIEWS)]


def test_corners_are_found_where_they_truly_are(source, rendered):
    for pair, truth in rendered[:4]:
        for image, corners in ((pair.left, truth.left), (pair.right, truth.right)):
            view = find_board(image, source.board)
            errors = [np.linalg.norm(view.corners - order, axis=1) for order in (corners, corners[::-1])]
            assert min(error.mean() for error in errors) < 0.15  # px; what the detector reaches in noise


def test_places_cover_both_images(source, rendered):
    for side in ("left", "right"):
        assert uncovered([getattr(truth, side) for _, truth in rendered], source.size) == []


def test_a_calibration_with_it_finds_the_rig(source, rendered):
    found = calibrate_stereo([pair.left for pair, _ in rendered], [pair.right for pair, _ in rendered])
    assert found.verdict.grade == "good"
    assert found.rms < 0.1
    truth = source.rig
    assert abs(found.rig.baseline - truth.baseline) < 4 * found.baseline_std
    for eye, std, true in (
        (found.rig.left, found.left_std, truth.left),
        (found.rig.right, found.right_std, truth.right),
    ):
        for at, index in ((0, (0, 0)), (1, (1, 1)), (2, (0, 2)), (3, (1, 2))):
            assert abs(eye.matrix[index] - true.matrix[index]) < 4 * std[at]


def test_between_places_it_moves_and_then_is_held_still():
    source = SimulatedBoard(n_frames=60, rate=10.0)
    truths = [source.render(index)[1].left for index in range(10, 20)]
    steps = [np.abs(after - before).max() for before, after in pairwise(truths)]
    assert max(steps[:5]) > 1.0
    assert max(steps[5:]) < 1e-9


def test_the_same_number_gives_the_same_pair(source):
    one, two = (SimulatedBoard(n_frames=3, seed=5).render(2)[0] for _ in range(2))
    np.testing.assert_array_equal(one.left, two.left)
    assert (one.left != SimulatedBoard(n_frames=3, seed=6).render(2)[0].left).any()


def test_it_is_a_source_that_can_be_named():
    with open_source("simulated:board?frames=2&rate=30") as source:
        pairs = list(source)
    assert [pair.index for pair in pairs] == [0, 1]
    assert pairs[0].left.shape == (480, 640)


def test_pairs_that_nobody_took_in_time_are_counted():
    with open_source("simulated:board?frames=40&rate=1000&paced=yes") as source:
        pairs = list(source)
    assert sum(pair.dropped for pair in pairs) == source.n_dropped > 0
    assert pairs[-1].index == 39


def test_a_board_that_fits_nowhere_is_refused():
    rig = SimulatedBoard().rig
    with pytest.raises(InputError, match="fits into both images hardly anywhere"):
        board_places(Board(square=900.0), StereoRig(rig.left, rig.right), 5)
