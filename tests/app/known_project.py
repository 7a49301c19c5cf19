"""A project whose every result is known, because it is made from the poses rather than found."""

from __future__ import annotations

import numpy as np

from skelgen.model import Joint, Limbs, Motion, Project, Skeleton, StageReport, Topology, Trajectories

STAGES = ("labels", "limbs", "joints", "skeleton")
N_FRAMES = 120
RATE = 60.0
PARENTS = np.array([-1, 0, 1, 0])  # a root with an arm of two limbs and a single limb
JOINT_AT = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 300.0], [0.0, 0.0, 250.0], [200.0, 0.0, 0.0]])  # in the parent, mm
CORNERS = np.array([[40.0, 0.0, 80.0], [-40.0, 10.0, 100.0], [0.0, 50.0, 120.0]])  # markers on each limb, mm
NAMES = ("C7", "<script>alert(1)</script>", 'LSHO" onload="x', "a&b", *(f"M{index}" for index in range(4, 12)))


def swing(n_frames, axis, phase):
    """Rotations about one axis that swing back and forth: shape (n_frames, 3, 3)."""
    angles = 0.7 * np.sin(np.linspace(0.0, 9.0, n_frames) + phase)
    cross = np.cross(np.eye(3), np.eye(3)[axis])
    return np.eye(3) + np.sin(angles)[:, None, None] * cross + (1 - np.cos(angles))[:, None, None] * cross @ cross


def moved(n_frames):
    """Poses of the four limbs by forward kinematics, shape (n_frames, 4, 4, 4); frame 0 is not special."""
    poses = np.tile(np.eye(4), (n_frames, len(PARENTS), 1, 1))
    for limb, parent in enumerate(PARENTS):
        above = poses[:, parent] if parent >= 0 else np.tile(np.eye(4), (n_frames, 1, 1))
        poses[:, limb, :3, :3] = above[:, :3, :3] @ swing(n_frames, limb % 3, float(limb))
        poses[:, limb, :3, 3] = above[:, :3, 3] + above[:, :3, :3] @ JOINT_AT[limb]
    return poses


def carried(poses, offsets):
    return np.einsum("flij,lmj->flmi", poses[..., :3, :3], offsets) + poses[:, :, np.newaxis, :3, 3]


def build_project(until="skeleton", noise=0.5, n_frames=N_FRAMES, names=NAMES):
    """A project whose every result is known, because it is made from the poses rather than found."""
    rng = np.random.default_rng(0)
    poses = moved(n_frames)
    rigid = carried(poses, np.tile(CORNERS, (4, 1, 1))).reshape(n_frames, 12, 3)
    measured = rigid + noise * rng.normal(size=rigid.shape)
    measured[10:20, 3] = np.nan
    take = Trajectories(measured, names, RATE, name="walk <1>.c3d", notices=("one marker was <empty>",))
    project = Project(take, seed=7).with_trajectories(take, StageReport(seconds=0.1))
    limb_of_marker = np.repeat(np.arange(4), 3)
    steps = [lambda p: p, lambda p: add_limbs(p, limb_of_marker), lambda p: add_joints(p, poses)]
    steps.append(lambda p: add_skeleton(p, poses, rigid, limb_of_marker))
    for step in steps[: STAGES.index(until) + 1]:
        project = step(project)
    return project


def add_limbs(project, limb_of_marker):
    between = project.take.positions[:, :, None] - project.take.positions[:, None]
    deviation = np.nanstd(np.linalg.norm(between, axis=3), axis=0)
    return project.with_limbs(Limbs(limb_of_marker, deviation), StageReport(seconds=0.2, notices=("4 limbs found",)))


def add_joints(project, poses):
    costs = np.array([[0, 2, 50, 3], [2, 0, 4, 60], [50, 4, 0, 90], [3, 60, 90, 0]], dtype=float)
    raw = poses[..., :3, 3][:, [1, 3, 2]].copy()
    along = (raw[:, 2] - raw[:, 0]) / 250.0  # of limb 1, whose two joints are 250 mm apart
    raw[0::2, 0] += along[0::2]  # 1 mm nearer and 1 mm farther in turn: the distance spreads by 1 mm
    raw[1::2, 0] -= along[1::2]
    topology = Topology(PARENTS, costs, raw, np.array([9, 8, 7]), np.array([2.1, 3.1, 4.1]), 0.02)
    return project.with_topology(topology, StageReport(seconds=0.3))


def add_skeleton(project, poses, rigid, limb_of_marker):
    kinds = {1: "ball", 3: "universal", 2: "hinge"}
    axis = {2: np.array([0.0, 0.0, 1.0])}
    joints = tuple(
        Joint(int(PARENTS[child]), child, JOINT_AT[child], np.zeros(3), kind, axis.get(child), np.full(3, 0.25))
        for child, kind in kinds.items()
    )
    reference = np.tile(np.eye(4), (4, 1, 1))
    for limb in (1, 2, 3):
        reference[limb, :3, 3] = reference[PARENTS[limb], :3, 3] + JOINT_AT[limb]
    offsets = np.tile(CORNERS, (4, 1))
    residuals = np.linalg.norm(project.take.positions - rigid, axis=2)
    skeleton = Skeleton(PARENTS, joints, limb_of_marker, offsets, np.nanmean(residuals, axis=0), reference)
    seen = np.ones((len(poses), 4), dtype=bool)
    motion = Motion(poses, poses[..., :3, 3][:, [1, 3, 2]], rigid, residuals, seen, RATE)
    return project.with_skeleton(skeleton, motion, StageReport(seconds=0.4))
