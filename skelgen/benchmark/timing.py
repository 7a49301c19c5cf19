"""Processor time and memory of the stages; each size in a process of its own."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from skelgen.benchmark.machine import in_own_process, peak_gigabytes
from skelgen.model import PointCloud, Trajectories


@dataclass(frozen=True)
class Run:
    """What one run of the stages took.

    Attributes
    ----------
    limbs, joints, skeleton : float
        Processor seconds of each stage, in a first run with what it imports.
    peak : float
        Most memory that the process has held [GB].
    labels : float
        Processor seconds of the labels, 0 for takes that have names.
    """

    limbs: float
    joints: float
    skeleton: float
    peak: float
    labels: float = 0.0

    @property
    def seconds(self) -> float:
        """Time of all stages."""
        return self.labels + self.limbs + self.joints + self.skeleton


def measure_runs(
    make: Callable[..., PointCloud | Trajectories], *given: object, n_runs: int = 1, solver: str = ""
) -> list[Run]:
    """Make a take in a fresh process, run the stages there on one core, and return what each run took.

    Parameters
    ----------
    make : callable
        A function of a module that returns a take.
    *given : object
        Its arguments.
    n_runs : int
        How often; the first run imports what it needs.
    solver : str
        How joints are sought; empty as is the default.
    """
    runs: list[Run] = in_own_process(_measured, make, given, n_runs, solver)
    return runs


def _measured(
    make: Callable[..., PointCloud | Trajectories], given: tuple[object, ...], n_runs: int, solver: str
) -> list[Run]:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    take = make(*given)
    with threadpool_limits(limits=1):
        return [run_stages(take, solver) for _ in range(n_runs)]


def run_stages(take: PointCloud | Trajectories, solver: str = "") -> Run:
    """Run the stages that a take needs, and return what they took; modules load where they are first needed."""
    times = [time.process_time()]
    if isinstance(take, PointCloud):
        from skelgen.stages.labels import LabelParameters, label_and_judge  # noqa: PLC0415

        take, _ = label_and_judge(take, LabelParameters())
    times.append(time.process_time())
    from skelgen.stages.limbs import find_limbs  # noqa: PLC0415 - its import is part of the time

    limbs = find_limbs(take)
    times.append(time.process_time())
    from skelgen.stages.joints import JointParameters, find_joints  # noqa: PLC0415

    topology = find_joints(take, limbs, JointParameters(solver=solver) if solver else JointParameters())
    times.append(time.process_time())
    from skelgen.stages.skeleton import fit_skeleton  # noqa: PLC0415

    fit_skeleton(take, limbs, topology)
    times.append(time.process_time())
    in_labels, in_limbs, in_joints, in_skeleton = np.diff(times).tolist()
    return Run(in_limbs, in_joints, in_skeleton, peak_gigabytes(), in_labels)
