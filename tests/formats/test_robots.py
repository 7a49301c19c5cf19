"""The programs that own URDF and MJCF are the judges: what they pose must be where the motion has it."""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import parse

import numpy as np
import pytest
from skelgen_formats.articulated import links_of
from skelgen_formats.capsules import capsule_of
from skelgen_formats.options import Options
from skelgen_formats.registry import find_format, write_file

from skelgen.benchmark.judges import read_columns
from skelgen.errors import WriteError
from skelgen.geometry.frame_rate import with_rate
from skelgen.geometry.rotations import matrix_from_vector

POSITION_MM = 0.01  # demanded; written with every digit
ROTATION = 1e-5  # of a matrix: 0.01 mm at a metre
BETWEEN = 20  # times as much between frames: there a universal joint turns evenly about its axes, not about one

OPTIONS = pytest.mark.parametrize("options", [{}, {"rate": 30.0}, {"joints": "as-found"}])


def body_poses(project, joints="as-moved"):
    """Where the bodies belong, shape (n_frames, n_limbs, 4, 4): the z axis of a hinge's is the axis it turns about."""
    turns = {link.limb: link.turn for link in links_of(project, joints)}
    poses = project.motion.world_from_limb.copy()
    poses[..., :3, :3] = poses[..., :3, :3] @ np.array([turns[limb] for limb in range(len(turns))])
    return poses


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
    truth = body_poses(with_rate(jointed_project, options.get("rate", 0.0)), options.get("joints", "as-moved"))
    for frame, row in enumerate(numbers[:, 2:]):
        robot.update_cfg(dict(zip(names, row, strict=True)))
        for limb, pose in enumerate(truth[frame]):
            found = robot.get_transform(f"limb{limb}", "world")
            assert np.abs(found[:3, 3] * 1000 - pose[:3, 3]).max() < POSITION_MM * allowed(options)
            assert np.abs(found[:3, :3] - pose[:3, :3]).max() < ROTATION * allowed(options)


def test_robot_has_markers_and_bones_in_their_places(jointed_project, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason="needs yourdfpy: pip install yourdfpy")
    robot = yourdfpy.URDF.load(str(write_file(jointed_project, tmp_path / "walk.urdf")[0]))
    turn = next(link.turn for link in links_of(jointed_project, "as-moved") if link.limb == 0)
    marker = turn @ robot.get_transform("marker_M1", "limb0")[:3, 3] * 1000
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
    poses = body_poses(truth, options.get("joints", "as-moved"))
    for frame, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        for limb, pose in enumerate(poses[frame]):
            body = data.body(f"limb{limb}")
            assert np.abs(body.xpos * 1000 - pose[:3, 3]).max() < POSITION_MM * allowed(options)
            assert np.abs(body.xmat.reshape(3, 3) - pose[:3, :3]).max() < ROTATION * allowed(options)
        for marker, name in enumerate(truth.trajectories.names[:-1]):
            place = data.site(name).xpos * 1000
            apart = np.abs(place - truth.motion.marker_positions[frame, marker]).max()
            assert apart < POSITION_MM * allowed(options)


