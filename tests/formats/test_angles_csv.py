from __future__ import annotations

import csv

import numpy as np
import pytest
from skelgen_formats import motion_csv as angles_csv
from skelgen_formats.registry import write_file

from skelgen.errors import WriteError
from skelgen.kinematics.inverse.inverse_kinematics import posture_of

HALF_DIGIT_DEG = 0.6e-6  # six digits behind the point


@pytest.fixture
def rows(small_project, tmp_path):
    path = write_file(small_project, tmp_path / "walk.angles.csv")[0]
    return list(csv.reader(path.read_text().splitlines()))


def test_header_names_joints_angles_and_units(rows):
    hinge = ["limb1-limb0_turn_deg", "limb1-limb0_turn_std_deg"]
    ball = [f"limb1-limb2_{name}{what}_deg" for name in "xyz" for what in ("", "_std")]
    assert rows[0] == ["frame", "time_s", *hinge, *ball]


def test_every_frame_has_its_angles_and_deviations(rows, small_project):
    numbers = np.array(rows[1:], dtype=float)
    posture = posture_of(small_project.skeleton, small_project.motion, small_project.trajectories.positions)
    assert np.array_equal(numbers[:, 1], small_project.motion.times)
    assert np.abs(numbers[:, 2:3] - np.rad2deg(posture.angles[0])).max() < HALF_DIGIT_DEG
    assert np.abs(numbers[:, 3:4] - np.rad2deg(posture.angle_std[0])).max() < HALF_DIGIT_DEG
    assert np.abs(numbers[:, 4::2] - np.rad2deg(posture.angles[1])).max() < HALF_DIGIT_DEG
    assert np.abs(numbers[:, 5::2] - np.rad2deg(posture.angle_std[1])).max() < HALF_DIGIT_DEG


def test_long_takes_are_written_in_parts_that_fit(rows, small_project, tmp_path, monkeypatch):
    monkeypatch.setattr(angles_csv, "_ANGLE_CHUNK", 5)
    path = write_file(small_project, tmp_path / "parts.angles.csv")[0]
    assert list(csv.reader(path.read_text().splitlines())) == rows


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.angles.csv")
