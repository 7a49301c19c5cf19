"""Many takes in one go, on processes and on a dask cluster: ``python tests/benchmarks/batch.py``.

Takes per second are by the clock on the wall, as a batch is about using all cores; others at work on the machine make
them fewer. Processor time hardly minds others; of the cluster it is not shown, as scheduler and workers use a few per
cent of a core for as long as they wait.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterator, Sequence
from functools import partial
from pathlib import Path

import psutil
from shown import show, show_machine, verdict

import skelgen
from skelgen.app.batch.run import Pool, run_batch
from skelgen.app.batch.takes import Entry
from skelgen.app.batch.work import Job, Outcome
from skelgen.app.batch.workers import in_processes, on_cluster
from skelgen.simulation import Structure, find_structure, simulate

N_TAKES, N_FRAMES, NOISE = 100, 1000, 0.3
N_WORKERS = 2
LEFT_OUT = ("head", "hand", "foot")  # which leaves ten limbs with three markers each
WANTED_RATE, WANTED_BYTES, WANTED_SLOWER = 5.0, 600e6, 1.15
WANTED_PROCESSOR = N_WORKERS / WANTED_RATE  # s


def main() -> None:
    """Print takes per second, memory of the workers, and what the cluster costs beside."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--takes", type=int, default=N_TAKES)
    n_takes = parser.parse_args().takes
    show_machine()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_takes(folder / "in", n_takes)
        here = timed(folder, "processes", partial(in_processes, n_workers=N_WORKERS))
        with cluster(folder) as address:
            pool = partial(on_cluster, address=address, shared=folder / "dask/manifest.json")
            timed(
                folder, "dask-first", partial(on_cluster, address=address, shared=folder / "dask-first/manifest.json")
            )
            there = timed(folder, "dask", pool)
    each, whole = (here[name] / there[name] for name in ("sustained", "rate"))
    most = f"<= {WANTED_SLOWER}"
    rows = [
        ("--jobs 2", "takes/s, workers starting included", f"{here['rate']:.2f}", f">= {WANTED_RATE:g}", ""),
        ("--jobs 2", "takes/s, sustained", f"{here['sustained']:.2f}", f">= {WANTED_RATE:g}",
         verdict(here["sustained"] >= WANTED_RATE)),
        ("--jobs 2", "processor time of a take, sustained [s]", f"{here['processor']:.2f}", f"<= {WANTED_PROCESSOR:g}",
         verdict(here["processor"] <= WANTED_PROCESSOR)),
        ("--jobs 2", "most memory of a worker [MB]", f"{here['peak'] / 1e6:.0f}", "< 600",
         verdict(here["peak"] < WANTED_BYTES)),
        ("--jobs 2", "the same after the first ten takes [MB]", f"{here['early'] / 1e6:.0f}", "flat", ""),
        ("dask", "takes/s, first takes of the workers included", f"{there['rate']:.2f}", "", ""),
        ("dask", "time of a take against --jobs 2", f"{each:.2f}", most, verdict(each <= WANTED_SLOWER)),
        ("dask", "whole time against --jobs 2", f"{whole:.2f}", most, verdict(whole <= WANTED_SLOWER)),
    ]  # fmt: skip
    show(f"{n_takes} takes of {N_FRAMES} frames x 30 markers", ("where", "what", "reached", "wanted", ""), rows)


def make_takes(folder: Path, n_takes: int) -> None:
    """Write labelled takes of ten limbs."""
    limbs = tuple(limb for limb in find_structure("human").limbs if not limb.name.endswith(LEFT_OUT))
    for seed in range(n_takes):
        take = simulate(Structure("ten-limbs", limbs), seed=seed, n_frames=N_FRAMES, noise=NOISE).take
        skelgen.write(take, folder / f"take{seed:03}.c3d")


def timed(folder: Path, name: str, pool: Pool) -> dict[str, float]:
    """Takes per second, those after the first of each worker, their processor time [s], and memory [bytes]."""
    ends: list[float] = []
    peaks: list[int] = []
    used: dict[int, float] = {}
    spent: list[float] = []

    def watched(job: Job, entries: Sequence[Entry]) -> Generator[Outcome, None, None]:
        for outcome in pool(job, entries):
            ends.append(time.monotonic())
            used.update(processor_seconds())  # of workers that were replaced, what they had used remains
            spent.append(sum(used.values()))
            peaks.append(outcome.peak)
            yield outcome

    began = time.monotonic()
    result = run_batch([folder / "in"], folder / name, pool=watched)
    seconds = time.monotonic() - began
    if result.failed:
        raise SystemExit(result.failed[0]["error"])
    skipped = 2 * N_WORKERS  # the first takes of each worker load what they need
    sustained = (len(ends) - skipped) / (ends[-1] - ends[skipped - 1])
    processor = (spent[-1] - spent[skipped - 1]) / (len(ends) - skipped)
    figures = {"rate": len(ends) / seconds, "sustained": sustained, "processor": processor}
    return {**figures, "peak": max(peaks), "early": max(peaks[:10])}


def processor_seconds() -> dict[int, float]:
    """Processor time [s] of this process and all that it has started, by their numbers."""
    found = {}
    me = psutil.Process()
    for process in (me, *me.children(recursive=True)):
        with contextlib.suppress(psutil.Error):
            times = process.cpu_times()
            found[process.pid] = times.user + times.system
    return found


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[str]:
    """A scheduler and two workers on this machine."""
    file = folder / "scheduler.json"
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    started = []

    def start(module: str, *arguments: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.{module}", "--no-dashboard", *arguments]
        started.append(subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL, cwd=folder))

    try:
        start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
        while not file.exists():
            time.sleep(0.1)
        for _ in range(N_WORKERS):
            start("dask_worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1")
        address = json.loads(file.read_text())["address"]
        from distributed import Client

        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(N_WORKERS)
        yield address
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


if __name__ == "__main__":
    main()
