"""What is said where a file names no unit of length: how large the capture is, and whether it may be no positions."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

PERSON_M = np.array([[0.1, 1.7, 0.05], [0.2, 0.1, -0.03], [-0.1, 0.1, 0.03], [0.4, 0.8, 0.1]])  # 1.6 m tall


def table(points: np.ndarray, n_frames: int = 3) -> str:
    titles = ",".join(f"p{n}_{axis}" for n in range(len(points)) for axis in "xyz")
    return f"{titles}\n" + n_frames * (",".join(f"{x:g}" for x in points.ravel()) + "\n")


def test_size_of_a_person_in_centimetres_is_told(put):
    notice = read_take(put("cm.csv", table(PERSON_M * 100))).notices[0]
    assert "mm is assumed" in notice
    assert "span 0.16 m (1.6 m, as people do, if this is cm)" in notice


@pytest.mark.parametrize("scale", [1, 1000])
def test_size_of_a_person_in_metres_and_millimetres_is_told_without_a_doubt(put, scale):
    notice = read_take(put("person.csv", table(PERSON_M * scale))).notices[0]
    assert "span 1.6 m;" in notice


@pytest.mark.parametrize(
    ("scale", "sentence"), [((0.3, 0.5, -0.1), "fractions of an image"), ((300, 280, 0.2), "pixels of an image")]
)
def test_coordinates_in_images_are_told(put, scale, sentence):
    points = np.abs(PERSON_M) * scale
    path = put("image.csv", table(points))
    assert any(sentence in notice for notice in read_take(path).notices)
    assert not any(sentence in notice for notice in read_take(path, recorded_unit="m").notices)


@pytest.mark.parametrize("points", [PERSON_M, np.abs(PERSON_M[:, [0, 2, 1]])])
def test_person_is_in_no_image(put, points):
    assert not any("image" in notice for notice in read_take(put("person.csv", table(points))).notices)
