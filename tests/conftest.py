"""A small finished project with known truth, made by forward kinematics; shared by the tests of several folders."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
from collections.abc import Iterator

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model import Joint, Limbs, Motion, Project, Skeleton, StageReport, Topology, Trajectories
from skelgen.model.topology import outward_order

MARKERS_PER_LIMB = 3


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Leave what thousands of tests consist of out of every search for garbage, now and later: nothing of it ends."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run tests of the whole first, which take longest: at the end one of two processes would wait for them."""
    items.sort(key=lambda item: len(item.path.parts))


def random_rotations(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Uniform rotation matrices from normal quaternions."""
    w, x, y, z = np.moveaxis((q := rng.normal(size=(*shape, 4))) / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def forward(parents, offsets, rotations, root_positions) -> np.ndarray:
    """world_from_limb of a chain whose limb frames begin at the joint to the parent: p_child = p + R_parent offset."""
    n_frames, n_limbs = rotations.shape[:2]
    poses = np.tile(np.eye(4), (n_frames, n_limbs, 1, 1))
    poses[:, :, :3, :3] = rotations
    for limb in outward_order(parents):
        parent = parents[limb]
        if parent < 0:
            poses[:, limb, :3, 3] = root_positions
        else:
            poses[:, limb, :3, 3] = poses[:, parent, :3, 3] + rotations[:, parent] @ offsets[limb]
    return poses


@pytest.fixture(scope="session")
def make_project():
    """Make a project: limbs turn at random about joints that truly connect them; the last marker is left out.

    Every seventh frame the first marker is unseen, and the first raw joint is unknown in frame 2.
    """

    def make(parents=(1, -1, 1), n_frames=12, seed=4, rate=100.0) -> Project:  # limb 1 is the root: order differs
        rng = np.random.default_rng(seed)
        parents = np.array(parents)
        n_limbs = len(parents)
        offsets = rng.normal(size=(n_limbs, 3)) * 300
        roots = np.array([500.0, 90.0, 1100.0]) + np.cumsum(rng.normal(size=(n_frames, 3)) * 20, axis=0)
        poses = forward(parents, offsets, random_rotations(rng, n_frames, n_limbs), roots)
        still = np.tile(np.eye(3), (1, n_limbs, 1, 1))
        reference = forward(parents, offsets, still, np.array([[480.0, 80.0, 1000.0]]))[0]
        limb_of_marker = np.append(np.repeat(np.arange(n_limbs), MARKERS_PER_LIMB), -1)
        marker_offsets = rng.normal(size=(len(limb_of_marker), 3)) * 80
        marker_offsets[-1] = np.nan
        on = limb_of_marker[:-1]
        rebuilt = np.full((n_frames, len(limb_of_marker), 3), np.nan)
        rebuilt[:, :-1] = (
            np.einsum("fmij,mj->fmi", poses[:, on, :3, :3], marker_offsets[:-1]) + poses[:, :, :3, 3][:, on]
        )
        tracked = rebuilt + rng.normal(size=rebuilt.shape) * 0.3
        tracked[:, -1] = rng.normal(size=(n_frames, 3)) * 1000
        tracked[::7, 0] = np.nan
        order = outward_order(parents)
        children = order[parents[order] >= 0]
        types = np.resize(["hinge", "ball"], len(children))
        joints = tuple(
            Joint(
                parent=int(parents[child]),
                child=int(child),
                position_in_parent=offsets[child],
                position_in_child=np.zeros(3),
                kind=str(kind),
                axis=np.array([0.6, 0.0, 0.8]) if kind == "hinge" else None,
                std=np.array([0.3, 0.4, 0.5]),
                covariance=np.diag([0.09, 0.16, 0.25]),
                covariance_in_child=np.diag([0.01, 0.04, 0.09]),
                axis_std=np.array([0.01, 0.0, 0.02]) if kind == "hinge" else None,
                second_axis_std=np.array([0.03, 0.0, 0.01]) if kind == "hinge" else None,
                turn_covariance=np.diag([1e-6, 4e-6, 9e-6]),
            )
            for child, kind in zip(children, types, strict=True)
        )
        spread = rng.random(len(limb_of_marker))
        skeleton = Skeleton(parents, joints, limb_of_marker, marker_offsets, spread, reference)
        stds = {"offset_std": 0.1 * np.abs(marker_offsets), "length_std": np.full(len(skeleton.lengths), 0.7)}
        skeleton = dataclasses.replace(skeleton, marker_noise=spread, **stds)
        seen = np.ones((n_frames, n_limbs), dtype=bool)
        seen[1:2, 0] = False
        residuals = np.linalg.norm(tracked - rebuilt, axis=2)
        motion = Motion(poses, poses[:, :, :3, 3][:, children], rebuilt, residuals, seen, rate)
        raw = motion.joint_positions + rng.normal(size=motion.joint_positions.shape)
        raw[2:3, :1] = np.nan
        n_joints = len(children)
        topology = Topology(
            parents, np.zeros((n_limbs, n_limbs)), raw, np.arange(n_joints) + 20, rng.random(n_joints), 0.01
        )
        names = tuple(f"M<{index}>&" for index in range(len(limb_of_marker)))
        take = Trajectories(tracked, names, rate, name="walk & run.c3d")
        report = StageReport({"alpha": 0.01, "worst": float("nan")}, 0.25, ("one marker is left out",))
        project = Project(take, seed=7).with_trajectories(take, report)
        project = project.with_limbs(Limbs(limb_of_marker, np.zeros((len(names), len(names)))), report)
        return project.with_topology(topology, report).with_skeleton(skeleton, motion, report)

    return make


@pytest.fixture(scope="session")
def small_project(make_project) -> Project:
    """Three limbs, ten markers, twelve frames."""
    return make_project()


@pytest.fixture
def wheel_project(make_project) -> Project:
    """The same, whose first joint, a hinge, turns ten times on from 0 in 2100 frames."""
    project = make_project(n_frames=2100)
    poses, wheel = project.motion.world_from_limb.copy(), project.skeleton.joints[0]
    turns = matrix_from_vector(np.linspace(0, 20 * np.pi, len(poses))[:, np.newaxis] * wheel.axis)
    poses[:, wheel.child, :3, :3] = poses[:, wheel.parent, :3, :3] @ turns
    return dataclasses.replace(project, _motion=dataclasses.replace(project.motion, world_from_limb=poses))


@pytest.fixture
def full_disk():
    """Make every file end after some bytes, as on a disk that is full: for writers in C, too."""
    resource = pytest.importorskip("resource", reason="limits on files are known to Unix only")

    @contextlib.contextmanager
    def limit(n_bytes: int) -> Iterator[None]:
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limit
