"""Chains and poses taken straight from a simulated truth."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.simulation import find_structure, simulate


@pytest.fixture(scope="session")
def true_chain():
    """A structure as a chain with its true poses: `.chain`, `.poses`, `.positions` as measured, `.truth`."""

    def make(name: str, seed: int = 0, **options: float) -> SimpleNamespace:
        structure, case = find_structure(name, seed), simulate(name, seed=seed, **options)
        joints = np.array([limb.joint for limb in structure.limbs])
        joints[0] = 0.0
        chain = Chain(structure.parents, structure.limb_of_marker, joints, structure.marker_offsets)
        world = case.truth.world_from_limb
        poses = ChainPoses(world[:, 0, :3, 3].copy(), world[:, :, :3, :3].copy())
        return SimpleNamespace(chain=chain, poses=poses, positions=case.take.positions, truth=case.truth)

    return make


@pytest.fixture(scope="session")
def random_poses():
    """`random_poses(n_frames, seed)`: world_from_body, shape (n_frames, 4, 4), turned and moved at will."""

    def make(n_frames: int, seed: int) -> np.ndarray:
        random = np.random.default_rng(seed)
        poses = np.tile(np.eye(4), (n_frames, 1, 1))
        poses[:, :3, :3] = matrix_from_vector(random.normal(size=(n_frames, 3)))
        poses[:, :3, 3] = random.normal(size=(n_frames, 3)) * 1000
        return poses

    return make


@pytest.fixture(scope="session")
def joined_bodies(random_poses):
    """Two bodies that share a point: `joined_bodies(turns [rad], at_first, at_second, seed)` gives both's poses."""

    def make(turns: np.ndarray, at_first: np.ndarray, at_second: np.ndarray, seed: int = 0):
        first = random_poses(len(turns), seed)
        second = first.copy()
        second[:, :3, :3] = first[:, :3, :3] @ matrix_from_vector(turns)
        joint = first[:, :3, :3] @ at_first + first[:, :3, 3]
        second[:, :3, 3] = joint - second[:, :3, :3] @ at_second
        return first, second

    return make
