"""How many exchanged labels and slips are found: ``python tests/benchmarks/swaps.py [folder of real recordings]``."""

from __future__ import annotations

import dataclasses
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.simulation import simulate
from skelgen.stages.repair.swaps import find_swaps, repair_swaps

STRUCTURES = ("human", "human:4", "quadruped", "tree:8")
SEEDS = range(6)
N_FRAMES = 3000
FAULTS = {"noise": 0.5, "soft_tissue": 2.0, "dropouts": 0.05}  # mm, mm, part of all positions
SWAPS_PER_MINUTE = 10.0
SECONDS = (0.1, 2.0)
NEAREST = 4  # markers of other limbs that labels are exchanged with
MOST_TRIES = 1000


@dataclass(frozen=True)
class Injected:
    """An exchange made on purpose."""

    pair: tuple[int, int]
    first: int
    last: int


def main() -> None:
    """Print what is found on simulated and on real takes."""
    show_machine()
    with threadpool_limits(limits=1):
        show_swaps()
        show_recordings(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[3] / "shared" / "data")


def show_swaps() -> None:
    """Exchanges found and repaired exactly, false alarms, time."""
    rows = []
    for structure in STRUCTURES:
        for inner in (True, False):
            rows.append((structure, "same limb" if inner else "near limbs", *swap_figures(structure, inner)))
    columns = ("structure", "exchanged on", "injected", "found", "of these exact", "false per minute", "clean", "s", "")
    show("Exchanged labels (wanted: found >= 95 %, exact >= 95 %, false < 1 per minute)", columns, rows)


def swap_figures(structure: str, inner: bool) -> tuple[str, ...]:
    """One row of the table."""
    total = found = exact = false = clean = 0
    seconds = minutes = 0.0
    for seed in SEEDS:
        simulated = simulate(structure, seed=seed, n_frames=N_FRAMES, **FAULTS)
        take, limb = simulated.take, simulated.truth.limb_of_marker
        minutes += take.n_frames / take.rate / 60
        injected = inject(take, limb, inner, np.random.default_rng(seed))
        spoiled = exchanged(take, injected)
        started = time.perf_counter()
        clean += len(find_swaps(take))
        seconds += (time.perf_counter() - started) / len(SEEDS)
        swaps = find_swaps(spoiled)
        repaired = repair_swaps(spoiled, swaps)
        total += len(injected)
        for one in injected:
            hit = any(set(one.pair) <= set(s.markers) and overlaps(one, s) for s in swaps)
            found += hit
            span = slice(max(one.first - 5, 0), one.last + 6)
            pair = list(one.pair)
            exact += hit and np.array_equal(repaired.positions[span, pair], take.positions[span, pair], equal_nan=True)
        false += sum(not any(set(one.pair) & set(s.markers) and overlaps(one, s) for one in injected) for s in swaps)
    reached = found >= 0.95 * total and exact >= 0.95 * found and false < minutes
    rates = (f"{100 * found / total:.0f} %", f"{100 * exact / max(found, 1):.0f} %", f"{false / minutes:.2f}")
    return str(total), *rates, str(clean), f"{seconds:.2f}", verdict(reached)


def overlaps(one: Injected, swap: object) -> bool:
    """Whether both share a frame."""
    return swap.first_frame <= one.last and swap.last_frame >= one.first


def inject(take: skelgen.Trajectories, limb: np.ndarray, inner: bool, rng: np.random.Generator) -> list[Injected]:
    """Choose exchanges that do not touch each other in time, of markers seen when it begins and ends."""
    wanted = max(1, round(SWAPS_PER_MINUTE * take.n_frames / take.rate / 60))
    typical = np.nanmedian(np.linalg.norm(take.positions[::50, :, None] - take.positions[::50, None], axis=3), axis=0)
    chosen: list[Injected] = []
    for _ in range(MOST_TRIES):
        length = max(2, round(rng.uniform(*SECONDS) * take.rate))
        first = int(rng.integers(1, take.n_frames - length - 1))
        marker = int(rng.integers(take.n_markers))
        allowed = np.flatnonzero((limb == limb[marker]) == inner)
        allowed = allowed[allowed != marker]
        other = int(rng.choice(allowed[np.argsort(typical[marker, allowed])][:NEAREST]))
        one = Injected((marker, other), first, first + length - 1)
        seen = take.seen[:, list(one.pair)]
        if (
            seen[one.first].any()
            and seen[one.last].any()
            and all(one.last < old.first - 10 or one.first > old.last + 10 for old in chosen)
        ):
            chosen.append(one)
        if len(chosen) == wanted:
            break
    return chosen


def exchanged(take: skelgen.Trajectories, injected: list[Injected]) -> skelgen.Trajectories:
    """The take with these exchanges."""
    positions = take.positions.copy()
    for one in injected:
        pair, frames = list(one.pair), slice(one.first, one.last + 1)
        positions[frames, pair] = positions[frames, pair[::-1]]
    return dataclasses.replace(take, positions=positions)


def show_recordings(folder: Path) -> None:
    """What is found in recordings as they are."""
    rows = []
    for path in sorted([*folder.rglob("*.c3d"), *folder.rglob("*.trc"), *folder.rglob("*.tsv")]):
        try:
            take = skelgen.read(path)
        except skelgen.SkelgenError as error:  # some show what must be refused
            print(error)
            continue
        if not isinstance(take, skelgen.Trajectories):
            continue
        started = time.perf_counter()
        swaps = find_swaps(take)
        rows.append((path.name, str(take.n_frames), str(len(swaps)), f"{time.perf_counter() - started:.2f}"))
        for swap in swaps[:10]:
            print(path.name, swap.sentence)
    show("Recordings as they are", ("recording", "frames", "exchanges", "s"), rows)


if __name__ == "__main__":
    main()
