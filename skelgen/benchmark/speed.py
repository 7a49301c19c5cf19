"""The suite of time and memory against frames and markers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

from skelgen.benchmark.plots import Series, draw
from skelgen.benchmark.sections import Effort, Figure, Section, table
from skelgen.benchmark.takes import LONG_TAKE_MARKERS, fifty_markers, long_take
from skelgen.benchmark.timing import Run, measure_runs
from skelgen.evaluation import Table
from skelgen.model import PointCloud, Trajectories
from skelgen.progress import Monitor
from skelgen.simulation import simulate

_TREE_FRAMES = 600
_FAULTS: dict[str, Any] = {"noise": 0.5, "dropouts": 0.05}  # mm, part of all positions
_SEEN: dict[str, Any] = {"noise": 0.3, "soft_tissue": 2.0, "n_cameras": 8, "ghosts": 0.2}
_WARMING_LIMBS = 8
_STAGES = ("limbs", "joints", "skeleton")


def measure_speed(effort: Effort, monitor: Monitor) -> Section:
    """Time and memory of all stages, on one core."""
    named = f"A human of {LONG_TAKE_MARKERS} markers at 200 Hz, 2 mm soft tissue"
    cloud = "A human of 50 markers before 8 cameras, without names"
    trees = f"Random trees, {_TREE_FRAMES} frames, 0.5 mm noise, 5 % dropouts"
    kinds: tuple[tuple[str, str, Callable[..., PointCloud | Trajectories], Sequence[int], tuple[str, ...]], ...] = (
        (named, "frames", long_take, effort.frames, _STAGES),
        (cloud, "frames", cloud_take, effort.cloud_frames, ("labels", *_STAGES)),
        (trees, "markers", tree_take, effort.limbs, _STAGES),
    )
    tables: list[Table] = []
    figures: list[Figure] = []
    measure_runs(tree_take, _WARMING_LIMBS)  # compiles what is compiled, which is once on a machine
    done, total = 0, sum(len(sizes) for _, _, _, sizes, _ in kinds)
    for title, axis, make, sizes, stages in kinds:
        runs = []
        for size in sizes:
            monitor.advance(done, total)
            shown = size if axis == "frames" else tree_take(size).n_markers
            runs.append((shown, measure_runs(make, size)[0]))
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


def cloud_take(n_frames: int) -> PointCloud:
    """Return a take without names as cameras see it."""
    return cast(PointCloud, simulate(fifty_markers(), n_frames=n_frames, labelled=False, **_SEEN).take)


def tree_take(n_limbs: int) -> Trajectories:
    """Return a labelled take of a random tree."""
    return cast(Trajectories, simulate(f"tree:{n_limbs}", n_frames=_TREE_FRAMES, **_FAULTS).take)


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
