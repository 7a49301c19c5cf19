"""Frames that are taken for calibrations: kept evenly, followed, and told of while they come."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.calibration.body import calibrate_body
from skelgen.capture.calibration.taking import BodyTaking, EvenFrames, JointTaking
from skelgen.capture.values import StereoPoints
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model.rig import BodyTarget

BALLS = np.array([[0.0, 0, 0], [61, 0, 0], [17, 72, 0], [-33, 25, 40], [40, 38, -52]])
PYRAMID = np.array([[0.0, 0, 0], [80, 0, 0], [80, 80, 0], [0, 80, 0], [40, 40, 50]])
NOISE = np.diag([0.1, 0.1, 0.4]) ** 2


def seen(balls, degrees=0.0, seed=0, strays=0):
    """One frame of balls at 1 m that are turned about y, with errors, in any order."""
    rng = np.random.default_rng(seed)
    points = balls @ matrix_from_vector(np.deg2rad([0, degrees, 0])).T
    points = np.concatenate([points, rng.uniform(-300, 300, (strays, 3))]) + np.array([0, 0, 1000])
    points = rng.permutation(points + rng.multivariate_normal(np.zeros(3), NOISE, len(points)))
    n = len(points)
    own = np.arange(n)
    return StereoPoints(points, np.tile(NOISE, (n, 1, 1)), own, own, np.zeros(n), np.zeros(n, bool))


@pytest.mark.parametrize("n_frames", [3, 8, 9, 100, 1000])
def test_kept_frames_are_few_evenly_spread_and_begin_with_the_first(n_frames):
    even = EvenFrames(8)
    for number in range(n_frames):
        even.add(number)
    frames = even.frames
    assert len(frames) <= 8
    assert frames[0] == 0
    assert len(set(np.diff(frames))) <= 1
    assert frames[-1] > 0.7 * (n_frames - 1) - 1


def test_a_target_is_followed_from_the_first_frame_that_shows_it_alone():
    taking = BodyTaking("hand", 5)  # stated, as most frames show other things that shine
    for number in range(31):
        strays = 4 if number % 3 else 0
        assert len(taking.add(seen(BALLS, 2 * number, number, strays))) == 1
    progress = taking.progress
    assert (progress.n_frames, progress.n_balls, progress.n_found) == (31, 5, 31)
    assert progress.n_alone == 11
    assert progress.turn == pytest.approx(60, abs=1.0)
    assert calibrate_body(taking.frames, "hand", progress.n_balls).n_frames == 31


def test_a_ball_that_was_hidden_at_first_makes_the_target_larger():
    taking = BodyTaking("hand")
    for number in range(4):
        taking.add(seen(BALLS[:4], number, number))
    assert taking.progress.n_balls == 4
    for number in range(6):
        (found,) = taking.add(seen(BALLS, number, 10 + number))
    assert taking.progress.n_balls == 5
    assert (found.points >= 0).sum() == 5


def test_another_target_is_followed_when_the_first_is_gone():
    taking = BodyTaking("hand")
    other = BALLS * [1.3, 0.8, 1.1]
    for balls in (BALLS, other):
        found = [taking.add(seen(balls, number, number)) for number in range(20)]
    assert len(found[-1]) == 1


def test_an_ambiguous_design_is_told_while_it_is_turned():
    taking = BodyTaking("pyramid")
    for number in range(5):
        assert taking.add(seen(PYRAMID, number, number)) == []
    assert taking.progress.problem.startswith("body 'pyramid' is ambiguous")


def test_a_target_like_one_that_is_there_is_told():
    taking = BodyTaking("hand", beside=[BodyTarget("old", BALLS)])
    taking.add(seen(BALLS))
    assert "body 'hand' can be taken for 'old'" in taking.progress.problem


def test_before_anything_is_seen_there_is_nothing_to_tell():
    taking = BodyTaking("hand")
    taking.add(seen(BALLS[:2]))
    assert (taking.progress.n_balls, taking.progress.n_alone, taking.progress.problem) == (0, 0, "")


def test_joints_need_two_targets():
    with pytest.raises(InputError, match="joints are between two targets"):
        JointTaking([BodyTarget("hand", BALLS)])


def test_motions_are_told_of_the_pairs_that_are_asked_for():
    other, aside = BALLS * [1.3, 0.8, 1.1], np.array([250.0, 0, 0])
    targets = [BodyTarget("hand", BALLS), BodyTarget("arm", other)]
    taking, turned = JointTaking(targets), JointTaking(targets, pairs=[("arm", "hand")])
    for number in range(20):
        hand, arm = seen(BALLS, 3 * number, number).points, seen(other + aside, 0, number).points
        points = np.concatenate([hand, arm])
        own = np.arange(10)
        covariance = np.tile(NOISE, (10, 1, 1))
        for each in (taking, turned):
            each.add(StereoPoints(points, covariance, own, own, np.zeros(10), np.zeros(10, bool)))
    (motion,) = taking.progress.motions
    assert motion.n_frames == 20
    assert motion.spans[0] == pytest.approx(57, abs=1.0)
    (reverse,) = turned.progress.motions
    assert (reverse.parent, reverse.child) == ("arm", "hand")
    assert reverse.spans == pytest.approx(motion.spans, abs=1.0)
