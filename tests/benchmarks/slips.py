"""How many slipped markers are found: ``python tests/benchmarks/slips.py [folder of real recordings]``.

Slips of 5, 10 and 20 mm in random directions are made in simulated takes and in recordings, one at a time in one of
four markers of a take; every other alarm is false. Recordings as they are show what else is found.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.model import Trajectories
from skelgen.simulation import simulate
from skelgen.stages.repair.slips import Slip, find_slips

STRUCTURES = ("human", "human:4", "quadruped")
SOFT_TISSUE = (0.0, 1.0, 2.0, 3.0)  # mm
SEEDS = (0, 1, 2)
N_FRAMES = 2000
SIZES = (5.0, 10.0, 20.0)  # mm
SLIPS = 4  # a take, far apart
NEAR_FRAMES = 3  # of the true frame
FROM_ENDS = 0.12  # of the take, where no slip is made
LEAST_SEEN = 0.5  # of the frames after a slip
RECORDINGS = ("*.c3d", "*.trc", "*.tsv")

WANTED, WANTED_FROM, TEN_MINUTES = 0.9, 10.0, 10

Turns = Callable[[int], np.ndarray]
Case = tuple[Trajectories, Turns]


def main() -> None:
    """Print what is found on simulated and on real takes."""
    show_machine()
    with threadpool_limits(limits=1):
        rows = [row for tissue in SOFT_TISSUE for row in figures(f"simulated, skin {tissue} mm", simulated(tissue))]
        folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[3] / "shared" / "data"
        takes = list(recordings(folder))
        rows += figures("recordings", takes)
        columns = ("takes", "slip [mm]", "made", "found", "frame right", "false", "clean", "minutes", "s a take", "")
        show("Slips (wanted: >= 90 % of those of 10 mm and more, < 1 false alarm in 10 minutes)", columns, rows)
        for take, _ in takes:
            for slip in find_slips(take):
                print(take.name, slip.sentence)


def simulated(tissue: float) -> list[Case]:
    """Simulated takes with noise and dropouts, and the orientation of each marker's limb."""
    cases = []
    for structure in STRUCTURES:
        for seed in SEEDS:
            faults = {"noise": 0.5, "soft_tissue": tissue, "dropouts": 0.03}
            made = simulate(structure, seed=seed, n_frames=N_FRAMES, **faults)
            turns = made.truth.world_from_limb[:, made.truth.limb_of_marker, :3, :3]
            cases.append((made.take, lambda marker, turns=turns: turns[:, marker]))
    return cases


def recordings(folder: Path) -> Iterator[Case]:
    """Labelled recordings, and the orientation of the three markers nearest to one."""
    for path in sorted(path for pattern in RECORDINGS for path in folder.rglob(pattern)):
        take = skelgen.read(path)
        if isinstance(take, Trajectories):
            yield take, partial(turns_near, take)


def figures(title: str, cases: Iterable[Case]) -> Iterator[tuple[str, ...]]:
    """One row for each size."""
    cases = list(cases)
    started = time.perf_counter()
    usual = [find_slips(take) for take, _ in cases]
    seconds = (time.perf_counter() - started) / max(len(cases), 1)
    clean, minutes = sum(map(len, usual)), sum(take.n_frames / take.rate / 60 for take, _ in cases)
    for size in SIZES:
        counts = np.zeros(4, dtype=int)
        for number, ((take, turns), known) in enumerate(zip(cases, usual, strict=True)):
            slipped, truth = with_slips(take, turns, size, np.random.default_rng(number))
            counts += counted(find_slips(slipped), truth, known)
        made, found, right, false = counts.tolist()
        reached = size < WANTED_FROM or (found >= WANTED * made and TEN_MINUTES * clean <= minutes)
        part = f"{100 * found / max(made, 1):.0f} %"
        numbers = (str(right), str(false), str(clean), f"{minutes:.1f}", f"{seconds:.2f}", verdict(reached))
        yield title, f"{size:.0f}", str(made), part, *numbers


def counted(slips: tuple[Slip, ...], truth: list[tuple[int, int]], known: tuple[Slip, ...]) -> list[int]:
    """Slips made, found, found at the very frame, and others that were not there before."""
    before = {(slip.marker, slip.frame) for slip in known}
    off = [[abs(slip.frame - frame) for slip in slips if slip.marker == marker] for marker, frame in truth]
    found = [each for each in off if each and min(each) <= NEAR_FRAMES]
    hits = {(marker, frame + shift) for marker, frame in truth for shift in range(-NEAR_FRAMES, NEAR_FRAMES + 1)}
    false = sum((slip.marker, slip.frame) not in hits | before for slip in slips)
    return [len(truth), len(found), sum(min(each) == 0 for each in found), false]


def with_slips(
    take: Trajectories, turns: Turns, size: float, rng: np.random.Generator
) -> tuple[Trajectories, list[tuple[int, int]]]:
    """The take with some markers slipped in a direction that turns with the limb; which, and from when."""
    positions = take.positions.copy()
    truth: list[tuple[int, int]] = []
    for frame in (np.linspace(FROM_ENDS, 1 - FROM_ENDS, SLIPS) * take.n_frames).astype(int).tolist():
        seen = take.seen[frame - 10 : frame + 10].all(axis=0) & (take.seen[frame:].mean(axis=0) > LEAST_SEEN)
        free = np.flatnonzero(seen & ~np.isin(np.arange(take.n_markers), [marker for marker, _ in truth]))
        if len(free):
            marker = int(rng.choice(free))
            direction = rng.normal(size=3)
            positions[frame:, marker] += size * turns(marker)[frame:] @ direction / np.linalg.norm(direction)
            truth.append((marker, frame))
    return dataclasses.replace(take, positions=positions), truth


def turns_near(take: Trajectories, marker: int) -> np.ndarray:
    """Axes through the three markers nearest to one, gaps bridged by straight lines, shape (n_frames, 3, 3)."""
    typical = np.linalg.norm(np.nanmedian(take.positions - take.positions[:, [marker]], axis=0), axis=1)
    near = take.positions[:, np.argsort(typical)[1:4]].reshape(take.n_frames, -1)
    frames, known = np.arange(take.n_frames), ~np.isnan(near)
    lines = [np.interp(frames, frames[k], column[k]) for k, column in zip(known.T, near.T, strict=True)]
    points = np.stack(lines, axis=1).reshape(take.n_frames, 3, 3)
    first, second = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    third = np.cross(first, second)
    axes = np.stack([first, np.cross(third, first), third], axis=2)
    with np.errstate(invalid="ignore"):  # three markers in a line have no axes
        return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))


if __name__ == "__main__":
    main()
