from __future__ import annotations

import csv

import numpy as np
import pytest
from skelgen_formats.bones import joint_names
from skelgen_formats.registry import write_file

from skelgen.errors import WriteError

HALF_DIGIT_MM = 0.6e-6  # six digits behind the point


@pytest.fixture
def rows(small_project, tmp_path):
    path = write_file(small_project, tmp_path / "walk.joints.csv")[0]
    return list(csv.reader(path.read_text().splitlines()))


def test_header_names_joints_axes_and_units(rows):
    joints = [f"limb1-limb{child}_{axis}_mm" for child in (0, 2) for axis in "xyz"]
    assert rows[0] == ["frame", "time_s", *joints]


def test_every_frame_has_its_positions(rows, small_project):
    numbers = np.array(rows[1:], dtype=float)
    assert np.array_equal(numbers[:, 0], np.arange(small_project.motion.n_frames))
    assert np.array_equal(numbers[:, 1], small_project.motion.times)
    truth = small_project.motion.joint_positions.reshape(len(numbers), -1)
    assert np.abs(numbers[:, 2:] - truth).max() < HALF_DIGIT_MM


def test_joints_are_called_after_parent_and_child(small_project):
    assert joint_names(small_project.skeleton) == ("limb1-limb0", "limb1-limb2")


def test_plain_csv_of_a_project_holds_its_joints(small_project, tmp_path):
    path = write_file(small_project, tmp_path / "walk.csv")[0]
    assert path.read_text().startswith("frame,time_s,limb1-limb0_x_mm")


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.joints.csv")
    assert list(tmp_path.iterdir()) == []
