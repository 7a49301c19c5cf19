"""Stand-ins for the stages: what they deliver is made from the arguments alone, in no time."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from types import ModuleType
from typing import ClassVar

import numpy as np
import pytest

from skelgen.model import Joint, Labelling, Limbs, Motion, Skeleton, Topology, Trajectories
from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class _Labels(StageParameters):
    stage: ClassVar[str] = "labels"
    config_section: ClassVar[str] = "TemporalCorrespondence"
    min_range: int = declare(3, "Shortest tracklet.", unit="frames", low=1, high=100, config_name="MINRANGE")


@dataclass(frozen=True)
class _Limbs(StageParameters):
    stage: ClassVar[str] = "limbs"
    config_section: ClassVar[str] = "SpectralClustering"
    method: str = declare("plain", "How.", choices=("plain", "fancy"))


@dataclass(frozen=True)
class _Joints(StageParameters):
    stage: ClassVar[str] = "joints"
    config_section: ClassVar[str] = "JC"
    alpha: float = declare(0.1, "Weight of the mean distance.", low=0.0, high=1.0, config_name="ALPHA")


@dataclass(frozen=True)
class _Skeleton(StageParameters):
    stage: ClassVar[str] = "skeleton"
    config_section: ClassVar[str] = "LimbFrame"
    robust: bool = declare(True, "Leave outliers out.")


def _label_markers(cloud, parameters, *, n_markers=None, identities=None, seed=0, monitor=None):
    n_markers = n_markers or int(cloud.points_per_frame.min())
    positions = np.stack([frame[:n_markers] for frame in cloud])
    monitor.notice("labelled by the order of points")
    return Trajectories(positions, [f"m{i}" for i in range(n_markers)], cloud.rate, cloud.name)


def _label_with_quality(cloud, parameters, **wishes):
    markers = _label_markers(cloud, parameters, **wishes)
    return markers, _labelling(markers)


def _labelling(trajectories):
    confidence = np.where(trajectories.seen, 0.75, np.nan)
    return Labelling(confidence, (), (), np.zeros(trajectories.n_frames, dtype=int))


def _check_labels(take, parameters, *, identities=None, monitor=None):
    monitor.notice("the markers are labelled already: no exchanged labels are found")
    return take, _labelling(take)


def _find_limbs(trajectories, parameters, *, n_limbs=None, seed=0, monitor=None):
    n_markers = trajectories.n_markers
    return Limbs(np.arange(n_markers) * (n_limbs or 2) // n_markers, np.zeros((n_markers, n_markers)))


def _find_joints(trajectories, limbs, parameters, *, seed=0, n_jobs=1, monitor=None):
    n_limbs = limbs.n_limbs
    raw = np.full((trajectories.n_frames, n_limbs - 1, 3), 10.0)
    zeros = np.zeros(n_limbs - 1)
    return Topology(
        np.arange(n_limbs) - 1, np.zeros((n_limbs, n_limbs)), raw, zeros.astype(int), zeros, parameters.alpha
    )


def _fit_skeleton(trajectories, limbs, topology, parameters, *, monitor=None, are_poses=False):
    monitor.advance(1, 1)
    n_frames, n_markers, n_limbs = trajectories.n_frames, trajectories.n_markers, limbs.n_limbs
    o = np.zeros(3)
    joints = tuple(Joint(parent, child, o, o, "ball", None, o) for parent, child in topology.edges.tolist())
    pose = np.tile(np.eye(4), (n_frames, n_limbs, 1, 1))
    offsets, deviations = np.zeros((n_markers, 3)), np.zeros(n_markers)
    skeleton = Skeleton(topology.parents, joints, limbs.limb_of_marker, offsets, deviations, pose[0])
    residuals = np.where(trajectories.seen, 0.5, np.nan)
    seen = np.ones((n_frames, n_limbs), dtype=bool)
    motion = Motion(pose, topology.raw_joint_positions, trajectories.positions, residuals, seen, trajectories.rate)
    return skeleton, motion


@pytest.fixture
def stand_ins(monkeypatch):
    """Replace the four stages by ones that answer at once; the parameters' classes by stage are returned."""
    parts = {
        "labels": {
            "LabelParameters": _Labels,
            "label_with_quality": _label_with_quality,
            "check_labels": _check_labels,
        },
        "limbs": {"LimbParameters": _Limbs, "find_limbs": _find_limbs},
        "joints": {"JointParameters": _Joints, "find_joints": _find_joints},
        "skeleton": {"SkeletonParameters": _Skeleton, "fit_skeleton": _fit_skeleton},
    }
    for stage, attributes in parts.items():
        module = ModuleType(f"skelgen.stages.{stage}")
        module.__dict__.update(attributes)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return parts


@pytest.fixture
def waving():
    """Six markers on two limbs: the second swings about the origin by a radian; 20 frames at 50 Hz."""
    arm = np.array([[100.0, 0, 0], [200, 30, 0], [300, 0, 40]])
    angles = np.sin(np.linspace(0, 6, 20))
    turned = np.stack([np.stack([np.cos(a) * arm[:, 0], np.sin(a) * arm[:, 0], arm[:, 2]], 1) for a in angles])
    still = np.tile(-arm, (20, 1, 1))
    return Trajectories(np.concatenate([still, turned], axis=1), tuple("abcdef"), 50.0, name="wave.csm")
