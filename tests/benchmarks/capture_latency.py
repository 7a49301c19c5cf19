"""How long a pair of images takes, and what prediction costs and gives: ``python tests/benchmarks/capture_latency.py``.

The reference arm, three targets of five balls with a ball joint and a hinge, swings before the reference rig; both
images of 640 x 480 pixels are rendered beforehand. Times are of the processor, on one core, without threads.

Prediction is measured on a target that swings at three speeds 1.5 m away, found with the errors that such poses have:
what is left of the errors, and by how much the smoothed poses are late (the shift in time at which they fit best). A
target that rests and then moves at 1 m/s at once shows the worst: how many milliseconds its smoothed place is behind.

The search for three targets among more and more points is timed with and without knowing where they should be.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from capture_bodies import make_frame
from shown import show, show_machine, verdict

from skelgen.capture.bodies import BodyFinder, ExpectedPose
from skelgen.capture.bodies.design import propose_targets
from skelgen.capture.bodies.prediction import BodyFilter, PredictionParameters
from skelgen.capture.live import MotionCapture
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.capture.values import FoundBody, FrameSet
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget

PAIRS, WARM_UP = 300, 5
SEEDS = (0, 1)
WANTED = (6.0, 12.0)  # ms: median and 99th percentile
RATE = 60.0  # Hz
NOISE = np.array([0.003, 0.003, 0.002, 0.2, 0.2, 0.6])  # rad and mm: 0.1 px, five balls 1.5 m away
SWINGS = (0.3, 1.0, 3.0)  # Hz, each by 150 mm and 0.6 rad
SPEED, REST = 1000.0, 10.0  # mm/s and s: how fast a target moves that starts at once, after how long
SWING_FRAMES, SETTLING = 1800, 60
CROWDS, SEARCHED = (15, 40, 100), 600  # points in a frame, and frames
FORETOLD = np.diag([0.02**2] * 3 + [5.0**2] * 3)  # rad^2 and mm^2: of a target that swings at 2 Hz
LAGS = np.linspace(-0.02, 0.05, 701)  # s


def measure(n_pairs: int, prediction: PredictionParameters | None) -> tuple[Floats, Floats]:
    """Milliseconds of every pair, and of those in which some balls touch."""
    times, touching = [], []
    for seed in SEEDS:
        source = simulated_rig("arm", n_frames=n_pairs // len(SEEDS), seed=seed)
        pairs: list[FrameSet] = list(source)
        with MotionCapture(source.settings, prediction=prediction, threads=False) as capture:
            for pair in pairs[:WARM_UP]:
                capture.see(pair)
            for pair in pairs:
                start = time.process_time()
                captured = capture.see(pair)
                times.append(1e3 * (time.process_time() - start))
                touching.append(any(balls.touching.any() for balls in captured.views))
    return np.array(times), np.array(times)[np.array(touching)]


def latency_rows(n_pairs: int) -> list[tuple[str, ...]]:
    """With and without prediction, and the pairs in which balls touch."""
    rows = []
    for title, prediction in (("as found", None), ("predicted", PredictionParameters())):
        times, touching = measure(n_pairs, prediction)
        median, late = np.percentile(times, (50, 99))
        rows.append(
            (
                title,
                f"{median:.2f} ms",
                f"{late:.2f} ms",
                f"{np.median(touching):.2f} ms of {len(touching)}" if len(touching) else "none",
                verdict(median <= WANTED[0] and late <= WANTED[1]),
            )
        )
    return rows


def swing(hertz: float) -> tuple[Floats, Floats]:
    """Poses of a target that swings, shape (n_frames, 4, 4), and their times [s]."""
    times = np.arange(SWING_FRAMES) / RATE
    phase = 2 * np.pi * hertz * times
    places = np.stack([150 * np.sin(phase), 100 * np.cos(phase), 1500 + 50 * np.sin(2 * phase)], axis=1)
    return transform_from(matrix_from_vector(np.sin(phase)[:, np.newaxis] * [0.4, 0.4, 0.2]), places), times


def errors(poses: Floats, truth: Floats) -> Floats:
    """Turns [rad] and shifts [mm] from the truth, shape (n, 6)."""
    turns = vector_from_matrix(poses[:, :3, :3] @ truth[:, :3, :3].swapaxes(1, 2))
    return np.concatenate([turns, poses[:, :3, 3] - truth[:, :3, 3]], axis=1)


def lag(places: Floats, truth: Floats, times: Floats) -> float:
    """Seconds by which places are late: the shift in time at which the truth fits them best."""
    inner = slice(SETTLING, -SETTLING)
    squares = []
    for shift in LAGS:
        moved = np.stack([np.interp(times[inner] - shift, times, truth[:, axis]) for axis in range(2)], axis=1)
        squares.append(((places[inner, :2] - moved) ** 2).sum())
    return float(LAGS[int(np.argmin(squares))])


def filtered(poses: Floats, times: Floats) -> tuple[Floats, Floats, Floats]:
    """Found, smoothed and foretold poses of a target."""
    rng = np.random.default_rng(0)
    one, raw, smooth, ahead = BodyFilter(PredictionParameters()), [], [], []
    for pose, moment in zip(poses, times, strict=True):
        expected = one.expected(moment)
        ahead.append(pose if expected is None else expected.world_from_body)
        error = rng.normal(size=6) * NOISE
        noisy = transform_from(matrix_from_vector(error[:3]) @ pose[:3, :3], pose[:3, 3] + error[3:])
        found = FoundBody("target", noisy, np.diag(NOISE**2), np.arange(5), 0.0)
        raw.append(noisy)
        smooth.append(one.corrected(moment, found).world_from_body)
    return np.array(raw), np.array(smooth), np.array(ahead)


def sudden_row() -> tuple[str, ...]:
    """A target that rests for ten seconds and then moves along x at once."""
    times = np.arange(720) / RATE
    places = np.stack([SPEED * np.maximum(times - REST, 0.0), 0 * times, 1500 + 0 * times], axis=1)
    poses = transform_from(np.tile(np.eye(3), (len(times), 1, 1)), places)
    _, smooth, _ = filtered(poses, times)
    start = int(REST * RATE)
    rest = slice(start // 2, start)
    left = np.sqrt((errors(smooth[rest], poses[rest]) ** 2).mean(axis=0) / NOISE**2)
    behind = 1e3 * (places[:, 0] - smooth[:, 0, 3])[start:] / SPEED
    shares = f"{100 * left[:3].mean():.0f} % at rest", f"{100 * left[3:].mean():.0f} % at rest"
    return ("at once", *shares, "-", f"{behind.max():.1f} ms at most, {behind[:30].mean():.1f} ms in the first 0.5 s")


def prediction_rows() -> list[tuple[str, ...]]:
    """Errors that are left, how far the prediction for the next frame is off, and the lag."""
    rows = []
    for hertz in SWINGS:
        poses, times = swing(hertz)
        raw, smooth, ahead = filtered(poses, times)
        before, after, off = (errors(part, poses)[SETTLING:] for part in (raw, smooth, ahead))
        left = np.sqrt((after**2).mean(axis=0) / (before**2).mean(axis=0))
        late = 1e3 * lag(smooth[:, :3, 3], poses[:, :3, 3], times)
        rows.append(
            (
                f"{hertz:g} Hz",
                f"{100 * left[:3].mean():.0f} %",
                f"{100 * left[3:].mean():.0f} %",
                f"{np.sqrt((off[:, 3:] ** 2).sum(axis=1).mean()):.2f} mm",
                f"{late:.1f} ms",
            )
        )
    return [*rows, sudden_row()]


def search_rows() -> list[tuple[str, ...]]:
    """Median times of the search everywhere and where the targets are expected."""
    rows, rig, rng = [], reference_rig(), np.random.default_rng(0)
    targets = propose_targets([BodyTarget(f"body{i}", rng.uniform(-60, 60, (5, 3))) for i in range(3)])
    finder = BodyFinder(targets)
    for n_points in CROWDS:
        times: tuple[list[float], list[float]] = ([], [])
        for _ in range(SEARCHED):
            frame = make_frame(rig, targets, rng, n_points)
            near = {
                target.name: ExpectedPose(pose, FORETOLD) for target, pose in zip(targets, frame.poses, strict=True)
            }
            for expected, spent in zip((None, near), times, strict=True):
                start = time.process_time()
                finder.find(frame.points, expected)
                spent.append(1e3 * (time.process_time() - start))
        rows.append((f"{n_points} points", *(f"{np.median(spent):.2f} ms" for spent in times)))
    return rows


if __name__ == "__main__":
    show_machine()
    n_pairs = int(sys.argv[1]) if len(sys.argv) > 1 else PAIRS
    columns = ("poses", "median (wanted 6 ms)", "99 % (wanted 12 ms)", "median where balls touch", "verdict")
    show(f"pair of images to joint angles, {n_pairs} pairs", columns, latency_rows(n_pairs))
    columns = ("swing", "errors of rotation left", "errors of place left", "next frame predicted within", "late by")
    show("prediction", columns, prediction_rows())
    show("search for three targets", ("among", "everywhere", "where expected"), search_rows())
