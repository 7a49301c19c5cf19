"""Time and memory of limbs, joints and skeleton on one core: ``python tests/benchmarks/speed.py``.

Time is that of the processor, as others may be at work on the machine. Every size runs in a process of its own: first
as a user meets it, with what must be imported, then again.
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np
from shown import show, show_machine, verdict

from skelgen.benchmark.speed import LONG_TAKE_MARKERS, Run, long_take, measure_runs
from skelgen.model import Trajectories
from skelgen.simulation import Structure, find_structure, simulate

FAULTS = {"noise": 0.5, "dropouts": 0.05}  # mm, part of all positions
REPEATS = 3
REPEATED = 10_000  # frames: longer takes run once
SOLVERS = ("closed-form", "conjugate-gradient")
LEFT_OUT = ("head", "hand", "foot")
TWO_MARKERS = "forearm"
FIFTH_MARKERS = 7  # limbs of the tree of 30 that get a marker more: 127 in all


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
    by_solver = {solver: measure_runs(take_of, SIZES[0], solver=solver)[0].joints for solver in SOLVERS}
    show("Joints by solver", ("solver", "first run [s]"), [(name, f"{one:.2f}") for name, one in by_solver.items()])


def rows_of(size: Size) -> list[tuple[str, ...]]:
    """The first run of a size, and the best of the others."""
    runs = measure_runs(take_of, size, n_runs=1 if size.n_frames > REPEATED else 1 + REPEATS)
    best = {f"best of {REPEATS}": min(runs[1:], key=lambda run: run.seconds)} if runs[1:] else {}
    kinds = {"first": runs[0]} | best
    return [row_of(size, kind, run) for kind, run in kinds.items()]


def row_of(size: Size, kind: str, run: Run) -> tuple[str, ...]:
    """One run as a row."""
    reached = run.seconds < size.seconds and run.peak < (size.gigabytes or np.inf)
    wanted = f"< {size.seconds:g} s" + (f", {size.gigabytes} GB" if size.gigabytes else "")
    parts = (f"{one:.2f}" for one in (run.limbs, run.joints, run.skeleton))
    return (size.text, kind, *parts, f"{run.seconds:.2f}", wanted, f"{run.peak:.2f}", verdict(reached))


def take_of(size: Size) -> Trajectories:
    """A labelled take of some size."""
    if size.n_markers == LONG_TAKE_MARKERS:
        return long_take(size.n_frames)
    structure = ten_limbs() if size.n_limbs == 10 else thirty_limbs()
    return simulate(structure, n_frames=size.n_frames, **FAULTS).take


def ten_limbs() -> Structure:
    """Return a human without head, hands and feet, with two markers on the forearms: 28 markers on 10 limbs."""
    limbs = [limb for limb in find_structure("human").limbs if not limb.name.endswith(LEFT_OUT)]
    fewer = [
        dataclasses.replace(limb, markers=limb.markers[:2]) if limb.name.endswith(TWO_MARKERS) else limb
        for limb in limbs
    ]
    return Structure("ten-limbs", tuple(fewer))


def thirty_limbs() -> Structure:
    """Return the random tree of 30 limbs, some with a fifth marker amid the others: 127 markers."""
    limbs = list(find_structure("tree:30").limbs)
    for index, limb in enumerate(limbs[:FIFTH_MARKERS]):
        markers = np.concatenate([limb.markers, limb.markers[:2].mean(axis=0, keepdims=True)])
        limbs[index] = dataclasses.replace(limb, markers=markers)
    return Structure("thirty-limbs", tuple(limbs))


if __name__ == "__main__":
    main()
