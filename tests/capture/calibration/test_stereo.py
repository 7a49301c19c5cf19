"""Calibration against known rigs, with bad views among good ones, and on the real chessboards."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("cv2")

from skelgen.capture.calibration.stereo import calibrate_stereo, calibrate_views, camera_rows
from skelgen.capture.reference_rig import reference_rig
from skelgen.errors import FormatError, InputError
from skelgen.geometry.rotations import vector_from_matrix

SIZE = (640, 480)
NAMES = [str(number) for number in range(1, 31)]


def calibrated(pairs, board):
    return calibrate_views(NAMES[: len(pairs)], pairs, board, SIZE)


def shared_numbers(rig) -> np.ndarray:
    """Focal lengths and principal points, lenses, and the translation."""
    own = [np.concatenate([e.matrix[[0, 1, 0, 1], [0, 1, 2, 2]], e.distortion]) for e in (rig.left, rig.right)]
    return np.concatenate([*own, rig.right_from_left[:3, 3]])


def test_exact_corners_give_the_rig_back(seen_pairs, board):
    found = calibrated(seen_pairs(6, noise=0.0), board)
    assert np.allclose(shared_numbers(found.rig), shared_numbers(reference_rig()), atol=1e-4)  # OpenCV takes float32
    assert np.allclose(found.rig.right_from_left, reference_rig().right_from_left, atol=1e-4)


def test_errors_are_those_that_the_standard_deviations_say(seen_pairs, board):
    """12 rigs of 15 numbers: their squares over the variances have the mean 1, within a seventh if they correlate."""
    squares = []
    for seed in range(12):
        found = calibrated(seen_pairs(8, noise=0.1, seed=seed), board)
        std = np.concatenate([found.left_std, found.right_std, found.translation_std])
        free = std > 0
        squares.append((((shared_numbers(found.rig) - shared_numbers(reference_rig()))[free] / std[free]) ** 2).mean())
    assert np.mean(squares) == pytest.approx(1.0, abs=0.4)


def test_rotation_between_the_cameras_is_shown_with_its_deviation(seen_pairs, board):
    found = calibrated(seen_pairs(8, noise=0.1), board)
    rows = {name: right for name, _, right in camera_rows(found)}
    true = np.degrees(np.linalg.norm(vector_from_matrix(reference_rig().right_from_left[:3, :3])))
    angle, std = map(float, rows["angle between the cameras [degrees]"].split(" ± "))
    assert 0 < std < 0.3
    assert abs(angle - true) < 4 * std
    assert all(" ± " in rows[f"rotation {axis} [degrees]"] for axis in "xyz")


def test_covariance_of_the_rig_is_that_of_its_numbers(seen_pairs, board):
    found = calibrated(seen_pairs(8, noise=0.1), board)
    std = np.sqrt(np.diag(found.rig.covariance))
    np.testing.assert_allclose(std[:9], found.left_std)
    np.testing.assert_allclose(std[15:24], found.right_std)
    np.testing.assert_allclose(std[27:], found.translation_std)
    assert not std[9:15].any()  # the left camera's frame is the world


def test_noise_of_the_corners_is_found(seen_pairs, board):
    found = calibrated(seen_pairs(12, noise=0.3), board)
    assert found.rig.noise == pytest.approx(0.3, rel=0.05)
    assert found.rms == pytest.approx(0.3 * np.sqrt(2), rel=0.05)


def test_radial_lens_is_taken_where_nothing_else_is_seen(seen_pairs, board):
    found = calibrated(seen_pairs(12, noise=0.1), board)
    assert not found.rig.left.distortion[2:].any()
    assert (found.left_std[:6] > 0).all()
    assert not found.left_std[6:].any()


@pytest.mark.parametrize("shift", [3.0, 30.0, 300.0])
def test_a_pair_of_two_moments_is_left_out_and_named(shift, seen_pairs, board):
    pairs = seen_pairs(10, noise=0.1)
    pairs[4] = (pairs[4][0], replace(pairs[4][1], corners=pairs[4][1].corners + np.array([0.0, shift])))
    found = calibrated(pairs, board)
    assert [pair.name for pair in found.pairs if not pair.is_used] == ["5"]
    assert "Pair 5 is left out" in str(found.verdict)
    assert np.abs(found.rig.left.matrix[0, 0] - reference_rig().left.matrix[0, 0]) < 5 * found.left_std[0]


def test_corners_numbered_from_the_other_end_are_turned_round(seen_pairs, board):
    pairs = seen_pairs(8, noise=0.1)
    pairs[2] = (pairs[2][0], replace(pairs[2][1], corners=pairs[2][1].corners[::-1]))
    assert all(pair.is_used for pair in calibrated(pairs, board).pairs)


def test_four_exchanged_pairs_of_thirteen_are_found_out(seen_pairs, board):
    pairs = seen_pairs(13, noise=0.1)
    rights = [right for _, right in pairs]
    rights[0], rights[3], rights[5], rights[8] = rights[3], rights[5], rights[8], rights[0]
    found = calibrated([(left, right) for (left, _), right in zip(pairs, rights, strict=True)], board)
    assert [index for index, pair in enumerate(found.pairs) if not pair.is_used] == [0, 3, 5, 8]
    assert found.rms < 0.16  # 0.1 px along both axes


def test_exchanged_cameras_are_told(seen_pairs, board):
    found = calibrated([(right, left) for left, right in seen_pairs(8, noise=0.1)], board)
    assert found.verdict.grade == "repeat"
    assert "exchange the cameras" in str(found.verdict)


def test_a_board_that_never_leans_makes_no_good_calibration(seen_pairs, board):
    verdict = calibrated(seen_pairs(8, noise=0.1, lean=0.0), board).verdict
    assert verdict.grade == "repeat"
    assert "turn it about different axes" in str(verdict)


def test_too_few_boards_say_how_many_were_found(seen_pairs, board):
    pairs = seen_pairs(4, noise=0.1)
    views = [pairs[0], pairs[1], (pairs[2][0], None), (None, pairs[3][1])]
    with pytest.raises(InputError, match=r"both images of 2 pairs \(3 left, 3 right images of 4\).*at least 3"):
        calibrated(views, board)


def test_real_chessboards_reach_the_reference(real_pairs):
    found = calibrate_stereo(*real_pairs)
    assert found.rms <= 0.22
    assert found.rig.left.matrix[0, 0] == pytest.approx(533.0, abs=2.0)
    assert found.rig.right.matrix[0, 0] == pytest.approx(538.0, abs=2.0)
    assert found.verdict.grade == "good"


def test_real_chessboards_with_a_blurred_a_black_and_a_late_image(real_pairs):
    import cv2

    left, right = ([cv2.imread(str(path), 0) for path in side] for side in real_pairs)
    right[4] = cv2.GaussianBlur(right[4], (0, 0), 2.5)
    left[2] = np.zeros_like(left[2])
    right[8] = np.roll(right[8], 20, axis=1)
    found = calibrate_stereo(left, right)
    words = str(found.verdict)
    assert "Pair 3 does not show the whole board" in words
    assert "Pair 5 is blurred" in words
    assert "Pair 9 is left out" in words
    assert found.rms <= 0.22


def test_images_of_two_sizes_are_named(real_pairs):
    left, right = real_pairs
    with pytest.raises(InputError, match=r"left image left01.jpg has 640 x 480.*right image 2 320 x 240"):
        calibrate_stereo(left[:3], [right[0], np.zeros((240, 320), dtype=np.uint8), right[2]])


def test_counting_squares_instead_of_corners_is_explained(real_pairs):
    left, right = real_pairs
    with pytest.raises(InputError, match="9x6 is there"):
        calibrate_stereo(left[:2], right[:2], board=(10, 7))


def test_images_without_a_board_say_what_to_do():
    black = [np.zeros((480, 640), dtype=np.uint8)] * 3
    with pytest.raises(InputError, match="light the board evenly"):
        calibrate_stereo(black, black)


def test_a_missing_partner_and_no_images_are_told():
    black = [np.zeros((480, 640), dtype=np.uint8)] * 3
    with pytest.raises(InputError, match="3 left and 2 right"):
        calibrate_stereo(black, black[:2])
    with pytest.raises(InputError, match="no images"):
        calibrate_stereo([], [])


def test_a_file_that_is_no_image_is_named(tmp_path):
    path = tmp_path / "left01.jpg"
    path.write_text("no image")
    with pytest.raises(FormatError, match=r"left01\.jpg: is no image"):
        calibrate_stereo([path], [path])
