"""Small pictures that tell their truth: every pixel of pair k is 10 k + 1 on the left, 10 k + 2 on the right."""

from __future__ import annotations

import numpy as np
import pytest

SIZE = (24, 16)


def picture(index: int, side: int, size=SIZE) -> np.ndarray:
    """Return the picture of one side; `side` is 1 for the left and 2 for the right."""
    return np.full((size[1], size[0]), 10 * (index % 25) + side, np.uint8)


@pytest.fixture
def save():
    """Write a picture to a file."""
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")

    def write(path, index, side, size=SIZE):
        path.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(path), picture(index, side, size))

    return write


@pytest.fixture
def save_video():
    """Write a video without loss; each frame is the picture of its number."""
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")

    def write(path, n_frames, side, size=SIZE, rate=50.0):
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), rate, size, False)
        if not writer.isOpened():
            pytest.skip("this OpenCV cannot write FFV1")
        for index in range(n_frames):
            writer.write(picture(index, side, size))
        writer.release()

    return write


@pytest.fixture
def marks():
    """Return what the pixels of all pairs say: index, left and right number."""

    def read(source):
        with source:
            return [(pair.index, int(pair.left[3, 5]), int(pair.right[3, 5])) for pair in source]

    return read
