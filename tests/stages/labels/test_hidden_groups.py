"""An arm that is hidden for a while comes back as itself, however its markers were matched one by one."""

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.hidden_groups import match_hidden

RATE, N_FRAMES, SPACING = 40.0, 800, 60.0
TRUNK = np.array([[0, 0, 0], [80, 0, 0], [10, 90, 0], [75, 85, 20], [20, 40, 60]], dtype=float)  # mm
ARM = np.array([[200, 0, 0], [265, 5, 10], [330, 0, 40], [250, 60, 5], [320, 55, 0]], dtype=float)  # mm
HIDDEN, N = slice(300, 360), len(TRUNK) + len(ARM)
PERMUTED = np.array([0, 1, 2, 3, 4, 6, 7, 5, 9, 8])


@pytest.fixture(scope="module")
def case(turning_limb) -> tuple[PointCloud, np.ndarray, np.ndarray]:
    """A trunk, and an arm that turns three times as fast and is hidden for a while: cloud, markers and tracks."""
    trunk, arm = turning_limb(TRUNK, N_FRAMES), turning_limb(ARM, 3 * N_FRAMES)[::3]
    positions = np.concatenate([trunk, arm], axis=1)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[HIDDEN, len(TRUNK) :] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(N_FRAMES) / RATE)
    return cloud, marker, marker + N * ((marker >= len(TRUNK)) & (frame >= HIDDEN.stop))


def matched(case, labels: np.ndarray, fixed: np.ndarray | None = None) -> np.ndarray:
    cloud, _, track = case
    return match_hidden(FollowedCloud(cloud, track, RATE, SPACING, fixed), labels)


def test_a_permuted_arm_is_matched_as_a_whole(case) -> None:
    _, marker, track = case
    found = matched(case, np.where(track >= N, PERMUTED[marker], marker))
    assert same(found, marker)


def test_a_track_without_a_marker_takes_part(case) -> None:
    _, marker, track = case
    wrong = np.where(track >= N, PERMUTED[marker], marker)
    wrong[(track >= N) & (marker == 9)] = -1
    assert same(matched(case, wrong), marker)


def test_markers_too_many_become_those_that_they_are(case) -> None:
    _, marker, track = case
    wrong = np.where((track >= N) & (marker >= 8), marker + 2, marker)  # two of the arm have another number then
    wrong[(track >= N) & (marker == 5)] = 6
    wrong[(track >= N) & (marker == 6)] = 5
    assert same(matched(case, wrong), marker)


def test_right_labels_stay(case) -> None:
    _, marker, _ = case
    assert matched(case, marker) is marker


def test_what_the_user_states_stays(case) -> None:
    _, marker, track = case
    wrong = np.where(track >= N, PERMUTED[marker], marker)
    assert matched(case, wrong, track >= N) is wrong


def test_a_track_away_from_all_places_gets_no_marker(case) -> None:
    cloud, marker, track = case
    stray = (track >= N) & (marker == 9)
    points = cloud.points.copy()
    points[stray] = np.random.default_rng(0).uniform(-900.0, 900.0, (int(stray.sum()), 3))
    moved = PointCloud(points, cloud.frame_starts, cloud.times)
    labels = np.where(stray, -1, marker)
    found = match_hidden(FollowedCloud(moved, track, RATE, SPACING), labels)
    np.testing.assert_array_equal(found, labels)


def same(found: np.ndarray, marker: np.ndarray) -> bool:
    """Whether points share a marker exactly where they truly do, whatever the markers' numbers are."""
    pairs = np.unique(np.stack([found, marker]), axis=1)
    return bool(found.min() >= 0 and pairs.shape[1] == len(np.unique(marker)) == len(np.unique(found)))


def test_a_body_that_left_with_both_arms_exchanged_is_matched_as_a_whole() -> None:
    """Left and right forearm are alike, so that only the upper arms say which is which; nothing is seen for a while."""
    case = simulate("human", seed=23, n_frames=400, noise=0.3)
    positions, names = case.take.positions, np.array(case.truth.limb_names)[case.truth.limb_of_marker]
    frame, marker = np.nonzero(np.broadcast_to((np.arange(400) // 100 != 1)[:, np.newaxis], positions.shape[:2]))
    starts = np.concatenate([[0], np.cumsum(np.bincount(frame, minlength=400))])
    cloud = PointCloud(positions[frame, marker], starts, case.take.times)
    exchanged = np.arange(len(names))
    left, right = (np.flatnonzero(names == f"{side} forearm") for side in ("left", "right"))
    exchanged[left], exchanged[right] = right, left
    take = FollowedCloud(cloud, marker + len(names) * (frame >= 200), case.take.rate, SPACING)
    assert same(match_hidden(take, np.where(frame >= 200, exchanged[marker], marker)), marker)
