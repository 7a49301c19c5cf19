"""What labels cost frame by frame: ``python tests/benchmarks/online.py [folder of real recordings]``."""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment
from shown import show, show_machine, verdict
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.simulation import find_structure, simulate
from skelgen.stages.labels import LabelParameters, Tracker, label_markers
from skelgen.stages.labels.online.links import Links

CASES = (("human", 8, 2.0), ("human", 6, 3.0), ("tree:10", 6, 2.0))  # structure, cameras, soft tissue [mm]
SEEDS = (1, 2)
N_FRAMES = 1500
FAULTS = {"noise": 0.3, "ghosts": 0.2}  # mm, points per frame
OTHER_MOTION = 100  # added to the seed of the take that the known skeleton comes from
RECORDINGS = (
    ("human/nick_freeform_001.c3d", False),
    ("human/nick_freeform_001.c3d", True),
    ("mouse/mouse_S15.c3d", False),
)
GAP, GAP_EVERY = 0.25, 2.0  # s
LONG_FRAMES = 50_000
SAME_POINT = 1e-9  # mm
WANTED, WANTED_KNOWN, WANTED_SPEED = 0.9, 0.99, 500.0


def main() -> None:
    """Print what is reached on simulated and on real takes, and how memory grows."""
    show_machine()
    with threadpool_limits(limits=1):
        show_simulated()
        show_recordings(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[3] / "shared" / "data")
        show_memory()


def show_simulated() -> None:
    """IDF1 of tracks alone, offline, online, and online with the skeleton known from another take."""
    rows = [simulated_figures(*case, seed) for case in CASES for seed in SEEDS]
    columns = (
        "structure",
        "cameras",
        "seed",
        "tracks",
        "offline",
        "online",
        "frames/s",
        "skeleton known",
        "frames/s",
        "",
    )
    show(f"IDF1 (wanted online: {WANTED}, skeleton known: {WANTED_KNOWN}, {WANTED_SPEED:.0f} frames/s)", columns, rows)


def simulated_figures(name: str, n_cameras: int, soft_tissue: float, seed: int) -> tuple[str, ...]:
    """One row of the table."""
    body = find_structure(name, seed)
    options = {"n_frames": N_FRAMES, "soft_tissue": soft_tissue, **FAULTS}
    simulated = simulate(body, seed=seed, n_cameras=n_cameras, labelled=False, **options)
    cloud, truth = simulated.take, simulated.truth.marker_of_point
    earlier = simulate(body, seed=seed + OTHER_MOTION, **{**options, "ghosts": 0.0}).take
    online, speed = online_figures(cloud, truth)
    known, known_speed = online_figures(cloud, truth, skelgen.reconstruct(earlier).skeleton)
    reached = online >= WANTED and known >= WANTED_KNOWN and min(speed, known_speed) >= WANTED_SPEED
    figures = (f"{tracks_alone(cloud, truth):.3f}", f"{offline(cloud, truth):.3f}", f"{online:.3f}", f"{speed:.0f}")
    return name, str(n_cameras), str(seed), *figures, f"{known:.3f}", f"{known_speed:.0f}", verdict(reached)


def online_figures(
    cloud: skelgen.PointCloud, truth: np.ndarray, skeleton: skelgen.Skeleton | None = None
) -> tuple[float, float]:
    """IDF1, and frames per second of processor time, that of the learning beside included."""
    tracker = Tracker(skeleton=skeleton, rate=cloud.rate)
    started = time.process_time()
    labels = [tracker.update(points, moment) for points, moment in zip(cloud, cloud.times, strict=True)]
    return idf1(np.concatenate(labels), truth), cloud.n_frames / (time.process_time() - started)


def tracks_alone(cloud: skelgen.PointCloud, truth: np.ndarray) -> float:
    """IDF1 of what is followed, when nothing is found again."""
    links = Links(LabelParameters())
    return idf1(np.concatenate([links.follow(points, 1) for points in cloud]), truth)


