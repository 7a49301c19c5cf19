"""Two legs that are alike and went on as each other after both were hidden are exchanged back."""

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.alike_parts import exchange_alike
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.turns import with_alike_apart

RATE, N_FRAMES, SPACING = 40.0, 800, 60.0
TRUNK = np.array([[0, 0, 0], [80, 0, 0], [10, 90, 0], [75, 85, 20], [20, 40, 60]], dtype=float)  # mm
LEG = np.array([[50, 0, 10], [90, 40, 30], [150, -30, 0], [220, 15, -25]], dtype=float)  # mm from the hip
MIRRORED = np.diag([1.0, 1.0, -1.0])
FIRST, SECOND = np.arange(5, 9), np.arange(9, 13)
HIDDEN, APART = slice(300, 340), slice(420, 460)  # both legs, and the second one alone
SWAPPED = np.concatenate([np.arange(5), SECOND, FIRST])


def swing(phase: float, points: np.ndarray, hip: np.ndarray) -> np.ndarray:
    """Points that swing about a hip, shape (n_frames, n_points, 3)."""
    angle = 0.6 * np.sin(2 * np.pi * 0.8 * np.arange(N_FRAMES) / RATE + phase)
    cos, sin, no = np.cos(angle), np.sin(angle), np.zeros(N_FRAMES)
    turn = np.stack([cos, -sin, no, sin, cos, no, no, no, no + 1], axis=1).reshape(-1, 3, 3)
    return np.einsum("fij,nj->fni", turn, points) + hip


@pytest.fixture(scope="module")
def case() -> tuple[FollowedCloud, np.ndarray]:
    """A trunk that stands, and two legs of which markers lie some mm otherwise: take and markers."""
    rng = np.random.default_rng(0)
    other = LEG @ MIRRORED + rng.normal(0.0, 3.0, LEG.shape)
    hips = np.array([60.0, 0.0, 150.0]), np.array([60.0, 0.0, -150.0])
    legs = swing(0.0, LEG, hips[0]), swing(np.pi / 2, other, hips[1])
    positions = np.concatenate([np.tile(TRUNK, (N_FRAMES, 1, 1)), *legs], axis=1)
    positions += rng.normal(0.0, 0.5, positions.shape)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[HIDDEN, 5:] = False
    seen[APART, SECOND] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(N_FRAMES) / RATE)
    track = marker + 13 * (frame >= HIDDEN.stop) + 13 * ((frame >= APART.stop) & (marker >= 9))
    return FollowedCloud(cloud, track, RATE, SPACING), marker


def same(found: np.ndarray, marker: np.ndarray) -> bool:
    """Whether points share a marker exactly where they truly do, whatever the markers' numbers are."""
    pairs = np.unique(np.stack([found, marker], axis=1), axis=0)
    return len(pairs) == marker.max() + 1 == len(np.unique(pairs[:, 0]))


def test_legs_that_went_on_as_each_other_are_exchanged_back(case) -> None:
    take, marker = case
    wrong = np.where(take.frame_of_point() >= HIDDEN.stop, SWAPPED[marker], marker)
    assert same(exchange_alike(take, wrong), marker)
    assert same(with_alike_apart(take, wrong), marker)


def test_right_labels_stay(case) -> None:
    take, marker = case
    assert exchange_alike(take, marker) is marker
    assert with_alike_apart(take, marker) is marker


def test_what_the_user_states_stays(case) -> None:
    take, marker = case
    wrong = np.where(take.frame_of_point() >= HIDDEN.stop, SWAPPED[marker], marker)
    stated = FollowedCloud(take.cloud, take.track_of_point, RATE, SPACING, marker >= 5)
    assert exchange_alike(stated, wrong) is wrong


def test_few_markers_have_no_parts(case) -> None:
    take, marker = case
    few = np.where(marker < 3, marker, -1)
    assert exchange_alike(take, few) is few
