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
    from skelgen.app.batch.work import Job
    from skelgen.app.constraints import RunOptions
    from skelgen.app.face import (
        apply_subject,
        calibrate_together,
        correct,
        evaluate,
        fill,
        load,
        read,
        reconstruct,
        run_batch,
        write,
    )
    from skelgen.capture.live import MotionCapture
    from skelgen.capture.simulated_rig import simulated_rig
    from skelgen.errors import (
        Cancelled,
        CaptureError,
        FormatError,
        InputError,
        KernelError,
        MissingPackageError,
        MissingResultError,
        ParameterError,
        SkelgenError,
        WriteError,
    )
    from skelgen.kinematics import LiveSkeleton
    from skelgen.model import (
        Identities,
        Identity,
        Joint,
        Labelling,
        Limbs,
        Motion,
        PointCloud,
        Poses,
        Project,
        Skeleton,
        StageReport,
        Topology,
        Trajectories,
    )
    from skelgen.model.filled import Filled
    from skelgen.model.rig import CaptureSettings
    from skelgen.progress import Monitor, SilentMonitor
    from skelgen.simulation import simulate
    from skelgen.stages.labels import Tracker

__version__ = "0.1.0"

_NAMES = {
    "skelgen.app.face": (
        "read",
        "load",
        "write",
        "reconstruct",
        "apply_subject",
        "calibrate_together",
        "correct",
        "fill",
        "evaluate",
        "run_batch",
    ),
    "skelgen.simulation": ("simulate",),
    "skelgen.app.constraints": ("RunOptions",),
    "skelgen.app.batch.work": ("Job",),
    "skelgen.stages.labels": ("Tracker",),
    "skelgen.kinematics": ("LiveSkeleton",),
    "skelgen.capture.live": ("MotionCapture",),
    "skelgen.capture.simulated_rig": ("simulated_rig",),
    "skelgen.model": (
        "PointCloud",
        "Trajectories",
        "Poses",
        "Identities",
        "Identity",
        "Labelling",
        "Limbs",
        "Topology",
        "Skeleton",
        "Joint",
        "Motion",
        "Project",
        "StageReport",
    ),
    "skelgen.model.filled": ("Filled",),
    "skelgen.model.rig": ("CaptureSettings",),
    "skelgen.progress": ("Monitor", "SilentMonitor"),
    "skelgen.errors": (
        "SkelgenError",
        "FormatError",
        "InputError",
        "ParameterError",
        "MissingResultError",
        "MissingPackageError",
        "KernelError",
        "WriteError",
        "CaptureError",
        "Cancelled",
    ),
}
"""Public names by the module that defines them, in the order in which the reference shows them."""

_HOMES = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [
    "Cancelled",
    "CaptureError",
    "CaptureSettings",
    "Filled",
    "FormatError",
    "Identities",
    "Identity",
    "InputError",
    "Job",
    "Joint",
    "KernelError",
    "Labelling",
    "Limbs",
    "LiveSkeleton",
    "MissingPackageError",
    "MissingResultError",
    "Monitor",
    "Motion",
    "MotionCapture",
    "ParameterError",
    "PointCloud",
    "Poses",
    "Project",
    "RunOptions",
    "SilentMonitor",
    "Skeleton",
    "SkelgenError",
    "StageReport",
    "Topology",
    "Tracker",
    "Trajectories",
    "WriteError",
    "apply_subject",
    "calibrate_together",
    "correct",
    "evaluate",
    "fill",
    "load",
    "read",
    "reconstruct",
    "run_batch",
    "simulate",
    "simulated_rig",
    "write",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'skelgen' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
