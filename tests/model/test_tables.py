"""Tables of a project, with a hinge that turns by one degree in every frame."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen.errors import MissingPackageError, MissingResultError
from skelgen.model import Joint, JointAngles, Motion, Skeleton
from skelgen.model.tables import angles_table, joints_table, limb_poses

N_FRAMES = 5


@pytest.fixture
def hinged():
    """Two limbs of one marker each; the second hangs 300 mm below the first and turns about x."""
    joint = Joint(0, 1, [0, 0, -300], [0, 0, 0], "hinge", [1, 0, 0], [1, 2, 3])
    offsets, pose = np.zeros((2, 3)), np.tile(np.eye(4), (2, 1, 1))
    skeleton = Skeleton([-1, 0], (joint,), [0, 1], offsets, np.zeros(2), pose)
    angles = np.deg2rad(np.arange(N_FRAMES, dtype=float))
    world = np.tile(np.eye(4), (N_FRAMES, 2, 1, 1))
    world[:, 1, :3, :3] = Rotation.from_rotvec(angles[:, np.newaxis] * [1, 0, 0]).as_matrix()
    world[:, 1, :3, 3] = (0, 0, -300)
    seen = np.ones((N_FRAMES, 2), dtype=bool)
    found = JointAngles(("turn",), angles[:, np.newaxis], np.full((N_FRAMES, 1), np.deg2rad(0.5)))
    markers = world[:, :, :3, 3]
    motion = Motion(world, world[:, 1:, :3, 3], markers, np.zeros((N_FRAMES, 2)), seen, 50.0)
    return skeleton, replace(motion, compute_angles=lambda _: (found,))


def test_angles_stand_in_degrees_with_deviations(hinged):
    table = angles_table(*hinged)
    assert list(table.columns) == ["frame", "time_s", "joint", "angle", "value_deg", "std_deg"]
    np.testing.assert_allclose(table.value_deg, np.arange(N_FRAMES))
    np.testing.assert_allclose(table.std_deg, 0.5)
    assert set(zip(table.joint, table.angle, strict=True)) == {("limb0-limb1", "turn")}


def test_joints_stand_in_mm_and_deviations_are_empty_where_none_were_estimated(hinged):
    table = joints_table(*hinged)
    assert table.z_mm.tolist() == [-300.0] * N_FRAMES
    assert table.std_x_mm.isna().all()
    np.testing.assert_allclose(table.time_s, np.arange(N_FRAMES) / 50)


def test_limb_poses_hold_the_rotation_as_a_quaternion(hinged):
    table = limb_poses(*hinged)
    shank = table[table.limb == "limb1"]
    xyzw = shank[["qx", "qy", "qz", "qw"]].to_numpy()
    np.testing.assert_allclose(np.rad2deg(Rotation.from_quat(xyzw).as_rotvec()[:, 0]), np.arange(N_FRAMES), atol=1e-12)
    assert len(table) == 2 * N_FRAMES
    assert table.seen.all()


def test_angles_are_computed_once(hinged):
    motion, calls = hinged[1], []
    counted = replace(motion, compute_angles=lambda one: calls.append(one) or motion.joint_angles)
    assert counted.joint_angles is counted.joint_angles
    assert len(calls) == 1


def test_motion_without_a_skeleton_has_no_angles(hinged):
    with pytest.raises(MissingResultError, match="no joint angles"):
        _ = replace(hinged[1], compute_angles=None).joint_angles


def test_tables_without_pandas_say_how_to_install_it(hinged, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'skelgen-mocap\[tables\]'"):
        joints_table(*hinged)
