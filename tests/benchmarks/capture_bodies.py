"""Rigid bodies among unlabelled points: ``python tests/benchmarks/capture_bodies.py [number of frames]``.

Three targets of five balls are posed at random in front of the seed's rig (Gaschler 2011, Table 4.1); each ball is
hidden with 20 % chance, and stray points fill up to 40. All points err with the covariance that 0.1 px in both images
give them. Bodies of which four balls or more are seen must be found; a pose counts if it is right within 2 mm.
"""

from __future__ import annotations

import sys
import time
from typing import NamedTuple

import numpy as np
from shown import show, show_machine, verdict

from skelgen.capture.blobs import StereoPoints
from skelgen.capture.bodies import BodyFinder, propose_targets
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget, Camera, StereoRig

N_TARGETS, N_BALLS, N_POINTS = 3, 5, 40
HIDDEN = 0.2
FEWEST = 4
SIZE = 60.0  # mm: half the width of a target
ROOM, MIDDLE = np.array([300.0, 220.0, 350.0]), np.array([-200.0, 0.0, 1200.0])  # mm: where both cameras look
WRONG = 2.0  # mm
FRAMES, WARM_UP = 3000, 20
SEEDS = (0, 1, 2)


class Frame(NamedTuple):
    """One frame with its truth: pose and number of seen balls of each target."""

    points: StereoPoints
    poses: list[Floats]
    seen: list[int]


def seed_rig() -> StereoRig:
    """The rig of Table 4.1: 833 px focal length, 477 mm baseline, 13 degrees between the cameras."""
    left = np.array([[832.79, 0, 316.69], [0, 833.76, 240.22], [0, 0, 1]])
    right = np.array([[836.32, 0, 318.77], [0, 836.27, 257.80], [0, 0, 1]])
    turn = matrix_from_vector(np.array([0.021, 0.227, -0.013]))
    pose = transform_from(turn, np.array([-474.36, -1.49, 51.03]))
    return StereoRig(Camera(640, 480, left, name="left"), Camera(640, 480, right, camera_from_world=pose, name="right"))


def covariances(rig: StereoRig, points: Floats) -> Floats:
    """Of triangulated points [mm^2], shape (n, 3, 3): the inverse of what both images say of them."""
    information = np.zeros((len(points), 3, 3))
    for camera in (rig.left, rig.right):
        turn, shift = camera.camera_from_world[:3, :3], camera.camera_from_world[:3, 3]
        seen = points @ turn.T + shift
        slopes = np.zeros((len(points), 2, 3))
        for axis in range(2):
            focal = camera.matrix[axis, axis] / seen[:, 2]
            slopes[:, axis, axis] = focal
            slopes[:, axis, 2] = -focal * seen[:, axis] / seen[:, 2]
        slopes = slopes @ turn
        information += slopes.swapaxes(1, 2) @ slopes / rig.noise**2
    return np.linalg.inv(information)


def make_frame(rig: StereoRig, targets: list[BodyTarget], rng: np.random.Generator, n_points: int) -> Frame:
    """Targets posed at random, with hidden balls and strays."""
    poses, places, seen = [], [], []
    for target in targets:
        pose = transform_from(matrix_from_vector(rng.normal(size=3) * 2), MIDDLE + rng.uniform(-0.7, 0.7, 3) * ROOM)
        shown = rng.uniform(size=len(target.points)) >= HIDDEN
        poses.append(pose)
        places.append((target.points @ pose[:3, :3].T + pose[:3, 3])[shown])
        seen.append(int(shown.sum()))
    strays = n_points - sum(seen)
    places.append(MIDDLE + rng.uniform(-1, 1, (strays, 3)) * ROOM)
    points = rng.permutation(np.concatenate(places))
    covariance = covariances(rig, points)
    points = points + (np.linalg.cholesky(covariance) @ rng.normal(size=(len(points), 3, 1)))[..., 0]
    numbers = np.arange(n_points)
    found = StereoPoints(points, covariance, numbers, numbers, np.zeros(n_points), np.zeros(n_points, bool))
    return Frame(found, poses, seen)


def measure(n_targets: int, n_points: int, n_frames: int) -> tuple[int, int, int, Floats]:
    """Poses found, poses that can be found, wrong ones, and milliseconds of every frame, over `SEEDS`."""
    rig, found, possible, wrong = seed_rig(), 0, 0, 0
    times: list[float] = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        wished = [BodyTarget(f"body{i}", rng.uniform(-SIZE, SIZE, (N_BALLS, 3))) for i in range(n_targets)]
        finder = BodyFinder(targets := propose_targets(wished, seed=seed))
        for number in range(n_frames // len(SEEDS)):
            frame = make_frame(rig, targets, rng, n_points)
            start = time.process_time()
            bodies = {body.name: body for body in finder.find(frame.points)}
            if number >= WARM_UP:
                times.append(1e3 * (time.process_time() - start))
            for target, pose, seen in zip(targets, frame.poses, frame.seen, strict=True):
                body = bodies.get(target.name)
                error = np.inf if body is None else np.linalg.norm(body.world_from_body[:3, 3] - pose[:3, 3])
                possible += seen >= FEWEST
                found += bool(seen >= FEWEST and error <= WRONG)
                wrong += bool(body is not None and error > WRONG)
    return found, possible, wrong, np.array(times)


def rows(n_frames: int) -> list[tuple[str, ...]]:
    """The target of the issue, and what lies beyond."""
    table = []
    for n_targets, n_points in ((N_TARGETS, N_POINTS), (1, 50), (3, 100)):
        found, possible, wrong, times = measure(n_targets, n_points, n_frames)
        share, median = found / possible, float(np.median(times))
        table.append(
            (
                f"{n_targets} x {N_BALLS} balls, {n_points} points",
                f"{100 * share:.2f} % of {possible}",
                str(wrong),
                f"{median:.2f} ms",
                f"{np.percentile(times, 99):.2f} ms",
                verdict(share >= 0.995 and wrong == 0 and (median <= 1.0 or n_points > N_POINTS)),
            )
        )
    return table


if __name__ == "__main__":
    show_machine()
    n_frames = int(sys.argv[1]) if len(sys.argv) > 1 else FRAMES
    columns = ("case", "found (wanted 99.5 %)", "wrong (wanted 0)", "median (wanted 1 ms)", "99 %", "verdict")
    show("rigid bodies, 20 % of the balls hidden", columns, rows(n_frames))
