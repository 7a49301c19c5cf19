"""Tables of joint positions and of joint angles hold what the project holds, to the digits they state."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.motion_csv import write_motion
from skelgen_formats.registry import write_file

from skelgen.errors import WriteError
from skelgen.kinematics.inverse.inverse_kinematics import posture_of

HALF_DIGIT = 0.6e-6  # mm or degrees: six digits behind the point


def rows_of(path):
    return list(csv.reader(path.read_text().splitlines()))


@pytest.fixture
def joints(small_project, tmp_path):
    return rows_of(write_file(small_project, tmp_path / "walk.joints.csv")[0])


@pytest.fixture
def angles(small_project, tmp_path):
    return rows_of(write_file(small_project, tmp_path / "walk.angles.csv")[0])


def test_header_names_joints_axes_and_units(joints):
    names = [f"limb1-limb{child}_{axis}_mm" for child in (0, 2) for axis in "xyz"]
    assert joints[0] == ["frame", "time_s", *names]


def test_every_frame_has_its_positions(joints, small_project):
    numbers = np.array(joints[1:], dtype=float)
    assert np.array_equal(numbers[:, 0], np.arange(small_project.motion.n_frames))
    assert np.array_equal(numbers[:, 1], small_project.motion.times)
    truth = small_project.motion.joint_positions.reshape(len(numbers), -1)
    assert np.abs(numbers[:, 2:] - truth).max() < HALF_DIGIT


def test_deviations_stand_behind_the_positions(small_project, tmp_path):
    std = np.random.default_rng(1).uniform(0.1, 2.0, small_project.motion.joint_positions.shape)
    project = replace(small_project, _motion=replace(small_project.motion, joint_std=std))
    header, *rows = rows_of(write_file(project, tmp_path / "walk.joints.csv")[0])
    assert header[8:] == [f"limb1-limb{child}_{axis}_std_mm" for child in (0, 2) for axis in "xyz"]
    numbers = np.array(rows, dtype=float)
    assert np.abs(numbers[:, 2:8] - project.motion.joint_positions.reshape(-1, 6)).max() < HALF_DIGIT
    assert np.abs(numbers[:, 8:] - std.reshape(-1, 6)).max() < HALF_DIGIT


def test_joints_are_called_after_parent_and_child(small_project):
    assert small_project.skeleton.joint_names == ("limb1-limb0", "limb1-limb2")


def test_plain_csv_of_a_project_holds_its_joints(small_project, tmp_path):
    path = write_file(small_project, tmp_path / "walk.csv")[0]
    assert path.read_text().startswith("frame,time_s,limb1-limb0_x_mm")


def test_header_names_joints_angles_and_units(angles):
    hinge = ["limb1-limb0_turn_deg", "limb1-limb0_turn_std_deg"]
    ball = [f"limb1-limb2_{name}{what}_deg" for name in "xyz" for what in ("", "_std")]
    assert angles[0] == ["frame", "time_s", *hinge, *ball]


@pytest.mark.parametrize("n_frames", [12, 2100])  # longer than what is written at once
def test_every_frame_has_its_angles_and_deviations(make_project, tmp_path, n_frames):
    project = make_project(n_frames=n_frames)
    numbers = np.array(rows_of(write_file(project, tmp_path / "walk.angles.csv")[0])[1:], dtype=float)
    posture = posture_of(project.skeleton, project.motion, project.trajectories.positions)
    assert np.array_equal(numbers[:, 1], project.motion.times)
    assert np.abs(numbers[:, 2] - np.unwrap(np.rad2deg(posture.angles[0][:, 0]), period=360)).max() < HALF_DIGIT
    assert np.abs(numbers[:, 3:4] - np.rad2deg(posture.angle_std[0])).max() < HALF_DIGIT
    assert np.abs(numbers[:, 4::2] - np.rad2deg(posture.angles[1])).max() < HALF_DIGIT
    assert np.abs(numbers[:, 5::2] - np.rad2deg(posture.angle_std[1])).max() < HALF_DIGIT


@pytest.mark.parametrize("suffix", [".joints.csv", ".angles.csv"])
def test_take_is_refused(small_project, tmp_path, suffix):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / f"walk{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("number", "text"), [(np.nan, "nan"), (-0.0, "-0.00"), (0.125, "0.12"), (-0.375, "-0.38")])
def test_numbers_are_rounded_as_python_rounds_them(tmp_path, number, text):
    write_motion(tmp_path / "x.csv", ["a", "b"], np.zeros(1), [np.array([[1.5, number]])], 2)
    assert rows_of(tmp_path / "x.csv")[1] == ["0", "0.0", "1.50", text]


def test_table_without_columns_has_its_frames(tmp_path):
    write_motion(tmp_path / "x.csv", [], np.arange(3.0), [np.zeros((2, 0)), np.zeros((1, 0))])
    assert rows_of(tmp_path / "x.csv")[1:] == [["0", "0.0"], ["1", "1.0"], ["2", "2.0"]]
