"""Long takes: limbs and joints from part of the frames, places and poses block by block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.app.project_file.archive import open_project, save_project
from skelgen.kinematics.inverse.motion import PosedMotion
from skelgen.model import Motion
from skelgen.stages.joints import find_joints
from skelgen.stages.skeleton import SkeletonParameters, fit_skeleton

FRAMES = 17_000  # more than are fitted at once: three blocks of poses, two of joints
ABSENT = slice(8_000, 8_600)  # longer than the margins of blocks, and across the end of one
LATE = 600
AS_NEAR = 0.7  # mm, of joints with 0.5 mm of noise on three markers a limb


@pytest.fixture(scope="module")
def case(simulated):
    """Three rods in a row, with truth."""
    return simulated("rods", n_frames=FRAMES, noise=0.5, dropouts=0.05)


@pytest.fixture(scope="module")
def fitted(case, true_limbs):
    limbs = true_limbs(case)
    topology = find_joints(case.take, limbs)
    return limbs, topology, *fit_skeleton(case.take, limbs, topology)


@pytest.fixture(scope="module")
def interrupted(case, fitted):
    """The motion of a take that the body enters late and leaves for a while."""
    positions = case.take.positions.copy()
    positions[:LATE] = positions[ABSENT] = np.nan
    take, limbs = replace(case.take, positions=positions), fitted[0]
    return fit_skeleton(take, limbs, find_joints(take, limbs))[1]


def joint_errors(positions, truth):
    return np.linalg.norm(positions - truth.joint_positions, axis=2)


def test_joints_of_a_long_take_are_placed_in_every_frame(case, fitted):
    topology = fitted[1]
    np.testing.assert_array_equal(topology.edges, case.truth.edges)
    errors = joint_errors(topology.raw_joint_positions, case.truth)
    assert np.nanmean(errors) < 2 * AS_NEAR
    assert (np.isnan(errors).mean(axis=0) < 0.2).all()


def test_skeleton_played_back_in_blocks_is_near_the_truth(case, fitted):
    _, _, skeleton, motion = fitted
    assert isinstance(motion, PosedMotion)
    assert tuple(one.kind for one in skeleton.joints) == case.truth.joint_kinds
    errors = joint_errors(motion.joint_positions, case.truth)
    assert errors.mean() < AS_NEAR
    assert 0.5 < np.sqrt((errors**2).mean() / 3) / motion.joint_std.mean() < 2.0


def test_motion_does_not_leap_between_blocks(fitted):
    leaps = np.linalg.norm(np.diff(fitted[3].joint_positions, n=2, axis=0), axis=2).max(axis=1)
    for border in np.linspace(0, FRAMES, 4).astype(int)[1:-1]:
        assert leaps[border - 2 : border].max() < np.quantile(leaps, 0.999)


def test_body_that_leaves_for_a_while_is_interpolated_across_blocks(interrupted):
    assert not interrupted.limb_seen[ABSENT].any()
    root = interrupted.origins[ABSENT.start - 1 : ABSENT.stop + 1, 0]
    steps = np.diff(root, axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to(steps.mean(axis=0), steps.shape), atol=1e-6)
    turns = interrupted.rotations[ABSENT]
    np.testing.assert_allclose(turns @ turns.swapaxes(2, 3), np.broadcast_to(np.eye(3), turns.shape), atol=1e-9)


def test_take_that_begins_without_the_body_holds_its_first_pose(interrupted):
    held = interrupted.joint_positions[:LATE]
    np.testing.assert_allclose(held, np.tile(interrupted.joint_positions[LATE], (LATE, 1, 1)))


def test_root_outward_fit_plays_back_in_blocks(case, fitted):
    limbs, topology, _, _ = fitted
    _, played = fit_skeleton(case.take, limbs, topology, SkeletonParameters(fit="root-outward"))
    assert np.nanmedian(played.residuals) < 3.0  # mm


@pytest.fixture(scope="module")
def posed(small_project):
    """The small project's motion, and the same as poses only."""
    motion, skeleton = small_project.motion, small_project.skeleton
    random = np.random.default_rng(0)
    quaternions = random.normal(size=(motion.n_frames, skeleton.n_limbs, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    origins = random.normal(size=(motion.n_frames, skeleton.n_limbs, 3)) * 100
    return PosedMotion(skeleton, quaternions, origins, small_project.trajectories, motion.limb_seen)


def test_what_follows_from_poses_is_computed_when_it_is_asked_for(posed, small_project):
    skeleton, measured = small_project.skeleton, small_project.trajectories.positions
    children = [joint.child for joint in skeleton.joints]
    np.testing.assert_array_equal(posed.joint_positions, posed.origins[:, children])
    np.testing.assert_allclose(posed.world_from_limb[..., :3, 3], posed.origins)
    limb = skeleton.limb_of_marker
    turned = np.einsum("fmij,mj->fmi", posed.rotations[:, limb], skeleton.marker_offsets)
    np.testing.assert_allclose(posed.marker_positions, turned + posed.origins[:, limb])
    np.testing.assert_allclose(posed.residuals, np.linalg.norm(measured - posed.marker_positions, axis=2))


def test_motion_of_poses_is_saved_as_any_other(posed, small_project, tmp_path):
    project = replace(small_project, _motion=posed)
    again = open_project(save_project(project, tmp_path / "long.skelgen")).motion
    assert type(again) is Motion
    np.testing.assert_array_equal(again.world_from_limb, posed.world_from_limb)
    np.testing.assert_array_equal(again.residuals, posed.residuals)
