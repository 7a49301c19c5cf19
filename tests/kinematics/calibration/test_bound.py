"""The Cramer-Rao bound: slopes that are right, freedoms that are none, fits that reach it."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.evaluation.joints import true_chain as chain_of_truth
from skelgen.kinematics.calibration.calibrate import calibrate
from skelgen.kinematics.calibration.uncertainty import cramer_rao_bound, expected_distance
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import ChainPoses, observed
from skelgen.kinematics.chain.normal_equations import frame_blocks, total_information
from skelgen.simulation import simulate

STEP = 1e-6
REACH = 1.1  # of one take's mean joint error over the bound, which scatters by some 5 % with 7 joints


@pytest.fixture(scope="module")
def tree():
    case = simulate("tree:8", seed=1, n_frames=200, noise=0.5)
    return (*chain_of_truth(case.truth), case)


def test_truth_obeys_its_joints(tree):
    chain, articulation, poses, case = tree
    np.testing.assert_allclose(poses.markers(chain), case.truth.marker_positions, atol=1e-9)
    np.testing.assert_allclose(articulation.projected(chain.parents, poses.rotations), poses.rotations, atol=1e-9)


def test_small_steps_of_the_freedoms_keep_the_joints(tree):
    chain, articulation, poses, _ = tree
    turns, _ = articulation.bases(chain.parents, poses.rotations)
    step = np.random.default_rng(0).normal(size=(len(poses.root), articulation.n_freedoms)) * 1e-4
    rotations = poses.stepped(np.einsum("fdq,fq->fd", turns, step)).rotations
    off = np.abs(articulation.projected(chain.parents, rotations) - rotations).max()
    assert off < 1e-6 < np.abs(rotations - poses.rotations).max()  # of second order


def test_axes_that_are_tilted_keep_the_joints(tree):
    chain, articulation, poses, _ = tree
    change = np.random.default_rng(0).normal(size=articulation.n_constants) * 0.1
    changed, rotations = articulation.tilted(chain.parents, poses.rotations, change)
    np.testing.assert_allclose(changed.projected(chain.parents, rotations), rotations, atol=1e-9)
    assert np.abs(changed.in_parent - articulation.in_parent).max() > 0.01


def test_axes_of_a_universal_joint_that_pass_each_other_keep_the_joint(tree):
    chain, articulation, poses, _ = tree
    limb = articulation.types.index("universal")
    change = np.zeros(articulation.n_constants)
    change[articulation.constant_columns[limb].stop - 1] = -articulation.between[limb] - 0.2
    changed, rotations = articulation.tilted(chain.parents, poses.rotations, change)
    assert changed.between[limb] == pytest.approx(0.2)
    np.testing.assert_allclose(changed.projected(chain.parents, rotations), rotations, atol=1e-9)


def test_normal_matrix_is_that_of_the_numerical_jacobian(tree):
    chain, articulation, poses, _ = tree
    some = poses[slice(0, 2)]
    here = observed(chain, articulation, some, some.markers(chain))
    n_own, n_all = articulation.n_freedoms, here.n_constants
    n_points = n_all - articulation.n_constants

    turns, _ = articulation.bases(chain.parents, some.rotations)

    def markers(own, constants):
        offsets = chain.offsets + constants[: 3 * chain.n_markers].reshape(-1, 3)
        joints = chain.joints.copy()
        joints[1:] += constants[3 * chain.n_markers : n_points].reshape(-1, 3)
        _, turned = articulation.tilted(chain.parents, some.rotations, constants[n_points:])
        moved = ChainPoses(some.root, turned).stepped(turns @ own)
        return moved.markers(chain.moved(joints, offsets)).reshape(2, -1)

    def slopes(n, function):
        unit = np.eye(n) * STEP
        return np.stack([(function(one) - function(-one)) / (2 * STEP) for one in unit], axis=-1)

    by_own = slopes(n_own, lambda own: markers(own, np.zeros(n_all)))
    by_constants = slopes(n_all, lambda constants: markers(np.zeros(n_own), constants))
    block = frame_blocks(here)
    np.testing.assert_allclose(block.own, by_own.swapaxes(1, 2) @ by_own, rtol=1e-4, atol=0.5)
    np.testing.assert_allclose(block.coupling, by_own.swapaxes(1, 2) @ by_constants, rtol=1e-4, atol=0.5)
    np.testing.assert_allclose(
        block.constants, np.einsum("frc,frd->cd", by_constants, by_constants), rtol=1e-4, atol=0.5
    )


def test_bound_lacks_only_free_frames_and_places_along_hinges(tree):
    chain, articulation, poses, case = tree
    information = total_information(observed(chain, articulation, poses, case.take.positions))
    scale = np.sqrt(np.diag(information))
    values = np.linalg.eigvalsh(information / np.outer(scale, scale))
    free = {"ball": 3, "universal": 1, "hinge": 2}
    n_free = 3 + sum(free[kind] for kind in articulation.types)  # three shifts of the root
    assert values[n_free - 1] < 1e-8 * values[-1] < values[n_free]


def test_bound_grows_with_the_noise_and_falls_with_constraints(tree):
    chain, articulation, poses, case = tree
    held = cramer_rao_bound(observed(chain, articulation, poses, case.take.positions), 0.5)
    louder = cramer_rao_bound(observed(chain, articulation, poses, case.take.positions), 1.0)
    free = cramer_rao_bound(observed(chain, Articulation.free(chain.n_limbs), poses, case.take.positions), 0.5)
    np.testing.assert_allclose(louder.distance, 2 * held.distance, rtol=1e-3)
    balls = np.array([kind == "ball" for kind in articulation.types])
    balls[0] = False  # the root has no joint
    assert (held.distance[:, balls] <= free.distance[:, balls] * (1 + 1e-6)).all()


def test_fit_of_the_whole_chain_reaches_the_bound(tree):
    chain, articulation, poses, case = tree
    bound = cramer_rao_bound(observed(chain, articulation, poses, case.take.positions), 0.5)
    found = calibrate(chain, poses, case.take.positions, articulation=articulation)
    gap = (found.poses.origins(found.chain) - poses.origins(chain))[:, 1:]
    error = np.linalg.norm(gap[:, [kind != "hinge" for kind in articulation.types[1:]]], axis=2).mean()
    smallest = bound.distance[:, [kind != "hinge" for kind in articulation.types]][:, 1:].mean()
    assert error < REACH * smallest


def test_expected_distance_is_the_mean_length_of_normal_vectors():
    random = np.random.default_rng(0)
    for root in (np.eye(3), np.diag([1.0, 0.0, 0.0]), random.normal(size=(3, 3))):
        mean = np.linalg.norm(random.normal(size=(200_000, 3)) @ root.T, axis=1).mean()
        assert expected_distance(root @ root.T) == pytest.approx(mean, rel=0.01)
    assert expected_distance(np.zeros((3, 3))) == 0.0
