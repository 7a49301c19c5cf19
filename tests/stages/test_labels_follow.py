"""Following points from frame to frame: the twins agree, the prediction is what it claims to be."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from skelgen.errors import Cancelled, InputError
from skelgen.model import PointCloud
from skelgen.progress import SilentMonitor
from skelgen.simulation import simulate
from skelgen.stages.labels import LabelParameters, plain
from skelgen.stages.labels.follow import follow_points, rules_of
from skelgen.stages.labels.tracks import Tracks

ASSIGNMENTS = ("greedy", "optimal")
PREDICTIONS = ("none", "constant_velocity", "double_exponential")
# Both recursions do a few sums of numbers up to 100 per frame.
ROUNDING = 1e-9


def cloud_of(frames):
    starts = np.concatenate([[0], np.cumsum([len(frame) for frame in frames])]).astype(np.intp)
    points = np.concatenate([np.zeros((0, 3)), *(np.reshape(frame, (-1, 3)) for frame in frames)])
    return PointCloud(points, starts, np.arange(len(frames)) / 100.0)


@pytest.fixture(scope="module")
def human():
    """A human with noise, dropouts and ghosts, and the marker of each point."""
    simulated = simulate("human", labelled=False, n_frames=150, noise=0.5, dropouts=0.1, ghosts=2.0, seed=3)
    return simulated.take


@pytest.mark.parametrize(("assignment", "prediction"), list(product(ASSIGNMENTS, PREDICTIONS)))
def test_compiled_and_plain_twins_agree_bit_for_bit(human, assignment, prediction):
    parameters = LabelParameters(assignment=assignment, prediction=prediction)
    owner, reach = follow_points(human, parameters, compiled=True)
    owner_of_plain, reach_of_plain = follow_points(human, parameters, compiled=False)
    assert np.array_equal(owner, owner_of_plain)
    assert reach == reach_of_plain


def test_twins_agree_where_many_points_compete():
    random = np.random.default_rng(0)
    crowd = cloud_of([random.normal(scale=10.0, size=(random.integers(0, 30), 3)) for _ in range(60)])
    for assignment in ASSIGNMENTS:
        parameters = LabelParameters(assignment=assignment, max_jump=15.0, mute=1)
        owners = [follow_points(crowd, parameters, compiled=compiled)[0] for compiled in (True, False)]
        assert np.array_equal(*owners)


def test_plain_twin_takes_over_where_numba_finds_no_cache(human, monkeypatch):
    expected, _ = follow_points(human, LabelParameters(), compiled=True)
    monkeypatch.setitem(__import__("sys").modules, "skelgen.stages.labels.compiled", None)
    owner, _ = follow_points(human, LabelParameters(), compiled=True)
    assert np.array_equal(owner, expected)


@pytest.mark.parametrize("smoothing", [0.2, 0.5, 0.9])
def test_prediction_is_laviolas_double_exponential_smoothing(smoothing):
    path = np.cumsum(np.random.default_rng(1).normal(size=(40, 3)), axis=0)
    tracks = Tracks(4)
    rules = rules_of(LabelParameters(smoothing=smoothing), 100.0)
    state = (tracks.motion, tracks.counters, tracks.totals)
    owner, surprise = np.empty(40, dtype=np.intp), np.empty(40)
    plain.follow_frames(path, np.arange(41), state, rules, owner, surprise)

    slope = path[1] - path[0]
    lag = (1 - smoothing) / smoothing * slope
    once, twice = path[1] - lag, path[1] - 2 * lag
    for point in path[2:]:
        once = smoothing * point + (1 - smoothing) * once
        twice = smoothing * once + (1 - smoothing) * twice
    ratio = smoothing / (1 - smoothing)
    expected = (2 + ratio) * once - (1 + ratio) * twice
    assert np.allclose(tracks.motion[0].sum(axis=0), expected, atol=ROUNDING)


def test_full_trust_in_the_last_point_is_constant_velocity():
    trusting = rules_of(LabelParameters(smoothing=1.0), 1.0)
    assert trusting == rules_of(LabelParameters(prediction="constant_velocity"), 1.0)


def test_optimal_assignment_keeps_apart_what_greedy_confuses():
    # Both markers move by 6 along x; the one in front is nearest to where the one behind was last seen.
    frames = [np.array([[6.0 * f, 0, 0], [6.0 * f + 10, 0, 0]]) for f in range(3)]
    options = {"prediction": "none", "max_jump": 50.0}
    optimal, _ = follow_points(cloud_of(frames), LabelParameters(assignment="optimal", **options))
    greedy, _ = follow_points(cloud_of(frames), LabelParameters(assignment="greedy", **options))
    assert optimal.tolist() == [0, 1] * 3
    assert greedy.tolist() != [0, 1] * 3


@pytest.mark.parametrize(("gap", "n_tracks"), [(3, 1), (4, 2)])
def test_a_track_is_continued_over_max_gap_frames_and_no_longer(gap, n_tracks):
    frames = [np.array([[5.0 * f, 0, 0]]) if f < 10 or f >= 10 + gap else np.empty((0, 3)) for f in range(30)]
    owner, _ = follow_points(cloud_of(frames), LabelParameters(max_gap=3, max_jump=6.0))
    assert len(np.unique(owner)) == n_tracks


def test_a_jumping_marker_is_muted_and_becomes_a_new_track():
    frames = [np.array([[0.1 * f + 500.0 * (f >= 10), 0, 0]]) for f in range(20)]
    owner, _ = follow_points(cloud_of(frames), LabelParameters(max_jump=20.0, mute=3))
    assert owner.tolist() == [0] * 10 + [-1] * 3 + [1] * 7


def test_rotated_takes_are_followed_alike(human):
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turned = PointCloud(human.points @ turn.T, human.frame_starts, human.times)
    owner, _ = follow_points(human, LabelParameters(max_jump=40.0))
    owner_of_turned, _ = follow_points(turned, LabelParameters(max_jump=40.0))
    assert np.array_equal(owner, owner_of_turned)


def test_a_crowd_of_points_is_an_input_error():
    crowd = cloud_of([np.zeros((1, 3)), np.random.default_rng(0).normal(size=(1001, 3))])
    with pytest.raises(InputError, match="frame 1 holds 1001 points"):
        follow_points(crowd, LabelParameters())


def test_following_can_be_cancelled(human):
    class Impatient(SilentMonitor):
        def advance(self, done, total):
            raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        follow_points(human, LabelParameters(), Impatient())
