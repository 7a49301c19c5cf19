"""Labels frame by frame."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import skelgen
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model import PointCloud, Skeleton
from skelgen.stages.labels import Tracker
from skelgen.stages.labels.online.pose_filter import PoseFilter
from skelgen.stages.labels.online.pose_search import PoseSearch
from skelgen.stages.labels.online.rigid_labels import RigidLabels

RATE = 100.0
FAULTS = {"noise": 0.3, "soft_tissue": 2.0}
EXACT = 1e-6  # mm: Gauss-Newton converges quadratically, three steps from a few degrees off leave rounding
GROWTH = 100_000  # bytes in 1200 frames: caches of the interpreter; an array kept of each frame would be 300 kB


def labelled(tracker: Tracker, frames: Iterable[np.ndarray], start: float = 0.0) -> np.ndarray:
    """Labels of all points of some frames."""
    return np.concatenate([tracker.update(points, start + index / RATE) for index, points in enumerate(frames)])


def idf1(labels: np.ndarray, truth: np.ndarray) -> float:
    """IDF1 of labels against the marker of each point, -1 for ghosts."""
    counts = np.zeros((labels.max() + 2, truth.max() + 2))
    np.add.at(counts, (labels, truth), 1)  # -1 counts into the last row and column
    pairs = counts[:-1, :-1]
    hits = pairs[linear_sum_assignment(pairs, maximize=True)].sum()
    return float(2 * hits / ((labels >= 0).sum() + (truth >= 0).sum()))


@pytest.fixture(scope="module")
def skeleton_of(simulated, reconstructed) -> Callable[[str], Skeleton]:
    """The skeleton of a structure, from a labelled take of the same markers."""
    made: dict[str, Skeleton] = {}

    def make(name: str) -> Skeleton:
        if name not in made:
            made[name] = reconstructed(simulated(name, seed=1, n_frames=300, **FAULTS).take).skeleton
        return made[name]

    return make


@dataclass(frozen=True)
class Case:
    """A cloud and the marker of each of its points."""

    cloud: PointCloud
    truth: np.ndarray


@pytest.fixture(scope="module")
def seen_by(simulated) -> Callable[..., Case]:
    """A cloud with occlusion and ghosts."""

    def make(name: str, n_cameras: int, n_frames: int = 400) -> Case:
        options = {**FAULTS, "n_cameras": n_cameras, "ghosts": 0.2, "labelled": False}
        take = simulated(name, seed=1, n_frames=n_frames, **options)
        return Case(take.take, take.truth.marker_of_point)

    return make


@pytest.fixture(scope="module")
def rigid_body() -> np.ndarray:
    """Six markers on a body that turns and walks, shape (n_frames, 6, 3) [mm]: no two distances are alike."""
    places = np.random.default_rng(3).uniform(-150, 150, (6, 3))
    seconds = np.arange(600) / RATE
    turns = matrix_from_vector(np.stack([0.3 * np.sin(seconds), 0.8 * seconds, 0.2 * np.cos(seconds)], axis=1))
    path = np.stack([300 * np.sin(seconds), 200 * seconds, 0 * seconds], axis=1)
    return places @ turns.swapaxes(1, 2) + path[:, np.newaxis]


def test_it_is_exported() -> None:
    assert skelgen.Tracker is Tracker


def test_markers_that_are_always_seen_keep_their_labels(rigid_body) -> None:
    rng = np.random.default_rng(0)
    orders = [rng.permutation(6) for _ in rigid_body]
    labels = labelled(Tracker(rate=RATE), [frame[order] for frame, order in zip(rigid_body, orders, strict=True)])
    truth = np.concatenate(orders)
    late = slice(6 * 20, None)
    assert len(set(zip(labels[late].tolist(), truth[late].tolist(), strict=True))) == 6


def test_lost_marker_is_found_again_by_its_rigid_group(rigid_body) -> None:
    tracker = Tracker(rate=RATE)
    before = labelled(tracker, rigid_body[:250])[-6:]
    labelled(tracker, rigid_body[250:350, 1:], 2.5)
    after = labelled(tracker, rigid_body[350:400], 3.5)[-6:]
    assert after.tolist() == before.tolist()


def test_all_markers_are_found_again_when_half_are_away_in_turn(rigid_body) -> None:
    tracker = Tracker(rate=RATE)
    before = labelled(tracker, rigid_body[:250])[-6:]
    labelled(tracker, rigid_body[250:350, :3], 2.5)
    middle = labelled(tracker, rigid_body[350:400], 3.5)[-6:]
    labelled(tracker, rigid_body[400:500, 3:], 4.0)
    after = labelled(tracker, rigid_body[500:550], 5.0)[-6:]
    assert before.tolist() == middle.tolist() == after.tolist()


def test_single_ghosts_get_no_label(rigid_body) -> None:
    tracker, rng = Tracker(rate=RATE), np.random.default_rng(1)
    ghosts = rng.uniform(-2000, 2000, (len(rigid_body), 1, 3))
    labels = labelled(tracker, np.concatenate([rigid_body, ghosts], axis=1)).reshape(-1, 7)
    assert (labels[:, 6] == -1).all()


def test_labels_without_a_skeleton_beat_tracks_alone(seen_by) -> None:
    case = seen_by("human", 8)
    assert idf1(labelled(Tracker(rate=RATE), case.cloud), case.truth) > 0.95


def test_labels_by_a_known_skeleton_are_its_markers(seen_by, skeleton_of) -> None:
    case = seen_by("human", 6)
    labels = labelled(Tracker(skeleton=skeleton_of("human"), rate=RATE), case.cloud)
    right = ((labels == case.truth) & (labels >= 0)).sum()
    assert 2 * right / ((labels >= 0).sum() + (case.truth >= 0).sum()) > 0.99


def test_labels_by_a_known_skeleton_survive_a_jump_in_time(seen_by, skeleton_of) -> None:
    case = seen_by("tree:6", 0)
    tracker, frames = Tracker(skeleton=skeleton_of("tree:6"), rate=RATE), list(case.cloud)
    labelled(tracker, frames[:50])
    labels = labelled(tracker, frames[300:350], 3.0)
    truth = case.truth[case.cloud.frame_starts[300] : case.cloud.frame_starts[350]]
    assert np.mean((labels == truth)[truth >= 0]) > 0.99


def test_same_frames_give_the_same_labels(seen_by) -> None:
    frames = list(seen_by("human", 8).cloud)[:150]
    first, second = (labelled(Tracker(rate=RATE), frames) for _ in range(2))
    assert np.array_equal(first, second)


def test_rate_is_found_from_the_time_stamps(rigid_body) -> None:
    tracker = Tracker()
    before = labelled(tracker, rigid_body[:250])[-6:]
    labelled(tracker, rigid_body[250:350, 1:], 2.5)
    assert labelled(tracker, rigid_body[350:400], 3.5)[-6:].tolist() == before.tolist()


def test_identities_outlive_a_jump_in_time(rigid_body) -> None:
    tracker = Tracker(rate=RATE)
    before = labelled(tracker, rigid_body[:250])[-6:]
    labels = labelled(tracker, rigid_body[400:450], 4.0).reshape(-1, 6)
    assert not set(labels[-1].tolist()) - {-1} - set(before.tolist())


@pytest.mark.parametrize("time", [1.0, 0.5])
def test_time_that_does_not_rise_is_an_error(time) -> None:
    tracker = Tracker(rate=RATE)
    tracker.update(np.zeros((1, 3)), 1.0)
    with pytest.raises(InputError, match="give each frame once, in order"):
        tracker.update(np.zeros((1, 3)), time)


@pytest.mark.parametrize("points", [np.zeros((2, 2)), np.full((2, 3), np.inf), np.zeros(3)])
def test_impossible_points_are_errors(points) -> None:
    with pytest.raises(InputError, match="points of a frame"):
        Tracker(rate=RATE).update(points, 0.0)


def test_impossibly_large_coordinates_are_an_error() -> None:
    with pytest.raises(InputError, match="check the unit"):
        Tracker(rate=RATE).update(np.full((2, 3), 1e200), 0.0)


def test_refused_frame_changes_nothing(rigid_body) -> None:
    tracker = Tracker(rate=RATE)
    tracker.update(rigid_body[0], 0.0)
    with pytest.raises(InputError):
        tracker.update(np.zeros((2, 2)), 0.01)
    tracker.update(rigid_body[1], 0.01)


@pytest.mark.parametrize("options", [{"rate": 0.0}, {"max_markers": 0}, {"window": 0.0}])
def test_impossible_settings_are_errors(options) -> None:
    with pytest.raises(InputError, match="above 0"):
        Tracker(**options)


@pytest.mark.parametrize(
    ("skeleton", "cause"),
    [("rom", "skelgen.load"), (Path("rom"), "skelgen.load"), ([1, 2], "skelgen.apply_subject"), (1, "skeleton is 1;")],
)
def test_what_is_no_skeleton_is_refused_in_a_sentence(skeleton, cause) -> None:
    with pytest.raises(InputError, match=cause):
        Tracker(skeleton=skeleton)


def test_frames_without_points_are_labelled_by_nothing() -> None:
    tracker = Tracker(rate=RATE)
    assert [len(tracker.update(points, time)) for time, points in enumerate([[], np.empty((0, 3))])] == [0, 0]


def test_unseen_rows_are_nobodys(rigid_body) -> None:
    tracker = Tracker(rate=RATE)
    frames = rigid_body[:50].copy()
    frames[:, 2] = np.nan
    labels = labelled(tracker, frames).reshape(-1, 6)
    assert (labels[:, 2] == -1).all()
    assert (labels[-1, [0, 1, 3, 4, 5]] >= 0).all()


def test_thousands_of_points_in_a_frame_do_not_hide_the_markers(rigid_body) -> None:
    tracker, rng = Tracker(rate=RATE), np.random.default_rng(5)
    before = labelled(tracker, rigid_body[:100])[-6:]
    crowd = np.concatenate([rigid_body[100], rng.uniform(-5000, 5000, (5000, 3))])
    assert tracker.update(crowd, 1.0)[:6].tolist() == before.tolist()


def test_number_of_remembered_markers_is_bounded() -> None:
    tracker, rng = Tracker(rate=RATE, max_markers=10), np.random.default_rng(2)
    for frame in range(200):
        if frame % 20 == 0:
            points = rng.uniform(-1000, 1000, (6, 3))
        tracker.update(points, frame / RATE)
    assert tracker.n_markers <= 10


def test_memory_stays_flat(rigid_body) -> None:
    tracker, rng = Tracker(rate=RATE), np.random.default_rng(4)
    frames = [frame[rng.random(6) > 0.1] for frame in np.concatenate([rigid_body, rigid_body[::-1]])]
    tracemalloc.start()
    labelled(tracker, frames)
    before, _ = tracemalloc.get_traced_memory()
    labelled(tracker, frames, 15.0)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < GROWTH


def test_pose_of_a_known_skeleton_is_exact_without_noise(simulated, reconstructed) -> None:
    take = simulated("tree:6", seed=1, n_frames=100).take
    project = reconstructed(take)
    chain = PoseFilter(project.skeleton)
    poses = project.motion.world_from_limb
    chain.set_pose(poses[10, :, :3, :3], poses[10, :, :3, 3])
    chain.advance(1)
    chain.fit(take.positions[11], np.arange(take.n_markers))
    assert np.abs(chain.positions_of(np.arange(take.n_markers)) - take.positions[11]).max() < 10 * EXACT


def test_pose_is_found_from_one_frame_in_any_order_and_place(simulated, skeleton_of, moved_world) -> None:
    skeleton = skeleton_of("tree:6")
    take = simulated("tree:6", seed=1, n_frames=300, **FAULTS).take
    points = moved_world.points(take.positions[150])
    chain = PoseFilter(skeleton)
    found = PoseSearch(chain).find(points[np.random.default_rng(0).permutation(len(points))], 100.0)
    chain.set_pose(*found)
    off = np.linalg.norm(chain.positions_of(np.arange(take.n_markers)) - points, axis=1)
    assert np.median(off) < 2 * FAULTS["soft_tissue"] * np.sqrt(3)


def test_two_labels_of_one_marker_are_joined_when_it_is_found_in_its_place(rigid_body) -> None:
    """A marker is lost; what is followed from then on flutters somewhere else, and comes back into its place."""
    labels, frames, tracks = RigidLabels(20, 30.0), rigid_body.copy(), np.array([10, 1, 2, 3, 4, 5])
    frames[250:310, 0] += np.random.default_rng(0).normal((800.0, 0.0, 0.0), 200.0, (60, 3))
    before = labelled_by(labels, frames[:250], np.arange(6))[-1]
    lost, new = int(before[0]), 6
    assert labelled_by(labels, frames[250:310], tracks)[-1].tolist() == [new, *before[1:]]
    assert labelled_by(labels, frames[310:], tracks)[-1].tolist() == before.tolist()
    assert labels.merged == {new: lost}


def labelled_by(labels: RigidLabels, frames: np.ndarray, tracks: np.ndarray) -> np.ndarray:
    """Labels of frames whose points have known tracks, shape (n_frames, n_points)."""
    return np.array([labels.update(frame, tracks, 1, RATE, 100.0) for frame in frames])
