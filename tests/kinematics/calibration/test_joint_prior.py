"""What is known of joints: it draws them back where slides of soft tissue place them out of reach."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.calibration.joint_places import joint_places, out_of_reach
from skelgen.kinematics.calibration.joint_prior import wants_joint_prior, with_joint_prior
from skelgen.kinematics.calibration.limb_errors import HingeShifts, deviations, limb_errors
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed
from skelgen.model import Limbs, Trajectories
from skelgen.stages.joints import JointConstraints, find_joints
from skelgen.stages.skeleton import fit_skeleton

PELVIS = np.array([[120.0, 0, 80], [120, 0, -80], [-120, 20, 60], [-120, 20, -60]])
TRUNK = np.array([[90.0, 380, 30], [-90, 400, 20], [0, 350, 150], [0, 420, -150]])
LUMBAR = np.array([0.0, 90.0, 0.0])
N_FRAMES = 600


def leaning_trunk():
    """A trunk on a pelvis, seen through skin: as it leans by 1 deg to the side, its skin rises by 24 mm."""
    time = np.linspace(0, 12, N_FRAMES)
    lean = np.deg2rad(1.0) * np.sin(1.7 * time)
    turns = np.stack([lean, 0.3 * lean, np.deg2rad(10.0) * np.sin(time)], axis=1)
    trunk = np.einsum("fij,mj->fmi", matrix_from_vector(turns), TRUNK - LUMBAR) + LUMBAR
    trunk[:, :, 1] += 24.0 * np.sin(1.7 * time)[:, np.newaxis]
    positions = np.concatenate([np.tile(PELVIS, (N_FRAMES, 1, 1)), trunk], axis=1)
    rng = np.random.default_rng(0)
    waves = np.sin(rng.uniform(0.5, 3, (8, 3)) * time[:, np.newaxis, np.newaxis] + rng.uniform(0, 6, (8, 3)))
    walk = matrix_from_vector(np.stack([0.2 * np.sin(0.9 * time), 0.5 * time, 0 * time], axis=1))
    return np.einsum("fij,fmj->fmi", walk, positions + 2.0 * waves) + 300.0, walk @ LUMBAR + 300.0


def test_a_joint_that_slides_place_out_of_reach_is_drawn_back():
    positions, lumbar = leaning_trunk()
    take = Trajectories(positions, [f"m{marker}" for marker in range(8)], 50.0)
    limbs = Limbs(np.repeat([0, 1], 4), np.zeros((8, 8)))
    topology = find_joints(take, limbs, constraints=JointConstraints(parents=np.array([-1, 0])))
    skeleton, motion = fit_skeleton(take, limbs, topology)
    error = np.linalg.norm(motion.joint_positions[:, 0] - lumbar, axis=1)
    assert np.median(error) < 250.0  # more than 700 mm by the data alone
    assert not skeleton.joints[0].is_determined  # its place is what was expected


@pytest.mark.parametrize("name", ["human", "rods", "quadruped"])
def test_joints_of_limbs_that_turn_are_in_reach_wherever_they_are(true_chain, name):
    case = true_chain(name, n_frames=100, noise=1.0)
    assert out_of_reach(observed(case.chain, Articulation.free(case.chain.n_limbs), case.poses, case.positions)) == []


def test_nearest_marker_and_distances_of_two_limbs():
    """The joint is 600 mm aside of the line between markers that are 200 mm apart."""
    chain = Chain(np.array([-1, 0]), np.array([0, 0, 1]), np.array([[0.0, 0, 0], [100, 600, 0]]),
                  np.array([[-50.0, 0, 0], [50, 0, 0], [100, -600, 0]]))  # fmt: skip
    still = ChainPoses(np.zeros((5, 3)), np.tile(np.eye(3), (5, 2, 1, 1)))
    fit = observed(chain, Articulation.free(2), still, still.markers(chain))
    (joint,) = joint_places(fit)
    assert joint.nearest == (1, 2) and not joint.turns.any() and not joint.has_one_axis
    assert joint.distance == pytest.approx(200.0)
    assert out_of_reach(fit) == [1]


@pytest.mark.parametrize(("turn", "is_trusted"), [(0.1, False), (0.4, True)])
def test_a_joint_far_out_is_trusted_only_where_turns_determine_it(turn, is_trusted):
    """The joint is 600 mm aside of markers that are 100 mm apart; 0.1 rad about a second axis may be skin."""
    marked, aside = np.array([[40.0, 0, 30], [-40, 0, 30], [0, 30, -30], [0, -30, 10]]), np.array([0, 0, 600.0])
    chain = Chain(np.array([-1, 0]), np.repeat([0, 1], 4), np.stack([0 * aside, aside]),
                  np.concatenate([marked, marked + np.array([0, 100, 0]) - aside]))  # fmt: skip
    time = np.linspace(0, 20, 50)
    turns = matrix_from_vector(np.stack([turn * np.sin(1.7 * time), 0 * time, 0.8 * np.sin(time)], axis=1))
    poses = ChainPoses(np.zeros((50, 3)), np.stack([np.tile(np.eye(3), (50, 1, 1)), turns], axis=1))
    fit = observed(chain, Articulation.free(2), poses, poses.markers(chain))
    assert out_of_reach(fit) == ([] if is_trusted else [1])


def test_a_hinge_far_along_its_axis_comes_back_between_its_limbs():
    """Residuals are the same wherever along its axis the hinge is; it starts 300 mm aside."""
    above = np.array([[40.0, 0, 30], [-40, 0, 30], [0, 30, -30], [40, 200, 0]])
    below = above * [1, -1, 1]
    turns = matrix_from_vector(np.stack([np.zeros(50), np.zeros(50), np.linspace(-0.6, 0.6, 50)], axis=1))
    rotations = np.stack([np.tile(np.eye(3), (50, 1, 1)), turns], axis=1)
    aside = np.array([0.0, 0, 300.0])
    chain = Chain(np.array([-1, 0]), np.repeat([0, 1], 4), np.array([[0.0, 0, 0], aside]),
                  np.concatenate([above, below - aside]))  # fmt: skip
    poses = ChainPoses(np.zeros((50, 3)), rotations)
    axes = np.tile([0.0, 0, 1], (2, 1))
    hinge = Articulation(("ball", "hinge"), axes, axes, np.zeros(2))
    fit = observed(chain, hinge, poses, poses.markers(chain))
    last = Calibration(fit.chain, fit.articulation, fit.poses, fit.positions, fit.weights, noise=1.0)
    found, growth = with_joint_prior(last, correlated=10.0)
    assert np.linalg.norm(found.chain.joints[1]) < 40.0
    assert np.abs(found.residuals).max() < 1.0
    shifts = HingeShifts(np.zeros((2, 2, 3)), np.zeros(2), np.zeros((27, 0)))
    across, other, along = deviations(limb_errors(found, shifts, growth).joint(1, 0))
    assert max(across, other) < 10.0 < along < 100.0  # mm; the limbs' middles are some 150 mm apart


def test_what_is_known_is_asked_only_where_residuals_last(true_chain):
    case = true_chain("human", n_frames=60, noise=1.0)
    fit = observed(case.chain, Articulation.free(case.chain.n_limbs), case.poses, case.positions)
    last = Calibration(fit.chain, fit.articulation, fit.poses, fit.positions, fit.weights, noise=1.0)
    assert wants_joint_prior(last, 10.0) and not wants_joint_prior(last, 1.5)


def test_the_longer_a_take_lasts_the_less_counts_what_is_known():
    """The true joint lies 60 mm beside the line between the limbs; residuals last as long in both takes."""
    marked = np.array([[40.0, 0, 30], [-40, 0, 30], [0, 30, -30], [0, -30, 10]])
    joint = np.array([0.0, 100, 60])
    chain = Chain(np.array([-1, 0]), np.repeat([0, 1], 4), np.stack([np.zeros(3), joint]),
                  np.concatenate([marked, marked - joint * [0, -1, 1]]))  # fmt: skip
    off = []
    for n_frames in (50, 1000):
        angles = 0.05 * np.sin(np.outer(np.linspace(0, 40, n_frames), [1.0, 1.4, 1.9]))
        turns = np.stack([np.tile(np.eye(3), (n_frames, 1, 1)), matrix_from_vector(angles)], axis=1)
        poses = ChainPoses(np.zeros((n_frames, 3)), turns)
        seen = poses.markers(chain) + np.random.default_rng(0).normal(0, 1.0, (n_frames, 8, 3))
        fit = observed(chain, Articulation.free(2), poses, seen)
        last = Calibration(fit.chain, fit.articulation, fit.poses, fit.positions, fit.weights, noise=1.0)
        found, _ = with_joint_prior(last, correlated=10.0)
        off.append(np.linalg.norm(found.chain.joints[1] - joint))
    assert off[0] > 10.0 and off[1] < off[0] / 3


def test_a_joint_out_of_reach_is_drawn_back_and_hinges_elsewhere_stay():
    marked = np.array([[40.0, 0, 30], [-40, 0, 30], [0, 30, -30], [0, -30, 10]])
    joints = np.array([[0.0, 0, 0], [0, 100, 0], [900, -100, 0]])
    others = (marked - joint * [1, -1, 1] for joint in joints[1:])
    chain = Chain(np.array([-1, 0, 0]), np.repeat([0, 1, 2], 4), joints, np.concatenate([marked, *others]))
    time, still = np.linspace(0, 20, 100), np.zeros(100)
    bends = np.stack([still, still, 0.5 * np.sin(time)], axis=1), np.stack([0.2 * np.sin(time), still, still], axis=1)
    turns = np.stack([np.tile(np.eye(3), (100, 1, 1)), *map(matrix_from_vector, bends)], axis=1)
    poses, axes = ChainPoses(np.zeros((100, 3)), turns), np.tile([0.0, 0, 1], (3, 1))
    fit = observed(chain, Articulation(("ball", "hinge", "ball"), axes, axes, np.zeros(3)), poses, poses.markers(chain))
    last = Calibration(fit.chain, fit.articulation, fit.poses, fit.positions, fit.weights, noise=1.0)
    assert out_of_reach(last) == [2]
    found, _ = with_joint_prior(last, 10.0, [2], others=False)
    assert out_of_reach(found) == []
    assert found.chain.joints[1] == pytest.approx(joints[1], abs=1.0)


def test_a_hinge_between_both_halves_stays_where_a_joint_of_one_is_far_off():
    """A shoulder is 300 mm from the mirror image of the other; what is known contradicts the data and is dropped."""
    marked = np.array([[40.0, 0, 30], [-40, 0, 30], [0, 30, -30], [0, -30, 10]])
    parents = np.array([-1, 0, 0, 0, 1, 2])
    joints = np.array([[0.0, 0, 0], [0, 200, 0], [0, -500, 0], [0, 0, 150], [0, 0, -250], [0, 0, -250]])
    offsets = np.array([[0.0, 0, 0], [0, 0, -100], [0, 300, -100], [0, 0, 120], [0, 0, -100], [0, 0, -100]])
    chain = Chain(parents, np.repeat(np.arange(6), 4), joints, (marked + offsets[:, np.newaxis]).reshape(-1, 3))
    time = np.linspace(0, 20, 60)
    turns = np.tile(np.eye(3), (60, 6, 1, 1))
    for limb in (1, 2, 4, 5):
        turns[:, limb] = matrix_from_vector(0.15 * np.sin(np.outer(time, [1.0, 1.3 + limb, 1.7])))
    turns[:, 3] = matrix_from_vector(np.stack([0 * time, 0.6 * np.sin(time), 0 * time], axis=1))
    poses = ChainPoses(np.zeros((60, 3)), turns)
    axes = np.tile([0.0, 1, 0], (6, 1))
    held = Articulation(("ball", "ball", "ball", "hinge", "ball", "ball"), axes, axes, np.zeros(6))
    fit = observed(chain, held, poses, poses.markers(chain) + np.random.default_rng(0).normal(0, 1, (60, 24, 3)))
    last = Calibration(fit.chain, fit.articulation, fit.poses, fit.positions, fit.weights, noise=1.0)
    found, _ = with_joint_prior(last, 1e5)
    assert np.linalg.norm(found.chain.joints[3] - joints[3]) < 30.0


def test_axes_of_limbs_that_are_one_rigid_body_do_not_come_from_rounding():
    marked = np.array([[40.0, 0, 30], [-40, 0, 30], [0, 30, -30], [0, -30, 10]])
    joints = np.array([[0.0, 0, 0], [0, 100, 20]])
    chain = Chain(np.array([-1, 0]), np.repeat([0, 1], 4), joints, np.concatenate([marked, marked * [1, 2, 1]]))
    rng, found = np.random.default_rng(0), []
    turns = matrix_from_vector(rng.normal(0, 1.0, (50, 1, 3)))
    for _ in range(2):
        noise = matrix_from_vector(rng.normal(0, 1e-12, (50, 2, 3)))  # rad
        poses = ChainPoses(np.zeros((50, 3)), turns @ noise)
        fit = observed(
            chain, Articulation(("ball", "rigid"), *np.zeros((2, 2, 3)), np.zeros(2)), poses, poses.markers(chain)
        )
        found.append(joint_places(fit)[0].axes_in_parent)
    assert np.abs((found[0] * found[1]).sum(axis=1)) == pytest.approx(np.ones(3))
