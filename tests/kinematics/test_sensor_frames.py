"""Matrices that are no rotations, and lengths in the unit of the sensors."""

import numpy as np
import pytest

import skelgen
from skelgen.errors import InputError
from skelgen.kinematics import find_hierarchy
from skelgen.kinematics.sensor_frames import poses_from_matrices, scaled_by_fixed_sensors
from skelgen.simulation import simulate

RNG = np.random.default_rng(2)
SKEWED = np.diag([1.4, 0.7, 1.1]) + 0.2 * RNG.normal(size=(3, 3))
MIRRORED = SKEWED * [1.0, 1.0, -1.0]


@pytest.fixture(scope="module")
def truth():
    return simulate("rods", n_frames=120, seed=1).truth


def joint_places(poses):
    """Where the found joints are in the world, shape (n_frames, n_joints, 3)."""
    found = find_hierarchy(poses, 0)
    places = []
    for child, joint in sorted(found.joints.items()):
        pose = poses.world_from_body[:, child]
        places.append(pose[:, :3, :3] @ joint.fit.in_child + pose[:, :3, 3])
    return np.stack(places, axis=1)


@pytest.mark.parametrize("matrix", [np.eye(3) * 0.1, SKEWED, MIRRORED], ids=["scaled", "skewed", "left-handed"])
def test_joints_are_where_they_are_whatever_the_sensors_axes(truth, matrix):
    given = truth.world_from_limb.copy()
    given[..., :3, :3] = given[..., :3, :3] @ matrix
    with pytest.raises(InputError, match="not a proper rotation"):
        skelgen.Poses(given, truth.limb_names, 100.0)
    poses = poses_from_matrices(given, truth.limb_names, 100.0)
    straight = skelgen.Poses(truth.world_from_limb, truth.limb_names, 100.0)
    np.testing.assert_allclose(joint_places(poses), joint_places(straight), atol=0.01)
    assert len(poses.notices) == len(truth.limb_names)


def test_a_world_with_skewed_axes_is_straightened(truth):
    world = SKEWED @ SKEWED.T / 2  # a symmetric one: how it is turned nobody can tell
    given = truth.world_from_limb.copy()
    given[..., :3, :] = world @ given[..., :3, :]
    poses = poses_from_matrices(given, truth.limb_names, 100.0)
    np.testing.assert_allclose(poses.world_from_body, truth.world_from_limb, atol=1e-6)
    assert "the world of the matrices is" in poses.notices[0]


def test_rotations_are_taken_as_they_are(truth):
    given = truth.world_from_limb[:, :, :3].copy()
    given[5, 1] = np.nan
    poses = poses_from_matrices(given, truth.limb_names, 100.0)
    assert poses.notices == ()
    np.testing.assert_allclose(poses.world_from_body[:, :, :3], given, atol=1e-12)


def test_masked_matrices_are_unseen(truth):
    given = np.ma.array(truth.world_from_limb, mask=False)
    given[5, 1] = np.ma.masked
    seen = np.isfinite(poses_from_matrices(given, truth.limb_names, 100.0).world_from_body).all(axis=(2, 3))
    assert np.argwhere(~seen).tolist() == [[5, 1]]


def test_matrices_that_change_their_shape_are_told(truth):
    given = truth.world_from_limb.copy()
    given[..., :3, :3] *= np.linspace(0.8, 1.2, 120)[:, np.newaxis, np.newaxis, np.newaxis]
    assert "vary by" in poses_from_matrices(given, truth.limb_names, 100.0).notices[0]


def test_flat_matrices_are_refused(truth):
    given = truth.world_from_limb.copy()
    given[7, 2, :3, 2] = 0.0
    with pytest.raises(InputError, match=f"the matrix of {truth.limb_names[2]} in frame 7 cannot be inverted"):
        poses_from_matrices(given, truth.limb_names, 100.0)


def test_two_fixed_sensors_tell_the_unit(truth):
    """As in O'Brien et al. (2000, 4): sensors 565 mm apart, with errors, in a unit of 0.94 cm."""
    rng, world = np.random.default_rng(0), np.concatenate([truth.world_from_limb, truth.world_from_limb[:, :1]], axis=1)
    world[:, 3, :3, 3] += world[:, 0, :3, :3] @ [0.0, 565.0, 0.0]
    world[..., :3, 3] += rng.normal(size=(*world.shape[:2], 3))
    raw = world.copy()
    raw[..., :3, 3] /= 9.4
    poses = scaled_by_fixed_sensors(skelgen.Poses(raw, (*truth.limb_names, "second"), 100.0), 565.0)
    np.testing.assert_allclose(poses.world_from_body[..., :3, 3], world[..., :3, 3], rtol=1e-3)
    assert poses.notices[-1].startswith("lengths are 9.4")
    assert f"{truth.limb_names[0]} and second" in poses.notices[-1]
    named = skelgen.Poses(raw, (*truth.limb_names, "second"), 100.0)
    with pytest.raises(InputError, match="these two sensors do not keep their distance"):
        scaled_by_fixed_sensors(named, 565.0, (truth.limb_names[0], truth.limb_names[2]))
    with pytest.raises(InputError, match="there is no sensor 'third'"):
        scaled_by_fixed_sensors(named, 565.0, ("third", "second"))


def test_the_unit_of_a_file_is_found_by_its_fixed_sensors(truth, tmp_path):
    world = np.concatenate([truth.world_from_limb, truth.world_from_limb[:, :1]], axis=1)
    world[:, 3, :3, 3] += world[:, 0, :3, :3] @ [0.0, 565.0, 0.0]
    world[..., :3, 3] /= 9.4
    skelgen.write(skelgen.Poses(world, (*truth.limb_names, "second"), 100.0), tmp_path / "walk.poses.csv")
    take = skelgen.read(tmp_path / "walk.poses.csv", fixed_distance=565.0)
    np.testing.assert_allclose(take.world_from_body[:, :3, :3, 3], truth.world_from_limb[..., :3, 3], rtol=1e-6)
