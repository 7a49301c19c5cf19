"""Identities by rigidity: a skeleton of the markers found so far brings back what occlusion took apart."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skelgen
from skelgen.evaluation.matching import find_identity
from skelgen.model import Limbs, Project, StageReport, Topology, Trajectories
from skelgen.simulation import simulate
from skelgen.stages.labels import LabelParameters, label_markers, refit_labels, tracked_points
from skelgen.stages.labels.explanations import Explanations, explain_points
from skelgen.stages.labels.model_fit.assignment import (
    assign_tracks,
    same_places,
    split_where_marker_changes,
)
from skelgen.stages.labels.model_fit.model import FoundStructure
from skelgen.stages.labels.model_fit.refine import core_markers, same_core

OCCLUDED = {"n_cameras": 6, "soft_tissue": 2.0, "ghosts": 0.2, "noise": 0.3, "labelled": False}


def score(case, **settings):
    labels = label_markers(case.take, LabelParameters(**settings))[0]
    return find_identity(Project(case.take).with_trajectories(labels, StageReport()), case.truth)[1]


@pytest.mark.parametrize("seed", range(2))
def test_occluded_human_is_labelled_better_than_by_sets_alone(seed):
    case = simulate("human", n_frames=800, seed=seed, **OCCLUDED)
    by_sets, by_rigidity = score(case, method="sets"), score(case)
    assert by_rigidity.idf1 >= max(by_sets.idf1, 0.99)
    assert by_rigidity.precision >= 0.998


def test_known_number_of_markers_is_obeyed():
    case = simulate("human", n_frames=400, seed=0, **OCCLUDED)
    assert label_markers(case.take, LabelParameters(), n_markers=40)[0].n_markers == 40


def test_labels_are_the_same_every_time():
    case = simulate("human", n_frames=300, seed=1, **OCCLUDED)
    first, second = (label_markers(case.take, LabelParameters(), seed=5)[0] for _ in range(2))
    np.testing.assert_array_equal(first.positions, second.positions)


@pytest.fixture(scope="module")
def quadruped():
    return simulate("quadruped", n_frames=300, seed=7, noise=0.5, soft_tissue=2.0, dropouts=0.1, labelled=False)


def true_trajectories(case):
    positions = case.truth.marker_positions + case.truth.soft_tissue
    return Trajectories(positions, tuple(f"m{number}" for number in range(positions.shape[1])), 100.0)


@pytest.fixture(scope="module")
def refit(quadruped):
    """Improves labels of the quadruped by its skeleton."""
    points = tracked_points(quadruped.take, LabelParameters())
    calibrated = true_trajectories(quadruped)
    skeleton = skelgen.reconstruct(calibrated).skeleton
    return lambda labels: refit_labels(points, labels, skeleton, calibrated, LabelParameters())


def test_markers_that_labels_lack_for_a_while_are_found_by_a_skeleton_of_their_own_take(quadruped, refit):
    truth = quadruped.truth.marker_of_point
    early = np.repeat(np.arange(300), quadruped.take.points_per_frame) < 200
    lost = early & (truth % 5 == 0)
    found = refit(np.where(lost, -1, truth))
    assert (found[lost] == truth[lost]).mean() > 0.95
    np.testing.assert_array_equal(found[~lost], truth[~lost])


def test_labels_that_this_take_contradicts_by_far_are_put_right(quadruped, refit):
    truth = quadruped.truth.marker_of_point
    late = np.repeat(np.arange(300), quadruped.take.points_per_frame) > 200
    exchanged = np.where(late & (truth == 0), 30, np.where(late & (truth == 30), 0, truth))
    assert (refit(exchanged) == truth).mean() > 0.99


def test_markers_of_a_limb_that_are_exchanged_all_the_time_are_told_apart_by_the_other_take(quadruped, refit):
    truth = quadruped.truth.marker_of_point
    first, second = np.flatnonzero(quadruped.truth.limb_of_marker == 3)[:2]
    exchanged = np.where(truth == first, second, np.where(truth == second, first, truth))
    np.testing.assert_array_equal(refit(exchanged), truth)


def test_labels_that_cannot_be_bettered_stay(quadruped, refit):
    truth = quadruped.truth.marker_of_point
    np.testing.assert_array_equal(refit(truth), truth)


def explanations_of(table):
    """Explanations from a table of scores, shape (n_points, n_markers)."""
    table = np.asarray(table, dtype=np.float32)
    return Explanations(*np.nonzero(table), table[table > 0], *table.shape)


def test_a_track_that_changes_its_marker_is_cut_there():
    scores = np.zeros((40, 2))
    scores[:25, 0] = scores[25:, 1] = 1.0
    scores[10, :] = [0.0, 1.0]  # a single contrary vote does not cut
    pieces = split_where_marker_changes(np.zeros(40, dtype=np.intp), explanations_of(scores))
    np.testing.assert_array_equal(np.flatnonzero(np.diff(pieces)), [24])


def test_a_marker_has_one_point_in_a_frame():
    frames = np.repeat(np.arange(20), 2)
    pieces = np.tile([0, 1], 20)
    assigned = assign_tracks(pieces, frames, explanations_of(np.tile([[0.9], [0.5]], (20, 1))), 20)
    np.testing.assert_array_equal(assigned.reshape(20, 2), np.tile([0, -1], (20, 1)))


def test_points_outside_the_gate_and_unknown_places_are_not_explained():
    predicted = np.array([[[0.0, 0, 0], [np.nan] * 3]])
    points = np.array([[0.0, 0, 0], [0, 3, 0], [0, 0, 9]])
    explained = explain_points(points, np.zeros(3, dtype=np.intp), predicted, np.full((1, 2), 6.0))
    assert explained.points.tolist() == [0, 1]
    assert explained.markers.tolist() == [0, 0]
    assert explained.scores.tolist() == [1.0, 0.75]


def test_a_point_is_explained_best_by_the_first_of_equal_markers_and_by_what_is_stated():
    explained = explanations_of([[0.0, 0.5, 0.5], [0.2, 0.0, 0.3], [0.0, 0.0, 0.0]])
    assert explained.best.tolist() == [1, 2, -1]
    stated = explained.with_pairs(np.array([2, 1]), np.array([0, 1]), 0.7)
    assert stated.best.tolist() == [1, 1, 0]
    assert stated.points.tolist() == [0, 0, 1, 1, 1, 2]


def test_markers_with_one_place_that_are_never_seen_together_are_one():
    together = np.array([[6.0, 0, 5], [0, 4, 4], [5, 4, 10]])
    offsets = np.array([[0.0, 0, 0], [0.5, 0, 0], [50, 0, 0]])
    same = same_places(together, offsets, np.zeros(3, dtype=np.intp), limits=np.array([2.0]))
    np.testing.assert_array_equal(same, [0, 0, 2])


def test_markers_seen_together_are_never_one():
    offsets = np.zeros((2, 3))
    same = same_places(np.full((2, 2), 9.0), offsets, np.zeros(2, dtype=np.intp), limits=np.array([2.0]))
    np.testing.assert_array_equal(same, [0, 1])


def test_rarely_seen_markers_do_not_carry_the_model_and_a_given_number_bounds_it():
    marker_of_point = np.repeat([0, 1, 2, 3], [100, 90, 20, 80])
    np.testing.assert_array_equal(core_markers(marker_of_point), [0, 1, 3])
    np.testing.assert_array_equal(core_markers(marker_of_point, 2), [0, 1])


def test_half_of_the_points_being_doubtful_in_the_file_changes_no_label():
    case = simulate("human", n_frames=300, seed=2, **OCCLUDED)
    error = np.where(np.arange(case.take.n_points) % 2, 0.1, 0.4)
    doubted = dataclasses.replace(case.take, attributes={"reprojection_error": error})
    plain, weighted = (label_markers(take, LabelParameters())[0] for take in (case.take, doubted))
    assert plain.n_markers == weighted.n_markers


BEFORE = np.repeat([0, 1, 2, -1], 400)
"""Marker of each point in an earlier turn."""


def test_a_core_under_other_numbers_is_the_same() -> None:
    after = np.repeat([2, 0, 1, -1], 400)
    assert same_core(BEFORE, np.array([0, 1, 2]), after, np.array([0, 1, 2])).tolist() == [2, 0, 1]


def test_points_that_gain_a_marker_do_not_change_the_core() -> None:
    after = np.repeat([0, 1, 2, 1], 400)
    assert same_core(BEFORE, np.array([0, 1, 2]), after, np.array([0, 1, 2])).tolist() == [0, 1, 2]


def test_markers_that_exchange_many_points_are_another_core() -> None:
    after = BEFORE.copy()
    after[380:420] = after[380:420][::-1]
    assert same_core(BEFORE, np.array([0, 1, 2]), after, np.array([0, 1, 2])) is None


def test_markers_that_exchange_few_points_are_the_same_core() -> None:
    after = BEFORE.copy()
    after[398:402] = after[398:402][::-1]
    assert same_core(BEFORE, np.array([0, 1, 2]), after, np.array([0, 1, 2])).tolist() == [0, 1, 2]


def test_a_core_of_which_a_marker_became_part_of_another_is_the_same_but_for_that_marker() -> None:
    after = np.where(BEFORE == 2, 1, BEFORE)
    assert same_core(BEFORE, np.array([0, 1, 2]), after, np.array([0, 1])).tolist() == [0, 1, -1]


def test_limbs_are_taken_over_without_markers_that_are_no_more_unless_a_limb_is_left_with_none() -> None:
    deviation = np.arange(25.0).reshape(5, 5)
    limbs = Limbs(np.array([0, 0, 1, 1, -1]), deviation)
    joints = np.zeros((1, 1, 3))
    topology = Topology(np.array([-1, 0]), np.zeros((2, 2)), joints, np.array([1]), np.zeros(1), 1.0)
    some = FoundStructure(limbs, topology).of_markers(np.array([1, 2, 4]))
    assert some is not None
    assert some.topology is topology
    np.testing.assert_array_equal(some.limbs.limb_of_marker, [0, 1, -1])
    np.testing.assert_array_equal(some.limbs.distance_deviation, deviation[np.ix_([1, 2, 4], [1, 2, 4])])
    assert FoundStructure(limbs, topology).of_markers(np.array([0, 1, 4])) is None


def test_a_core_with_a_new_marker_is_another() -> None:
    after = np.where(np.arange(len(BEFORE)) < 10, 3, BEFORE)
    assert same_core(BEFORE, np.array([0, 1, 2]), after, np.array([0, 1, 2, 3])) is None


def test_a_core_without_markers_is_no_core() -> None:
    none = np.zeros(0, dtype=np.intp)
    assert same_core(BEFORE, none, BEFORE, none) is None
