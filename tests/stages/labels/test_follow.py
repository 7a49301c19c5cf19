"""Following points from frame to frame: tracks are as good as markers, the prediction is what it claims to be."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest

from skelgen._kernels.track_matching import find_pairs, rising_order
from skelgen._kernels.tracking import follow_frames
from skelgen._kernels.tracks import TrackedPoints, Tracks
from skelgen.errors import InputError
from skelgen.model import PointCloud
from skelgen.progress import SilentMonitor
from skelgen.simulation import simulate
from skelgen.stages.labels import LabelParameters
from skelgen.stages.labels.tracking.follow import MOST_POINTS_PER_FRAME, follow_points, rules_of
from skelgen.stages.labels.tracking.statistics import point_weights, time_steps

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
def test_every_combination_follows_most_points_as_their_markers(human, assignment, prediction):
    track_of_point, _ = follow_points(human, LabelParameters(assignment=assignment, prediction=prediction))
    followed = track_of_point >= 0
    assert followed.mean() > 0.8
    for frame, (first, last) in enumerate(pairwise(human.frame_starts)):
        own = track_of_point[first:last][followed[first:last]]
        assert len(own) == len(set(own.tolist())), frame  # no two points of a frame are the same marker


@pytest.mark.parametrize("assignment", ASSIGNMENTS)
def test_points_that_are_given_in_another_order_are_followed_alike(assignment):
    random = np.random.default_rng(0)
    frames = [random.normal(scale=10.0, size=(random.integers(0, 30), 3)) for _ in range(60)]
    orders = [random.permutation(len(frame)) for frame in frames]
    parameters = LabelParameters(assignment=assignment, max_jump=15.0, mute=1)
    track_of_point, _ = follow_points(cloud_of(frames), parameters)
    mixed, _ = follow_points(cloud_of([frame[order] for frame, order in zip(frames, orders, strict=True)]), parameters)
    starts = np.cumsum([0, *(len(frame) for frame in frames)])
    back = np.concatenate([start + np.argsort(order) for start, order in zip(starts, orders, strict=False)])
    pairs = np.unique(np.stack([track_of_point, mixed[back.astype(int)]]), axis=1)
    assert len(pairs.T) == len(np.unique(track_of_point)) == len(np.unique(mixed))  # the same tracks by other numbers


@pytest.mark.parametrize("smoothing", [0.2, 0.5, 0.9])
def test_prediction_is_laviolas_double_exponential_smoothing(smoothing):
    path = np.cumsum(np.random.default_rng(1).normal(size=(40, 3)), axis=0)
    tracks = Tracks(4)
    rules = rules_of(LabelParameters(smoothing=smoothing), 100.0)
    state = (tracks.motion, tracks.counters, tracks.totals)
    found, surprise = np.empty(40, dtype=np.intp), np.empty(40)
    ones, nothing = np.ones(40), np.empty((0, 5))
    points = TrackedPoints(path, ones, found, surprise, nothing)
    follow_frames(points, np.arange(41), np.ones(40, dtype=np.intp), state, rules)

    slope = path[1] - path[0]
    lag = (1 - smoothing) / smoothing * slope
    once, twice = path[1] - lag, path[1] - 2 * lag
    for point in path[2:]:
        once = smoothing * point + (1 - smoothing) * once
        twice = smoothing * once + (1 - smoothing) * twice
    ratio = smoothing / (1 - smoothing)
    expected = (2 + ratio) * once - (1 + ratio) * twice
    assert np.allclose(tracks.motion[0, :2].sum(axis=0), expected, atol=ROUNDING)


def test_full_trust_in_the_last_point_is_constant_velocity():
    trusting = rules_of(LabelParameters(smoothing=1.0), 1.0)
    constant = rules_of(LabelParameters(prediction="constant_velocity"), 1.0)
    assert (trusting.level_gain, trusting.slope_gain) == (constant.level_gain, constant.slope_gain)


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
    track_of_point, _ = follow_points(cloud_of(frames), LabelParameters(max_gap=3, max_jump=6.0))
    assert len(np.unique(track_of_point)) == n_tracks


def test_a_jumping_marker_is_muted_and_becomes_a_new_track():
    frames = [np.array([[0.1 * f + 500.0 * (f >= 10), 0, 0]]) for f in range(20)]
    track_of_point, _ = follow_points(cloud_of(frames), LabelParameters(max_jump=20.0, mute=3))
    assert track_of_point.tolist() == [0] * 10 + [-1] * 3 + [1] * 7


def test_rotated_takes_are_followed_alike(human):
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turned = PointCloud(human.points @ turn.T, human.frame_starts, human.times)
    track_of_point, _ = follow_points(human, LabelParameters(max_jump=40.0))
    owner_of_turned, _ = follow_points(turned, LabelParameters(max_jump=40.0))
    assert np.array_equal(track_of_point, owner_of_turned)


class Listening(SilentMonitor):
    """A monitor that keeps its notices."""

    def __init__(self):
        self.sentences = []

    def notice(self, sentence):
        self.sentences.append(sentence)


def test_a_crowded_frame_is_left_out_and_told():
    walk = [np.array([[5.0 * f, 0, 0], [5.0 * f, 100.0, 0]]) for f in range(20)]
    walk[8] = np.random.default_rng(0).normal(scale=100.0, size=(MOST_POINTS_PER_FRAME + 1, 3))
    monitor = Listening()
    track_of_point, _ = follow_points(cloud_of(walk), LabelParameters(), monitor)
    assert track_of_point[:16].tolist() == track_of_point[-16:].tolist() == [0, 1] * 8
    assert (track_of_point[16 : 16 + len(walk[8])] == -1).all()
    assert "frame 8 holds 10001 points" in monitor.sentences[0]


def test_crowds_in_all_frames_are_an_input_error():
    crowd = cloud_of([np.zeros((MOST_POINTS_PER_FRAME + 1, 3))] * 2)
    with pytest.raises(InputError, match="and so do all others"):
        follow_points(crowd, LabelParameters())


def test_thousands_of_points_in_a_frame_do_not_end_tracks():
    rng = np.random.default_rng(1)
    walk = [np.array([[5.0 * f, 0, 0], [5.0 * f, 100.0, 0], [5.0 * f, 0, 90.0]]) for f in range(60)]
    for frame in (20, 21, 40):
        walk[frame] = np.concatenate([walk[frame], rng.uniform(-1000, 1000, size=(5000, 3))])
    cloud = cloud_of(walk)
    track_of_point, _ = follow_points(cloud, LabelParameters())
    assert track_of_point[-3:].tolist() == track_of_point[:3].tolist() == [0, 1, 2]


def markers_moving(n_frames, paths):
    """Frames of markers on given paths, functions of the frame; None where unseen."""
    places = [[path(frame) for path in paths] for frame in range(n_frames)]
    return [np.array([place for place in frame if place is not None], dtype=float) for frame in places]


def test_doubles_of_a_marker_get_no_track_and_break_none():
    rng = np.random.default_rng(0)
    walk = markers_moving(200, [lambda f, y=y: [3.0 * f, y, 5.0 * np.sin(f / 9)] for y in (0.0, 120.0, 260.0)])
    doubled = [np.concatenate([frame, frame[:1] + 0.5]) if f % 3 else frame for f, frame in enumerate(walk)]
    noisy = [frame + 0.1 * rng.normal(size=frame.shape) for frame in doubled]
    track_of_point, _ = follow_points(cloud_of(noisy), LabelParameters())
    assert sorted(set(track_of_point.tolist())) == [-1, 0, 1, 2]
    assert (track_of_point == -1).sum() == sum(len(frame) == 4 for frame in doubled)


def test_two_markers_that_part_after_merging_get_new_tracks():
    def side(sign):
        return lambda f: None if 100 <= f < 120 else [2.0 * f, sign * max(4.0, 0.8 * abs(f - 110)), 0.0]

    def merged(frame):
        return [2.0 * frame, 0.0, 0.0] if 100 <= frame < 120 else None

    others = [lambda f, z=z: [2.0 * f, 0.0, z] for z in (150.0, 300.0)]
    rng = np.random.default_rng(2)
    frames = [
        frame + 0.3 * rng.normal(size=frame.shape)
        for frame in markers_moving(220, [side(1), side(-1), merged, *others])
    ]
    track_of_point, _ = follow_points(cloud_of(frames), LabelParameters())
    before, after = set(track_of_point[:4].tolist()), set(track_of_point[-4:].tolist())
    assert len(before & after) == 2  # the others; name_of_point is name_of_point of the merged two nobody can tell


def test_a_pause_ends_all_tracks_and_a_short_gap_does_not():
    frames = [np.array([[4.0 * f, 0, 0], [4.0 * f, 80.0, 0]]) for f in range(60)]
    for dropped, n_tracks in ((3, 2), (30, 4)):
        kept = [f for f in range(60) if not 20 <= f < 20 + dropped]
        cloud = cloud_of([frames[f] for f in kept])
        cloud = PointCloud(cloud.points, cloud.frame_starts, np.array(kept) / 100.0)
        track_of_point, _ = follow_points(cloud, LabelParameters(max_jump=8.0, mute=0))
        assert len(np.unique(track_of_point)) == n_tracks


def test_gaps_count_in_time_and_repeated_stamps_are_told():
    cloud = cloud_of([np.zeros((1, 3))] * 6)
    stamps = np.array([0.0, 0.011, 0.011, 0.03, 0.04, 0.1])
    monitor = Listening()
    steps = time_steps(PointCloud(cloud.points, cloud.frame_starts, stamps), monitor)
    assert steps[0] == 1
    assert steps[2] == 1
    assert steps[-1] > 3
    assert "1 frame repeats the time stamp" in monitor.sentences[0]


def test_steps_of_a_regular_take_are_one():
    assert time_steps(cloud_of([np.zeros((1, 3))] * 5)).tolist() == [1] * 5


@pytest.mark.parametrize("fault", [{}, {"merged": 60.0}, {"duplicates": 0.5}, {"edge_jumps": 4.0}, {"ghosts": 2.0}])
def test_tracks_are_pure(fault):
    simulated = simulate("human", labelled=False, n_frames=400, noise=0.5, dropouts=0.1, seed=5, **fault)
    track_of_point, _ = follow_points(simulated.take, LabelParameters())
    marker = simulated.truth.marker_of_point
    real = (track_of_point >= 0) & (marker >= 0)
    counts = np.zeros((track_of_point.max() + 1, marker.max() + 1), dtype=int)
    np.add.at(counts, (track_of_point[real], marker[real]), 1)
    assert counts.max(axis=1).sum() >= 0.999 * counts.sum()
    lengths = counts.sum(axis=1)
    assert lengths[lengths >= 50].sum() > 0.85 * (marker >= 0).sum()  # in pieces of half a second, between dropouts


def test_points_that_the_file_doubts_weigh_less():
    cloud = cloud_of([np.zeros((4, 3))] * 50)
    rng = np.random.default_rng(0)
    error = rng.uniform(0.4, 0.6, size=200)
    error[7] = 5.0
    n_blobs = np.full(200, 4.0)
    n_blobs[9] = 2.0
    rated = PointCloud(cloud.points, cloud.frame_starts, cloud.times, {"reprojection_error": error, "n_blobs": n_blobs})
    weights = point_weights(rated)
    assert (weights > 0).all() and (weights <= 1).all()
    assert weights[7] < 0.05
    assert weights[9] == pytest.approx(0.5, rel=0.3)
    assert np.median(weights) > 0.9


@pytest.mark.parametrize("attributes", [{}, {"reprojection_error": np.zeros(8)}, {"n_blobs": np.zeros(8)}])
def test_points_of_which_the_file_says_nothing_weigh_one(attributes):
    cloud = cloud_of([np.zeros((4, 3))] * 2)
    assert (point_weights(PointCloud(cloud.points, cloud.frame_starts, cloud.times, attributes)) == 1).all()


def test_a_doubted_point_loses_to_one_that_is_as_near():
    expected, points = np.zeros((1, 3)), np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    terms = np.array([[10.0, 20.0, 4.0, 4.0]])  # reach, gain there, squared width, exponent
    pairs, gains, _ = find_pairs(expected, terms, points, np.array([1.0, 0.1]), rising_order(points[:, 0]))
    gain_of_point = dict(zip(pairs[:, 1].tolist(), gains.tolist(), strict=True))
    assert 0 < gain_of_point[1] < gain_of_point[0]
