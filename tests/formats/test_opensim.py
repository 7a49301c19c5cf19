"""OpenSim itself is the judge: what it poses, and what its inverse kinematics makes of the markers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.articulated import plain_names
from skelgen_formats.capsules import capsule_of
from skelgen_formats.options import Options
from skelgen_formats.registry import find_format, write_file

from skelgen.benchmark.judges import opensim_columns, opensim_postures
from skelgen.errors import WriteError
from skelgen.geometry.frame_rate import with_rate
from skelgen.geometry.up_axis import with_up_axis

POSITION_MM = 0.1  # demanded
ANGLE_DEG = 0.5  # demanded

opensim = pytest.importorskip("opensim", reason="needs OpenSim: pip install 'opensim>=4.6'")
opensim.Logger.setLevelString("off")


@pytest.fixture
def files(jointed_project, tmp_path):
    return write_file(jointed_project, tmp_path / "walk.osim")


def in_mm(vector):
    return 1000 * np.array([vector.get(axis) for axis in range(3)])


@pytest.mark.parametrize("options", [{}, {"rate": 30.0}, {"joints": "as-found"}])
def test_bodies_and_markers_are_where_the_motion_has_them(jointed_project, tmp_path, options):
    model_file, motion_file, *_ = write_file(jointed_project, tmp_path / "walk.osim", **options)
    truth = with_rate(jointed_project, options.get("rate", 0.0))
    model = opensim.Model(str(model_file))
    for frame, state in opensim_postures(model, opensim_columns(motion_file), range(truth.motion.n_frames)):
        for limb in range(truth.skeleton.n_limbs):
            place = in_mm(model.getBodySet().get(f"limb{limb}").getTransformInGround(state).p())
            assert np.abs(place - truth.motion.world_from_limb[frame, limb, :3, 3]).max() < POSITION_MM
        for marker, name in enumerate(plain_names(truth.trajectories.names[:-1])):
            place = in_mm(model.getMarkerSet().get(name).getLocationInGround(state))
            assert np.abs(place - truth.motion.marker_positions[frame, marker]).max() < POSITION_MM


def test_sentences_on_joints_left_open_do_not_disturb_opensim(jointed_project, files, tmp_path):
    joints = tuple(replace(joint, open_directions=3, name="") for joint in jointed_project.skeleton.joints)
    marked = replace(jointed_project, _skeleton=replace(jointed_project.skeleton, joints=joints))
    motion_file = write_file(marked, tmp_path / "open.osim")[1]
    assert "their places are a choice: limb1-limb0, " in motion_file.read_text().partition("endheader")[0]
    marked_columns, columns = opensim_columns(motion_file), opensim_columns(files[1])
    assert list(marked_columns) == list(columns)
    np.testing.assert_array_equal(list(marked_columns.values()), list(columns.values()))
    stored = opensim.Storage(str(motion_file))  # the older reader, of OpenSim's tools
    assert (stored.getSize(), stored.isInDegrees()) == (marked.motion.n_frames, True)


def test_joints_are_of_the_kinds_found(files):
    model = opensim.Model(str(files[0]))
    joints = model.getJointSet()
    kinds = {joints.get(index).getName(): joints.get(index).getConcreteClassName() for index in range(joints.getSize())}
    assert kinds == {
        "world-limb1": "FreeJoint",
        "world-limb5": "FreeJoint",
        "limb1-limb0": "PinJoint",
        "limb1-limb2": "BallJoint",
        "limb5-limb6": "BallJoint",
        "limb5-limb7": "PinJoint",
        "limb2-limb3": "CustomJoint",
        "limb2-limb4": "WeldJoint",
        "limb3-limb8": "BallJoint",
    }


def test_inverse_kinematics_of_opensim_returns_the_angles(files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # OpenSim looks for the model where it runs
    tool = opensim.InverseKinematicsTool("walk.ik.xml")
    assert tool.run()
    ours, theirs = opensim_columns(files[1]), opensim_columns(tmp_path / "walk.ik.mot")
    assert set(ours) == set(theirs)
    for name, angles in ours.items():
        assert np.abs(theirs[name] - angles).max() < (1e-3 * POSITION_MM if name[-2] == "t" else ANGLE_DEG), name


def test_times_of_motion_and_markers_are_the_same_short_numbers(files):
    rows = [path.read_text().splitlines() for path in (files[1], files[2])]
    motion = [line.split("\t")[0] for line in rows[0][7:]]
    markers = [line.split("\t")[1] for line in rows[1][6:]]
    assert motion == markers == [repr(round(frame * 0.02, 2)) for frame in range(40)]


def test_masses_and_inertias_are_those_of_capsules(jointed_project, tmp_path):
    model = opensim.Model(str(write_file(jointed_project, tmp_path / "walk.osim", density=700.0)[0]))
    for limb in range(jointed_project.skeleton.n_limbs):
        body, capsule = model.getBodySet().get(f"limb{limb}"), capsule_of(jointed_project.skeleton, limb, 700.0)
        assert body.getMass() == pytest.approx(capsule.mass)
        assert np.abs(in_mm(body.getMassCenter()) / 1000 - capsule.centre).max() < 1e-12
        inertia = body.getInertia()
        moments = inertia.getMoments(), inertia.getProducts()
        found, truth = [vector.get(axis) for vector in moments for axis in range(3)], capsule.inertia()
        assert found == pytest.approx([*np.diag(truth), truth[0, 1], truth[0, 2], truth[1, 2]])


def test_ranges_hold_the_motion_with_a_margin(files):
    model, motion = opensim.Model(str(files[0])), opensim_columns(files[1])
    coordinates = model.getCoordinateSet()  # which ends with the model
    for name, values in motion.items():
        coordinate = coordinates.get(name)
        scale, margin = (1.0, 0.09) if name[-2] == "t" else (np.deg2rad(1.0), np.deg2rad(4.9))
        low, high = scale * values.min(), scale * values.max()
        assert coordinate.getRangeMin() < min(low, coordinate.getDefaultValue()) - margin, name
        assert max(high, coordinate.getDefaultValue()) + margin < coordinate.getRangeMax() < 2 * np.pi, name


@pytest.mark.parametrize(("axes", "up"), [("as-recorded", 2), ("z-to-y", 1), ("auto", 1)])
def test_zero_pose_stands_as_the_motion_does(standing_project, tmp_path, axes, up):
    model = opensim.Model(str(write_file(standing_project, tmp_path / "walk.osim", axes=axes)[0]))
    gravity = model.getGravity()
    assert [gravity.get(axis) for axis in range(3)] == [-9.80665 if axis == up else 0.0 for axis in range(3)]
    truth = with_up_axis(standing_project, "as-recorded" if up == 2 else "z-to-y").skeleton.reference_pose
    state = model.initSystem()
    for limb in range(standing_project.skeleton.n_limbs):
        place = in_mm(model.getBodySet().get(f"limb{limb}").getTransformInGround(state).p())
        assert np.abs(place - truth[limb, :3, 3]).max() < POSITION_MM


def test_joint_that_wobbles_becomes_a_ball_and_the_export_says_so(small_project, tmp_path):
    entry = find_format("opensim")
    assert any("wobble" in remark and "limb1-limb0" in remark for remark in entry.remarks(small_project, Options()))
    model = opensim.Model(str(write_file(small_project, tmp_path / "w.osim")[0]))
    assert model.getJointSet().get("limb1-limb0").getConcreteClassName() == "BallJoint"


def test_joint_that_wobbles_stays_a_hinge_on_wish_and_the_export_says_what_it_costs(small_project, tmp_path):
    remarks = find_format("opensim").remarks(small_project, Options(joints="as-found"))
    assert any("move markers by up to" in remark for remark in remarks)
    model = opensim.Model(str(write_file(small_project, tmp_path / "w.osim", joints="as-found")[0]))
    assert model.getJointSet().get("limb1-limb0").getConcreteClassName() == "PinJoint"


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.osim")
    assert list(tmp_path.iterdir()) == []
