"""skelgen: markers in, skeleton out.

This is all that scripts need; the packages below it are for those who change skelgen::

    import skelgen
    take = skelgen.read("take.c3d")
    project = skelgen.reconstruct(take)
    skelgen.write(project, "walk.xml")

Everything is loaded at its first use, so that ``import skelgen`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from skelgen.app.batch.work import Job as Job
    from skelgen.app.bodies import split_bodies as split_bodies
    from skelgen.app.constraints import RunOptions as RunOptions
    from skelgen.app.face import calibrate_together as calibrate_together
    from skelgen.app.face import correct as correct
    from skelgen.app.face import evaluate as evaluate
    from skelgen.app.face import fill as fill
    from skelgen.app.face import load as load
    from skelgen.app.face import read as read
    from skelgen.app.face import reconstruct as reconstruct
    from skelgen.app.face import run_batch as run_batch
    from skelgen.app.files import write as write
    from skelgen.app.subject import apply_subject as apply_subject
    from skelgen.app.taking_back import take_back as take_back
    from skelgen.capture.live import MotionCapture as MotionCapture
    from skelgen.capture.simulated_rig import simulated_rig as simulated_rig
    from skelgen.errors import *  # noqa: F403 - all of them, and nothing else
    from skelgen.kinematics import LiveSkeleton as LiveSkeleton
    from skelgen.kinematics.sensor_frames import poses_from_matrices as poses_from_matrices
    from skelgen.kinematics.sensor_frames import scaled_by_fixed_sensors as scaled_by_fixed_sensors
    from skelgen.model import Identities as Identities
    from skelgen.model import Identity as Identity
    from skelgen.model import Joint as Joint
    from skelgen.model import Labelling as Labelling
    from skelgen.model import Limbs as Limbs
    from skelgen.model import Motion as Motion
    from skelgen.model import PointCloud as PointCloud
    from skelgen.model import Poses as Poses
    from skelgen.model import Project as Project
    from skelgen.model import Skeleton as Skeleton
    from skelgen.model import StageReport as StageReport
    from skelgen.model import Topology as Topology
    from skelgen.model import Trajectories as Trajectories
    from skelgen.model.filled import Filled as Filled
    from skelgen.model.rig import CaptureSettings as CaptureSettings
    from skelgen.progress import Monitor as Monitor
    from skelgen.progress import SilentMonitor as SilentMonitor
    from skelgen.simulation import simulate as simulate
    from skelgen.stages.labels import Tracker as Tracker

__version__ = "0.1.0"

_NAMES = {
    "skelgen.app.face": "read load reconstruct calibrate_together correct fill evaluate run_batch",
    "skelgen.app.files": "write",
    "skelgen.app.bodies": "split_bodies",
    "skelgen.app.subject": "apply_subject",
    "skelgen.app.taking_back": "take_back",
    "skelgen.simulation": "simulate",
    "skelgen.app.constraints": "RunOptions",
    "skelgen.app.batch.work": "Job",
    "skelgen.stages.labels": "Tracker",
    "skelgen.kinematics": "LiveSkeleton",
    "skelgen.kinematics.sensor_frames": "poses_from_matrices scaled_by_fixed_sensors",
    "skelgen.capture.live": "MotionCapture",
    "skelgen.capture.simulated_rig": "simulated_rig",
    "skelgen.model": "PointCloud Trajectories Poses Identities Identity Labelling Limbs Topology Skeleton Joint Motion "
    "Project StageReport",
    "skelgen.model.filled": "Filled",
    "skelgen.model.rig": "CaptureSettings",
    "skelgen.progress": "Monitor SilentMonitor",
    "skelgen.errors": "SkelgenError FormatError InputError ParameterError MissingResultError MissingPackageError "
    "KernelError WriteError CaptureError Cancelled",
}
"""Public names by the module that defines them, in the order in which the reference shows them."""

_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = [*_HOMES]  # noqa: PLE0604 - texts, as the line above makes them


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'skelgen' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
