"""Bends of joints, and markers that slide with them."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.chain.chain import ChainPoses
from skelgen.kinematics.soft_tissue.model import soft_tissue_at_rest


@pytest.fixture(scope="module")
def tree(true_chain):
    return true_chain("tree:8", n_frames=300)


def test_bends_have_mean_square_one_and_those_of_a_joint_do_not_go_together(tree):
    tissue = soft_tissue_at_rest(tree.chain, tree.poses)
    flexions = tissue.flexions(tree.chain, tree.poses)
    for joint in range(1, tree.chain.n_limbs):
        own = flexions[:, tissue.joints == joint]
        np.testing.assert_allclose(own.T @ own / len(own), np.eye(own.shape[1]), atol=1e-9)


def test_hinges_bend_in_one_way_and_balls_in_three(tree):
    """Rotation vectors of a universal joint leave the plane of its axes when it flexions far."""
    tissue = soft_tissue_at_rest(tree.chain, tree.poses)
    fewest, most = ({"ball": 3, "universal": two, "hinge": 1} for two in (2, 3))
    for kind, limb in zip(tree.truth.joint_kinds, tree.truth.edges[:, 1], strict=True):
        assert fewest[kind] <= (tissue.joints == limb).sum() <= most[kind]


def test_markers_may_follow_the_joints_of_their_limb_only(tree):
    tissue = soft_tissue_at_rest(tree.chain, tree.poses)
    reach = tissue.reach(tree.chain)
    for limb in range(tree.chain.n_limbs):
        children = np.flatnonzero(tree.chain.parents == limb)
        assert set(tissue.joints[reach[limb]]) == {int(one) for one in (limb, *children) if one}


def test_still_joints_carry_no_displacements(true_chain):
    case = true_chain("tree:8", n_frames=100, motion_range=0.01)
    assert not len(soft_tissue_at_rest(case.chain, case.poses).joints)


def test_displacements_are_slopes_times_bends_in_the_limbs_axes(tree):
    random = np.random.default_rng(0)
    at_rest = soft_tissue_at_rest(tree.chain, tree.poses)
    tissue = at_rest.with_slopes(random.normal(size=at_rest.slopes.shape))
    displacements, flexions = tissue.displacements(tree.chain, tree.poses), tissue.flexions(tree.chain, tree.poses)
    for frame, marker in ((0, 0), (7, 5), (299, -1)):
        limb = tree.chain.limb_of_marker[marker]
        local = tissue.slopes[marker] @ flexions[frame]
        np.testing.assert_allclose(displacements[frame, marker], tree.poses.rotations[frame, limb] @ local)


def test_displacements_are_the_same_whatever_the_limbs_frames(tree):
    chain, poses, random = tree.chain, tree.poses, np.random.default_rng(1)
    at_rest = soft_tissue_at_rest(chain, poses)
    tissue = at_rest.with_slopes(random.normal(size=at_rest.slopes.shape))
    turn = matrix_from_vector(random.normal(size=(chain.n_limbs, 3)))
    turned = ChainPoses(poses.root, poses.rotations @ turn.swapaxes(1, 2))
    displacements = tissue.turned(chain, turn).displacements(chain, turned)
    np.testing.assert_allclose(displacements, tissue.displacements(chain, poses), atol=1e-9)
