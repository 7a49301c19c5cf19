from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import write_file

from skelgen.errors import MissingResultError, WriteError
from skelgen.model import Project


def test_cost_matrix_is_read_by_numpy(small_project, tmp_path):
    path = write_file(small_project, tmp_path / "walk.costs.txt")[0]
    np.testing.assert_array_equal(np.loadtxt(path), small_project.limbs.distance_deviation)


def test_tree_is_read_by_numpy(small_project, tmp_path):
    limb, parent, cost = np.loadtxt(write_file(small_project, tmp_path / "walk.tree.txt")[0]).T
    topology = small_project.topology
    np.testing.assert_array_equal(parent, topology.parents)
    below = topology.parents >= 0
    np.testing.assert_array_equal(cost[below], topology.joint_costs[topology.parents[below], limb[below].astype(int)])
    assert np.isnan(cost[~below]).all()


@pytest.mark.parametrize("name", ["a.costs.txt", "a.tree.txt"])
def test_names_of_limbs_stand_in_the_comments(small_project, tmp_path, name):
    named = small_project.with_limb_names(("left\nforearm", "chest", "hand"))
    path = write_file(named, tmp_path / name)[0]
    assert "# limb 0: left forearm: M<0>&, " in path.read_text(encoding="utf-8")
    np.testing.assert_array_equal(np.loadtxt(path), np.loadtxt(write_file(small_project, tmp_path / f"b{name}")[0]))


def test_a_file_of_limbs_has_a_row_per_marker_and_no_joint_positions(small_project, tmp_path):
    rows = write_file(small_project, tmp_path / "a.limbs.csv")[0].read_text(encoding="utf-8").splitlines()
    assert rows[:2] == ["marker,limb,name", "M<0>&,0,limb0"]
    assert len(rows) == 1 + small_project.trajectories.n_markers


@pytest.mark.parametrize("name", ["a.costs.txt", "a.tree.txt", "a.limbs.csv"])
def test_takes_are_refused(small_project, tmp_path, name):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / name)
    with pytest.raises(MissingResultError):
        write_file(Project(small_project.trajectories), tmp_path / name)
