"""Time and memory of limbs, joints and skeleton on one core: ``python tests/benchmarks/speed.py``.

Time is that of the processor, as others may be at work on the machine. Every size runs in a process of its own: first
as a user meets it, with what must be imported, then again.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import time

import numpy as np
from shown import in_own_process, peak_gigabytes, show, show_machine, verdict
from threadpoolctl import threadpool_limits

from skelgen.model import Trajectories
from skelgen.simulation import Structure, find_structure, simulate

LEFT_OUT = ("head", "hand", "foot")
TWO_MARKERS = "forearm"
FAULTS = {"noise": 0.5, "dropouts": 0.05}  # mm, part of all positions
REPEATS = 3
SOLVERS = ("closed-form", "conjugate-gradient")
FIFTH_MARKERS = 7  # limbs of the tree of 30 that get a marker more: 127 in all

HOUR = {"n_frames": 6000, "rate": 200.0, "noise": 0.3, "soft_tissue": 2.0, "n_cameras": 8}
HOUR_MARKERS = 40
FRESH_NOISE = 0.2  # mm
CHUNK = 10_000  # frames


@dataclasses.dataclass(frozen=True)
class Size:
    """A size of take, and what is wanted of it."""

    n_frames: int
    n_markers: int
    n_limbs: int
    seconds: float
    gigabytes: float | None = None

    @property
    def text(self) -> str:
        """As the tables show it."""
        return f"{self.n_frames} x {self.n_markers} x {self.n_limbs}"


SIZES = (
    Size(2000, 28, 10, seconds=1.5),
    Size(1500, 127, 30, seconds=8.0),
    Size(48_000, 40, 14, seconds=180.0, gigabytes=2.5),
    Size(720_000, 40, 14, seconds=180.0, gigabytes=2.5),
)


def main() -> None:
    """Print time by size and stage, memory, and what conjugate gradients for all joints take."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most-frames", type=int, default=SIZES[-1].n_frames, help="leave longer takes out")
    most = parser.parse_args().most_frames
    show_machine()
    rows = [row for size in SIZES if size.n_frames <= most for row in rows_of(size)]
    columns = ("frames x markers x limbs", "run", "limbs", "joints", "skeleton", "all [s]", "wanted", "peak [GB]", "")
    show("Labelled takes, one core: processor seconds by stage", columns, rows)
    by_solver = {solver: in_own_process(timed, SIZES[0], solver, 1)[0]["joints"] for solver in SOLVERS}
    show("Joints by solver", ("solver", "first run [s]"), [(name, f"{one:.2f}") for name, one in by_solver.items()])


def rows_of(size: Size) -> list[tuple[str, ...]]:
    """The first run of a size, and the best of the others."""
    runs = in_own_process(timed, size, SOLVERS[0], 1 if size.n_frames > CHUNK else 1 + REPEATS)
    kinds = {"first": runs[0]} | ({f"best of {REPEATS}": min(runs[1:], key=total)} if runs[1:] else {})
    return [row_of(size, kind, run) for kind, run in kinds.items()]


def row_of(size: Size, kind: str, run: dict[str, float]) -> tuple[str, ...]:
    """One run as a row."""
    reached = total(run) < size.seconds and run["peak"] < (size.gigabytes or np.inf)
    wanted = f"< {size.seconds:g} s" + (f", {size.gigabytes} GB" if size.gigabytes else "")
    parts = (f"{run[name]:.2f}" for name in ("limbs", "joints", "skeleton"))
    return (size.text, kind, *parts, f"{total(run):.2f}", wanted, f"{run['peak']:.2f}", verdict(reached))


def total(run: dict[str, float]) -> float:
    """Time of all stages."""
    return run["limbs"] + run["joints"] + run["skeleton"]


def timed(size: Size, solver: str, n_runs: int) -> list[dict[str, float]]:
    """Run the three stages some times, and return their times and the peak of memory after each run."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    take = take_of(size)
    with threadpool_limits(limits=1):
        return [run_stages(take, solver) for _ in range(n_runs)]


def run_stages(take: Trajectories, solver: str) -> dict[str, float]:
    """Time of each stage [s], imports included, and the peak of memory [GB]."""
    times = [time.process_time()]
    from skelgen.stages.limbs import find_limbs

    limbs = find_limbs(take)
    times.append(time.process_time())
    from skelgen.stages.joints import JointParameters, find_joints

    topology = find_joints(take, limbs, JointParameters(solver=solver))
    times.append(time.process_time())
    from skelgen.stages.skeleton import fit_skeleton

    fit_skeleton(take, limbs, topology)
    times.append(time.process_time())
    seconds = dict(zip(("limbs", "joints", "skeleton"), np.diff(times).tolist(), strict=True))
    return seconds | {"peak": peak_gigabytes()}


def take_of(size: Size) -> Trajectories:
    """A labelled take of some size."""
    if size.n_markers == HOUR_MARKERS:
        return long_take(size.n_frames)
    structure = ten_limbs() if size.n_limbs == 10 else thirty_limbs()
    return simulate(structure, n_frames=size.n_frames, **FAULTS).take


def ten_limbs() -> Structure:
    """A human without head, hands and feet, with two markers on the forearms: 28 markers on 10 limbs."""
    limbs = [limb for limb in find_structure("human").limbs if not limb.name.endswith(LEFT_OUT)]
    fewer = [
        dataclasses.replace(limb, markers=limb.markers[:2]) if limb.name.endswith(TWO_MARKERS) else limb
        for limb in limbs
    ]
    return Structure("ten-limbs", tuple(fewer))


def thirty_limbs() -> Structure:
    """The random tree of 30 limbs, some with a fifth marker amid the others: 127 markers."""
    limbs = list(find_structure("tree:30").limbs)
    for index, limb in enumerate(limbs[:FIFTH_MARKERS]):
        markers = np.concatenate([limb.markers, limb.markers[:2].mean(axis=0, keepdims=True)])
        limbs[index] = dataclasses.replace(limb, markers=markers)
    return Structure("thirty-limbs", tuple(limbs))


def long_take(n_frames: int, seed: int = 0) -> Trajectories:
    """A short simulated take forth and back until it is long enough, with fresh noise, so that it is soon made."""
    short = simulate("human", seed=seed, **HOUR).take
    turn = 2 * short.n_frames - 2
    frames = np.arange(n_frames) % turn
    frames = np.where(frames < short.n_frames, frames, turn - frames)
    positions, random = np.empty((n_frames, HOUR_MARKERS, 3)), np.random.default_rng(seed)
    for first in range(0, n_frames, CHUNK):
        part = short.positions[frames[first : first + CHUNK], :HOUR_MARKERS]
        positions[first : first + CHUNK] = part + random.normal(0.0, FRESH_NOISE, part.shape)
    positions.flags.writeable = False
    return Trajectories(positions, short.names[:HOUR_MARKERS], short.rate)


if __name__ == "__main__":
    main()
