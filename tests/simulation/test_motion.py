"""The motion obeys the joints: what is rigid stays rigid, hinges keep their axis, joints coincide in both limbs."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.simulation import Truth, find_structure, simulate

NAMES = ["rods", "human", "classic-human", "quadruped", "tree:12"]
ROUNDING = 1e-9  # mm: metres of 1e3 mm in double precision, through a chain of a dozen rotations
N_FRAMES = 120


def in_world(truth: Truth, limbs: np.ndarray, positions: np.ndarray) -> np.ndarray:
    poses = truth.world_from_limb[:, limbs]
    return (poses[..., :3, :3] @ positions[..., None])[..., 0] + poses[..., :3, 3]


@pytest.mark.parametrize("name", NAMES)
def test_a_joint_is_at_one_place_in_both_limbs(name: str) -> None:
    truth = simulate(name, n_frames=N_FRAMES, seed=4).truth
    from_parent = in_world(truth, truth.edges[:, 0], truth.positions_in_parent)
    from_child = in_world(truth, truth.edges[:, 1], truth.positions_in_child)
    assert np.abs(from_parent - truth.joint_positions).max() < ROUNDING
    assert np.abs(from_child - truth.joint_positions).max() < ROUNDING


@pytest.mark.parametrize("name", NAMES)
def test_markers_of_one_limb_keep_their_distances(name: str) -> None:
    truth = simulate(name, n_frames=N_FRAMES, seed=4).truth
    for limb in range(truth.n_limbs):
        markers = truth.marker_positions[:, truth.limb_of_marker == limb]
        distances = np.linalg.norm(markers[:, :, None] - markers[:, None], axis=3)
        assert np.ptp(distances, axis=0).max() < ROUNDING


@pytest.mark.parametrize("name", NAMES[1:])  # rods have no hinge
def test_a_hinge_keeps_its_axis_in_both_limbs(name: str) -> None:
    truth = simulate(name, n_frames=N_FRAMES, seed=4).truth
    hinges = [index for index, kind in enumerate(truth.joint_kinds) if kind == "hinge"]
    assert hinges
    for joint in hinges:
        for limb in truth.edges[joint]:
            turns = truth.world_from_limb[:, limb, :3, :3]
            in_limb = (turns.swapaxes(1, 2) @ truth.joint_axes[:, joint, :, None])[..., 0]
            assert np.ptp(in_limb, axis=0).max() < ROUNDING


@pytest.mark.parametrize("name", ["human", "quadruped", "tree:12"])
def test_the_two_axes_of_a_universal_joint_keep_their_angle(name: str) -> None:
    structure, truth = find_structure(name, seed=4), simulate(name, n_frames=N_FRAMES, seed=4).truth
    universal = [index for index, kind in enumerate(truth.joint_kinds) if kind == "universal"]
    assert universal
    for joint in universal:
        child = truth.edges[joint, 1]
        second = truth.world_from_limb[:, child, :3, :3] @ structure.limbs[child].axes[1]
        assert np.ptp((second * truth.joint_axes[:, joint]).sum(axis=1)) < ROUNDING


@pytest.mark.parametrize("name", NAMES)
def test_every_joint_is_exercised(name: str) -> None:
    truth = simulate(name, n_frames=1000, seed=4).truth
    parents, children = truth.edges.T
    turns = truth.world_from_limb[:, parents, :3, :3].swapaxes(2, 3) @ truth.world_from_limb[:, children, :3, :3]
    from_start = np.clip((np.trace(turns[0].swapaxes(1, 2) @ turns, axis1=2, axis2=3) - 1) / 2, -1, 1)
    assert np.rad2deg(np.arccos(from_start)).max(axis=0).min() > 20


def test_the_motion_is_smooth() -> None:
    positions = simulate("human", n_frames=500, seed=0).truth.marker_positions
    fastest = np.linalg.norm(np.diff(positions, axis=0), axis=2).max() * 100 / 1000
    assert fastest < 10  # m/s: a hand in a brisk swing


def test_no_motion_range_leaves_the_joints_still() -> None:
    truth = simulate("human", n_frames=20, motion_range=0.0).truth
    root_from_world = np.linalg.inv(truth.world_from_limb[:, :1])
    assert np.ptp(root_from_world @ truth.world_from_limb, axis=0).max() < ROUNDING


def test_the_root_stays_within_its_walk() -> None:
    truth = simulate("human", n_frames=2000, walk=500.0).truth
    assert np.abs(truth.world_from_limb[:, 0, :2, 3]).max() <= 500
