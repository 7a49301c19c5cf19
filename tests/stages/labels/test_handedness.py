"""Limbs are never mirrored: which of two markers is which, their sides tell where distances do not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen._kernels.marker_exchanges import explained
from skelgen.stages.labels.merging.handedness import LEAST_MOMENTS, evidence_of_sides
from skelgen.stages.labels.merging.likelihood import distance_sums

SPACING, N_MOMENTS = 60.0, 24
FOOT = np.array([[35, 0, 0], [-35, 0, 0], [0, -150, 0], [0, -120, 80], [0, -60, 50], [0, -30, 60]], dtype=float)  # mm
"""Both toes are as far from the others, which lie in the plane between them."""


@pytest.fixture(params=range(3))
def foot(request) -> np.ndarray:
    """A foot that turns, with noise; the toes are exchanged in a third of the moments."""
    rng = np.random.default_rng(request.param)
    turns = Rotation.random(N_MOMENTS, random_state=request.param).as_matrix()
    places = (FOOT + rng.normal(0, 2, (N_MOMENTS, *FOOT.shape))) @ turns.swapaxes(1, 2)
    places[8:16, :2] = places[8:16, 1::-1]
    return places


def of_toes(places: np.ndarray) -> np.ndarray:
    gains = explained(np.stack(distance_sums(places)), SPACING)
    return evidence_of_sides(np.array([[0, 1]]), places, gains, SPACING)[0]


def test_markers_with_the_same_distances_are_told_by_their_sides(foot) -> None:
    evidence = of_toes(foot)
    assert (evidence[8:16] > 10.0).all()
    assert (np.delete(evidence, np.s_[8:16]) < -10.0).all()


def test_turning_and_shifting_all_changes_nothing(foot) -> None:
    moved = foot @ Rotation.from_euler("xyz", (1, 2, 3)).as_matrix() + (500.0, -2000.0, 900.0)
    np.testing.assert_allclose(of_toes(moved), of_toes(foot), atol=1e-8)


def test_exchanging_the_markers_everywhere_changes_nothing(foot) -> None:
    np.testing.assert_allclose(of_toes(foot[:, [1, 0, 2, 3, 4, 5]]), of_toes(foot), atol=1e-8)


def test_what_is_not_seen_tells_nothing_and_another_plane_speaks_instead(foot) -> None:
    hidden = foot.copy()
    hidden[4, 0] = hidden[10, 2:4] = hidden[12, 2:] = np.nan
    evidence = of_toes(hidden)
    assert evidence[4] == evidence[12] == 0.0
    assert evidence[10] > 10.0


@pytest.mark.parametrize("partners", [FOOT[2:, :2], FOOT[2:, :2] + np.array([[-60, 0], [60, 0], [60, 40], [-60, 40]])])
def test_markers_in_one_plane_have_no_sides(partners) -> None:
    flat = np.zeros(FOOT.shape)
    flat[:2], flat[2:, :2] = FOOT[:2], partners
    assert not of_toes(flat + np.random.default_rng(0).normal(0, 2, (N_MOMENTS, *FOOT.shape))).any()


def test_few_moments_and_few_markers_tell_nothing(foot) -> None:
    assert not of_toes(foot[: LEAST_MOMENTS - 1]).any()
    assert not of_toes(foot[:, :5]).any()
