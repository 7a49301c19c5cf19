"""Another frame rate keeps frames that fall on old ones, keeps joints closed, and invents nothing that was not seen."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.frame_rate import n_frames_at, with_rate
from skelgen.geometry.rotations import matrix_from_vector, vector_from_matrix
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.filled import Filled, PositionSource

ROUNDING = 1e-9  # mm: a few products of metres in mm, of 2e-13 each


@pytest.fixture
def markers() -> Trajectories:
    """A marker that walks 1 mm a frame along x, and one beside it that is unseen in frame 2."""
    positions = np.zeros((7, 2, 3))
    positions[:, :, 0] = np.arange(7)[:, np.newaxis]
    positions[2, 1] = np.nan
    return Trajectories(positions, ("a", "b"), 120.0)


@pytest.mark.parametrize(
    ("rate", "n_frames"), [(0.0, 7), (120.0, 7), (60.0, 4), (240.0, 13), (100.0, 6), (90.0, 5), (7.0, 1)]
)
def test_frames_fill_the_time_of_the_take_and_no_more(markers, rate, n_frames):
    assert n_frames_at(7, 120.0, rate) == n_frames
    assert with_rate(markers, rate).n_frames == n_frames


def test_rate_as_recorded_is_the_same_value(markers):
    assert with_rate(markers, 0.0) is markers


def test_positions_go_straight_between_frames(markers):
    at = with_rate(markers, 100.0)
    assert at.rate == 100.0
    np.testing.assert_allclose(at.positions[:, 0, 0], 1.2 * np.arange(6), rtol=0, atol=1e-12)


def test_every_second_frame_is_the_old_one_to_the_last_digit(small_project):
    rate = small_project.trajectories.rate
    half, double = with_rate(small_project, rate / 2), with_rate(small_project, 2 * rate)
    old = small_project.motion.world_from_limb
    np.testing.assert_allclose(half.motion.world_from_limb, old[::2], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(double.motion.world_from_limb[::2], old, rtol=0, atol=ROUNDING)
    assert np.array_equal(double.trajectories.positions[::2], small_project.trajectories.positions, equal_nan=True)


def test_unseen_in_either_neighbour_is_unseen_between_them(markers):
    seen = with_rate(markers, 240.0).seen[:, 1]
    assert np.flatnonzero(~seen).tolist() == [3, 4, 5]


def test_joints_stay_closed_and_limbs_rigid_between_frames(small_project):
    project = with_rate(small_project, 2.7 * small_project.motion.rate)
    motion, skeleton = project.motion, project.skeleton
    poses = motion.world_from_limb
    for index, joint in enumerate(skeleton.joints):
        at = np.append(joint.position_in_parent, 1.0)
        np.testing.assert_allclose((poses[:, joint.parent] @ at)[:, :3], motion.joint_positions[:, index], atol=1e-9)
        np.testing.assert_allclose(poses[:, joint.child, :3, 3], motion.joint_positions[:, index], atol=1e-9)
    on = poses[:, skeleton.limb_of_marker[:-1]]
    rebuilt = np.einsum("fmij,mj->fmi", on[..., :3, :3], skeleton.marker_offsets[:-1]) + on[..., :3, 3]
    np.testing.assert_allclose(motion.marker_positions[:, :-1], rebuilt, rtol=0, atol=ROUNDING)
    assert np.isnan(motion.marker_positions[:, -1]).all()


def test_limbs_turn_evenly_against_their_parents(small_project):
    rate = small_project.motion.rate
    coarse, fine = small_project.motion.rotations, with_rate(small_project, 4 * rate).motion.rotations
    against = [turns[:, 1].swapaxes(-1, -2) @ turns[:, 0] for turns in (coarse, fine)]  # limb 0 hangs on limb 1
    steps = vector_from_matrix(against[1][:-1].swapaxes(-1, -2) @ against[1][1:])
    whole = vector_from_matrix(against[0][:-1].swapaxes(-1, -2) @ against[0][1:])
    np.testing.assert_allclose(steps * 4, np.repeat(whole, 4, axis=0), rtol=0, atol=1e-9)


def test_interpolated_limbs_stay_marked(small_project):
    seen = with_rate(small_project, 2 * small_project.motion.rate).motion.limb_seen[:, 0]
    assert np.flatnonzero(~seen).tolist() == [1, 2, 3]


def test_residuals_are_those_of_the_markers_between_frames(small_project):
    project = with_rate(small_project, 73.0)
    apart = np.linalg.norm(project.trajectories.positions - project.motion.marker_positions, axis=2)
    assert np.array_equal(project.motion.residuals, apart, equal_nan=True)
    assert project.topology.raw_joint_positions.shape[0] == project.motion.n_frames == project.take.n_frames


def test_bodies_turn_by_slerp_and_unseen_ones_stay_unseen():
    turns = matrix_from_vector(np.array([[0.0, 0, 0], [0, 0, 1.0], [0, 0, 2.0]]))
    transforms = np.tile(np.eye(4), (3, 2, 1, 1))
    transforms[:, 0, :3, :3] = turns
    transforms[2, 1] = np.nan
    at = with_rate(Poses(transforms, ("a", "b"), 10.0), 20.0).world_from_body
    np.testing.assert_allclose(vector_from_matrix(at[:, 0, :3, :3])[:, 2], [0, 0.5, 1, 1.5, 2], rtol=0, atol=1e-12)
    assert np.isnan(at[:, 1, 0, 3]).tolist() == [False, False, False, True, True]


def test_filled_markers_stay_marked(markers):
    positions = markers.positions.copy()
    positions[2, 1] = [2.0, 0, 0]
    source = np.zeros((7, 2), dtype=int)
    source[2, 1] = PositionSource.LIMB
    filled = with_rate(Filled(markers, positions, source, np.where(source > 0, 0.4, 0.0)), 240.0)
    assert filled.source[:, 1].tolist() == [0, 0, 0, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0]
    np.testing.assert_allclose(filled.positions[:, 1, 0], np.arange(13) / 2, rtol=0, atol=1e-12)


def test_points_without_labels_stay_as_they_are():
    cloud = PointCloud(np.ones((2, 3)), np.array([0, 1, 2]), np.array([0.0, 0.1]))
    assert with_rate(cloud, 50.0) is cloud


@pytest.mark.parametrize("rate", [-1.0, float("nan"), float("inf")])
def test_impossible_rate_is_refused(markers, rate):
    with pytest.raises(InputError, match="must be above 0"):
        with_rate(markers, rate)


def test_rate_that_makes_too_many_frames_is_refused(markers):
    with pytest.raises(InputError, match="more than 2000000 are not written"):
        with_rate(markers, 1e8)
