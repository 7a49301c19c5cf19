"""Wand calibration of a room, truth and bound: ``python tests/benchmarks/room_calibration.py [seconds] [cameras ...]``.

A wand of 500 mm is waved in a simulated room of 4 x 4 m before cameras of 1280 x 1024 at 100 Hz, each covered a third
of the time; centres err by 0.05 px. Points of a grid in the room are then measured with what was found and compared
with the truth after the best motion of all: without noise, which leaves the errors of the calibration, and with it. The
bound is that of Cramer and Rao.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import numpy as np
from shown import show, show_machine
from unrendered import blobs_of

from skelgen.capture.optics import in_image, project
from skelgen.capture.room.calibrate import calibrate_wand, point_covariances, room_grid
from skelgen.capture.room.points import PointMatcher, balls_at
from skelgen.capture.room.simulated import ROOM_RATE, WAND, room_rig, wand_scene
from skelgen.geometry.orientation import fit_transform
from skelgen.model.arrays import Floats
from skelgen.model.rig import CameraRig

SEEDS = 5
SECONDS = 60


def off(
    found: CameraRig, true: CameraRig, points: Floats, noise: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Root mean square error [mm] of points after the best motion, and of the scale [%]."""
    seen = np.full((len(points), 3), np.nan)
    for index, point in enumerate(points):
        pixels = [project(eye, point[np.newaxis]) for eye in true.cameras]
        views = [
            balls_at(one[in_image(eye, one)] + noise * rng.normal(size=one[in_image(eye, one)].shape), true.noise)
            for eye, one in zip(true.cameras, pixels, strict=True)
        ]
        there = PointMatcher(found).find(views)
        if len(there):
            seen[index] = there.points[0]
    known = np.isfinite(seen[:, 0])
    motion = fit_transform(points, seen, known)
    gaps = seen[known] - (points[known] @ motion[:3, :3].T + motion[:3, 3])
    one, other = seen[known] - seen[known].mean(axis=0), points[known] - points[known].mean(axis=0)
    return float(np.sqrt((gaps**2).sum(axis=1).mean())), 100 * float(np.sqrt((one**2).sum() / (other**2).sum()) - 1)


def row(n_cameras: int, seconds: float, seed: int) -> tuple[float, ...]:
    """Figures of one calibration."""
    rig = room_rig(n_cameras)
    n_frames = int(seconds * ROOM_RATE)
    scene, rng = wand_scene(rig, n_frames, seed=seed), np.random.default_rng(seed)
    frames = [blobs_of(scene, frame, rig, rng)[0] for frame in range(n_frames)]
    begin = time.process_time()
    done = calibrate_wand(frames, WAND, [eye.size for eye in rig.cameras], rig.names)
    spent = time.process_time() - begin
    points = room_grid(scene.positions.reshape(-1, 3))
    bounds = point_covariances(rig, done.covariance, points)
    calibrated = 3 * np.diag(bounds[0]).mean()
    noisy = np.trace(bounds[1], axis1=1, axis2=2).mean()
    alone, scale = off(done.rig, rig, points, 0.0, rng)
    with_noise, _ = off(done.rig, rig, points, rig.noise, rng)
    return alone, np.sqrt(calibrated), with_noise, np.sqrt(calibrated + noisy), scale, spent


def main(seconds: float, cameras: Sequence[int]) -> None:
    """Print the table."""
    show_machine()
    rows = []
    for n_cameras in cameras:
        found = np.array([row(n_cameras, seconds, seed) for seed in range(SEEDS)])
        rows += [
            (str(n_cameras), str(seed), *(f"{value:.4f}" for value in one[:5]), f"{one[5]:.1f}")
            for seed, one in enumerate(found)
        ]
        together = [*np.sqrt((found[:, :5] ** 2).mean(axis=0)), found[:, 5].mean()]
        rows.append((str(n_cameras), "rms", *(f"{value:.4f}" for value in together[:5]), f"{together[5]:.1f}"))
    columns = ("cameras", "seed", "calibration [mm]", "bound", "points [mm]", "bound", "scale [%]", "seconds")
    show(f"Wand calibration of {seconds:g} s", columns, rows)


if __name__ == "__main__":
    chosen = [int(text) for text in sys.argv[2:]]
    main(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS, chosen or [8])
