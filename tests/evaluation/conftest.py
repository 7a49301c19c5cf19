"""Results made from the truth itself, so that every score is known beforehand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from skelgen.model import Joint, Limbs, Motion, PointCloud, Project, Skeleton, StageReport, Topology, Trajectories
from skelgen.simulation import SimulatedTake, Truth, simulate


def perfect_project(simulated: SimulatedTake) -> Project:
    """The result that finds exactly what is true."""
    truth, take = simulated.truth, simulated.take
    take_markers = trajectories_of_points(take, truth) if isinstance(take, PointCloud) else take
    n_markers, n_limbs, n_joints = truth.n_markers, truth.n_limbs, truth.n_joints
    costs, none = np.zeros((n_limbs, n_limbs)), np.zeros(n_joints, dtype=np.intp)
    topology = Topology(truth.parents, costs, truth.joint_positions, none, np.zeros(n_joints), 0.1)
    return (
        Project(take)
        .with_trajectories(take_markers, StageReport())
        .with_limbs(Limbs(truth.limb_of_marker, np.zeros((n_markers, n_markers))), StageReport())
        .with_topology(topology, StageReport())
        .with_skeleton(true_skeleton(truth), true_motion(truth), StageReport())
    )


def trajectories_of_points(cloud: PointCloud, truth: Truth) -> Trajectories:
    positions = np.full((truth.n_frames, truth.n_markers, 3), np.nan)
    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    real = truth.marker_of_point >= 0
    positions[frames[real], truth.marker_of_point[real]] = cloud.points[real]
    return Trajectories(positions, tuple(map(str, range(truth.n_markers))), truth.rate)


def true_skeleton(truth: Truth) -> Skeleton:
    joints = tuple(
        Joint(
            parent=int(parent),
            child=int(child),
            position_in_parent=truth.positions_in_parent[index],
            position_in_child=truth.positions_in_child[index],
            kind=truth.joint_kinds[index],
            axis=None,
            std=np.zeros(3),
        )
        for index, (parent, child) in enumerate(truth.edges)
    )
    n_markers = truth.n_markers
    reference = np.tile(np.eye(4), (truth.n_limbs, 1, 1))
    offsets = np.zeros((n_markers, 3))
    return Skeleton(truth.parents, joints, truth.limb_of_marker, offsets, np.zeros(n_markers), reference)


def true_motion(truth: Truth, joint_shift: np.ndarray | float = 0.0, marker_shift: float = 0.0) -> Motion:
    """The true motion, with joints moved by a world vector and markers moved by as much along x."""
    markers = truth.marker_positions + marker_shift * np.array([1.0, 0.0, 0.0])
    seen = np.ones((truth.n_frames, truth.n_limbs), dtype=np.bool_)
    residuals = np.zeros((truth.n_frames, truth.n_markers))
    joints = truth.joint_positions + joint_shift
    return Motion(truth.world_from_limb, joints, markers, residuals, seen, truth.rate)


@pytest.fixture(name="perfect")
def _perfect() -> Callable[[SimulatedTake], Project]:
    """`perfect_project`: build the result that finds exactly what is true."""
    return perfect_project


@pytest.fixture(name="moved")
def _moved() -> Callable[..., Motion]:
    """`true_motion`: build the true motion with stated errors."""
    return true_motion


@pytest.fixture(scope="module")
def human() -> SimulatedTake:
    """A human of 15 limbs, 40 frames, labelled, without faults."""
    return simulate("human", n_frames=40)


@pytest.fixture(scope="module")
def points() -> SimulatedTake:
    """The rods, 60 frames, as points in random order with ghosts and dropouts."""
    return simulate("rods", n_frames=60, labelled=False, ghosts=1.0, dropouts=0.1, noise=0.5)
