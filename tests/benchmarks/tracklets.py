"""How pure tracklets are, and how fast they come: ``python tests/benchmarks/tracklets.py [folder of recordings]``."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.simulation.markers import merged_points, shuffled_points
from skelgen.simulation.motion import smooth_curves
from skelgen.stages.labels import LabelParameters
from skelgen.stages.labels.tracking.follow import follow_points

SEEDS = range(3)
N_FRAMES = 1500
RATE = 100.0  # Hz
CAMERAS = {"noise": 0.3, "ghosts": 0.2}
CASES = (
    ("human, 8 cameras, 2 mm", "human", CAMERAS | {"n_cameras": 8, "soft_tissue": 2.0}),
    ("human, 6 cameras, 3 mm", "human", CAMERAS | {"n_cameras": 6, "soft_tissue": 3.0}),
    ("human, 4 cameras, 2 mm", "human", CAMERAS | {"n_cameras": 4, "soft_tissue": 2.0}),
    ("human, dropouts 0.05", "human", {"noise": 0.5, "dropouts": 0.05}),
    ("human, dropouts 0.2", "human", {"noise": 0.5, "dropouts": 0.2}),
    ("human, 3 ghosts", "human", {"noise": 0.5, "dropouts": 0.05, "ghosts": 3.0}),
    ("human, merged 60 mm", "human", {"noise": 0.5, "merged": 60.0}),
    ("human, 0.5 duplicates", "human", {"noise": 0.5, "duplicates": 0.5, "dropouts": 0.05}),
    ("human, edge jumps 5 mm", "human", CAMERAS | {"n_cameras": 6, "edge_jumps": 5.0}),
    ("human, clean", "human", {}),
    ("tree:10, 6 cameras, 1 mm", "tree:10", CAMERAS | {"n_cameras": 6, "soft_tissue": 1.0}),
)
RECORDINGS = ("human/nick_freeform_001.c3d", "mouse/mouse_S15.c3d", "wheelchair/racing_full.c3d")
MERGED = (0.0, 10.0)  # mm
N_CROSSING, CROSSING_ROOM = 20, 250.0  # markers, mm to each side: two of them meet within 10 mm once in a second or so
CROSSING_FREQUENCIES = (0.2, 1.5)  # Hz
GAP_EVERY, GAP_SECONDS = 2.0, 0.25
FAST = 5000.0  # frames per second
PER_MILLION = 1e6
COLUMNS = (
    "case",
    "points",
    "other, ppm",  # points whose track is mostly another marker's
    "none, ppm",  # points of no marker in the track of a marker
    "mixed",  # tracks with points of two markers
    "tracks",
    "long",  # of half a second
    "in long",  # part of the markers' points
    "frames/s",
    "",
)


def main() -> None:
    """Print purity, number of tracklets and speed of every case."""
    show_machine()
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[3] / "shared" / "data"
    with threadpool_limits(limits=1):
        follow_points(simulate("rods", n_frames=10, labelled=False).take, LabelParameters())
        rows = [_row(name, [_simulated(kind, seed, options) for seed in SEEDS]) for name, kind, options in CASES]
        for merged in MERGED:
            rows.append(_row(f"crossing, merged {merged:g} mm", [crossing(seed, merged) for seed in SEEDS]))
        for path in RECORDINGS:
            for gaps in (False, True):
                name = path.split("/")[-1] + (", gaps" if gaps else "")
                rows.append(_row(name, [unlabelled(skelgen.read(folder / path), gaps, 0)]))
        show("Tracklets (wanted: 5000 frames per second)", COLUMNS, rows)


def _simulated(kind: str, seed: int, options: dict[str, float]) -> tuple[PointCloud, np.ndarray]:
    simulated = simulate(kind, seed=seed, n_frames=N_FRAMES, labelled=False, **options)
    return simulated.take, simulated.truth.marker_of_point


def _row(name: str, takes: list[tuple[PointCloud, np.ndarray]]) -> tuple[str, ...]:
    """One row: means over the takes."""
    figures = np.array([_figures(cloud, marker) for cloud, marker in takes]).mean(axis=0)
    points, other, none, mixed, tracks, n_long, in_long, speed = figures
    impure = (f"{PER_MILLION * other:.0f}", f"{PER_MILLION * none:.0f}", f"{mixed:.1f}")
    shown = (f"{tracks:.0f}", f"{n_long:.0f}", f"{100 * in_long:.1f} %", f"{speed:.0f}")
    return name, f"{points:.0f}", *impure, *shown, verdict(speed >= FAST)


def _figures(cloud: PointCloud, marker: np.ndarray) -> tuple[float, ...]:
    started = time.process_time()
    track_of_point, _ = follow_points(cloud, LabelParameters())
    speed = cloud.n_frames / (time.process_time() - started)
    tracked = track_of_point >= 0
    counts = np.zeros((int(track_of_point.max()) + 1, int(marker.max()) + 2), dtype=np.intp)
    np.add.at(counts, (track_of_point[tracked], marker[tracked]), 1)  # points of no marker fall into the last column
    of_markers, sizes = counts[:, :-1], counts.sum(axis=1)
    own = of_markers.max(axis=1)
    other, none = of_markers.sum(axis=1) - own, np.where(own > 0, counts[:, -1], 0)
    is_long, real = sizes >= cloud.rate / 2, (marker >= 0).sum()
    n_tracks, n_mixed, n_long = (sizes > 0).sum(), (other > 0).sum(), is_long.sum()
    return (
        len(track_of_point),
        other.sum() / real,
        none.sum() / real,
        n_mixed,
        n_tracks,
        n_long,
        own[is_long].sum() / real,
        speed,
    )


def crossing(seed: int, merged: float) -> tuple[PointCloud, np.ndarray]:
    """Markers that move freely through the same room, and meet."""
    rng = np.random.default_rng(seed)
    paths = smooth_curves(rng, N_FRAMES, RATE, 3 * N_CROSSING, CROSSING_FREQUENCIES).reshape(N_FRAMES, N_CROSSING, 3)
    observed = CROSSING_ROOM * paths + 0.3 * rng.normal(size=paths.shape)
    apart, frames, points = merged_points(observed, merged)
    more = (frames, np.full(len(frames), -1, dtype=np.intp), points)
    places, starts, markers = shuffled_points(apart, more, rng)
    return PointCloud(places, starts, np.arange(N_FRAMES) / RATE), markers


def unlabelled(take: skelgen.Trajectories, gaps: bool, seed: int) -> tuple[PointCloud, np.ndarray]:
    """A recording without its labels, with further gaps if asked for."""
    rng = np.random.default_rng(seed)
    positions = np.array(take.positions)
    length, every = round(GAP_SECONDS * take.rate), round(GAP_EVERY * take.rate)
    for marker in range(take.n_markers if gaps else 0):
        for first in range(int(rng.integers(every)), take.n_frames, every):
            positions[first : first + length, marker] = np.nan
    nothing = (np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp), np.empty((0, 3)))
    points, starts, markers = shuffled_points(positions, nothing, rng)
    return PointCloud(points, starts, np.arange(take.n_frames) / take.rate), markers


if __name__ == "__main__":
    main()
