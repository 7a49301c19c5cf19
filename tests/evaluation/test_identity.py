"""Label scores of results with stated errors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.evaluation import evaluate
from skelgen.model import Project, StageReport, Trajectories
from skelgen.simulation import SimulatedTake, simulate

N_RODS_MARKERS = 9


def relabelled(project: Project, positions: np.ndarray) -> Project:
    names = tuple(map(str, range(positions.shape[1])))
    return project.with_trajectories(Trajectories(positions, names, 100.0), StageReport())


def test_perfect_labels_score_one(points: SimulatedTake, perfect) -> None:
    labels = evaluate(perfect(points), points.truth).labels
    assert (labels.idf1, labels.precision, labels.recall) == (1.0, 1.0, 1.0)
    assert (labels.n_markers_found, labels.n_markers_true) == (N_RODS_MARKERS, N_RODS_MARKERS)


def test_the_order_of_markers_does_not_matter(points: SimulatedTake, perfect) -> None:
    project = perfect(points)
    positions = project.trajectories.positions[:, np.random.default_rng(0).permutation(N_RODS_MARKERS)]
    assert evaluate(relabelled(project, positions), points.truth).labels.idf1 == 1.0


def test_two_markers_that_change_places_halfway_lose_half_of_their_points(perfect) -> None:
    whole = simulate("rods", n_frames=60, labelled=False)
    positions = perfect(whole).trajectories.positions.copy()
    positions[30:, [0, 1]] = positions[30:, [1, 0]]
    labels = evaluate(relabelled(perfect(whole), positions), whole.truth).labels
    assert labels.idf1 == pytest.approx(1 - 1 / N_RODS_MARKERS)


def test_a_marker_that_is_never_found_costs_recall_alone(perfect) -> None:
    whole = simulate("rods", n_frames=60, labelled=False)
    labels = evaluate(relabelled(perfect(whole), perfect(whole).trajectories.positions[:, 1:]), whole.truth).labels
    assert (labels.precision, labels.recall) == (1.0, pytest.approx(1 - 1 / N_RODS_MARKERS))


def test_a_marker_made_of_ghosts_costs_precision_alone(perfect) -> None:
    haunted = simulate("rods", n_frames=60, labelled=False, ghosts=2.0)
    frames = np.repeat(np.arange(60), haunted.take.points_per_frame)
    is_ghost = haunted.truth.marker_of_point < 0
    marker = np.full((60, 1, 3), np.nan)
    marker[frames[is_ghost], 0] = haunted.take.points[is_ghost]
    n_ghosts, n_true = len(np.unique(frames[is_ghost])), 60 * N_RODS_MARKERS
    positions = np.concatenate([perfect(haunted).trajectories.positions, marker], axis=1)
    labels = evaluate(relabelled(perfect(haunted), positions), haunted.truth).labels
    assert (labels.precision, labels.recall) == (pytest.approx(n_true / (n_true + n_ghosts)), 1.0)


def test_filled_gaps_are_no_labels(points: SimulatedTake, perfect) -> None:
    project = perfect(points)
    filled = np.where(np.isnan(project.trajectories.positions), 1e5, project.trajectories.positions)
    assert evaluate(relabelled(project, filled), points.truth).labels.idf1 == 1.0


def test_positions_may_be_smoothed_a_little(points: SimulatedTake, perfect) -> None:
    project = perfect(points)
    smoothed = project.trajectories.positions + 0.2
    assert evaluate(relabelled(project, smoothed), points.truth).labels.idf1 == 1.0


def test_limbs_of_an_unlabelled_take_are_compared_by_identity(points: SimulatedTake, perfect) -> None:
    scores = evaluate(perfect(points), points.truth)
    assert scores.limbs.is_exact and scores.topology.is_exact and scores.worst_joint_error == 0


def test_a_result_without_markers_scores_zero(points: SimulatedTake, perfect) -> None:
    labels = evaluate(relabelled(perfect(points), np.empty((60, 0, 3))), points.truth).labels
    assert labels.idf1 == 0.0


def test_a_truth_that_knows_no_points_is_an_input_error(points: SimulatedTake, perfect) -> None:
    labelled = dataclasses.replace(points.truth, marker_of_point=np.empty(0, dtype=int))
    with pytest.raises(InputError, match="points"):
        evaluate(perfect(points), labelled)
