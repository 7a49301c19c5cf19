"""Kinematic loops: gaps follow poses and constants as stated; poses that are fitted keep them closed."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import ChainPoses, observed
from skelgen.kinematics.inverse.loop_closure import KinematicLoops, fit_closed_poses

STEP = 1e-5  # mm and rad; central differences err by its square


@pytest.fixture
def loop(true_chain):
    """The human's hands at one point of both, in 5 frames."""
    case = true_chain("human", n_frames=5)
    leaves = [limb for limb in range(case.chain.n_limbs) if not (case.chain.parents == limb).any()]
    places = np.array([[[10.0, -20.0, 30.0], [-5.0, 15.0, 40.0]]])
    return case, KinematicLoops(np.array([leaves[-2:]]), places)


def test_gaps_follow_the_poses_as_their_slopes_say(loop):
    case, loops = loop
    by_pose, _ = loops.slopes(case.chain, case.poses)
    for column in np.random.default_rng(0).choice(by_pose.shape[2], 12, replace=False):
        step = np.zeros((5, by_pose.shape[2]))
        step[:, column] = STEP
        after, before = (loops.gaps(case.chain, case.poses.stepped(sign * step)) for sign in (1, -1))
        slope = (after - before).reshape(5, -1) / (2 * STEP)
        np.testing.assert_allclose(by_pose[:, :, column], slope, atol=1e-4)


def test_gaps_follow_joints_and_places_as_their_slopes_say(loop):
    case, loops = loop
    _, by_constants = loops.slopes(case.chain, case.poses)
    n_joints = case.chain.n_limbs - 1
    for column in range(by_constants.shape[2]):
        change = np.zeros(by_constants.shape[2])
        change[column] = 1.0  # mm; gaps are linear in both
        joints = case.chain.joints.copy()
        joints[1:] += change[: 3 * n_joints].reshape(-1, 3)
        moved = loops.moved(change[3 * n_joints :]).gaps(case.chain.moved(joints, case.chain.offsets), case.poses)
        slope = (moved - loops.gaps(case.chain, case.poses)).reshape(5, -1)
        np.testing.assert_allclose(by_constants[:, :, column], slope, atol=1e-9)


def test_points_that_coincide_are_found(true_chain):
    case = true_chain("rods")
    pairs = np.array([[0, 2]])  # joined in the tree: a loop of two limbs
    loops = KinematicLoops.of_poses(pairs, case.chain, case.poses)
    assert loops.gap(case.chain, case.poses)[0] < 1e-3


def test_fitted_poses_close_the_ring(true_chain):
    """Rods that are bent until the ends of the last two meet, from poses where they do not."""
    case = true_chain("rods", n_frames=20)
    free = Articulation.free(case.chain.n_limbs)
    meeting = KinematicLoops(np.array([[1, 2]]), case.chain.offsets[[3, 6]].reshape(1, 2, 3))
    fitted = fit_closed_poses(observed(case.chain, free, case.poses, case.positions), meeting)
    assert meeting.gap(case.chain, fitted)[0] < 0.01 * meeting.gap(case.chain, case.poses)[0]
    assert np.isfinite(fitted.rotations).all()


def test_closed_poses_of_a_ring_that_holds_are_the_true_ones(true_chain):
    case = true_chain("rods", n_frames=20)
    free = Articulation.free(case.chain.n_limbs)
    joined = KinematicLoops.of_poses(np.array([[0, 1]]), case.chain, case.poses)
    shaken = matrix_from_vector(np.random.default_rng(1).normal(size=(20, case.chain.n_limbs, 3)) * 0.05)
    start = ChainPoses(case.poses.root + 5.0, shaken @ case.poses.rotations)
    fitted = fit_closed_poses(observed(case.chain, free, start, case.positions), joined)
    np.testing.assert_allclose(fitted.rotations, case.poses.rotations, atol=1e-5)
