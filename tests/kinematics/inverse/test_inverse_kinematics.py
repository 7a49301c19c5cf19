"""Inverse kinematics of a known skeleton: angles that are true, deviations that hold, honest refusals."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.inverse.inverse_kinematics import METHODS, LiveSkeleton, hold_joints, solve
from skelgen.kinematics.inverse.motion import MotionAngles
from skelgen.kinematics.inverse.root_outward import KnownJoints, pose_outward
from skelgen.kinematics.inverse.skeleton_tree import SkeletonTree
from skelgen.kinematics.joints.angles import joint_angles
from skelgen.model import Joint, Motion, Skeleton

X, Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
POINTS = np.array([[50.0, 0, 40], [-50, 20, -40], [0, -60, 10], [0, 40, -10]])
N_FRAMES = 200
NOISE = 0.5  # mm
COVERED = (0.90, 0.98)  # of 95 % intervals; 200 frames scatter by 1.5 %


@pytest.fixture(scope="module")
def arm():
    """A ball, a hinge about x, a universal joint about x and y, each 300 mm behind the last, and true angles."""
    joints = tuple(
        Joint(i, i + 1, np.array([0.0, 0, 300]), np.zeros(3), kind, axis, np.zeros(3), second)
        for i, (kind, axis, second) in enumerate([("ball", None, None), ("hinge", X, None), ("universal", X, Y)])
    )
    skeleton = Skeleton(
        parents=np.array([-1, 0, 1, 2]),
        joints=joints,
        limb_of_marker=np.repeat(np.arange(4), 4),
        marker_offsets=np.tile(POINTS, (4, 1)),
        marker_std=np.full(16, NOISE),
        reference_pose=np.tile(np.eye(4), (4, 1, 1)),
    )
    angles = np.random.default_rng(0).uniform(-0.8, 0.8, (N_FRAMES, 6))
    turns = [matrix_from_vector(angles[:, :3]), matrix_from_vector(angles[:, 3:4] * X)]
    turns.append(matrix_from_vector(angles[:, 4:5] * X) @ matrix_from_vector(angles[:, 5:] * Y))
    rotation, origin = np.tile(np.eye(3), (N_FRAMES, 1, 1)), np.zeros((N_FRAMES, 3))
    positions = [POINTS + origin[:, None]]
    for joint, turn in zip(joints, turns, strict=True):
        origin = origin + rotation @ joint.position_in_parent
        rotation = rotation @ turn
        positions.append(np.einsum("fij,mj->fmi", rotation, POINTS) + origin[:, None])
    return skeleton, np.concatenate(positions, axis=1), (angles[:, :3], angles[:, 3:4], angles[:, 4:])


@pytest.mark.parametrize("method", METHODS)
def test_exact_markers_give_the_true_angles(arm, method):
    skeleton, positions, angles = arm
    posture = solve(skeleton, positions, method=method)
    for found, true in zip(posture.angles, angles, strict=True):
        np.testing.assert_allclose(found, true, atol=1e-5)
    assert posture.limb_seen.all()
    np.testing.assert_allclose(posture.joint_positions, posture.world_from_limb[:, :, :3, 3][:, 1:], atol=0)
    np.testing.assert_allclose(posture.joint_positions[:, 0], np.tile([0.0, 0, 300], (N_FRAMES, 1)), atol=1e-3)


def test_joints_that_are_held_to_their_types_share_what_that_costs(arm):
    """What lies behind the hinge is turned across its axis by 0.03 rad, the last limb by 9 mm; half is left."""
    skeleton, positions, _ = arm
    true = solve(skeleton, positions).world_from_limb
    wobbling = true.copy()
    bent = true[:, 2, :3, :3] @ matrix_from_vector(0.03 * Y) @ true[:, 2, :3, :3].swapaxes(1, 2)
    wobbling[:, 2:, :3, :3] = bent[:, np.newaxis] @ true[:, 2:, :3, :3]
    away = true[:, 2:, :3, 3] - true[:, 2:3, :3, 3]
    wobbling[:, 2:, :3, 3] = true[:, 2:3, :3, 3] + np.einsum("fij,flj->fli", bent, away)
    held = hold_joints(skeleton, wobbling)
    turn = held[:, 1, :3, :3].swapaxes(1, 2) @ held[:, 2, :3, :3]
    np.testing.assert_allclose(turn @ X, np.tile(X, (N_FRAMES, 1)), atol=1e-9)
    before, after = (np.linalg.norm((one - wobbling)[:, 3, :3, 3], axis=1).mean() for one in (true, held))
    assert after < before / 2


def test_one_frame_is_a_take_of_one_frame(arm):
    skeleton, positions, angles = arm
    np.testing.assert_allclose(solve(skeleton, positions[3]).angles[1][0], angles[1][3], atol=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_intervals_of_angles_and_joints_hold_the_truth(arm, method):
    skeleton, positions, angles = arm
    exact = solve(skeleton, positions)
    held = {}
    for seed in range(3):
        noisy = positions + np.random.default_rng(seed).normal(size=positions.shape) * NOISE
        posture = solve(skeleton, noisy, method=method)
        for joint, (found, std, true) in enumerate(zip(posture.angles, posture.angle_std, angles, strict=True)):
            held.setdefault(f"angles {joint}", []).append(np.abs(found - true) <= 1.96 * std)
        gaps = np.abs(posture.joint_positions - exact.joint_positions)[:, [0, 2]]  # a hinge's is told across its axis
        held.setdefault("joints", []).append(gaps <= 1.96 * posture.joint_std[:, [0, 2]])
    for what, parts in held.items():
        assert COVERED[0] <= np.concatenate(parts).mean() <= COVERED[1], what


def test_whole_chain_is_nearer_than_root_outward(arm):
    skeleton, positions, angles = arm
    noisy = positions + np.random.default_rng(2).normal(size=positions.shape)
    errors = [np.abs(solve(skeleton, noisy, method=one).angles[2] - angles[2]).mean() for one in METHODS]
    assert errors[0] < errors[1]


def test_limb_with_one_marker_is_posed_where_its_joint_allows(arm):
    skeleton, positions, angles = arm
    few = positions.copy()
    few[:, 9:12] = np.nan  # three of the four markers beyond the hinge
    few[:, 12:] = np.nan
    posture = solve(skeleton, few)
    np.testing.assert_allclose(posture.angles[1], angles[1], atol=1e-4)
    assert np.isfinite(posture.angle_std[2]).all()


def test_unseen_limb_is_marked_and_uncertain(arm):
    skeleton, positions, _ = arm
    hidden = positions.copy()
    hidden[:, 12:] = np.nan
    posture = solve(skeleton, hidden)
    assert not posture.limb_seen[:, 3].any()
    assert (posture.angle_std[2] > 0.5).all()
    assert np.isfinite(posture.world_from_limb).all()


def test_masked_markers_are_unseen(arm):
    skeleton, positions, _ = arm
    masked = np.ma.array(positions, mask=False)
    masked[:, 12:] = np.ma.masked
    np.testing.assert_array_equal(solve(skeleton, masked).limb_seen[:, 3], False)


def test_frame_without_markers_is_refused(arm):
    skeleton, positions, _ = arm
    empty = positions[:3].copy()
    empty[1] = np.nan
    with pytest.raises(InputError, match="frame 1 shows no marker"):
        solve(skeleton, empty)


def test_unknown_method_is_refused(arm):
    with pytest.raises(InputError, match="there are whole-chain, root-outward"):
        solve(arm[0], arm[1], method="magic")


def test_rigid_joint_has_no_angle():
    joint = Joint(0, 1, np.zeros(3), np.zeros(3), "rigid", None, np.zeros(3))
    assert joint_angles(joint, np.tile(np.eye(3), (5, 1, 1))).shape == (5, 0)


@pytest.mark.parametrize("method", METHODS)
def test_live_frames_are_those_of_the_take(arm, method):
    skeleton, positions, _ = arm
    live = LiveSkeleton(skeleton, method=method)
    whole = solve(skeleton, positions[:20], method=method)
    for frame in range(20):
        seen = live.see(positions[frame])
        np.testing.assert_allclose(seen.world_from_limb[0], whole.world_from_limb[frame], atol=1e-5)
        np.testing.assert_allclose(seen.angle_std[1][0], whole.angle_std[1][frame], rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_hidden_limb_keeps_its_angle_live(arm, method):
    skeleton, positions, angles = arm
    live = LiveSkeleton(skeleton, method=method)
    live.see(positions[0])
    hidden = positions[1].copy()
    hidden[12:] = np.nan  # all beyond the universal joint
    posture = live.see(hidden)
    np.testing.assert_allclose(posture.angles[2][0], angles[2][0], atol=1e-5)
    np.testing.assert_allclose(posture.angles[1][0], angles[1][1], atol=1e-4)
    assert not posture.limb_seen[0, 3]
    assert (posture.angle_std[2][0] > 0.5).all()


def test_frame_without_markers_holds_the_skeleton_still(arm):
    skeleton, positions, _ = arm
    live = LiveSkeleton(skeleton)
    with pytest.raises(InputError, match="first frame shows no marker"):
        live.see(np.full_like(positions[0], np.nan))
    before = live.see(positions[0])
    after = live.see(np.full_like(positions[0], np.nan))
    np.testing.assert_allclose(after.world_from_limb, before.world_from_limb, atol=1e-9)
    assert not after.limb_seen.any()
    assert after.joint_std.min() > 100  # mm


def test_root_with_two_markers_is_found_by_the_others(arm):
    """Live, a root that its markers do not fix starts as it was, and the chain turns it."""
    skeleton, positions, _ = arm
    live = LiveSkeleton(skeleton, method="whole-chain")
    live.see(positions[0])
    few = positions[1].copy()
    few[2:4] = np.nan
    np.testing.assert_allclose(live.see(few).world_from_limb, solve(skeleton, positions[1]).world_from_limb, atol=1e-3)


def test_motion_computes_the_angles_of_inverse_kinematics(arm):
    skeleton, positions, angles = arm
    posture = solve(skeleton, positions)
    motion = Motion(
        world_from_limb=posture.world_from_limb,
        joint_positions=posture.joint_positions,
        marker_positions=positions,
        residuals=np.zeros(positions.shape[:2]),
        limb_seen=posture.limb_seen,
        rate=100.0,
        compute_angles=MotionAngles(skeleton, positions),
    )
    assert [joint.names for joint in motion.joint_angles] == [("x", "y", "z"), ("turn",), ("first", "second")]
    for joint, true, wanted in zip(motion.joint_angles, angles, posture.angle_std, strict=True):
        np.testing.assert_allclose(joint.values, true, atol=1e-5)
        np.testing.assert_allclose(joint.std, wanted)


def test_hinge_is_posed_by_markers_on_a_line_through_its_joint(arm):
    """Markers beyond the hinge lie on one line with it, which is not its axis: they tell its angle."""
    skeleton, _, angles = arm
    tree = SkeletonTree(skeleton, 0, None)
    places = np.array([[0.0, 0, 100], [0, 0, 250]])
    offsets = np.concatenate([tree.chain.offsets[:8], places])
    chain = Chain(tree.chain.parents[:3], np.repeat([0, 1, 2], [4, 4, 2]), tree.chain.joints[:3], offsets)
    outer = matrix_from_vector(angles[0]) @ matrix_from_vector(angles[1] * X)
    rotations = np.stack([np.tile(np.eye(3), (N_FRAMES, 1, 1)), matrix_from_vector(angles[0]), outer], axis=1)
    positions = ChainPoses(np.zeros((N_FRAMES, 3)), rotations).markers(chain)
    poses, fixed = pose_outward(chain, positions, joints=KnownJoints(tree.articulation))
    assert fixed.all()
    np.testing.assert_allclose(poses.rotations, rotations, atol=1e-6)
    assert not pose_outward(chain, positions)[1][:, 2].any()
