"""Long takes: limbs and joints from part of the frames, places and poses block by block, as good as all at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.app.project_file.archive import open_project, save_project
from skelgen.kinematics.inverse.posed_motion import PosedMotion
from skelgen.model import Motion
from skelgen.stages.joints import find_joints, search, segments
from skelgen.stages.skeleton import fit_skeleton, long_takes

ABSENT = slice(400, 560)  # longer than the margins of blocks


@pytest.fixture
def short_blocks(monkeypatch):
    """Takes of more than 200 frames count as long, and are looked at in blocks of some 150."""
    for module in (segments, search, long_takes):
        monkeypatch.setattr(module, "BLOCK_FRAMES", 150)
    monkeypatch.setattr(segments, "THIN_FRAMES", 300)
    monkeypatch.setattr(long_takes, "LONGEST_AT_ONCE", 200)
    monkeypatch.setattr(long_takes, "TELLING_FRAMES", 300)
    monkeypatch.setattr(long_takes, "MARGIN", 40)


@pytest.fixture(scope="module")
def case(simulated):
    return simulated("human", n_frames=900, noise=0.5, dropouts=0.05)


@pytest.fixture(scope="module")
def at_once(case, true_limbs):
    limbs = true_limbs(case)
    topology = find_joints(case.take, limbs)
    return limbs, topology, *fit_skeleton(case.take, limbs, topology)


def mean_error(motion, topology, truth):
    """Mean distance [mm] of all joints but hinges, whose place along the axis is a choice, from the truth."""
    gaps = []
    for column, (first, second) in enumerate(topology.edges.tolist()):
        true = [set(edge) == {first, second} for edge in truth.edges.tolist()].index(True)
        if truth.joint_kinds[true] == "ball":
            gaps.append(motion.joint_positions[:, column] - truth.joint_positions[:, true])
    return np.linalg.norm(np.stack(gaps), axis=2).mean()


def test_tree_of_a_long_take_is_that_of_all_frames(short_blocks, case, true_limbs, at_once):
    limbs, topology, _, _ = at_once
    found = find_joints(case.take, limbs)
    np.testing.assert_array_equal(found.parents, topology.parents)
    apart = np.linalg.norm(found.raw_joint_positions - topology.raw_joint_positions, axis=2)
    assert np.nanmedian(apart) < 3.0  # mm; a hinge may lie elsewhere along its axis
    assert (np.isnan(apart).mean(axis=0) < 0.2).all()


def test_skeleton_played_back_in_blocks_is_as_near_the_truth_as_one_fitted_at_once(short_blocks, case, at_once):
    limbs, topology, skeleton, motion = at_once
    in_blocks, played = fit_skeleton(case.take, limbs, topology)
    assert isinstance(played, PosedMotion)
    assert [one.kind for one in in_blocks.joints] == [one.kind for one in skeleton.joints]
    wanted = mean_error(motion, topology, case.truth)
    assert mean_error(played, topology, case.truth) < 1.5 * wanted + 0.1  # a third of the frames told the skeleton
    np.testing.assert_array_equal(played.limb_seen, motion.limb_seen)
    ratio = np.median(played.joint_std / motion.joint_std)
    assert 0.8 < ratio < 1.6


def test_motion_does_not_leap_between_blocks(short_blocks, case, at_once):
    limbs, topology, _, _ = at_once
    _, played = fit_skeleton(case.take, limbs, topology)
    leaps = np.linalg.norm(np.diff(played.joint_positions, n=2, axis=0), axis=2).max(axis=1)
    assert leaps.max() < 3 * np.quantile(leaps, 0.9)


def test_body_that_leaves_for_a_while_is_interpolated_across_blocks(short_blocks, case, at_once):
    positions = case.take.positions.copy()
    positions[ABSENT] = np.nan
    take, limbs = replace(case.take, positions=positions), at_once[0]
    topology = find_joints(take, limbs)
    _, played = fit_skeleton(take, limbs, topology)
    assert not played.limb_seen[ABSENT].any()
    root = played.origins[ABSENT.start - 1 : ABSENT.stop + 1, int(topology.roots[0])]
    steps = np.diff(root, axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to(steps.mean(axis=0), steps.shape), atol=1e-6)
    turns = played.rotations[ABSENT]
    np.testing.assert_allclose(turns @ turns.swapaxes(2, 3), np.broadcast_to(np.eye(3), turns.shape), atol=1e-9)


def test_take_that_begins_without_the_body_holds_its_first_pose(short_blocks, case, at_once):
    positions = case.take.positions.copy()
    positions[:100] = np.nan
    take, limbs = replace(case.take, positions=positions), at_once[0]
    _, played = fit_skeleton(take, limbs, find_joints(take, limbs))
    np.testing.assert_allclose(played.joint_positions[:100], np.tile(played.joint_positions[100], (100, 1, 1)))


def test_root_outward_fit_plays_back_in_blocks(short_blocks, case, at_once):
    limbs, topology, _, _ = at_once
    parameters = long_takes.SkeletonParameters(fit="root-outward")
    _, played = fit_skeleton(case.take, limbs, topology, parameters)
    assert np.nanmedian(played.residuals) < 3.0  # mm


@pytest.fixture(scope="module")
def posed(small_project):
    """The small project's motion, and the same as poses only."""
    motion, skeleton = small_project.motion, small_project.skeleton
    random = np.random.default_rng(0)
    quaternions = random.normal(size=(motion.n_frames, skeleton.n_limbs, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    origins = random.normal(size=(motion.n_frames, skeleton.n_limbs, 3)) * 100
    return PosedMotion(
        skeleton, quaternions, origins, small_project.trajectories.positions, motion.limb_seen, motion.rate
    )


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
