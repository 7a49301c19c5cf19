"""Whether confidence in labels means something: ``python tests/benchmarks/confidence.py [seeds] [recordings]``.

Takes without labels are labelled, and each position is right if its point is of the true marker that its marker stands
for. Errors must concentrate where confidence is low. Then labels of complete takes are exchanged on purpose, and judged
without being repaired.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment
from shown import show, show_machine
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.model import Labelling, PointCloud, Trajectories
from skelgen.simulation import simulate
from skelgen.stages.labels import LabelParameters, label_markers, labelling_of_markers
from skelgen.stages.labels.point_labels import find_points

USUAL_PLACE = Path(__file__).parents[3] / "shared" / "data"
SEEDS = 2
N_FRAMES = 1000
TAKES = {
    "human, 8 cameras": ("human", {"n_cameras": 8, "soft_tissue": 2.0, "ghosts": 0.2}),
    "human, 6 cameras": ("human", {"n_cameras": 6, "soft_tissue": 3.0, "ghosts": 0.2}),
    "human, 4 cameras": ("human", {"n_cameras": 4, "soft_tissue": 2.0, "ghosts": 0.2}),
    "human, 15 % dropouts": ("human", {"dropouts": 0.15, "soft_tissue": 2.0, "ghosts": 1.0}),
    "tree:10, 6 cameras": ("tree:10", {"n_cameras": 6, "soft_tissue": 1.0, "ghosts": 0.2}),
}
RECORDINGS = {"human/nick_freeform_001.c3d": (0.0, 0.25), "arm/arm-4-4-4_clean_30fps.c3d": (0.25,)}
"""Seconds of the gaps that are made every two seconds in each marker; 0 = none."""

EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 0.999, 1.0)
SWAPS = 10
LONGEST_SWAP = 150  # frames

Judged = tuple[Trajectories, Labelling, np.ndarray]


def main() -> None:
    """Print recall of wrong positions, false doubts, and the share of right positions by confidence."""
    n_seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else USUAL_PLACE
    show_machine()
    with threadpool_limits(limits=1):
        found = {name: [_simulated(*take, seed) for seed in range(n_seeds)] for name, take in TAKES.items()}
        found |= {name: [judged] for name, judged in _recordings(folder)}
        exchanged = {"exchanged labels": [_exchanged(seed) for seed in range(n_seeds)]}
    columns = ("take", "positions", "wrong", "wrong in doubtful spans", "right in doubtful spans", "spans")
    show("Doubtful spans", columns, [_row(name, takes) for name, takes in {**found, **exchanged}.items()])
    well = [take for name, takes in found.items() if "arm" not in name for take in takes]
    show("Confidence of all but the arm", ("confidence", "positions", "right"), _bins(well))
    show("Confidence where labels were exchanged", ("confidence", "positions", "right"), _bins(exchanged.popitem()[1]))
    _show_time()


def _simulated(structure: str, options: dict[str, float], seed: int) -> Judged:
    case = simulate(structure, seed=seed, n_frames=N_FRAMES, noise=0.3, labelled=False, **options)
    return _judged(case.take, np.asarray(case.truth.marker_of_point))


def _recordings(folder: Path) -> list[tuple[str, Judged]]:
    judged = []
    for name, gaps in RECORDINGS.items():
        if not (folder / name).exists():
            print(f"{name} is absent and left out")
            continue
        for gap in gaps:
            title = f"{Path(name).stem}, gaps of {gap:g} s" if gap else Path(name).stem
            judged.append((title, _judged(*_without_labels(skelgen.read(folder / name), gap))))
    return judged


def _without_labels(take: Trajectories, gap: float) -> tuple[PointCloud, np.ndarray]:
    rng = np.random.default_rng(0)
    seen = take.seen.copy()
    for marker in range(take.n_markers if gap else 0):
        for start in range(int(rng.integers(0, int(2 * take.rate))), take.n_frames, int(2 * take.rate)):
            seen[start : start + int(gap * take.rate), marker] = False
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    order = np.concatenate([first + rng.permutation(last - first) for first, last in pairwise(starts)])
    return PointCloud(take.positions[seen][order], starts, take.times, name=take.name), np.nonzero(seen)[1][order]


def _judged(cloud: PointCloud, true_of_point: np.ndarray) -> Judged:
    markers, labelling = label_markers(cloud, LabelParameters())
    marker_of_point = find_points(cloud, markers.positions)
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    used = marker_of_point >= 0
    counts = np.zeros((markers.n_markers, true_of_point.max() + 1))
    both = used & (true_of_point >= 0)
    np.add.at(counts, (marker_of_point[both], true_of_point[both]), 1)
    stands_for = np.full(markers.n_markers, -2)
    rows, columns = linear_sum_assignment(-counts)
    stands_for[rows] = columns
    right = np.zeros(markers.seen.shape, dtype=bool)
    right[frame_of_point[used], marker_of_point[used]] = true_of_point[used] == stands_for[marker_of_point[used]]
    return markers, labelling, right


def _exchanged(seed: int) -> Judged:
    take = simulate("human", seed=seed, n_frames=3 * N_FRAMES, noise=0.5, soft_tissue=2.0, dropouts=0.05).take
    rng = np.random.default_rng(seed)
    positions, right = take.positions.copy(), np.ones(take.seen.shape, dtype=bool)
    for _ in range(SWAPS):
        pair = rng.choice(take.n_markers, 2, replace=False)
        first = int(rng.integers(0, take.n_frames - LONGEST_SWAP))
        span = slice(first, first + int(rng.integers(LONGEST_SWAP // 10, LONGEST_SWAP)))
        positions[span, pair] = positions[span, pair[::-1]]
        right[span, pair] = False
    wrong = dataclasses.replace(take, positions=positions)
    return wrong, labelling_of_markers(wrong, wrong), right


def _row(name: str, takes: list[Judged]) -> tuple[str, ...]:
    wrong = doubted = false = total = spans = 0
    for markers, labelling, right in takes:
        seen, doubtful = markers.seen, labelling.doubtful
        total += int(seen.sum())
        wrong += int((seen & ~right).sum())
        doubted += int((doubtful & ~right).sum())
        false += int((doubtful & right).sum())
        spans += len(labelling.doubts)
    recall = f"{100 * doubted / wrong:.1f} %" if wrong else "-"
    return (
        name,
        str(total),
        f"{100 * wrong / total:.2f} %",
        recall,
        f"{100 * false / (total - wrong):.2f} %",
        str(spans),
    )


def _bins(takes: list[Judged]) -> list[tuple[str, ...]]:
    confidence = np.concatenate([labelling.confidence[markers.seen] for markers, labelling, _ in takes])
    right = np.concatenate([right[markers.seen] for markers, _, right in takes])
    place = np.clip(np.digitize(confidence, EDGES) - 1, 0, len(EDGES) - 2)
    rows = []
    for index, (low, high) in enumerate(pairwise(EDGES)):
        inside = right[place == index]
        rows.append((f"{low:g} - {high:g}", str(len(inside)), f"{100 * inside.mean():.2f} %" if len(inside) else "-"))
    return rows


def _show_time() -> None:
    case = simulate("human", seed=0, n_frames=1500, n_cameras=6, soft_tissue=2.0, labelled=True)
    started = time.process_time()
    labelling_of_markers(case.take, case.take)
    seconds = time.process_time() - started
    print(f"{case.take.n_frames} frames of {case.take.n_markers} markers are judged in {seconds:.2f} s of one core")


if __name__ == "__main__":
    main()
