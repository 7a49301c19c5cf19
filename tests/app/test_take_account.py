from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.app.first_look import account_of, account_sentences
from skelgen.app.tables import project_tables, take_facts
from skelgen.geometry.up_axis import up_of
from skelgen.model import PointCloud, Project, StageReport, Trajectories


@pytest.fixture(scope="module")
def walking() -> Trajectories:
    """Feet that stay on the floor while the rest sways and walks along x; 1.7 m tall, z up."""
    rng = np.random.default_rng(0)
    positions = rng.uniform(-200, 200, (200, 8, 3))
    positions[:, :, 2] = np.linspace(0, 1700, 8) + rng.normal(0, 1, (200, 8))
    positions[:, :, 0] += np.linspace(0, 4000, 200)[:, None]
    names = ("LASI", "RASI", "VSAC", "RTHI", "RKNE", "RSHA", "RANK", "RTOE")
    return Trajectories(positions, names, 100.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_axis_along_which_the_feet_stay_is_up(walking, axis):
    facts = account_of(Trajectories(np.roll(walking.positions, axis - 2, axis=2), walking.names, 100.0))
    assert (facts["up"], facts["up_sure"], facts["unit"]) == ("xyz"[axis], "sure", "")
    assert facts["height_mm"] == pytest.approx(1700, abs=10)


def test_false_points_do_not_say_what_is_up_once_markers_are_found(walking):
    false = np.random.default_rng(2).uniform(-3000, 3000, (200, 1, 3))
    points = np.concatenate([walking.positions, false], axis=1).reshape(-1, 3)
    project = Project(PointCloud(points, np.arange(0, 1801, 9), walking.times))
    assert up_of(project) != "z"
    project = project.with_trajectories(replace(walking, names=tuple("abcdefgh")), StageReport({}))
    assert (up_of(project), project_tables(project)["take"]["up"]) == ("z", "z")


def test_joints_that_have_the_names_of_a_persons_say_what_is_up(make_project):
    project = make_project()
    joints = tuple(
        replace(joint, name=name)
        for joint, name in zip(project.skeleton.joints, ("left shoulder", "left knee"), strict=True)
    )
    positions = project.motion.joint_positions.copy()
    positions[:] = [[[0.0, 900.0, 10.0], [0.0, 400.0, 0.0]]]
    motion = replace(project.motion, joint_positions=positions)
    assert up_of(replace(project, _skeleton=replace(project.skeleton, joints=joints), _motion=motion)) == "y"


def test_noise_in_a_box_has_no_sure_axis():
    noise = np.random.default_rng(1).uniform(-500, 500, (300, 9, 3))
    assert account_of(Trajectories(noise, tuple("abcdefghi"), 100.0))["up_sure"] == "unsure"


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "in m"), (1e3, "in mm")])
def test_unit_that_can_hardly_be_right_is_told(walking, factor, unit):
    facts = account_of(Trajectories(walking.positions * factor, walking.names, 100.0))
    assert f"probably {unit}, not as stated" in facts["unit"]


def test_gaps_are_counted_and_points_have_none(walking):
    holes = walking.positions.copy()
    holes[:50, 0] = np.nan
    assert account_of(Trajectories(holes, walking.names, 100.0))["missing"] == 50 / 1600
    cloud = PointCloud(holes[60], np.array([0, 4, 8]), np.array([0.0, 0.01]))
    assert account_of(cloud)["missing"] is None


def test_marker_set_is_known_by_its_names():
    take = skelgen.simulate("rods", n_frames=20).take
    names = ("nose", "left_shoulder", "right_shoulder", "left_hip", "right_hip", "left_knee")
    keypoints = Trajectories(take.positions[:, :6], names, 100.0)
    assert "MediaPipe" in account_of(keypoints)["suit"]
    assert account_of(take)["suit"] == ""
    assert any(line.startswith("names: keypoints") for line in account_sentences(take_facts(keypoints)))
