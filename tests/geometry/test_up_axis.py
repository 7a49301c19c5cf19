"""A turn of the world exchanges coordinates, keeps every digit, and leaves a project whole."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.up_axis import AS_RECORDED, TURNS, with_up_axis
from skelgen.model import PointCloud, Poses, Trajectories


def arrays_of(value):
    """Every array in a value."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from arrays_of(item)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from arrays_of(getattr(value, field.name))


def turn_of(wish):
    """The rotation matrix of a wish."""
    order, signs = TURNS[wish]
    return np.eye(3)[list(order)] * np.array(signs)[:, np.newaxis]


def test_what_was_up_along_z_is_up_along_y():
    take = Trajectories(np.array([[[1.0, 2.0, 3.0]]]), ("a",), 50.0)
    assert with_up_axis(take, "z-to-y").positions.tolist() == [[[1.0, 3.0, -2.0]]]


@pytest.mark.parametrize("wish", TURNS)
def test_turns_are_rotations_and_no_mirrors(wish):
    turn = turn_of(wish)
    assert np.array_equal(turn @ turn.T, np.eye(3))
    assert np.linalg.det(turn) == 1.0


def test_a_project_turned_there_and_back_is_the_same_to_the_last_digit(small_project):
    back = with_up_axis(with_up_axis(small_project, "z-to-y"), "y-to-z")
    pairs = list(zip(arrays_of(small_project), arrays_of(back), strict=True))
    assert len(pairs) > 10
    assert all(np.array_equal(before, after, equal_nan=True) for before, after in pairs)


@pytest.mark.parametrize("wish", ["z-to-y", "y-to-z"])
def test_a_turned_project_still_fits_its_markers(small_project, wish):
    turned = with_up_axis(small_project, wish)
    motion, skeleton = turned.motion, turned.skeleton
    on = skeleton.limb_of_marker[:-1]
    poses = motion.world_from_limb[:, on]
    rebuilt = np.einsum("fmij,mj->fmi", poses[..., :3, :3], skeleton.marker_offsets[:-1]) + poses[..., :3, 3]
    # Sums of three products of metres in mm, in another order: some 1e3 x 2^-52.
    assert np.allclose(rebuilt, motion.marker_positions[:, :-1], rtol=0, atol=1e-9)
    measured = np.linalg.norm(turned.trajectories.positions - motion.marker_positions, axis=2)
    assert np.allclose(measured[:, :-1], motion.residuals[:, :-1], rtol=0, atol=1e-9, equal_nan=True)


def test_raw_joints_and_reference_pose_turn_with_the_rest(small_project):
    turned, turn = with_up_axis(small_project, "z-to-y"), turn_of("z-to-y")
    raw = small_project.topology.raw_joint_positions @ turn.T
    assert np.array_equal(turned.topology.raw_joint_positions, raw, equal_nan=True)
    reference = small_project.skeleton.reference_pose
    assert np.array_equal(turned.skeleton.reference_pose[:, :3, 3], reference[:, :3, 3] @ turn.T)


def test_limbs_have_the_axes_of_the_turned_world_in_the_reference_pose(small_project):
    turned, turn = with_up_axis(small_project, "z-to-y"), turn_of("z-to-y")
    assert np.array_equal(turned.skeleton.reference_pose[:, :3, :3], np.tile(np.eye(3), (3, 1, 1)))
    for before, after in zip(small_project.skeleton.joints, turned.skeleton.joints, strict=True):
        assert np.array_equal(after.position_in_parent, turn @ before.position_in_parent)
        assert np.array_equal(after.covariance, turn @ before.covariance @ turn.T)
        assert (after.axis is None) == (before.axis is None)


def test_points_and_bodies_are_turned(small_project):
    turn = turn_of("y-to-z")
    points = np.random.default_rng(1).normal(size=(6, 3))
    cloud = with_up_axis(PointCloud(points, np.array([0, 3, 6]), np.array([0.0, 0.1])), "y-to-z")
    assert np.array_equal(cloud.points, points @ turn.T)
    poses = small_project.motion.world_from_limb
    bodies = with_up_axis(Poses(poses, ("a", "b", "c"), 50.0), "y-to-z")
    assert np.array_equal(bodies.world_from_body[..., :3, :], turn @ poses[..., :3, :])


def test_as_recorded_is_the_value_itself(small_project):
    assert with_up_axis(small_project, AS_RECORDED) is small_project


def test_unknown_axes_are_answered_with_the_known_ones(small_project):
    with pytest.raises(InputError, match="as-recorded, z-to-y, y-to-z"):
        with_up_axis(small_project, "up")