def offline(cloud: skelgen.PointCloud, truth: np.ndarray) -> float:
    """IDF1 of the labels stage, which sees the whole take."""
    markers = label_markers(cloud, LabelParameters())[0]
    labels = np.full(cloud.n_points, -1)
    for frame, points in enumerate(cloud):
        seen = np.flatnonzero(markers.seen[frame])
        apart = np.abs(points[:, np.newaxis] - markers.positions[frame, seen]).max(axis=2)
        point, column = np.nonzero(apart < SAME_POINT)
        labels[cloud.frame_starts[frame] + point] = seen[column]
    return idf1(labels, truth)


def idf1(labels: np.ndarray, truth: np.ndarray) -> float:
    """IDF1 of the labels of points against their markers; -1 is nobody's in both."""
    counts = np.zeros((labels.max() + 2, truth.max() + 2))
    np.add.at(counts, (labels, truth), 1)
    pairs = counts[:-1, :-1]
    hits = pairs[linear_sum_assignment(pairs, maximize=True)].sum()
    return float(2 * hits / ((labels >= 0).sum() + (truth >= 0).sum()))


def show_recordings(folder: Path) -> None:
    """The like for recordings whose labels are removed; the known skeleton is that of their first half."""
    rows = []
    for name, has_gaps in RECORDINGS:
        if not (folder / name).exists():
            print(f"{folder / name} is absent")
            continue
        take = skelgen.read(folder / name)
        half = take.n_frames // 2
        first = skelgen.Trajectories(take.positions[:half], take.names, take.rate)
        cloud, truth = without_labels(take, has_gaps)
        later, later_truth = without_labels(take, has_gaps, half)
        online, speed = online_figures(cloud, truth)
        known, _ = online_figures(later, later_truth, skelgen.reconstruct(first).skeleton)
        figures = (f"{tracks_alone(cloud, truth):.3f}", f"{offline(cloud, truth):.3f}", f"{online:.3f}", f"{speed:.0f}")
        rows.append((Path(name).name, "injected" if has_gaps else "own", *figures, f"{known:.3f}"))
    columns = ("recording", "gaps", "tracks", "offline", "online", "frames/s", "second half, skeleton of the first")
    show("IDF1 on recordings, labels removed", columns, rows)


def without_labels(take: skelgen.Trajectories, has_gaps: bool, start: int = 0) -> tuple[skelgen.PointCloud, np.ndarray]:
    """The take from a frame on as points in random order, and the marker of each."""
    rng = np.random.default_rng(0)
    seen = take.seen.copy()
    for marker in range(take.n_markers if has_gaps else 0):
        for first in range(int(rng.integers(0, int(GAP_EVERY * take.rate))), take.n_frames, int(GAP_EVERY * take.rate)):
            seen[first : first + int(GAP * take.rate), marker] = False
    markers = [rng.permutation(np.flatnonzero(row)) for row in seen[start:]]
    points = np.concatenate([take.positions[start + frame, row] for frame, row in enumerate(markers)])
    starts = np.concatenate([[0], np.cumsum([len(row) for row in markers])])
    return skelgen.PointCloud(points, starts, np.arange(len(markers)) / take.rate), np.concatenate(markers)


def show_memory() -> None:
    """What the process needs over a long session: a take forth and back, again and again."""
    cloud = simulate("human", seed=1, n_frames=N_FRAMES, n_cameras=6, soft_tissue=2.0, labelled=False, **FAULTS).take
    frames = [*cloud, *list(cloud)[::-1]]
    tracker, rows = Tracker(rate=cloud.rate), []
    for index in range(LONG_FRAMES):
        tracker.update(frames[index % len(frames)], index / cloud.rate)
        if (index + 1) % (LONG_FRAMES // 5) == 0:
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            rows.append((str(index + 1), f"{peak:.0f}", str(tracker.n_markers), str(len(tracker.merged))))
    show("Memory in a long session (wanted: flat)", ("frames", "peak [MiB]", "markers remembered", "joined"), rows)


if __name__ == "__main__":
    main()
