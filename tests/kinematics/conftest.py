"""Chains and poses taken straight from a simulated truth."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from skelgen.geometry.orientation import fit_transform
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics import pose_covariance
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.model import Poses
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


MARKERS = (
    np.array([[50.0, 0, 40], [-50, 20, -40], [0, -60, 10], [0, 40, -10]]),
    np.array([[40.0, 10, 60], [-40, 30, -50], [0, -50, -10], [0, 10, 0]]),
)
JOINT_AT = (np.array([30.0, -20, 150]), np.array([-20.0, 10, -170]))
FIRST_AXIS, SECOND_AXIS = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
REST = matrix_from_vector(np.array([0.3, 0.5, -0.2]))


@pytest.fixture(scope="session")
def tracked_joint():
    """Two bodies with four markers each, joined at a point, tracked with noise.

    `tracked_joint(kind, seed, noise [mm], degrees, n_frames)` gives `.poses` (bodies ``upper`` and ``lower``),
    `.covariances` of both, and the truth: `.in_parent`, `.in_child` [mm], `.first` axis in the parent, `.second` axis
    in the child, `.angles` [rad]. Each angle swings by +-`degrees` as a sine of its own.
    """

    def make(kind: str, seed: int = 0, noise: float = 1.0, degrees: float = 20.0, n_frames: int = 200):
        random = np.random.default_rng(seed)
        angles = np.deg2rad(degrees) * _waves(random, 3, n_frames)
        turn = {
            "ball": matrix_from_vector(angles),
            "hinge": matrix_from_vector(angles[:, :1] * FIRST_AXIS),
            "universal": matrix_from_vector(angles[:, :1] * FIRST_AXIS)
            @ matrix_from_vector(angles[:, 1:2] * SECOND_AXIS),
            "rigid": np.tile(np.eye(3), (n_frames, 1, 1)),
        }[kind]
        upper, lower = np.tile(np.eye(4), (2, n_frames, 1, 1))
        upper[:, :3, :3] = matrix_from_vector(_waves(random, 3, n_frames))
        upper[:, :3, 3] = 300 * _waves(random, 3, n_frames)
        lower[:, :3, :3] = upper[:, :3, :3] @ turn @ REST
        lower[:, :3, 3] = upper[:, :3, :3] @ JOINT_AT[0] + upper[:, :3, 3] - lower[:, :3, :3] @ JOINT_AT[1]
        bodies = [_tracked(random, body, points, noise) for body, points in zip((upper, lower), MARKERS, strict=True)]
        return SimpleNamespace(
            poses=Poses(np.stack(bodies, axis=1), ("upper", "lower"), 30.0),
            covariances=np.stack([pose_covariance(points, max(noise, 1e-6)) for points in MARKERS]),
            in_parent=JOINT_AT[0],
            in_child=JOINT_AT[1],
            first=FIRST_AXIS,
            second=REST.T @ (FIRST_AXIS if kind == "hinge" else SECOND_AXIS),
            rotations=turn @ REST,
            angles=angles,
        )

    return make


def _waves(random, n, n_frames):
    times = np.arange(n_frames)[:, None] / 30
    return np.sin(2 * np.pi * random.uniform(0.2, 1.0, n) * times + random.uniform(0, 2 * np.pi, n))


def _tracked(random, body, points, noise):
    positions = np.einsum("fij,nj->fni", body[:, :3, :3], points) + body[:, None, :3, 3]
    positions += noise * random.normal(size=positions.shape)
    return fit_transform(points, positions, np.ones(positions.shape[:2], dtype=bool))
