from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.bodies.prediction import HISTORY, BodyFilter, CentreNoise, Prediction, PredictionParameters
from skelgen.capture.values import FoundBody
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix

RATE = 60.0
NOISE = np.array([0.003, 0.003, 0.002, 0.2, 0.2, 0.6])
"""rad and mm; of a target of five balls 1.5 m away."""


def swinging(n_frames, hertz=0.7):
    """Poses of a body that swings by 150 mm and 0.6 rad, shape (n_frames, 4, 4), and their times."""
    times = np.arange(n_frames) / RATE
    phase = 2 * np.pi * hertz * times
    turns = matrix_from_vector(np.sin(phase)[:, np.newaxis] * [0.4, 0.4, 0.2])
    places = np.stack([150 * np.sin(phase), 100 * np.cos(phase), 1000 + 50 * np.sin(2 * phase)], axis=1)
    return transform_from(turns, places), times


def seen(pose, rng, name="hand"):
    error = rng.normal(size=6) * NOISE
    noisy = transform_from(matrix_from_vector(error[:3]) @ pose[:3, :3], pose[:3, 3] + error[3:])
    return FoundBody(name, noisy, np.diag(NOISE**2), np.arange(5), 0.1)


def errors(found, truth):
    turn = vector_from_matrix(found[:, :3, :3] @ truth[:, :3, :3].swapaxes(1, 2))
    return np.concatenate([turn, found[:, :3, 3] - truth[:, :3, 3]], axis=1)


def filtered(hertz):
    """Raw and smoothed errors, and the latter's squares in stated deviations, of 10 s of swinging, 0.5 s left out."""
    rng, (poses, times) = np.random.default_rng(0), swinging(600, hertz)
    one, raw, smooth, squares = BodyFilter(PredictionParameters()), [], [], []
    for pose, time in zip(poses, times, strict=True):
        found = seen(pose, rng)
        better = one.corrected(time, found)
        raw.append(found.world_from_body)
        smooth.append(better.world_from_body)
        away = errors(better.world_from_body[np.newaxis], pose[np.newaxis])[0]
        squares.append(away @ np.linalg.solve(better.covariance, away) / 6)
    return errors(np.array(raw), poses)[30:], errors(np.array(smooth), poses)[30:], np.array(squares)[30:]


def test_smoothed_poses_of_a_slow_body_err_less():
    raw, smooth, _ = filtered(0.3)
    assert ((smooth**2).mean(axis=0) < 0.7 * (raw**2).mean(axis=0)).all()


@pytest.mark.parametrize("hertz", [0.3, 1.5, 3.0])
def test_smoothing_never_harms_and_says_how_sure_it_is(hertz):
    raw, smooth, squares = filtered(hertz)
    assert ((smooth**2).mean(axis=0) < 1.03 * (raw**2).mean(axis=0)).all()
    assert squares.mean() == pytest.approx(1.0, abs=0.15)


def test_body_is_expected_where_it_will_be():
    rng, (poses, times) = np.random.default_rng(1), swinging(120)
    one = BodyFilter(PredictionParameters())
    for pose, time in zip(poses[:-1], times[:-1], strict=True):
        one.corrected(time, seen(pose, rng))
    expected = one.expected(times[-1])
    away = errors(expected.world_from_body[np.newaxis], poses[-1:])[0]
    assert (np.abs(away) < 5 * np.sqrt(np.diag(expected.covariance))).all()
    assert np.linalg.norm(away[3:]) < 3.0  # mm; it moves by 10 mm from frame to frame


def test_nothing_is_expected_before_a_body_was_seen_and_long_after():
    rng, (poses, _) = np.random.default_rng(1), swinging(1)
    one = BodyFilter(PredictionParameters(hold=0.5))
    assert one.expected(0.0) is None
    one.corrected(0.0, seen(poses[0], rng))
    assert one.expected(0.4) is not None
    assert one.expected(0.6) is None


def test_first_pose_and_a_jump_are_taken_as_they_are():
    rng, (poses, times) = np.random.default_rng(2), swinging(30)
    one = BodyFilter(PredictionParameters())
    for pose, time in zip(poses, times, strict=True):
        last = one.corrected(time, seen(pose, rng))
    assert not np.array_equal(last.world_from_body, poses[-1])
    far = transform_from(np.eye(3), np.array([500.0, 0, 2000]))
    found = seen(far, rng)
    np.testing.assert_array_equal(one.corrected(times[-1] + 1 / RATE, found).world_from_body, found.world_from_body)


def test_uncertainty_of_the_expected_pose_grows_with_time():
    rng, (poses, _) = np.random.default_rng(0), swinging(1)
    one = BodyFilter(PredictionParameters())
    one.corrected(0.0, seen(poses[0], rng))
    soon, late = (np.diag(one.expected(time).covariance) for time in (0.02, 0.1))
    assert (late > soon).all()


def test_each_body_has_its_own_filter():
    rng, (poses, times) = np.random.default_rng(3), swinging(2)
    both = Prediction(["hand", "arm"])
    both.corrected(times[0], [seen(poses[0], rng, "hand")])
    assert set(both.expected(times[1])) == {"hand"}


def test_the_noise_of_balls_is_what_targets_show_and_never_more_than_the_rig_states():
    noise = CentreNoise(0.1)
    found = FoundBody("torso", np.eye(4), np.eye(6), np.arange(5), 0.1, noise=0.3)
    changes = [noise.seen([found]) for _ in range(HISTORY)]
    assert changes == [*[1.0] * (HISTORY - 1), pytest.approx(0.3)]
    assert noise.used == pytest.approx(0.03)
    for _ in range(HISTORY):
        noise.seen([replace(found, noise=20.0)])
    assert noise.used == 0.1
    for _ in range(HISTORY):
        noise.seen([])
    assert noise.used == 0.1
