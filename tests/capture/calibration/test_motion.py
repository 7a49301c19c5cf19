from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.calibration.joints import MAX_FRAMES, joint_motion
from skelgen.capture.values import FoundBody
from skelgen.geometry.rotations import matrix_from_vector, transform_from


def found(name, vector):
    return FoundBody(name, transform_from(matrix_from_vector(vector), np.zeros(3)), np.eye(6), np.arange(5), 0.1)


def moved(vectors, seed=0):
    """A child that is turned so in its parent, which turns by itself."""
    frames = []
    for vector, own in zip(
        np.deg2rad(vectors), np.random.default_rng(seed).normal(size=(len(vectors), 3)), strict=True
    ):
        parent = found("upper", own)
        turn = parent.world_from_body[:3, :3] @ matrix_from_vector(vector)
        frames.append([parent, FoundBody("lower", transform_from(turn, np.ones(3)), np.eye(6), np.arange(5), 0.1)])
    return frames


AXIS = np.array([1.0, 2.0, -2.0]) / 3


def test_a_hinge_turns_about_one_axis_wherever_that_points():
    motion = joint_motion(moved(np.linspace(-10, 80, 50)[:, np.newaxis] * AXIS), "upper", "lower")
    assert motion.spans == pytest.approx((90, 0, 0), abs=1e-6)
    assert motion.advice("hinge") == ""


def test_a_ball_that_turns_about_one_axis_only_is_told():
    motion = joint_motion(moved(np.linspace(-10, 80, 50)[:, np.newaxis] * AXIS), "upper", "lower")
    assert motion.advice("ball") == (
        "lower turned in upper about one axis only; a ball joint is measured about all axes"
    )
    rng = np.random.default_rng(0)
    assert joint_motion(moved(rng.uniform(-30, 30, (50, 3))), "upper", "lower").advice("ball") == ""


def test_too_little_motion_is_told_with_its_size():
    motion = joint_motion(moved(np.linspace(0, 12, 50)[:, np.newaxis] * AXIS), "upper", "lower")
    assert motion.advice() == "lower turned by 12 degrees in upper; move the joint further"


def test_frames_that_show_one_target_only_say_nothing():
    frames = [frame[:1] for frame in moved(np.zeros((4, 3)))]
    motion = joint_motion(frames, "upper", "lower")
    assert (motion.n_frames, motion.spans) == (0, (0, 0, 0))
    assert "were not seen together yet" in motion.advice()


def test_long_motions_are_thinned_from_end_to_end():
    motion = joint_motion(moved(np.linspace(0, 60, 1000)[:, np.newaxis] * AXIS), "upper", "lower")
    assert motion.n_frames == 1000
    assert len(motion.turns) == MAX_FRAMES
    assert motion.spans[0] == pytest.approx(60)
