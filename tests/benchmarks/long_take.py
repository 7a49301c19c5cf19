"""Time and memory of the labels stage for takes of any length, up to an hour: ``python tests/benchmarks/long_take.py``.

Time is that of the processor, as others may be at work on the machine.

A short simulated take runs forth and back until it is long enough, with fresh noise each time, so that making it costs
nothing beside labelling it; every length is labelled in a process of its own, whose peak of memory is printed.
"""

from __future__ import annotations

import argparse
import itertools
import time

import numpy as np
from shown import in_own_process, peak_gigabytes, show, show_machine, verdict
from threadpoolctl import threadpool_limits

from skelgen.errors import SkelgenError
from skelgen.model import PointCloud
from skelgen.progress import SilentMonitor
from skelgen.simulation import simulate
from skelgen.stages.labels import LabelParameters, label_markers

RATE = 200.0  # Hz
N_MARKERS = 40
SHORT_FRAMES = 6000
FAULTS = {"n_cameras": 8, "noise": 0.3, "soft_tissue": 2.0, "ghosts": 0.2}
FRESH_NOISE = 0.2  # mm
HOUR = int(3600 * RATE)
LENGTHS = (12_000, 48_000, 144_000, HOUR)  # frames
WANTED_RATE = 1000.0  # frames/s of the whole stage
WANTED_GIGABYTES = 2.5


class Phases(SilentMonitor):
    """Notes when each part of the work began, and the peak of memory until then."""

    def __init__(self) -> None:
        self.begun: list[tuple[str, float, float]] = []

    def begin(self, name: str) -> None:
        self.begun.append((name, time.process_time(), peak_gigabytes()))


def main() -> None:
    """Print time and memory by length, and what dominates in the longest take."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lengths", type=int, nargs="*", default=LENGTHS, help="in frames")
    parser.add_argument("--method", default="rigidity")
    given = parser.parse_args()
    show_machine()
    rows = []
    for n_frames in given.lengths:
        facts = in_own_process(labelled, n_frames, given.method)
        rows.append(row_of(n_frames, facts))
        phases = ", ".join(f"{name} {seconds:.1f} s (until {peak:.2f} GB)" for name, seconds, peak in facts["phases"])
        print(f"{n_frames} frames: {phases}\n", flush=True)
    columns = ("frames", "points", "CPU s", "frames/s", "of the take [GB]", "peak [GB]", "markers", "")
    wanted = f"wanted {WANTED_RATE:g} frames/s, {WANTED_GIGABYTES} GB"
    title = f"{given.method}, {N_MARKERS} markers at {RATE:g} Hz, 8 cameras: {wanted}"
    show(title, columns, rows)


def row_of(n_frames: int, facts: dict) -> tuple[str, ...]:
    """One row of the table."""
    speed = n_frames / facts["seconds"]
    reached = speed >= WANTED_RATE and facts["peak"] < WANTED_GIGABYTES
    numbers = (f"{facts['seconds']:.1f}", f"{speed:.0f}", f"{facts['before']:.2f}", f"{facts['peak']:.2f}")
    return (str(n_frames), str(facts["n_points"]), *numbers, str(facts["markers"]), verdict(reached))


def labelled(n_frames: int, method: str) -> dict:
    """Label a take, and note time and memory."""
    cloud, parameters = long_cloud(n_frames), LabelParameters(method=method)
    before, phases = peak_gigabytes(), Phases()
    started = time.process_time()
    with threadpool_limits(limits=1):
        try:
            markers = label_markers(cloud, parameters, monitor=phases)[0].n_markers
        except SkelgenError as error:
            markers = str(error)
    ended = time.process_time()
    ends = [begun for _, begun, _ in phases.begun[1:]] + [ended]
    peaks = [peak for _, _, peak in phases.begun[1:]] + [peak_gigabytes()]
    parts = [(name, end - begun, peak) for (name, begun, _), end, peak in zip(phases.begun, ends, peaks, strict=True)]
    facts = {"seconds": ended - started, "before": before, "peak": peak_gigabytes(), "markers": markers}
    return facts | {"n_points": cloud.n_points, "phases": parts}


def long_cloud(n_frames: int, seed: int = 0) -> PointCloud:
    """A short take forth and back until `n_frames` are full, with fresh noise."""
    short, markers = short_take(seed)
    frames = np.arange(n_frames) % (2 * SHORT_FRAMES - 2)
    frames = np.where(frames < SHORT_FRAMES, frames, 2 * SHORT_FRAMES - 2 - frames)
    counts = short.points_per_frame[frames]
    starts = np.concatenate([[0], np.cumsum(counts)])
    points = np.empty((starts[-1], 3))
    random = np.random.default_rng(seed)
    for frame, (first, last) in enumerate(itertools.pairwise(starts)):
        points[first:last] = short.frame(frames[frame])
        points[first:last] += random.normal(0.0, FRESH_NOISE, (last - first, 3))
    points.flags.writeable = False
    return PointCloud(points, starts, np.arange(n_frames) / RATE, name=f"{n_frames} frames of {markers} markers")


def short_take(seed: int) -> tuple[PointCloud, int]:
    """What is repeated: a simulated human without its last markers, so that `N_MARKERS` are left."""
    simulated = simulate("human", n_frames=SHORT_FRAMES, rate=RATE, seed=seed, labelled=False, **FAULTS)
    cloud, keep = simulated.take, simulated.truth.marker_of_point < N_MARKERS
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)[keep]
    starts = np.concatenate([[0], np.cumsum(np.bincount(frame_of_point, minlength=cloud.n_frames))])
    return PointCloud(cloud.points[keep], starts, cloud.times), N_MARKERS


if __name__ == "__main__":
    main()
