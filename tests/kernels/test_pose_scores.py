"""Scores of candidate poses, against the likelihood of points where markers are."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.explained_points import LimbMarkers, scores_of_poses
from skelgen.geometry.rotations import matrix_from_vector, transform_from

CHANCE = float(np.log(100.0**3))  # one point in a cube of 100 mm
DEVIATIONS = np.array([1.0, 2.0, 4.0])  # mm


@pytest.fixture
def limb() -> LimbMarkers:
    return LimbMarkers(100.0 * np.random.default_rng(0).normal(size=(3, 3)), DEVIATIONS)


@pytest.fixture
def pose() -> np.ndarray:
    rng = np.random.default_rng(1)
    return transform_from(matrix_from_vector(rng.normal(size=3)), 500.0 * rng.normal(size=3))


def points_at(limb: LimbMarkers, pose: np.ndarray) -> np.ndarray:
    return limb.offsets @ pose[:3, :3].T + pose[:3, 3]


def test_the_score_is_the_density_of_nearest_points_over_chance(limb, pose):
    away = np.array([1.5, -1.0, 0.5])
    points = np.concatenate([[[9e3, 0.0, 0.0]], points_at(limb, pose) + away])
    scores, used = scores_of_poses(pose[np.newaxis], limb, points, CHANCE)
    density = np.exp(-0.5 * (away @ away) / DEVIATIONS**2) / (2 * np.pi * DEVIATIONS**2) ** 1.5
    assert scores[0] == pytest.approx((CHANCE + np.log(density)).sum())
    assert used.tolist() == [[False, True, True, True]]


def test_markers_whose_points_are_missing_count_nothing(limb, pose):
    points = points_at(limb, pose)
    both, _ = scores_of_poses(pose[np.newaxis], limb, points[:2], CHANCE)
    one, used = scores_of_poses(pose[np.newaxis], limb, points[:1], CHANCE)
    assert one[0] == pytest.approx(CHANCE - 1.5 * np.log(2 * np.pi))
    assert both[0] > one[0]
    assert used.all()


def test_a_pose_that_puts_markers_elsewhere_explains_nothing(limb, pose):
    elsewhere = pose.copy()
    elsewhere[:3, 3] += 3000.0
    scores, used = scores_of_poses(np.array([pose, elsewhere]), limb, points_at(limb, pose), CHANCE)
    assert scores[0] > 0.0 == scores[1]
    assert not used[1].any()
