"""How exact the skeleton is when the truth is known: ``python tests/benchmarks/accuracy.py``."""

from __future__ import annotations

from dataclasses import dataclass

from shown import show, show_machine, verdict

from skelgen.benchmark.accuracy import FAULTS, WANTED_EXACT, WANTED_TIMES_BOUND, reconstructed
from skelgen.benchmark.page import Effort
from skelgen.simulation import SimulationParameters

N_FRAMES = 1000
SEEDS = (0, 1, 2)


@dataclass(frozen=True)
class Outcome:
    """The worst of several seeds for one structure."""

    limbs: int
    trees: int
    marker: float
    worst_joint: float
    mean_joints: tuple[float, ...]
    times_bound: tuple[float, ...]


def main() -> None:
    """Print both tables."""
    show_machine()
    show_exact()
    show_noisy()


def show_exact() -> None:
    """Takes without any fault: markers and joints against the truth."""
    rows = []
    for name in Effort().structures:
        found = outcome(name, SimulationParameters())
        is_reached = found.marker <= WANTED_EXACT["marker"] and found.worst_joint <= WANTED_EXACT["joint"]
        figures = (f"{found.marker:.2g}", f"{found.worst_joint:.2g}")
        rows.append((name, *counts(found), *figures, verdict(is_reached and all_exact(found))))
    columns = ("structure", "limbs exact", "tree exact", "worst limb [mm]", "worst joint [mm]", "")
    show(
        f"Exact takes, {N_FRAMES} frames; wanted: all exact, mean deviation of a limb's markers <= "
        f"{WANTED_EXACT['marker']} mm, joint <= {WANTED_EXACT['joint']} mm (hinges across their axis)",
        columns,
        rows,
    )


def show_noisy() -> None:
    """Takes with noise and dropouts: structure and joints against the truth."""
    rows = []
    for name in Effort().structures:
        found = outcome(name, FAULTS)
        is_reached = all_exact(found) and max(found.times_bound) <= WANTED_TIMES_BOUND
        figures = (" ".join(f"{one:.3f}" for one in series) for series in (found.mean_joints, found.times_bound))
        rows.append((name, *counts(found), *figures, f"{found.worst_joint:.3f}", verdict(is_reached)))
    columns = ("structure", "limbs exact", "tree exact", "mean joint error by seed [mm]", "times the bound")
    show(
        f"0.5 mm noise, 5 % dropouts, {N_FRAMES} frames; wanted: all exact, <= {WANTED_TIMES_BOUND} times the bound",
        (*columns, "worst joint [mm]", ""),
        rows,
    )


def outcome(name: str, faults: SimulationParameters) -> Outcome:
    """Reconstruct one structure with every seed."""
    scores = [reconstructed(name, seed, faults.replace(n_frames=N_FRAMES)) for seed in SEEDS]
    return Outcome(
        limbs=sum(one.limbs is not None and one.limbs.is_exact for one in scores),
        trees=sum(one.topology is not None and one.topology.is_exact for one in scores),
        marker=max(deviation or 0.0 for one in scores for deviation in one.limb_deviations.values()),
        worst_joint=max(one.worst_joint_error or 0.0 for one in scores),
        mean_joints=tuple(one.mean_joint_error or 0.0 for one in scores),
        times_bound=tuple(one.times_bound or 0.0 for one in scores),
    )


def counts(found: Outcome) -> tuple[str, str]:
    """How many seeds gave the true limbs and the true tree."""
    return f"{found.limbs} of {len(SEEDS)}", f"{found.trees} of {len(SEEDS)}"


def all_exact(found: Outcome) -> bool:
    """Whether limbs and tree are exact for all seeds."""
    return found.limbs == found.trees == len(SEEDS)


if __name__ == "__main__":
    main()