def test_mujoco_takes_the_urdf_and_poses_it_as_the_motion_has_it(jointed_project, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'mujoco>=3'")
    model_file, motion = write_file(jointed_project, tmp_path / "walk.urdf")
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    header, numbers = read_columns(motion)
    for row, poses in zip(numbers[:, 2:], jointed_project.motion.world_from_limb, strict=True):
        for name, value in zip(header[2:], row, strict=True):
            data.joint(name.rpartition("_")[0]).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        for limb in (0, 1, 2, 3, 5, 6, 7, 8):  # MuJoCo makes one body of limbs that a rigid joint holds
            assert np.abs(data.body(f"limb{limb}").xpos * 1000 - poses[limb, :3, 3]).max() < POSITION_MM


def test_pybullet_takes_the_urdf_with_its_masses(jointed_project, judged_apart, tmp_path):
    files = write_file(jointed_project, tmp_path / "walk.urdf")
    found = judged_apart("pybullet", "bullet_poses.py", *files)
    for places, poses in zip(found["places"], jointed_project.motion.world_from_limb, strict=True):
        for limb, pose in enumerate(poses):
            assert np.abs(np.array(places[f"limb{limb}"]) * 1000 - pose[:3, 3]).max() < POSITION_MM
    for limb in range(jointed_project.skeleton.n_limbs):
        mass = capsule_of(jointed_project.skeleton, limb, 1000.0).mass
        assert found["masses"][f"limb{limb}"] == pytest.approx(mass)
    total = sum(capsule_of(jointed_project.skeleton, limb, 1000.0).mass for limb in range(9))
    assert sum(found["masses"].values()) == pytest.approx(total, rel=1e-5)  # all else weighs next to nothing


def test_masses_and_inertias_are_what_mujoco_reckons_of_the_capsules(jointed_project, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'mujoco>=3'")
    model = mujoco.MjModel.from_xml_path(str(write_file(jointed_project, tmp_path / "w.mjcf.xml", density=800.0)[0]))
    for limb in range(jointed_project.skeleton.n_limbs):
        capsule, body = capsule_of(jointed_project.skeleton, limb, 800.0), model.body(f"limb{limb}")
        assert body.mass[0] == pytest.approx(capsule.mass)
        assert sorted(body.inertia) == pytest.approx(np.linalg.eigvalsh(capsule.inertia()))
        turn = next(link.turn for link in links_of(jointed_project, "as-moved") if link.limb == limb)
        assert np.abs(turn @ body.ipos - capsule.centre).max() < 1e-12


def test_inertias_of_the_urdf_are_those_of_the_capsules(jointed_project, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason="needs yourdfpy: pip install yourdfpy")
    robot = yourdfpy.URDF.load(str(write_file(jointed_project, tmp_path / "walk.urdf", density=500.0)[0]))
    for link in links_of(jointed_project, "as-moved"):
        capsule, inertial = capsule_of(jointed_project.skeleton, link.limb, 500.0), robot.link_map[link.name].inertial
        assert inertial.mass == pytest.approx(capsule.mass)
        assert np.abs(link.turn @ inertial.origin[:3, 3] - capsule.centre).max() < 1e-12
        assert np.abs(link.turn @ inertial.inertia @ link.turn.T - capsule.inertia()).max() < 1e-12


def test_hinges_turn_about_z_and_zero_is_the_reference_pose(jointed_project, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason="needs yourdfpy: pip install yourdfpy")
    robot = yourdfpy.URDF.load(str(write_file(jointed_project, tmp_path / "walk.urdf")[0]))
    hinges = [name for name in robot.joint_map if name.endswith(("_turn", "_first", "_second"))]
    assert len(hinges) == 4
    assert all(robot.joint_map[name].axis.tolist() == [0, 0, 1] for name in hinges)
    robot.update_cfg(np.zeros(len(robot.actuated_joint_names)))
    for link in links_of(jointed_project, "as-moved"):
        pose = robot.get_transform(link.name, "world")
        reference = jointed_project.skeleton.reference_pose[link.limb]
        assert np.abs(pose[:3, 3] * 1000 - reference[:3, 3]).max() < POSITION_MM
        assert np.abs(pose[:3, :3] - reference[:3, :3] @ link.turn).max() < ROTATION


@pytest.mark.parametrize("name", ["walk.urdf", "walk.mjcf.xml"])
def test_ranges_hold_the_motion_and_zero_with_a_margin(jointed_project, tmp_path, name):
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'mujoco>=3'")
    model = mujoco.MjModel.from_xml_path(str(write_file(jointed_project, tmp_path / name)[0]))
    for link in links_of(jointed_project, "as-moved"):
        for title, angles in zip(link.angle_names, link.angles.T, strict=True):
            if name.endswith(".urdf") or link.kind in {"hinge", "universal"}:
                low, high = model.joint(title).range
                assert low < min(angles.min(), 0.0) - np.deg2rad(4.9)
                assert max(angles.max(), 0.0) + np.deg2rad(4.9) < high < 2 * np.pi


@pytest.mark.parametrize("name", ["walk.urdf", "walk.mjcf.xml"])
def test_wheels_have_no_limits(jointed_project, tmp_path, name):
    wheel = next(joint for joint in jointed_project.skeleton.joints if joint.child == 7)  # a hinge without children
    poses = jointed_project.motion.world_from_limb.copy()
    turns = matrix_from_vector(np.linspace(0, 4 * np.pi, len(poses))[:, np.newaxis] * wheel.axis)
    poses[:, 7, :3, :3] = poses[:, 7, :3, :3] @ turns
    project = replace(jointed_project, _motion=replace(jointed_project.motion, world_from_limb=poses))
    written = [one for one in parse(write_file(project, tmp_path / name)[0]).iter("joint") if one.get("name")]
    free = ["continuous" in one.attrib.values() or one.get("limited") == "false" for one in written]
    assert [one.get("name") for one, is_free in zip(written, free, strict=True) if is_free] == ["limb5-limb7_turn"]
    assert not any("lower" in limit.attrib for one in written if "continuous" in one.attrib.values() for limit in one)


@pytest.mark.parametrize(("axes", "down"), [("as-recorded", 2), ("z-to-y", 1), ("auto", 2)])
def test_gravity_points_down_as_it_is_found(standing_project, tmp_path, axes, down):
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'mujoco>=3'")
    model = mujoco.MjModel.from_xml_path(str(write_file(standing_project, tmp_path / "w.mjcf.xml", axes=axes)[0]))
    assert model.opt.gravity.tolist() == [-9.80665 if axis == down else 0.0 for axis in range(3)]


@pytest.mark.parametrize(
    ("name", "axes"), [("w.mjcf.xml", "auto"), ("w.mjcf.xml", "y-to-z"), ("w.osim", "as-recorded")]
)
def test_gravity_turns_with_the_axes_and_is_not_sought_anew(jointed_project, tmp_path, name, axes):
    """y is up, as the lowest marker sways by 1 mm; once z is turned backward, a marker that hangs still is lowest."""
    positions = jointed_project.trajectories.positions.copy()
    positions[:, -1] = [0.0, np.nanmin(positions[:, :, 1]) - 1000.0, 1e4]
    positions[::2, -1, 1] -= 2.0
    take = replace(jointed_project.trajectories, positions=positions)
    project = replace(jointed_project, take=take, _trajectories=take)
    text = write_file(project, tmp_path / name, axes=axes)[0].read_text()
    assert ("0.0 -9.80665 0.0" if name == "w.osim" else "0.0 0.0 -9.80665") in text


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


@pytest.mark.parametrize(("part", "kind"), [(0.01, "hinge"), (0.1, "ball")])
def test_a_hinge_stays_one_where_it_wobbles_no_more_than_bearings_do(jointed_project, part, kind):
    joint = next(one for one in jointed_project.skeleton.joints if one.kind == "hinge")
    (link,) = (link for link in links_of(jointed_project, "as-moved") if link.limb == joint.child)
    across = np.cross(joint.axis, [1.0, 0.0, 0.0])
    wobble = matrix_from_vector(part * np.ptp(link.angles) * across / np.linalg.norm(across))
    poses = jointed_project.motion.world_from_limb.copy()
    poses[-1, joint.child, :3, :3] = poses[-1, joint.child, :3, :3] @ wobble
    wobbly = replace(jointed_project, _motion=replace(jointed_project.motion, world_from_limb=poses))
    assert next(link.kind for link in links_of(wobbly, "as-moved") if link.limb == joint.child) == kind


def test_export_says_what_robots_cannot_hold(jointed_project):
    urdf = " ".join(find_format("urdf").remarks(jointed_project, Options()))
    assert "three, two and six joints in a row" in urdf
    assert "deviations of angles are not written" in " ".join(find_format("mjcf").remarks(jointed_project, Options()))


@pytest.mark.parametrize("name", ["walk.urdf", "walk.mjcf.xml", "walk.mjcf"])
def test_take_is_refused(small_project, tmp_path, name):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["walk.urdf", "walk.mjcf.xml"])
def test_coordinates_are_read_without_the_marks_of_joints(jointed_project, tmp_path, name):
    first, *others = jointed_project.skeleton.joints
    joints = (replace(first, open_directions=3), *others)
    marked = replace(jointed_project, _skeleton=replace(jointed_project.skeleton, joints=joints))
    plain, with_marks = (read_columns(write_file(one, tmp_path / name)[1]) for one in (jointed_project, marked))
    assert with_marks[0] == plain[0]
    np.testing.assert_array_equal(with_marks[1], plain[1])


@pytest.fixture(name="on_a_stand")
def on_a_stand_fixture(jointed_project):
    """The jointed project, but the roots of both bodies stand in the room as in the first frame."""
    poses, take = jointed_project.motion.world_from_limb.copy(), jointed_project.trajectories
    positions, skeleton = take.positions.copy(), jointed_project.skeleton
    for limbs in skeleton.bodies:
        root = next(limb for limb in limbs if limb in skeleton.roots)
        held = poses[0, root] @ np.linalg.inv(poses[:, root])
        poses[:, limbs] = held[:, np.newaxis] @ poses[:, limbs]
        on = np.flatnonzero(np.isin(skeleton.limb_of_marker, limbs))
        positions[:, on] = (held[:, np.newaxis, :3, :3] @ positions[:, on, :, np.newaxis])[..., 0] + held[
            :, np.newaxis, :3, 3
        ]
    take = replace(take, positions=positions)
    return replace(jointed_project, _trajectories=take, _motion=replace(jointed_project.motion, world_from_limb=poses))


def test_a_base_that_stands_in_the_room_has_no_joint_that_is_free(on_a_stand, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'mujoco>=3'")
    model_file, motion = write_file(on_a_stand, tmp_path / "arm.mjcf.xml")
    assert not list(parse(model_file).iter("freejoint"))
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    truth = body_poses(on_a_stand)
    for frame, row in enumerate(read_columns(motion)[1][:, 2:]):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        for limb, pose in enumerate(truth[frame]):
            assert np.abs(data.body(f"limb{limb}").xpos * 1000 - pose[:3, 3]).max() < POSITION_MM
            assert np.abs(data.body(f"limb{limb}").xmat.reshape(3, 3) - pose[:3, :3]).max() < ROTATION
