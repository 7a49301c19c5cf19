from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.calibration.body import calibrate_body
from skelgen.capture.values import StereoPoints
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.rigid_bodies import normal_form
from skelgen.model.rig import BodyTarget

BALLS = np.array([[0.0, 0, 0], [61, 0, 0], [17, 72, 0], [-33, 25, 40], [40, 38, -52]])
NOISE = np.diag([0.1, 0.1, 0.4]) ** 2


def stereo_points(points, covariance):
    n = len(points)
    return StereoPoints(points, covariance, np.arange(n), np.arange(n), np.zeros(n), np.zeros(n, bool))


def make_frames(seed, n_frames, strays=0, hidden=0.0, turn=1.5, balls=BALLS):
    """A target that turns about all axes at 1 m; after the first frame with strays and hidden balls; shuffled."""
    rng = np.random.default_rng(seed)
    frames = []
    for number in range(n_frames):
        pose = matrix_from_vector(rng.uniform(-turn, turn, 3))
        points = balls @ pose.T + [0, 0, 1000] + rng.uniform(-80, 80, 3)
        if number:
            points = points[rng.uniform(size=len(balls)) >= hidden]
            points = np.concatenate([points, np.array([0, 0, 1000]) + rng.uniform(-300, 300, (strays, 3))])
        points = rng.permutation(points + rng.multivariate_normal(np.zeros(3), NOISE, len(points)))
        frames.append(stereo_points(points, np.tile(NOISE, (len(points), 1, 1))))
    return frames


def error(target, balls=BALLS):
    """Distances of the calibrated balls from the true ones in one normal form; the order is a choice of the first."""
    lengths = np.linalg.norm(balls[:, np.newaxis] - balls, axis=2)
    own = np.linalg.norm(target.points[:, np.newaxis] - target.points, axis=2)
    order = [int(np.argmin(np.abs(np.sort(lengths, axis=1) - row).sum(axis=1))) for row in np.sort(own, axis=1)]
    assert sorted(order) == list(range(len(balls)))
    return target.points - normal_form(balls[order])[0]


def test_shape_is_found_among_strays_with_balls_hidden():
    done = calibrate_body(make_frames(0, 60, strays=6, hidden=0.15), "hand", 5)
    assert np.abs(error(done.target)).max() < 0.25  # five deviations of 0.4 mm over sqrt(60)
    assert done.n_frames + done.n_left_out == 60
    assert done.notices == ()


def test_stated_deviations_are_those_of_the_errors():
    squares = []
    for seed in range(20):
        done = calibrate_body(make_frames(seed, 15), "hand")
        std = np.asarray(done.target.std)
        squares.append(((error(done.target)[std > 0] / std[std > 0]) ** 2).mean())
        assert done.noise == pytest.approx(1.0, abs=0.25)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.35)


def test_weights_make_the_shape_better_than_equal_ones():
    from skelgen.capture.calibration.body import fit_weighted_shape
    from skelgen.geometry.rotations import transform_from
    from skelgen.kinematics import calibrate_rigid_body

    rng, points = np.random.default_rng(0), normal_form(BALLS)[0]
    plain, weighted = [], []
    for _ in range(10):
        turns = matrix_from_vector(rng.uniform(-1.5, 1.5, (12, 3)))
        poses = transform_from(turns, rng.uniform(-50, 50, (12, 3)))
        positions = np.einsum("fij,kj->fki", turns, points) + poses[:, np.newaxis, :3, 3]
        positions += rng.multivariate_normal(np.zeros(3), NOISE, positions.shape[:2])
        start = calibrate_rigid_body(positions)
        shape = fit_weighted_shape(
            start.points, start.world_from_body, positions, np.tile(NOISE, (*positions.shape[:2], 1, 1))
        )
        plain.append(((start.points - points) ** 2).mean())
        weighted.append(((shape.points - points) ** 2).mean())
    assert np.mean(weighted) < 0.8 * np.mean(plain)


def test_first_ball_is_the_origin_and_fixed():
    target = calibrate_body(make_frames(1, 12), "hand").target
    np.testing.assert_array_equal(target.points[0], 0)
    np.testing.assert_array_equal(target.points[1, 1:], 0)
    assert target.points[2, 2] == 0
    np.testing.assert_array_equal(np.asarray(target.std)[0], 0)


def test_too_few_frames_and_turns_are_told():
    few = calibrate_body(make_frames(2, 5, turn=0.05), "hand")
    assert any("rests on 5 frames" in notice for notice in few.notices)
    assert any("turned by" in notice for notice in few.notices)


def test_more_than_the_noise_says_is_told():
    frames = make_frames(3, 20)
    sure = [stereo_points(frame.points, frame.covariance / 9) for frame in frames]
    done = calibrate_body(sure, "hand")
    assert done.noise == pytest.approx(3.0, rel=0.2)
    assert "off by" in done.notices[0]


def test_no_frame_with_the_target_alone_is_refused():
    with pytest.raises(InputError, match="no frame shows exactly 5 points, the balls of body 'hand' and nothing else"):
        calibrate_body(make_frames(0, 10, strays=4)[1:], "hand", 5)


def test_frames_without_points_are_refused():
    with pytest.raises(InputError, match="no frame shows 4 points or more"):
        calibrate_body([stereo_points(np.zeros((2, 3)), np.tile(NOISE, (2, 1, 1)))], "hand")


def test_ambiguous_target_is_refused_with_the_reason():
    pyramid = np.array([[0.0, 0, 0], [80, 0, 0], [80, 80, 0], [0, 80, 0], [40, 40, 50]])
    with pytest.raises(InputError, match=r"body 'pyramid' is ambiguous.*near equal"):
        calibrate_body(make_frames(0, 12, balls=pyramid), "pyramid")


def test_target_that_looks_like_another_one_is_refused():
    with pytest.raises(InputError, match="body 'hand' can be taken for 'old'"):
        calibrate_body(make_frames(0, 12), "hand", beside=[BodyTarget("old", BALLS)])


def test_verdict_says_what_the_target_is_worth():
    good = calibrate_body(make_frames(0, 60), "hand").verdict
    assert good.grade == "good"
    assert good.sentences[0].endswith("Its design is not ambiguous.")
    few = calibrate_body(make_frames(2, 5, turn=0.05), "hand").verdict
    assert few.grade == "usable"
    assert few.sentences[1].startswith("Body 'hand' rests on 5 frames")
    sure = [stereo_points(frame.points, frame.covariance / 9) for frame in make_frames(3, 20)]
    assert calibrate_body(sure, "hand").verdict.grade == "repeat"


def test_an_ambiguous_design_is_told_with_a_better_one():
    pyramid = np.array([[0.0, 0, 0], [80, 0, 0], [80, 80, 0], [0, 80, 0], [40, 40, 50]])
    with pytest.raises(InputError, match=r"it would do to move ball \d, which is .* mm from the others, by \d+ mm"):
        calibrate_body(make_frames(0, 12, balls=pyramid), "pyramid")
    cross = 50.0 * np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    with pytest.raises(InputError, match="choose one whose distances all differ"):
        calibrate_body(make_frames(0, 12, balls=cross), "cross")
    other = BALLS.copy()
    other[4] = [-20.0, -55.0, 21.0]  # four balls are alike, which is all that may be seen
    with pytest.raises(InputError, match=r"can be taken for 'old'.*it would do to move ball"):
        calibrate_body(make_frames(0, 12), "hand", beside=[BodyTarget("old", other)])
