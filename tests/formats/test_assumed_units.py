"""What is said where a file names no unit of length: how large the capture is, and whether it may be no positions."""

from __future__ import annotations

import json

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


@pytest.mark.parametrize(
    "titles", ["0_x,0_y,0_z,0_vis,1_x,1_y,1_z,1_vis", "x_0,y_0,z_0,visibility_0,x_1,y_1,z_1,visibility_1"]
)
def test_landmarks_in_images_may_be_out_of_them(put, titles):
    """MediaPipe guesses where legs are that the camera does not see."""
    row = "0.54,0.57,-1.97,0.99,0.82,3.1,-0.29,0.002\n"
    assert any("of visibility" in notice for notice in read_take(put("image.csv", f"{titles}\n{row * 3}")).notices)
    world = row.replace("0.54,0.57", "-0.02,-0.6")
    assert not any("image" in notice for notice in read_take(put("world.csv", f"{titles}\n{world * 3}")).notices)
    plain = titles.replace("visibility", "n").replace("vis", "n")
    assert not any("image" in notice for notice in read_take(put("plain.csv", f"{plain}\n{row * 3}")).notices)


def test_landmarks_in_images_are_told_of_tidy_tables(put):
    rows = "".join(f"{frame},{name},0.5,{y},-1.2,0.9\n" for frame in range(3) for name, y in (("a", 0.4), ("b", 1.3)))
    take = read_take(put("tidy.csv", f"frame,landmark,x,y,z,visibility\n{rows}"))
    assert any("of visibility" in notice for notice in take.notices)


@pytest.mark.parametrize(
    "text",
    [
        "t,a_x_mm,a_y_mm,a_z_mm,b_x_mm,b_y_mm,b_z_mm\n0,1,2,3,4,5,6\n",
        "frame,name,x_mm,y_mm,z_mm\n0,a,1,2,3\n0,b,4,5,6\n",
    ],
)
def test_unit_that_titles_name_is_taken_whatever_the_user_states(put, text):
    take = read_take(put("mm.csv", text), recorded_unit="m")
    np.testing.assert_array_equal(take.positions[0], [[1, 2, 3], [4, 5, 6]])
    assert any("the file names its length unit, mm, which is taken" in notice for notice in take.notices)


def test_unit_that_is_not_known_is_taken_as_stated_and_else_refused(put, refused):
    value = {"unit": "ells", "positions": (PERSON_M * np.ones((3, 1, 1))).tolist()}
    path = put("ells.json", json.dumps(value))
    assert "`--recorded-unit` states one" in refused(path)
    take = read_take(path, recorded_unit="cm")
    np.testing.assert_allclose(take.positions[0], PERSON_M * 10)
    assert "cm is taken" in take.notices[0]
