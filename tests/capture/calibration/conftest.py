"""Poses of a board before the reference rig, with the pixels that both cameras see; and the real pairs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from skelgen.capture.calibration.chessboard import Board, BoardView
from skelgen.capture.optics import in_image, project
from skelgen.capture.reference_rig import reference_rig
from skelgen.geometry.rotations import matrix_from_vector, transform_from

CHESSBOARDS = Path(__file__).parents[3] / ".." / "shared" / "data" / "stereo_chessboard"
SHARP_EDGE = 2.5  # px


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(6)


@pytest.fixture
def board() -> Board:
    return Board(9, 6, 25.0)


@pytest.fixture
def real_pairs() -> tuple[list[Path], list[Path]]:
    if not CHESSBOARDS.is_dir():
        pytest.skip("the recordings in ../shared/data are not here")
    return sorted(CHESSBOARDS.glob("left*.jpg")), sorted(CHESSBOARDS.glob("right*.jpg"))


@pytest.fixture
def seen_pairs(board):
    """A function that returns pairs of views of the board by the reference rig, with noise [px] and turns [rad]."""

    def make(n_pairs: int, noise: float, seed: int = 6, lean: float = 0.6) -> list[tuple[BoardView, BoardView]]:
        rng, rig, pairs = np.random.default_rng(seed), reference_rig(), []
        while len(pairs) < n_pairs:
            turn = matrix_from_vector(rng.uniform(-lean, lean, 3))
            place = rng.uniform([0.0, -250.0, 800.0], [450.0, 250.0, 1500.0])
            pose = transform_from(turn, place - turn @ board.points.mean(axis=0))
            points = board.points @ pose[:3, :3].T + pose[:3, 3]
            pixels = [project(eye, points) for eye in (rig.left, rig.right)]
            if all(in_image(eye, seen).all() for eye, seen in zip((rig.left, rig.right), pixels, strict=True)):
                left, right = (BoardView(seen + noise * rng.normal(size=seen.shape), SHARP_EDGE) for seen in pixels)
                pairs.append((left, right))
        return pairs

    return make
