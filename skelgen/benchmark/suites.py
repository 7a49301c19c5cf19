"""The suites of `skelgen benchmark` in their order, and running them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from threadpoolctl import threadpool_limits

from skelgen.benchmark import accuracy
from skelgen.benchmark.sections import QUICK, Effort, Section
from skelgen.benchmark.speed import measure_speed
from skelgen.errors import InputError
from skelgen.progress import SILENT, Monitor

SUITES: dict[str, Callable[[Effort, Monitor], Section]] = {
    "labels": accuracy.measure_labels,
    "exact": accuracy.measure_exact,
    "joints": accuracy.measure_joints,
    "tissue": accuracy.measure_tissue,
    "stereo": accuracy.measure_stereo,
    "exports": accuracy.measure_exports,
    "speed": measure_speed,
}
"""Every suite by its name, in the order of the page."""


def run_benchmark(names: Sequence[str] = (), *, quick: bool = False, monitor: Monitor = SILENT) -> list[Section]:
    """Measure accuracy, speed and memory on this machine, on one core.

    Parameters
    ----------
    names : sequence of str
        Suites, see `SUITES`; all if left out.
    quick : bool
        Fewer seeds and frames: two to three minutes.
    monitor : Monitor
        Told which suite runs and how far it is.

    Raises
    ------
    InputError
        If there is no suite of a name.
    """
    for name in names:
        if name not in SUITES:
            raise InputError(f"there is no suite {name!r}; suites are {', '.join(SUITES)}")
    sections = []
    with threadpool_limits(limits=1):
        for name in [name for name in SUITES if not names or name in names]:
            monitor.begin(f"measuring {name}")
            sections.append(SUITES[name](QUICK if quick else Effort(), monitor))
    return sections
