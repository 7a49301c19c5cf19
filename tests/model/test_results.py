"""Limbs, topology, skeleton and motion: checked when made, derived values that follow."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.model import Joint, Limbs, Skeleton, Topology
from skelgen.model.topology import outward_order


def test_limbs_know_their_markers():
    limbs = Limbs([0, 1, -1, 1], np.zeros((4, 4)))
    assert (limbs.n_limbs, limbs.n_markers) == (2, 4)
    assert [limbs.markers_of(limb).tolist() for limb in (0, 1)] == [[0], [1, 3]]


def test_markers_that_are_all_left_out_make_no_limb():
    assert Limbs([-1, -1], np.zeros((2, 2))).n_limbs == 0


@pytest.mark.parametrize("labels", [[0, 2], [1, 1], [-2, 0]])
def test_limbs_numbered_with_holes_are_refused(labels):
    with pytest.raises(InputError, match="numbered from 0 without holes"):
        Limbs(labels, np.zeros((2, 2)))


def test_deviations_of_other_markers_are_refused():
    with pytest.raises(InputError, match="distance_deviation has shape"):
        Limbs([0, 0], np.zeros((3, 3)))


def tree(parents, n_frames=4):
    n_limbs, n_joints = len(parents), int((np.array(parents) >= 0).sum())
    none = np.zeros(n_joints)
    return Topology(
        parents, np.zeros((n_limbs, n_limbs)), np.zeros((n_frames, n_joints, 3)), none.astype(int), none, 0.1
    )


def test_joints_are_listed_from_the_root_outward():
    topology = tree([2, 0, -1, 0, 2])
    assert topology.roots.tolist() == [2]
    assert topology.children.tolist() == [0, 4, 1, 3]
    assert topology.edges.tolist() == [[2, 0], [2, 4], [0, 1], [0, 3]]


def test_trees_may_be_several():
    topology = tree([-1, 0, -1, 2])
    assert topology.roots.tolist() == [0, 2]
    assert topology.n_joints == 2


@pytest.mark.parametrize("parents", [[1, 0], [-1, 2, 1], [0]])
def test_cycles_are_refused(parents):
    with pytest.raises(InputError, match="cycle"):
        tree(parents)


@pytest.mark.parametrize("parents", [[-1, 2], [-2, 0]])
def test_parents_that_are_no_limb_are_refused(parents):
    with pytest.raises(InputError, match="names no limb"):
        tree(parents)


def test_raw_positions_of_other_joints_are_refused():
    topology = tree([-1, 0])
    with pytest.raises(InputError, match="raw_joint_positions has shape"):
        dataclasses.replace(topology, raw_joint_positions=np.zeros((4, 2, 3)))


def test_random_trees_are_walked_parents_first():
    random = np.random.default_rng(0)
    for _ in range(20):
        new_number = random.permutation(12)
        parents = np.full(12, -1)
        for limb in range(1, 12):
            parents[new_number[limb]] = new_number[random.integers(limb)]
        order = outward_order(parents).tolist()
        assert sorted(order) == list(range(12))
        assert all(parents[limb] < 0 or order.index(parents[limb]) < order.index(limb) for limb in order)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"kind": "knee"}, "types are ball, universal, hinge, rigid"),
        ({"std": [np.nan, 0, 0]}, "std"),
        ({"axis": [1.0]}, "axis"),
    ],
)
def test_bad_joints_are_refused(change, sentence):
    joint = Joint(0, 1, np.zeros(3), np.zeros(3), "hinge", np.array([0, 0, 1.0]), np.zeros(3))
    with pytest.raises(InputError, match=sentence):
        dataclasses.replace(joint, **change)


def test_joints_in_another_order_are_refused(small_project):
    skeleton = small_project.skeleton
    with pytest.raises(InputError, match="from the root outward"):
        dataclasses.replace(skeleton, joints=skeleton.joints[::-1])


def test_lengths_are_between_the_joints_of_one_limb(small_project):
    skeleton = small_project.skeleton  # limbs 0 and 2 hang on limb 1
    gap = skeleton.joints[0].position_in_parent - skeleton.joints[1].position_in_parent
    assert skeleton.lengths == {(0, 1): pytest.approx(np.linalg.norm(gap))}
    assert skeleton.limb_of_length((0, 1)) == 1


def test_joints_of_a_limb_are_at_their_place_in_it(small_project):
    skeleton = small_project.skeleton
    assert [index for index, _ in skeleton.joints_of(1)] == [0, 1]
    ((index, place),) = skeleton.joints_of(2)
    assert index == 1
    np.testing.assert_array_equal(place, np.zeros(3))


def test_arrays_of_results_are_read_only(small_project):
    values = (small_project.limbs, small_project.topology, small_project.skeleton, small_project.motion)
    arrays = [getattr(value, field.name) for value in values for field in dataclasses.fields(value)]
    arrays += [joint.position_in_parent for joint in small_project.skeleton.joints]
    arrays = [array for array in arrays if isinstance(array, np.ndarray)]
    assert len(arrays) > 12
    assert not any(array.flags.writeable for array in arrays)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"world_from_limb": np.full((12, 3, 4, 4), np.nan)}, "world_from_limb holds values that are not finite"),
        ({"joint_positions": np.zeros((11, 2, 3))}, "joint_positions has shape"),
        ({"residuals": np.zeros((12, 3))}, "residuals has shape"),
        ({"limb_seen": np.ones((12, 2), dtype=bool)}, "limb_seen has shape"),
    ],
)
def test_incomplete_motion_is_refused(small_project, change, sentence):
    with pytest.raises(InputError, match=sentence):
        dataclasses.replace(small_project.motion, **change)


def test_motion_knows_its_times_and_rotations(small_project):
    motion = small_project.motion
    np.testing.assert_allclose(motion.times, np.arange(12) / 100)
    np.testing.assert_array_equal(motion.rotations, motion.world_from_limb[:, :, :3, :3])


def test_a_marker_on_a_limb_without_a_place_on_it_is_refused():
    offsets = np.array([[1.0, 2.0, np.nan], [np.nan] * 3])
    with pytest.raises(InputError, match="markers on limbs must be finite"):
        Skeleton([-1], (), [0, -1], offsets, np.zeros(2), np.eye(4)[np.newaxis])
