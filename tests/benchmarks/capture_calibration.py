"""Two cameras from real chessboards, and from a known rig: ``python tests/benchmarks/capture_calibration.py``."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict

from skelgen.capture.calibration.chessboard import Board, BoardView
from skelgen.capture.calibration.stereo import StereoCalibration, calibrate_stereo, calibrate_views
from skelgen.capture.optics import in_image, project
from skelgen.capture.reference_rig import reference_rig
from skelgen.geometry.rotations import matrix_from_vector, transform_from

CHESSBOARDS = Path(__file__).parents[2] / ".." / "shared" / "data" / "stereo_chessboard"
WANTED_RMS = 0.22  # px
WANTED_FOCAL, FOCAL_RANGE = (533.0, 538.0), 2.0  # px

BOARD = Board(9, 6, 25.0)
SEEDS = range(20)
N_PAIRS = 12
NOISE = 0.1  # px


def main() -> None:
    """Print both tables."""
    show_machine()
    show_real()
    show_known_rig()


def show_real() -> None:
    """The real pairs as they are, and with one of them spoilt."""
    if not CHESSBOARDS.is_dir():
        print("the recordings in ../shared/data are not here")
        return
    left, right = sorted(CHESSBOARDS.glob("left*.jpg")), sorted(CHESSBOARDS.glob("right*.jpg"))
    start = time.process_time()
    rows = [real_row("as they are", calibrate_stereo(left, right))]
    seconds = time.process_time() - start
    mixed = [right[1], right[0], *right[2:]]
    rows.append(real_row("two right images exchanged", calibrate_stereo(left, mixed)))
    columns = ("13 pairs", "pairs used", "rms [px]", "wanted", "focal lengths [px]", "wanted", "verdict", "")
    show(f"Real chessboards, {seconds:.2f} s of one core", columns, rows)


def real_row(name: str, found: StereoCalibration) -> tuple[str, ...]:
    """What was reached on the real pairs."""
    focal = [eye.matrix[0, 0] for eye in (found.rig.left, found.rig.right)]
    is_near = all(abs(have - want) <= FOCAL_RANGE for have, want in zip(focal, WANTED_FOCAL, strict=True))
    deviations = [found.left_std[0], found.right_std[0]]
    shown = " / ".join(f"{value:.2f} ± {std:.2f}" for value, std in zip(focal, deviations, strict=True))
    used = sum(pair.is_used for pair in found.pairs)
    reached = verdict(found.rms <= WANTED_RMS and is_near)
    return name, str(used), f"{found.rms:.3f}", f"<= {WANTED_RMS}", shown, "533 / 538 ± 2", found.verdict.grade, reached


def show_known_rig() -> None:
    """Errors beside the standard deviations that the calibration states."""
    errors, stds, spoilt = [], [], []
    for seed in SEEDS:
        pairs = seen_pairs(seed)
        found = calibrate_views([str(index) for index in range(N_PAIRS)], pairs, BOARD, reference_rig().left.size)
        errors.append(numbers(found) - numbers_of_reference())
        stds.append([found.left_std[0], found.left_std[2], found.right_std[0], found.baseline_std])
        pairs[3] = (pairs[3][0], replace(pairs[3][1], corners=pairs[7][1].corners))
        bad = calibrate_views([str(index) for index in range(N_PAIRS)], pairs, BOARD, reference_rig().left.size)
        spoilt.append(numbers(bad) - numbers_of_reference())
    rows = [
        (name, *(f"{value:.3f}" for value in values))
        for name, *values in zip(
            ("fx left [px]", "cx left [px]", "fx right [px]", "baseline [mm]"),
            np.sqrt(np.square(errors).mean(axis=0)),
            np.sqrt(np.square(stds).mean(axis=0)),
            np.sqrt(np.square(spoilt).mean(axis=0)),
            strict=True,
        )
    ]
    columns = ("of the reference rig", "rms error", "stated deviation", "rms error with one pair of two moments")
    show(f"{N_PAIRS} boards, corners with {NOISE} px of noise, {len(SEEDS)} seeds", columns, rows)


def numbers(found: StereoCalibration) -> np.ndarray:
    """Two focal lengths, one principal point, the baseline."""
    rig = found.rig
    return np.array([rig.left.matrix[0, 0], rig.left.matrix[0, 2], rig.right.matrix[0, 0], rig.baseline])


def numbers_of_reference() -> np.ndarray:
    """The truth."""
    rig = reference_rig()
    return np.array([rig.left.matrix[0, 0], rig.left.matrix[0, 2], rig.right.matrix[0, 0], rig.baseline])


def seen_pairs(seed: int) -> list[tuple[BoardView, BoardView]]:
    """Views of boards at random poses that both cameras see whole."""
    rng, rig, pairs = np.random.default_rng(seed), reference_rig(), []
    while len(pairs) < N_PAIRS:
        turn = matrix_from_vector(rng.uniform(-0.6, 0.6, 3))
        place = rng.uniform([0.0, -250.0, 800.0], [450.0, 250.0, 1500.0])
        pose = transform_from(turn, place - turn @ BOARD.points.mean(axis=0))
        points = BOARD.points @ pose[:3, :3].T + pose[:3, 3]
        pixels = [project(eye, points) for eye in (rig.left, rig.right)]
        if all(in_image(eye, seen).all() for eye, seen in zip((rig.left, rig.right), pixels, strict=True)):
            left, right = (BoardView(seen + NOISE * rng.normal(size=seen.shape), 2.5) for seen in pixels)
            pairs.append((left, right))
    return pairs


if __name__ == "__main__":
    main()
