"""Tracklets that are merged limb by limb, with many hypotheses kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.model.tracklets import TrackletPoints
from skelgen.simulation import simulate
from skelgen.simulation.markers import carried_markers
from skelgen.simulation.people import natural_motion, person, realistic_soft_tissue
from skelgen.stages.labels import label_markers
from skelgen.stages.labels.merging.likelihood import distance_sums, evidence_of_labels
from skelgen.stages.labels.merging.limbs import main_groups, measure_pairs, merge_on_limbs, rigid_odds
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import counts_together, find_points
from skelgen.stages.labels.tracking.follow import find_tracklets, follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing

RATE, SPACING = 100.0, 30.0
LABELLED = 0.99
PLACES = np.array(
    [[[0, 0, 0], [40, 0, 0], [0, 25, 0], [10, 10, 50.0]], [[0, 0, 0], [35, 5, 0], [5, 45, 0], [0, 20, 30.0]]]
)


def two_limbs(rng, n_frames):
    """Two limbs of four markers that turn and move independently, shape (n_frames, 8, 3), with 0.3 mm noise."""
    time = np.arange(n_frames)[:, np.newaxis] / RATE
    points = []
    for places in PLACES:
        axis, phase = rng.normal(size=3), rng.uniform(0, 6, 3)
        angle = 1.5 * np.sin(3.0 * time[:, 0] + phase[0])
        cross = np.cross(np.eye(3), axis / np.linalg.norm(axis))
        turn = np.eye(3) + np.sin(angle)[:, None, None] * cross + (1 - np.cos(angle))[:, None, None] * cross @ cross
        points.append(np.einsum("fij,nj->fni", turn, places) + (300 * np.sin(2.0 * time + phase))[:, np.newaxis])
    return np.concatenate(points, axis=1) + rng.normal(scale=0.3, size=(n_frames, 8, 3))


def cut_up(positions, pieces):
    """Points and tracklets of pieces (marker, first frame, frame after the last)."""
    n_frames, n_markers = positions.shape[:2]
    frames = [np.arange(first, last) for _, first, last in pieces]
    points = [frame * n_markers + marker for frame, (marker, _, _) in zip(frames, pieces, strict=True)]
    starts = np.concatenate([[0], np.cumsum([len(frame) for frame in frames])]).astype(np.intp)
    arrays = (np.concatenate(one).astype(np.int32) for one in (points, frames))
    return positions.reshape(-1, 3), TrackletPoints(*arrays, starts, n_frames)


def test_limb_that_vanishes_whole_is_found_again_by_its_shape():
    positions = two_limbs(np.random.default_rng(0), 400)
    pieces = [(marker, first, last) for first, last in ((0, 180), (220, 400)) for marker in range(4)]
    pieces += [(marker, 0, 400) for marker in range(4, 8)]
    points, tracklets = cut_up(positions, pieces)
    group = merge_on_limbs(measure_pairs(points, tracklets, RATE, SPACING), np.arange(len(tracklets)))
    assert group[:4].tolist() == group[4:8].tolist()
    assert len(np.unique(group)) == 8


def test_markers_that_come_back_together_are_told_by_the_distances_between_them():
    positions = two_limbs(np.random.default_rng(1), 400)
    pieces = [(marker, first, last) for first, last in ((0, 200), (230, 400)) for marker in (1, 2, 3)]
    points, tracklets = cut_up(positions, [(0, 0, 400), *pieces, *((marker, 0, 400) for marker in range(4, 8))])
    group = merge_on_limbs(measure_pairs(points, tracklets, RATE, SPACING), np.arange(len(tracklets)))
    assert group[1:4].tolist() == group[4:7].tolist()


def test_markers_of_one_limb_have_odds_above_and_others_below_zero():
    positions = two_limbs(np.random.default_rng(2), 60)
    distance = np.linalg.norm(positions[:, :, np.newaxis] - positions[:, np.newaxis], axis=3)
    count = np.full((8, 8), 60.0)
    np.fill_diagonal(count, 0.0)
    odds, deviation = rigid_odds(count, np.maximum(distance.std(axis=0), 1e-6))
    same = np.kron(np.eye(2), np.ones((4, 4))) - np.eye(8)
    assert (odds[same == 1] > 0).all()
    assert (odds[same + np.eye(8) == 0] < 0).all()
    assert deviation == pytest.approx(0.3 * np.sqrt(2), rel=0.2)


def test_labels_that_are_exchanged_for_a_while_have_less_evidence():
    positions = two_limbs(np.random.default_rng(3), 60)
    wrong = positions.copy()
    wrong[40:, [0, 1]] = wrong[40:, [1, 0]]
    parted = np.concatenate([positions, positions[:, :1]], axis=1)
    parted[:30, 8] = parted[30:, 0] = np.nan
    sums = [np.array(distance_sums(one)) for one in (positions, wrong, parted)]
    right, *others = (evidence_of_labels(one, SPACING)[0] for one in sums)
    assert right > max(others)


def test_tracklets_of_one_group_never_overlap():
    made = simulate("tree:4", seed=0, n_frames=400, dropouts=0.3, dropout_seconds=0.2, noise=0.3, labelled=False)
    tracks, _ = follow_points(made.take, LabelParameters())
    tracklets = find_tracklets(made.take, tracks, RATE, replace(LabelParameters(), min_range=14))
    pairs = measure_pairs(made.take.points, tracklets, RATE, typical_spacing(made.take))
    group = merge_on_limbs(pairs, np.arange(len(tracklets)))
    same = group[:, np.newaxis] == group
    assert not (same & tracklets.overlaps & ~np.eye(len(group), dtype=bool)).any()


def test_tracklets_belong_to_the_label_that_most_of_their_points_have():
    tracklet = np.array([0, 0, 0, 1, 1, 2, 3])
    assert main_groups(np.array([4, 4, 1, -1, -1, 1, -1]), tracklet)[[0, 2]].tolist() == [4, 1]
    groups = main_groups(np.array([4, 4, 1, -1, -1, 1, -1]), tracklet)
    assert len(np.unique(groups)) == 4


def test_fast_trees_of_which_a_fourth_is_hidden_are_labelled():
    options = {"n_frames": 600, "spacing": 25.0, "dropouts": 0.25, "dropout_seconds": 0.35, "noise": 0.3}
    made = simulate("tree:5", seed=2, labelled=False, **options)
    trajectories, _ = label_markers(made.take, LabelParameters())
    found, true = find_points(made.take, trajectories.positions), made.truth.marker_of_point
    together = counts_together(found, true)[1:, 1:]
    assert together.max(axis=0).sum() > 0.97 * len(true)


def test_a_runner_hidden_in_pieces_is_labelled_again_until_nothing_is_left_over():
    rng = np.random.default_rng(4)
    who = person("animation-41", 0.0, rng)
    angles, poses = natural_motion(who, "run", 400, RATE, rng)
    angles, poses = [angles[limb] for limb in who.limbs], poses[:, who.limbs]
    positions = carried_markers(who.worn, poses) + realistic_soft_tissue(who.worn, poses, angles, RATE, rng, who)
    positions += rng.normal(scale=0.3, size=positions.shape)
    seen = np.ones(positions.shape[:2], dtype=bool)
    for marker in range(seen.shape[1]):
        while seen[:, marker].mean() > 0.77:
            start = rng.integers(len(seen))
            seen[start : start + 1 + int(rng.exponential(0.14) * RATE), marker] = False
    frame, true = np.nonzero(seen)
    starts = np.searchsorted(frame, np.arange(len(seen) + 1))
    cloud = PointCloud(positions[frame, true], starts, np.arange(len(seen)) / RATE)
    trajectories, _ = label_markers(cloud, LabelParameters())
    assert trajectories.n_markers == seen.shape[1]
    together = counts_together(find_points(cloud, trajectories.positions), true)[1:, 1:]
    assert together.max(axis=0).sum() > LABELLED * len(true)
