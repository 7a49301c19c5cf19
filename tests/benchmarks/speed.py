"""How long the stages take on one core, and how much memory: ``python tests/benchmarks/speed.py``."""

from __future__ import annotations

import dataclasses
import os
import resource
import sys

from shown import show, show_machine, verdict
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.simulation import Structure, find_structure, simulate

N_FRAMES = 2000
LEFT_OUT = ("head", "hand", "foot")
TWO_MARKERS = "forearm"
FAULTS = {"noise": 0.5, "dropouts": 0.05}  # mm, part of all positions
REPEATS = 3
WANTED_SECONDS = 5.0  # the seed: 90 s on four machines
SOLVERS = ("closed-form", "conjugate-gradient")
KILO = 1024  # getrusage counts in KiB on Linux, in bytes on macOS


def main() -> None:
    """Print seconds per stage for both solvers of the joints, and the memory."""
    show_machine()
    keep_to_one_core()
    take = simulate(ten_limbs(), n_frames=N_FRAMES, **FAULTS).take
    before = peak_memory()
    with threadpool_limits(limits=1):
        first = stage_seconds(take, SOLVERS[0])
        best = [min((stage_seconds(take, SOLVERS[0]) for _ in range(REPEATS)), key=total)]
        after = peak_memory()
        best.append(stage_seconds(take, SOLVERS[1]))
    runs = {f"{SOLVERS[0]}, first run": first, f"{SOLVERS[0]}, best of {REPEATS}": best[0], SOLVERS[1]: best[1]}
    rows = [(name, *(f"{one:.2f}" for one in run.values()), f"{total(run):.2f}") for name, run in runs.items()]
    shape = f"{take.n_frames} frames x {take.n_markers} markers x 10 limbs, labelled, one core"
    show(f"{shape}: seconds by stage", ("solver of the joints", *first, "all"), rows)
    outcome = [
        (
            "all stages, closed form [s]",
            f"< {WANTED_SECONDS:g}",
            f"{total(first):.2f}",
            verdict(total(first) < WANTED_SECONDS),
        ),
        ("joints, descent / closed form", "-", f"{best[1]['joints'] / best[0]['joints']:.0f}", ""),
        ("peak memory of the stages [MiB]", "-", f"{after - before:.0f} above {before:.0f} of the simulation", ""),
    ]
    show("Outcome", ("figure", "wanted", "reached", ""), outcome)


def keep_to_one_core() -> None:
    """Leave this process one core, where the system lets us."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def ten_limbs() -> Structure:
    """A human without head, hands and feet, with two markers on the forearms: 28 markers on 10 limbs."""
    limbs = [limb for limb in find_structure("human").limbs if not limb.name.endswith(LEFT_OUT)]
    fewer = [
        dataclasses.replace(limb, markers=limb.markers[:2]) if limb.name.endswith(TWO_MARKERS) else limb
        for limb in limbs
    ]
    return Structure("ten-limbs", tuple(fewer))


def stage_seconds(take: skelgen.Trajectories, solver: str) -> dict[str, float]:
    """Run all stages and return their times."""
    project = skelgen.reconstruct(take, parameters={"joints": {"solver": solver}})
    return {name: report.seconds for name, report in project.reports.items()}


def total(seconds: dict[str, float]) -> float:
    """Time of all stages."""
    return sum(seconds.values())


def peak_memory() -> float:
    """Most memory that this process has held [MiB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / KILO if sys.platform != "darwin" else peak / KILO**2


if __name__ == "__main__":
    main()
