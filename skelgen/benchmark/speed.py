"""The suite of time and memory against frames and markers."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
from threadpoolctl import threadpool_limits

from skelgen.benchmark.page import Effort, Figure, Section, Series, draw, table
from skelgen.errors import SkelgenError
from skelgen.evaluation import Table
from skelgen.model import PointCloud, Trajectories
from skelgen.progress import Monitor
from skelgen.simulation import SimulationParameters, Structure, find_structure, simulate

_TREE_FRAMES = 600
_FAULTS = SimulationParameters(n_frames=_TREE_FRAMES, noise=0.5, dropouts=0.05)
_SEEN = SimulationParameters(noise=0.3, soft_tissue="2.0", n_cameras=8, ghosts=0.2, labelled=False)
_LIMBS_OF_FIRST_RUN = 8
_STAGES = ("limbs", "joints", "skeleton")


def measure_speed(effort: Effort, monitor: Monitor, measure: Callable[..., list[Run]] | None = None) -> Section:
    """Time and memory of all stages, on one core.

    Parameters
    ----------
    effort : Effort
        How many seeds and frames are measured.
    monitor : Monitor
        Receives the progress.
    measure : callable (make, size) -> list of Run, optional
        Measures one take; `measure_runs` if left out.
    """
    measure = measure or measure_runs
    named = f"A human of {LONG_TAKE_MARKERS} markers at 200 Hz, 2 mm soft tissue"
    cloud = "A human of 50 markers before 8 cameras, without names"
    trees = f"Random trees, {_TREE_FRAMES} frames, 0.5 mm noise, 5 % dropouts"
    kinds: tuple[tuple[str, str, Callable[..., PointCloud | Trajectories], Sequence[int], tuple[str, ...]], ...] = (
        (named, "frames", long_take, effort.frames, _STAGES),
        (cloud, "frames", _cloud_take, effort.cloud_frames, ("labels", *_STAGES)),
        (trees, "markers", _tree_take, effort.limbs, _STAGES),
    )
    tables: list[Table] = []
    figures: list[Figure] = []
    measure(_tree_take, _LIMBS_OF_FIRST_RUN)  # compiles what is compiled, which is once on a machine
    done, total = 0, sum(len(sizes) for _, _, _, sizes, _ in kinds)
    for title, axis, make, sizes, stages in kinds:
        runs = []
        for size in sizes:
            monitor.advance(done, total)
            shown = size if axis == "frames" else _tree_take(size).n_markers
            runs.append((shown, measure(make, size)[0]))
            done += 1
        columns = (axis, *(f"{stage} [s]" for stage in stages), "all [s]", "peak [GB]")
        tables.append(table(title, columns, [_row(*one, stages) for one in runs]))
        figures += _figures(title, axis, runs, stages)
    monitor.advance(total, total)
    return Section(
        "speed",
        "Time and memory",
        "Processor time on one core, imports included, but not what is compiled once on a machine; each size in a "
        "process of its own, whose peak of memory holds Python, its packages, the take and its making.",
        tuple(tables),
        tuple(figures),
    )


def _cloud_take(n_frames: int) -> PointCloud:
    """Return a take without names as cameras see it."""
    return cast(PointCloud, simulate(fifty_markers(), parameters=_SEEN.replace(n_frames=n_frames)).take)


def _tree_take(n_limbs: int) -> Trajectories:
    """Return a labelled take of a random tree."""
    return cast(Trajectories, simulate(f"tree:{n_limbs}", parameters=_FAULTS).take)


def _row(size: int, run: Run, stages: Sequence[str]) -> tuple[str, ...]:
    seconds = (f"{getattr(run, stage):.2f}" for stage in stages)
    return (str(size), *seconds, f"{run.seconds:.2f}", f"{run.peak:.2f}", "")


def _figures(title: str, axis: str, runs: Sequence[tuple[int, Run]], stages: Sequence[str]) -> tuple[Figure, Figure]:
    sizes = [float(size) for size, _ in runs]
    times = [Series(stage, sizes, [getattr(run, stage) for _, run in runs]) for stage in stages]
    times.append(Series("all", sizes, [run.seconds for _, run in runs]))
    memory = [Series("peak", sizes, [run.peak for _, run in runs])]
    return (
        Figure(f"{title}: time.", draw(f"Time against {axis}", axis, "processor time [s]", times)),
        Figure(f"{title}: memory.", draw(f"Memory against {axis}", axis, "peak of memory [GB]", memory)),
    )


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
        return [time_stages(take, solver) for _ in range(n_runs)]


def time_stages(take: PointCloud | Trajectories, solver: str = "") -> Run:
    """Run the stages that a take needs and measure each; modules load where they are first needed.

    Parameters
    ----------
    take : PointCloud or Trajectories
        With defaults for everything.
    solver : str
        How joints are sought; empty as is the default.
    """
    times = [time.process_time()]
    if isinstance(take, PointCloud):
        from skelgen.stages.labels import LabelParameters, label_markers  # noqa: PLC0415

        take, _ = label_markers(take, LabelParameters())
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


LONG_TAKE_MARKERS = 40

_FOUR_MARKERS = ("pelvis", "chest", "head", "left thigh", "right thigh")
_LONG = SimulationParameters(n_frames=6000, rate=200.0, noise=0.3, soft_tissue="2.0", n_cameras=8)
_FRESH_NOISE = 0.2  # mm
_CHUNK = 10_000  # frames


def fifty_markers() -> Structure:
    """Return the human with a fourth marker on five limbs: 50 in all."""
    more = {limb.name: limb for limb in find_structure("human:4").limbs}
    limbs = tuple(more[limb.name] if limb.name in _FOUR_MARKERS else limb for limb in find_structure("human").limbs)
    return Structure("human-50", limbs)


def long_take(n_frames: int) -> Trajectories:
    """Return a short simulated take forth and back until it is long enough, with fresh noise, so that it is soon made.

    An hour at 200 Hz has 720 000 frames.
    """
    short = cast(Trajectories, simulate("human", parameters=_LONG).take)
    turn = 2 * short.n_frames - 2
    frames = np.arange(n_frames) % turn
    frames = np.where(frames < short.n_frames, frames, turn - frames)
    positions, random = np.empty((n_frames, LONG_TAKE_MARKERS, 3)), np.random.default_rng(0)
    for first in range(0, n_frames, _CHUNK):
        part = short.positions[frames[first : first + _CHUNK], :LONG_TAKE_MARKERS]
        positions[first : first + _CHUNK] = part + random.normal(0.0, _FRESH_NOISE, part.shape)
    positions.flags.writeable = False
    return Trajectories(positions, short.names[:LONG_TAKE_MARKERS], short.rate)


_Answer = TypeVar("_Answer")
_UNIT = 1024 if sys.platform != "darwin" else 1  # getrusage counts in KiB, on macOS in bytes
_MEMORY_FACTS = Path("/proc/self/status")  # of Linux


def peak_gigabytes() -> float:
    """Return the most memory that this process has held [GB]; NaN on systems that do not tell.

    Linux is asked for the process's own peak: what getrusage says there begins with the peak of the parent.
    """
    with contextlib.suppress(OSError):
        for line in _MEMORY_FACTS.read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e9
    try:
        import resource  # noqa: PLC0415 - not on Windows
    except ImportError:
        return float("nan")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _UNIT / 1e9


def in_own_process(work: Callable[..., _Answer], *given: object) -> _Answer:
    """Return what a function of a module returns in a fresh process: a process never forgets its peak of memory.

    Parameters
    ----------
    work : callable
        A function of a module.
    *given
        Its arguments; those and what it returns must be picklable.

    Raises
    ------
    SkelgenError
        If the process ends without an answer.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, work, *given))
    process.start()
    sender.close()
    try:
        answer: _Answer = receiver.recv()
        return answer
    except EOFError:
        process.join()
        raise SkelgenError(
            f"the process that measures {work.__name__} ended with exit code {process.exitcode}; is memory short?"
        ) from None
    finally:
        process.join()


def _send(sender: Connection, work: Callable[..., object], *given: object) -> None:
    sender.send(work(*given))
    sender.close()
