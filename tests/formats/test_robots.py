"""The programs that own URDF and MJCF are the judges: what they pose must be where the motion has it."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.options import Options
from skelgen_formats.registry import find_format, write_file

from skelgen.benchmark.judges import read_columns
from skelgen.errors import WriteError
from skelgen.geometry.frame_rate import with_rate

POSITION_MM = 0.01  # demanded; written with every digit
ROTATION = 1e-5  # of a matrix: 0.01 mm at a metre
BETWEEN = 20  # times as much between frames: there a universal joint turns evenly about its axes, not about one

OPTIONS = pytest.mark.parametrize("options", [{}, {"rate": 30.0}, {"joints": "as-found"}])


def allowed(options):
    return BETWEEN if "rate" in options else 1


@OPTIONS
def test_yourdfpy_poses_the_robot_as_the_motion_has_it(jointed_project, tmp_path, options):
    yourdfpy = pytest.importorskip("yourdfpy", reason="needs yourdfpy: pip install yourdfpy")
    model, motion = write_file(jointed_project, tmp_path / "walk.urdf", **options)
    robot = yourdfpy.URDF.load(str(model))
    assert robot.validate()
    header, numbers = read_columns(motion)
    names = [name.rpartition("_")[0] for name in header[2:]]
    assert set(names) == set(robot.actuated_joint_names)
    truth = with_rate(jointed_project, options.get("rate", 0.0)).motion
    for frame, row in enumerate(numbers[:, 2:]):
        robot.update_cfg(dict(zip(names, row, strict=True)))
        for limb, pose in enumerate(truth.world_from_limb[frame]):
            found = robot.get_transform(f"limb{limb}", "world")
            assert np.abs(found[:3, 3] * 1000 - pose[:3, 3]).max() < POSITION_MM * allowed(options)
            assert np.abs(found[:3, :3] - pose[:3, :3]).max() < ROTATION * allowed(options)


def test_robot_has_markers_and_bones_in_their_places(jointed_project, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason="needs yourdfpy: pip install yourdfpy")
    robot = yourdfpy.URDF.load(str(write_file(jointed_project, tmp_path / "walk.urdf")[0]))
    marker = robot.get_transform("marker_M1", "limb0")[:3, 3] * 1000
    assert np.abs(marker - jointed_project.skeleton.marker_offsets[1]).max() < POSITION_MM
    bone = robot.link_map["limb1"].visuals[0]
    end = (bone.origin @ [0, 0, bone.geometry.cylinder.length / 2, 1])[:3] * 1000
    assert np.abs(end - jointed_project.skeleton.joints[0].position_in_parent).max() < POSITION_MM


@OPTIONS
def test_mujoco_poses_the_model_as_the_motion_has_it(jointed_project, tmp_path, options):
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'mujoco>=3'")
    model_file, motion = write_file(jointed_project, tmp_path / "walk.mjcf.xml", **options)
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    qpos = read_columns(motion)[1][:, 2:]
    assert np.array_equal(model.key_qpos[0], qpos[0])
    truth = with_rate(jointed_project, options.get("rate", 0.0))
    for frame, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        for limb, pose in enumerate(truth.motion.world_from_limb[frame]):
            body = data.body(f"limb{limb}")
            assert np.abs(body.xpos * 1000 - pose[:3, 3]).max() < POSITION_MM * allowed(options)
            assert np.abs(body.xmat.reshape(3, 3) - pose[:3, :3]).max() < ROTATION * allowed(options)
        for marker, name in enumerate(truth.trajectories.names[:-1]):
            place = data.site(name).xpos * 1000
            apart = np.abs(place - truth.motion.marker_positions[frame, marker]).max()
            assert apart < POSITION_MM * allowed(options)


def test_quaternions_of_the_motion_never_jump(jointed_project, tmp_path):
    header, numbers = read_columns(write_file(jointed_project, tmp_path / "walk.mjcf.xml")[1])
    first = [index for index, name in enumerate(header) if name.endswith("_qw")]
    for column in first:
        quaternions = numbers[:, column : column + 4]
        assert ((quaternions[1:] * quaternions[:-1]).sum(axis=1) > 0).all()


@pytest.mark.parametrize("name", ["walk.urdf", "walk.mjcf.xml"])
def test_any_motion_of_joints_that_wobble_is_kept(small_project, tmp_path, name):
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'mujoco>=3'")
    model_file, motion = write_file(small_project, tmp_path / name)
    if name.endswith(".urdf"):
        assert "limb1-limb0_rz" in model_file.read_text()
        return
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    data.qpos[:] = read_columns(motion)[1][-1, 2:]
    mujoco.mj_kinematics(model, data)
    assert np.abs(data.body("limb0").xmat.reshape(3, 3) - small_project.motion.rotations[-1, 0]).max() < ROTATION


def test_export_says_what_robots_cannot_hold(jointed_project):
    urdf = " ".join(find_format("urdf").remarks(jointed_project, Options()))
    assert "three, two and six joints in a row" in urdf
    assert "deviations of angles are not written" in " ".join(find_format("mjcf").remarks(jointed_project, Options()))


@pytest.mark.parametrize("name", ["walk.urdf", "walk.mjcf.xml", "walk.mjcf"])
def test_take_is_refused(small_project, tmp_path, name):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / name)
    assert list(tmp_path.iterdir()) == []
