"""The suite of time and memory against frames and markers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

from skelgen.benchmark.plots import Series, draw
from skelgen.benchmark.sections import Effort, Figure, Section, table
from skelgen.benchmark.takes import LONG_TAKE_MARKERS, long_take
from skelgen.benchmark.timing import Run, measure_runs
from skelgen.model import Trajectories
from skelgen.progress import Monitor
from skelgen.simulation import simulate

_TREE_FRAMES = 600
_FAULTS: dict[str, Any] = {"noise": 0.5, "dropouts": 0.05}  # mm, part of all positions
_STAGES = ("limbs", "joints", "skeleton")


def measure_speed(effort: Effort, monitor: Monitor) -> Section:
    """Time and memory of limbs, joints and skeleton, on one core."""
    total = len(effort.frames) + len(effort.limbs)
    by_frames: list[tuple[int, Run]] = []
    by_markers: list[tuple[int, Run]] = []
    for done, n_frames in enumerate(effort.frames):
        monitor.advance(done, total)
        by_frames.append((n_frames, measure_runs(long_take, n_frames)[0]))
    for done, n_limbs in enumerate(effort.limbs, start=len(by_frames)):
        monitor.advance(done, total)
        by_markers.append((tree_take(n_limbs).n_markers, measure_runs(tree_take, n_limbs)[0]))
    monitor.advance(total, total)
    columns = (*(f"{stage} [s]" for stage in _STAGES), "all [s]", "peak [GB]")
    human = f"A human of {LONG_TAKE_MARKERS} markers at 200 Hz, 2 mm soft tissue"
    trees = f"Random trees, {_TREE_FRAMES} frames, 0.5 mm noise, 5 % dropouts"
    return Section(
        "speed",
        "Time and memory",
        "Labelled takes; processor time of a first run on one core, with what it imports; each size in a process of "
        "its own, whose peak of memory holds Python, its packages and the take.",
        (
            table(human, ("frames", *columns), [_row(*one) for one in by_frames]),
            table(trees, ("markers", *columns), [_row(*one) for one in by_markers]),
        ),
        (*_figures(human, "frames", by_frames), *_figures(trees, "markers", by_markers)),
    )


def tree_take(n_limbs: int) -> Trajectories:
    """Return a labelled take of a random tree."""
    return cast(Trajectories, simulate(f"tree:{n_limbs}", n_frames=_TREE_FRAMES, **_FAULTS).take)


def _row(size: int, run: Run) -> tuple[str, ...]:
    stages = (f"{getattr(run, stage):.2f}" for stage in _STAGES)
    return (str(size), *stages, f"{run.seconds:.2f}", f"{run.peak:.2f}", "")


def _figures(title: str, axis: str, runs: Sequence[tuple[int, Run]]) -> tuple[Figure, Figure]:
    sizes = [float(size) for size, _ in runs]
    times = [Series(stage, sizes, [getattr(run, stage) for _, run in runs]) for stage in _STAGES]
    times.append(Series("all", sizes, [run.seconds for _, run in runs]))
    memory = [Series("peak", sizes, [run.peak for _, run in runs])]
    return (
        Figure(f"{title}: time.", draw(f"Time against {axis}", axis, "processor time [s]", times)),
        Figure(f"{title}: memory.", draw(f"Memory against {axis}", axis, "peak of memory [GB]", memory)),
    )
