"""The rows that are printed and dumped."""

from __future__ import annotations

import json

import numpy as np

from skelgen.app.summary import column_rows, project_tables, take_facts
from skelgen.model import PointCloud, Project, Trajectories


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
    seen = small_project.motion.residuals[~np.isnan(small_project.motion.residuals)]
    assert tables["residuals"]["max_mm"] == seen.max()


def test_bare_project_has_only_its_take(small_project):
    assert set(project_tables(Project(small_project.take))) == {"take", "seed", "stages"}


def test_tables_are_strict_json(small_project):
    json.dumps(project_tables(small_project), allow_nan=False)
