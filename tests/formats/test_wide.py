from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

POSITIONS = np.array([[[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]], [[1.6, 2.6, 3.6], [np.nan] * 3]]) + 100
TIMES = [0.0, 0.02]


def rows(before: str = "", after: str = "", delimiter: str = ",") -> str:
    lines = [["" if np.isnan(x) else f"{x:g}" for x in frame.ravel()] for frame in POSITIONS]
    return "".join(before.format(n, TIMES[n]) + delimiter.join(cells) + after + "\n" for n, cells in enumerate(lines))


ANIPOSE = "nose_x,nose_y,nose_z,tail.base_x,tail.base_y,tail.base_z,nose_error,fnum\n" + rows(after=",0.1,0")
FREEMOCAP = "frame,timestamp,nose_x,nose_y,nose_z,tail.base_x,tail.base_y,tail.base_z\n" + rows("{},{},")
BLANKS = "Time (s);nose X;nose Y;nose Z;tail.base X;tail.base Y;tail.base Z\n" + rows("{1};", delimiter=";")
UNDER = "nose,,,tail.base,,\nX,Y,Z,X,Y,Z\n" + rows()
UNITS = "t,nose_x_mm,nose_y_mm,nose_z_mm,tail.base_x_mm,tail.base_y_mm,tail.base_z_mm\n" + rows("{1},")
DEEPLABCUT = (
    "scorer" + ",net" * 6 + "\nbodyparts,nose,nose,nose,tail.base,tail.base,tail.base\ncoords" + ",x,y,z" * 2 + "\n"
) + rows("{},")


@pytest.mark.parametrize(
    ("text", "rate"),
    [(ANIPOSE, 100.0), (FREEMOCAP, 50.0), (BLANKS, 50.0), (UNDER, 100.0), (UNITS, 50.0), (DEEPLABCUT, 100.0)],
)
def test_table_is_read_by_its_titles(put, text, rate):
    path = put("points.dat", text)
    take = read_take(path)
    assert recognise(path).name == "wide-csv"
    assert (take.names, take.rate) == (("nose", "tail.base"), rate)
    np.testing.assert_allclose(take.positions, POSITIONS)
    assert any("100 Hz is assumed" in notice for notice in take.notices) == (rate == 100.0)
    assert any("mm is assumed" in notice for notice in take.notices) == ("mm" not in text)


def test_rate_and_unit_are_those_stated(put):
    take = read_take(put("points.csv", UNDER), recorded_rate=30, recorded_unit="cm")
    assert take.rate == 30.0
    np.testing.assert_allclose(take.positions, POSITIONS * 10)
    assert take.notices == ()


def test_two_people_of_deeplabcut_keep_their_names(put):
    head = "scorer" + ",net" * 6 + "\nindividuals,a,a,a,b,b,b\nbodyparts" + ",nose" * 6 + "\ncoords" + ",x,y,z" * 2
    assert read_take(put("two.csv", head + "\n" + rows("{},"))).names == ("a:nose", "b:nose")


def test_points_in_images_say_what_to_do(refused, put):
    head = "scorer,net,net,net\nbodyparts,nose,nose,nose\ncoords,x,y,likelihood\n0,10,20,0.9\n"
    assert "2D; triangulate" in refused(put("2d.csv", head))


def test_parquet_is_read_alike(tmp_path):
    table = pytest.importorskip("pandas").DataFrame({"time": TIMES})
    for column, title in enumerate(("nose_x", "nose_y", "nose_z", "tail_x", "tail_y", "tail_z")):
        table[title] = POSITIONS.reshape(2, -1)[:, column]
    table.to_parquet(tmp_path / "points.parquet")
    take = read_take(tmp_path / "points.parquet")
    assert (take.names, take.rate) == (("nose", "tail"), 50.0)
    np.testing.assert_array_equal(take.positions, POSITIONS)


def test_damaged_parquet_is_refused(refused, put):
    pytest.importorskip("pyarrow")
    assert "damaged" in refused(put("points.parquet", b"PAR1 and nothing else PAR1"))


def test_some_other_table_is_refused_with_the_formats(refused, put):
    assert "known are motive (.csv), nexus (.csv), wide-csv (.csv)" in refused(put("a.csv", "name,age\nAnn,42\n"))
