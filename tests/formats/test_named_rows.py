"""Texts without titles in which names stand before coordinates: two points in three frames."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

PLACES = [("knee", (100.5, 200, 300)), ("toe", (400, 500, 600))]
TIMES = (0.0, 0.02, 0.04)


def text(line, before="", end=""):
    points = [line.format(*place, n=name) for name, place in PLACES]
    return "".join(before.format(t=t, f=round(50 * t)) + "".join(points) + end for t in TIMES)


LAYOUTS = {
    "blocks": text("{n} {0} {1} {2}\n", before="time {t}\n"),
    "molecules": text("{n}\t{0}\t{1}\t{2}\n", before="2\nframe {f} t={t}\n"),
    "line of a frame": text(",{n},{0},{1},{2}", before="{t}", end="\n"),
    "brackets": text(" {n}: ({0}, {1}, {2})", before="{t} s", end="\n"),
    "log": "".join(f"[I] 12:00:0{t} marker {n} x={p[0]} y={p[1]} z={p[2]}\n" for t in TIMES for n, p in PLACES),
    "pairs": text(" {n}_x={0} {n}_y={1} {n}_z={2}", before="t={t}", end="\n"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_names_before_coordinates_are_read(put, layout):
    path = put("points.txt", LAYOUTS[layout])
    take = read_take(path)
    assert recognise(path).name == "named-rows"
    assert (take.names, take.rate) == (("knee", "toe"), pytest.approx(50.0))
    np.testing.assert_allclose(take.positions, [[place for _, place in PLACES]] * 3)


def test_point_without_a_line_is_unseen(put):
    rows = ["a 1 2 3", "b 4 5 6", "a 1 2 3", "b 4 5 6", "b 4 5 6", "a 1 2 3", "b 4 5 6"]
    assert read_take(put("gap.txt", "\n".join(rows) + "\n")).seen[:, 0].tolist() == [True, True, False, True]


def test_names_of_each_line_alone_are_refused(put, refused):
    rows = "".join(f"{name} 1 2 3\n" for name in "ab") * 3 + "".join(f"c{n} 1 2 3\na 1 2 3\n" for n in range(4000))
    assert "4002 names in 4003 frames" in refused(put("many.txt", rows))


@pytest.mark.parametrize("content", [":FULLY-SPECIFIED\n1\nroot 1 2 3\nhead 4 5 6\n2\nroot 1 2 3\nhead 4 5 6\n"])
def test_motion_with_names_before_angles_is_not_taken_for_points(put, refused, content):
    assert refused(put("walk.txt", content))


def test_forces_are_no_points(put, refused):
    rows = "".join(f"acc 1 2 {n} gyro 4 5 6\n" for n in range(4))
    assert "no points, and left out: acc, gyro" in refused(put("imu.txt", rows))


@pytest.mark.parametrize("title", ["{n}", "Marker: {n}", "{n},,,"])
def test_tables_of_a_point_each_below_its_name_are_read(put, title):
    tables = [
        title.format(n=name) + "\ntime,X (mm),Y (mm),Z (mm)\n" + "".join(f"{t},{p[0]},{p[1]},{p[2]}\n" for t in TIMES)
        for name, p in PLACES
    ]
    take = read_take(put("points.csv", "\n".join(tables)))
    assert (take.names, take.rate) == (("knee", "toe"), pytest.approx(50.0))
    np.testing.assert_allclose(take.positions, [[place for _, place in PLACES]] * 3)


def test_table_of_a_single_point_is_refused(put, refused):
    assert "a single point, which has no skeleton" in refused(put("one.csv", "Walk\nframe,x,y,z\n0,1,2,3\n1,2,3,4\n"))


@pytest.mark.parametrize("mark", [" ", ":"])
def test_numbers_of_points_are_no_people(put, mark):
    rows = "".join(f"{at}{mark}{n} {p[0]} {p[1]} {p[2]}\n" for _ in TIMES for at, (n, p) in enumerate(PLACES, start=1))
    take = read_take(put("numbered.txt", rows))
    assert (take.names, take.n_frames) == (("knee", "toe"), 3)
    assert not any("dropped" in notice for notice in take.notices)


@pytest.mark.parametrize("end", [" ", ": ", "\n"])
def test_takes_with_frame_numbers_are_no_people(put, end):
    frames = [(n, t) for t in range(3) for n in range(1, 6)]
    rows = "".join(f"{n}{end}knee {n} {t} 3\n{n}{end}toe {n} 5 {t}\n" for n, t in frames)
    take = read_take(put("takes.txt", rows), recorded_unit="mm")
    assert take.names == ("knee", "toe")
    np.testing.assert_array_equal(take.positions[:, 0, :2], frames)
    assert any("frame numbers go back" in notice for notice in take.notices)


def test_points_in_images_with_a_confidence_are_no_points_of_three_coordinates(put, refused):
    rows = "".join(f"{n / 30:.3f},{n},1,{name},0.{n + 1},0.6,0.9\n" for n in range(9) for name in ("nose", "neck"))
    assert "triangulate" in refused(put("pose.csv", f"timestamp,frame_id,track_id,joint,x,y,confidence\n{rows}"))


def test_the_third_coordinate_may_be_called_otherwise(put):
    rows = "".join(f"{name},{x},{y},{z}\n" for _ in TIMES for name, (x, y, z) in PLACES)
    assert read_take(put("depth.txt", f"name,x,y,depth\n{rows}")).names == ("knee", "toe")
