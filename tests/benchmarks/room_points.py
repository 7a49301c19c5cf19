"""Balls of many cameras to points: ``python tests/benchmarks/room_points.py [frames] [cameras ...]``.

A person of 45 markers walks in a simulated room of 4 x 4 m; limbs hide markers, balls nearer than 4 px are seen as one.
Centres err by 0.05 px. A point is wrong if it is farther from all markers than five of its deviations and 1 mm.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import numpy as np
from shown import show, show_machine
from unrendered import blobs_of

from skelgen.capture.room.simulated import person_scene, room_rig
from skelgen.capture.room.tracks import RoomTracker

CAMERAS = (2, 3, 4, 6, 8, 16)
SEEDS = 3
N_FRAMES = 500
DEVIATIONS, LEAST = 5.0, 1.0  # of a point, and mm
FEWEST = 2  # cameras of a marker that is asked for


def row(n_cameras: int, n_frames: int, seed: int) -> tuple[str, ...]:
    """Figures of one take."""
    rig = room_rig(n_cameras)
    scene, rng = person_scene(rig, n_frames, seed=seed), np.random.default_rng(seed)
    frames = [blobs_of(scene, frame, rig, rng) for frame in range(n_frames)]
    tracker = RoomTracker(rig)
    tracker.load()
    begin, found = time.process_time(), []
    for frame, (views, _) in enumerate(frames):
        found.append(tracker.see(views, frame / scene.rate))
    seconds = time.process_time() - begin
    n_seen = n_found = n_wrong = n_points = n_alone = n_placed = 0
    errors, errors_alone = [], []
    for frame, ((points, own), (_, numbers)) in enumerate(zip(found, frames, strict=True)):
        kept = tracker.tracks.are_markers(own)
        places, std = points.points[kept], np.sqrt(np.linalg.eigvalsh(points.covariance[kept])[:, -1])
        known = np.concatenate([one[one >= 0] for one in numbers])
        count = np.bincount(known, minlength=scene.positions.shape[1])
        seen = np.flatnonzero(count >= FEWEST)
        gaps = np.linalg.norm(places[:, np.newaxis] - scene.positions[frame], axis=2)
        nearest, off = gaps.argmin(axis=1), gaps.min(axis=1)
        is_right = off <= DEVIATIONS * std + LEAST
        n_seen, n_points, n_wrong = n_seen + len(seen), n_points + len(places), n_wrong + int((~is_right).sum())
        n_found += int(np.isin(seen, nearest[is_right]).sum())
        is_alone = points.n_cameras[kept] == 1
        errors.append(off[is_right & ~is_alone])
        errors_alone.append(off[is_alone])
        n_alone, n_placed = n_alone + int((count == 1).sum()), n_placed + int((is_right & is_alone).sum())
    rms, middle = np.sqrt((np.concatenate(errors) ** 2).mean()), np.median([0.0, *np.concatenate(errors_alone)])
    return (
        *(str(n_cameras), str(seed), f"{n_seen / n_frames:.1f}", f"{100 * n_found / n_seen:.2f}"),
        *(f"{100 * n_wrong / n_points:.3f}", f"{rms:.3f}"),
        *(f"{n_alone / n_frames:.1f}", f"{100 * n_placed / max(n_alone, 1):.0f}", f"{middle:.2f}"),
        f"{1000 * seconds / n_frames:.2f}",
    )


def main(n_frames: int, cameras: Sequence[int]) -> None:
    """Print the table."""
    show_machine()
    rows = [row(n_cameras, n_frames, seed) for n_cameras in cameras for seed in range(SEEDS)]
    columns: tuple[str, ...] = ("cameras", "seed", "seen by two or more", "found [%]", "wrong [%]", "rms [mm]")
    columns = (*columns, "by one", "placed [%]", "median [mm]", "ms a frame")
    show(f"Markers of a person in a room, {n_frames} frames", columns, rows)


if __name__ == "__main__":
    chosen = [int(text) for text in sys.argv[2:]]
    main(int(sys.argv[1]) if len(sys.argv) > 1 else N_FRAMES, chosen or CAMERAS)
