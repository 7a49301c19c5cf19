"""The rows that are printed and dumped."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from skelgen.app.advice import advice_on
from skelgen.app.tables import column_rows, project_tables, take_facts
from skelgen.cli.screen import Screen, show_project
from skelgen.model import Labelling, PointCloud, Project, StageReport, Trajectories
from skelgen.model.labelling import Doubt, Tracklets


def with_gaps():
    """Marker a is unseen in frames 1, 2 and 5; b always seen; c never."""
    positions = np.zeros((6, 3, 3))
    positions[[1, 2, 5], 0] = np.nan
    positions[:, 2] = np.nan
    return Trajectories(positions, ("a", "b", "c"), 100.0)


def test_gaps_are_counted_and_measured():
    rows = [tuple(row.values()) for row in column_rows(with_gaps())]
    assert rows == [("a", 3, 2, 2), ("b", 6, 0, 0), ("c", 0, 1, 6)]


def test_extent_leaves_unseen_positions_out():
    facts = take_facts(with_gaps())
    assert facts["low_mm"] == facts["high_mm"] == [0, 0, 0]
    assert (facts["kind"], facts["count"], facts["frames"]) == ("markers", 3, 6)


def test_cloud_without_points_has_no_extent():
    facts = take_facts(PointCloud(np.zeros((0, 3)), [0, 0], [0.0]))
    assert facts["low_mm"] is None


def test_finished_project_has_all_tables(small_project):
    tables = project_tables(small_project)
    assert [row["limb"] for row in tables["limbs"]] == [0, 1, 2]
    assert [row["parent"] for row in tables["limbs"]] == small_project.topology.parents.tolist()
    assert [row["joint"] for row in tables["joints"]] == ["limb1-limb0", "limb1-limb2"]
    length = np.linalg.norm(np.subtract(*(joint.position_in_parent for joint in small_project.skeleton.joints)))
    assert tables["lengths"][0]["length_mm"] == length
    assert tables["lengths"][0]["std_mm"] == 0.7
    assert tables["lengths"][0]["name"] == f"limb{tables['lengths'][0]['limb']}"
    seen = small_project.motion.residuals[~np.isnan(small_project.motion.residuals)]
    assert tables["residuals"]["max_mm"] == seen.max()


def test_the_range_of_a_wheel_is_that_of_all_its_turns(wheel_project):
    row = project_tables(wheel_project)["angles"][0]
    assert (row["angle"], row["low_deg"], row["mean_deg"], row["high_deg"]) == (
        "turn",
        pytest.approx(0, abs=1e-6),
        pytest.approx(1800, abs=1),  # the wheel is unseen in some frames
        pytest.approx(3600),
    )


def test_a_wheel_turns_as_far_in_the_table_of_joints_as_its_angle_goes(wheel_project):
    tables = project_tables(wheel_project)
    angle = tables["angles"][0]
    assert tables["joints"][0]["turns_deg"][0] == pytest.approx(angle["high_deg"] - angle["low_deg"], abs=0.1)


def test_full_turns_of_frames_that_hide_a_limb_are_in_no_range(wheel_project):
    motion, wheel = wheel_project.motion, wheel_project.skeleton.joints[0]
    seen = motion.limb_seen.copy()
    seen[50:-50, wheel.child] = False
    hidden = replace(wheel_project, _motion=replace(motion, limb_seen=seen))
    row = project_tables(hidden)["angles"][0]
    assert -90 < row["low_deg"] < row["high_deg"] < 90


def test_deviations_of_hinges_are_those_across_their_axis(small_project):
    hinge, ball = project_tables(small_project)["joints"]
    assert ball["std_mm"] == pytest.approx(np.sqrt(0.09 + 0.16 + 0.25))
    assert ball["child_std_mm"] == pytest.approx(np.sqrt(0.01 + 0.04 + 0.09))
    along = 0.6**2 * 0.09 + 0.8**2 * 0.25  # its axis is (0.6, 0, 0.8)
    assert hinge["std_mm"] == pytest.approx(np.sqrt(0.5 - along))
    assert hinge["axis_std_deg"] == pytest.approx(np.rad2deg(np.sqrt(0.01**2 + 0.02**2)))
    assert ball["axis_std_deg"] is None


def test_every_angle_has_its_range_and_deviation(small_project):
    rows = project_tables(small_project)["angles"]
    assert [(row["joint"], row["angle"]) for row in rows] == [
        ("limb1-limb0", "turn"),
        *(("limb1-limb2", name) for name in "xyz"),
    ]
    for row in rows:
        assert row["low_deg"] <= row["mean_deg"] <= row["high_deg"]
        assert row["std_deg"] > 0


def test_bare_project_has_only_its_take(small_project):
    assert set(project_tables(Project(small_project.take))) == {"take", "seed", "stages"}


def test_tables_are_strict_json(small_project):
    assert json.loads(json.dumps(project_tables(small_project), allow_nan=False))  # raises if a number is no number


def judged(project):
    """The project with its first marker in doubt for two frames and called a piece of the second."""
    confidence = np.where(project.trajectories.seen, 0.99, np.nan)
    doubt = Doubt(0, 3, 4, "piece", 1, 0.1, "the two may be one marker")
    labelling = Labelling(confidence, (doubt,), ((2, 3),), np.zeros(project.trajectories.n_frames, dtype=int))
    return Project(project.take).with_trajectories(project.trajectories, StageReport(), labelling)


def test_labels_are_summed_up_with_advice(small_project):
    facts = project_tables(judged(small_project))["labelling"]
    assert (facts["markers"], facts["doubtful_spans"]) == (10, 1)
    assert facts["doubtful_share"] == 2 / small_project.trajectories.seen.sum()
    assert any("--n-markers" in sentence and "carries 9" in sentence for sentence in facts["advice"])
    assert any("M<2>& and M<3>&" in sentence for sentence in facts["advice"])
    assert "left_out" not in facts


def test_nothing_is_advised_where_nothing_is_doubtful(small_project):
    trajectories = small_project.trajectories
    confidence = np.where(trajectories.seen, 0.99, np.nan)
    labelling = Labelling(confidence, (), (), np.zeros(trajectories.n_frames, dtype=int))
    project = Project(small_project.take).with_trajectories(trajectories, StageReport(), labelling)
    assert advice_on(project) == ()


def test_ghosts_and_rare_markers_are_named_in_the_advice():
    positions = np.random.default_rng(0).normal(size=(100, 3, 3))
    positions[5:, 2] = np.nan
    markers = Trajectories(positions, ("a", "b", "c"), 100.0)
    cloud = PointCloud(np.zeros((400, 3)), np.arange(101) * 4, np.arange(100) / 100.0)
    confidence = np.where(markers.seen, 0.99, np.nan)
    tracklets = Tracklets([0, 1], [0, -1], [0, 0], [99, 99], [100, 100])
    labelling = Labelling(confidence, (), (), np.full(100, 2), tracklets)
    told = " ".join(advice_on(Project(cloud).with_trajectories(markers, StageReport(), labelling)))
    assert "50.0 % of the points belong to no marker" in told
    assert "c in 5 %" in told
    assert "1 track is left out although" in told


def test_a_body_whose_skeleton_is_not_given_is_said():
    """Of a take that was labelled by a skeleton, four long tracks are left out at the same time."""
    markers = Trajectories(np.random.default_rng(0).normal(size=(200, 3, 3)), ("a", "b", "c"), 100.0)
    cloud = PointCloud(np.zeros((1400, 3)), np.arange(201) * 7, np.arange(200) / 100.0)
    lost = Tracklets(np.arange(4), [-1] * 4, [0, 10, 20, 30], [150] * 4, [100] * 4)
    labelling = Labelling(np.full((200, 3), 0.99), (), (), np.full(200, 4), lost)
    (told,) = advice_on(Project(cloud).with_trajectories(markers, StageReport(), replace(labelling, subject="anna")))
    assert "up to 4 tracks" in told
    assert "--skeleton for each body" in told
    found = " ".join(advice_on(Project(cloud).with_trajectories(markers, StageReport(), labelling)))
    assert "--skeleton" not in found


def test_the_screen_says_how_sure_labels_are(small_project, capsys):
    show_project(Screen(), project_tables(judged(small_project)))
    lines = capsys.readouterr().out.splitlines()
    line = next(line for line in lines if line.startswith("labels:"))
    assert "10 markers; 1 doubtful span (" in line
    assert any(line.startswith("  try: some markers look like pieces") for line in lines)
