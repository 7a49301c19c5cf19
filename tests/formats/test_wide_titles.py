"""Titles of wide tables: spellings that name the same two points."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

from tests.formats.wide_rows import POSITIONS, rows


@pytest.mark.parametrize("titles", ["x_nose,y_nose,z_nose,x_toe,y_toe,z_toe", "Xnose,Ynose,Znose,Xtoe,Ytoe,Ztoe"])
def test_axis_may_stand_before_the_name(put, titles):
    take = read_take(put("before.csv", f"{titles}\n" + "100,200,300,400,500,600\n" * 3))
    assert take.names == ("nose", "toe")
    np.testing.assert_array_equal(take.positions[0], [[100, 200, 300], [400, 500, 600]])


@pytest.mark.parametrize(
    "titles",
    [
        "{0} [X],{0} [Y],{0} [Z],{1} [X],{1} [Y],{1} [Z]",
        "{0} (x),{0} (y),{0} (z),{1} (x),{1} (y),{1} (z)",
        "{0} X / mm,{0} Y / mm,{0} Z / mm,{1} X / mm,{1} Y / mm,{1} Z / mm",
        "{0}_position_x,{0}_position_y,{0}_position_z,{1}_position_x,{1}_position_y,{1}_position_z",
        "{0}_tx,{0}_ty,{0}_tz,{1}_tx,{1}_ty,{1}_tz",
        "tx_{0},ty_{0},tz_{0},tx_{1},ty_{1},tz_{1}",
        "px_{0},py_{0},pz_{0},px_{1},py_{1},pz_{1}",
        "{0}_1,{0}_2,{0}_3,{1}_1,{1}_2,{1}_3",
        "# {0}_x,{0}_y,{0}_z,{1}_x,{1}_y,{1}_z",
        "{0},{0},{0},{1},{1},{1}\nx,y,z,x,y,z\nmm,mm,mm,mm,mm,mm",
    ],
)
def test_titles_that_scripts_write_name_the_points(put, titles):
    take = read_take(put("points.csv", titles.format("nose", "tail") + "\n" + rows()))
    assert take.names == ("nose", "tail")
    np.testing.assert_allclose(take.positions, POSITIONS)


def test_columns_of_a_point_may_stand_apart(put):
    take = read_take(put("apart.csv", "a_x,b_x,a_y,b_y,a_z,b_z\n" + "100,200,300,400,500,600\n" * 3))
    np.testing.assert_array_equal(take.positions[0], [[100, 300, 500], [200, 400, 600]])


def test_four_numbered_columns_are_no_point(put):
    """MATLAB scripts write quaternions beside points so; which component is the scalar, nobody says."""
    text = "// fs=50  nSamples=2\n// posUnit=m\nPELV_1,PELV_2,PELV_3,LFEP_1,LFEP_2,LFEP_3,qR_1,qR_2,qR_3,qR_4\n"
    take = read_take(put("thesis.csv", text + "1,2,3,4,5,6,1,0,0,0\n" * 2))
    assert (take.names, take.rate) == (("PELV", "LFEP"), 50.0)
    assert "quaternions without positions, and left out: qR" in take.notices
    np.testing.assert_array_equal(take.positions[0, 0], [1000, 2000, 3000])


def test_columns_of_vectors_are_counted_from_0_as_python_does(put):
    """Kinetics Toolkit writes homogeneous coordinates so, with a fourth that is 1."""
    titles = ",".join(f"{name}[{n}]" for name in ("C7", "CLAV") for n in range(4))
    take = read_take(put("serve.csv", f"Time,{titles}\n" + "".join(f"{n / 50},1,2,3,1,4,5,6,1\n" for n in range(3))))
    assert (take.names, take.rate) == (("C7", "CLAV"), 50.0)
    np.testing.assert_array_equal(take.positions[0], [[1000, 2000, 3000], [4000, 5000, 6000]])


def test_places_and_quaternions_may_have_words_of_their_own(put):
    """As Axis Studio and loggers of Azure Kinect write them."""
    titles = (
        ",".join(f"Hips-Joint-Posi-{axis}" for axis in "xyz") + "," + ",".join(f"A-Joint-Posi-{axis}" for axis in "xyz")
    )
    velocities = ",".join(f"Hips-Joint-Velo-{axis}" for axis in "xyz")
    text = f"timestamp_usec,{titles},{velocities}\n" + "".join(f"{n * 20000},1,2,3,4,5,6,7,8,9\n" for n in range(3))
    take = read_take(put("axis.csv", text))
    assert (take.names, take.rate) == (("Hips-Joint", "A-Joint"), 50.0)


def test_last_of_two_lines_of_titles_counts(put):
    """Venus3D names the points twice; rate and unit stand before, with an empty cell between."""
    text = "#Venus3D CSV Data\n#Sample Rate,,120.0\n#Units,,mm\n#Point Type,,,P1(X),P1(Y),P1(Z),P2(X),P2(Y),P2(Z)\n"
    text += "ID,Sample,Time,1(X),1(Y),1(Z),2(X),2(Y),2(Z)\n" + "".join(
        f"{n},{n},{n / 120},1,2,3,4,5,6\n" for n in range(3)
    )
    take = read_take(put("venus.csv", text))
    assert (take.names, take.rate, take.n_frames) == (("1", "2"), 120.0, 3)
    np.testing.assert_array_equal(take.positions[2], [[1, 2, 3], [4, 5, 6]])


def test_names_that_stand_in_cells_are_those_of_the_points(put):
    """As `rostopic echo -p` writes the markers of Vicon."""
    marker = "field.markers{0}.marker_name,field.markers{0}.translation.x,field.markers{0}.translation.y"
    titles = ",".join(f"{marker},field.markers{{0}}.translation.z".format(n) for n in range(2))
    text = f"%time,{titles}\n" + "".join(f"{t}0000000,LASI,1,2,3,RASI,4,5,6\n" for t in (10, 12))
    take = read_take(put("ros.csv", text))
    assert (take.names, take.rate) == (("LASI", "RASI"), 50.0)


def test_quoted_titles_may_hold_what_parts_cells(put):
    titles = ",".join(f'"{name}, left_{axis}"' for name in ("knee", "hip") for axis in "xyz")
    take = read_take(put("quoted.csv", f"__time,{titles}\n0,1,2,3,400,500,600\n0.01,1,2,3,400,500,600\n"))
    assert (take.rate, take.names) == (100.0, ("knee  left", "hip  left"))
    np.testing.assert_array_equal(take.positions[0, 1], [400, 500, 600])


@pytest.mark.parametrize(
    "title",
    [
        "\"('{n}', '{a}')\"",
        "{n} {a}-axis",
        "{n}_{a}coord",
        "{n} {a}-Koordinate [mm]",
        "Pos_{a}_{n}",
        "{n}_{a}_3d",
        "{n}_{a}_filtered",
        "{n}_{a} (millimeters)",
        "{n}_{a}__mm",
        "{n}|{a}",
        "{n}: {a}",
    ],
)
def test_axes_may_be_spelt_in_other_ways(put, title):
    titles = ",".join(title.format(n=name, a=axis) for name in ("knee", "toe") for axis in "xyz")
    take = read_take(put("spelt.csv", f"{titles}\n{rows()}"))
    assert take.names == ("knee", "toe")
    np.testing.assert_allclose(take.positions, POSITIONS)


def test_points_in_the_usual_spelling_count_before_raw_ones(put):
    raw = "a_x_raw,a_y_raw,a_z_raw"
    assert read_take(put("raw.csv", f"a_x,a_y,a_z,b_x,b_y,b_z,{raw}\n{rows(after=',7,8,9')}")).names == ("a", "b")


@pytest.mark.parametrize("names", ["nose,,,tail.base,,", ",nose,,,tail.base,", ",,nose,,,tail.base"])
def test_name_may_stand_over_any_of_its_columns(put, names):
    take = read_take(put("merged.csv", f"{names}\nX,Y,Z,X,Y,Z\n{rows()}"))
    assert take.names == ("nose", "tail.base")
    np.testing.assert_allclose(take.positions, POSITIONS)


def test_points_without_names_are_numbered_and_this_is_told(put):
    take = read_take(put("nameless.csv", f"Frame,X,Y,Z,X,Y,Z\n{rows('{},')}"))
    assert take.names == ("0", "1")
    assert any("points are numbered" in notice for notice in take.notices)


def test_columns_may_have_different_units(put):
    titles = "a_x_mm,a_y_mm,a_z_mm,b_x_m,b_y_m,b_z_m"
    take = read_take(put("units.csv", f"{titles}\n1,2,3,0.004,0.005,0.006\n"))
    np.testing.assert_allclose(take.positions[0], [[1, 2, 3], [4, 5, 6]])


def test_form_in_which_most_points_are_titled_counts(put):
    """OpenFace has directions of both eyes, a pose, points in the image, and those in the room as X_0, Y_0, Z_0."""
    titles = "frame,gaze_0_x,gaze_0_y,gaze_0_z,gaze_1_x,gaze_1_y,gaze_1_z,x_0,x_1,x_2,y_0,y_1,y_2"
    titles += "".join(f",{axis}_{number}" for axis in "XYZ" for number in range(3))
    take = read_take(put("face.csv", f"{titles}\n" + "1,0,0,1,0,0,1,9,9,9,9,9,9,10,11,12,20,21,22,500,501,502\n" * 3))
    assert take.names == ("0", "1", "2")
    np.testing.assert_array_equal(take.positions[0], [[10, 20, 500], [11, 21, 501], [12, 22, 502]])
    assert "points whose titles are of another form are left out: gaze_0, gaze_1" in take.notices


def test_more_than_four_numbers_are_no_point(put):
    """A database writes six covariances beside each position."""
    titles = ",".join(
        f"{name}.{what}[{n}]" for name in "ab" for what, size in (("xyz", 3), ("unc", 6)) for n in range(size)
    )
    take = read_take(put("numbers.csv", f"{titles}\n" + "1,2,3,9,9,9,9,9,9,4,5,6,9,9,9,9,9,9\n" * 3))
    assert take.names == ("a.xyz", "b.xyz")


def test_quaternions_whose_scalar_nobody_names_are_told(refused, put):
    names = ",".join(
        f"{name}_x,{name}_y,{name}_z," + ",".join(f"{name}_quat_{n}" for n in range(1, 5)) for name in "ab"
    )
    take = read_take(put("bodies.csv", f"{names}\n" + "1,2,3,1,0,0,0,4,5,6,1,0,0,0\n" * 3))
    assert (take.names, "which number is w (qw, qx, qy, qz): a, b" in " ".join(take.notices)) == (("a", "b"), True)
    alone = "time,x,y,z,quat_1,quat_2,quat_3,quat_4\n" + "0,1,2,3,1,0,0,0\n0.1,1,2,3,1,0,0,0\n"
    assert "which number is w" in refused(put("body.csv", alone))
    assert "which number is w" in refused(put("body.csv", alone.replace("quat_", "quat-")))


@pytest.mark.parametrize("title", ["{n}.localPosition.{a}", "{n}_local_{a}", "{n} Local Position {a}"])
def test_positions_called_local_are_told(put, title):
    titles = ",".join(title.format(n=name, a=axis) for name in ("knee", "toe") for axis in "xyz")
    take = read_take(put("local.csv", f"{titles}\n{rows()}"))
    assert any("called local" in notice for notice in take.notices)


@pytest.mark.parametrize("titles", ["time,a,a,a,b,b,b", "time,a,,,b,,", "time,a,a.1,a.2,b,b.1,b.2"])
def test_three_columns_under_one_name_are_a_point(put, titles):
    take = read_take(put("threes.csv", f"{titles}\n" + rows("{1},")))
    assert take.names == ("a", "b")
    np.testing.assert_allclose(take.positions[0], POSITIONS[0])
    assert "three columns under one name are taken as x, y and z" in take.notices


@pytest.mark.parametrize(("title", "mm"), [("{0}_{1} (in)", 25.4), ("{0}_{1}_inch", 25.4), ("{0} {1} [ft]", 304.8)])
def test_lengths_may_be_in_inches_or_feet(put, title, mm):
    titles = ",".join(title.format(name, axis) for name in ("nose", "tail") for axis in "xyz")
    take = read_take(put("inches.csv", f"{titles}\n" + rows()))
    np.testing.assert_allclose(take.positions, POSITIONS * mm)


@pytest.mark.parametrize("titles", ["Joint,X,Y,Z,Joint,X,Y,Z", "X,Y,Z,Joint,X,Y,Z,Joint"])
def test_names_in_cells_stand_before_or_behind_their_points(put, titles):
    rows = ["hip,1,2,3,toe,4,5,6\n" if titles.startswith("J") else "1,2,3,hip,4,5,6,toe\n"] * 2
    assert read_take(put("cells.csv", titles + "\n" + "".join(rows))).names == ("hip", "toe")


@pytest.mark.parametrize("axes", ["AP ML V", "A/P M/L S/I", "forward left up", "East North Up"])
def test_directions_in_words_are_axes(put, axes):
    titles = ",".join(f"{name}_{axis}" for name in ("knee", "toe") for axis in axes.split())
    take = read_take(put("words.csv", f"{titles}\n{rows()}"))
    assert take.names == ("knee", "toe")
    np.testing.assert_allclose(take.positions, POSITIONS)
    assert any("directions in words" in notice for notice in take.notices)


@pytest.mark.parametrize(
    "title", ["{n}_{a}_position [mm]", "{n} {a} in mm", "{a}_{n}_mm", "{n}->{a} (mm)", "{n} {a} pos (mm)"]
)
def test_axes_and_units_may_stand_in_other_places(put, title):
    titles = ",".join(title.format(n=name, a=axis) for name in ("knee", "toe") for axis in "xyz")
    take = read_take(put("places.csv", f"{titles}\n{rows()}"))
    assert take.names == ("knee", "toe")
    assert not any("no length unit" in notice for notice in take.notices)


def test_titles_of_three_levels_in_one_cell_are_names(put):
    titles = ",".join(f"\"('{name}', 'pos', '{axis}')\"" for name in ("knee", "toe") for axis in "xyz")
    take = read_take(put("levels.csv", f"\"('time', '', '')\",{titles}\n" + rows("{1},")))
    assert (take.names, take.rate) == (("knee", "toe"), 50.0)


def test_velocities_of_points_of_one_letter_are_no_points(put):
    titles = ",".join(f"{bone}-{what}-{axis}" for bone in ("01", "02") for what in "XV" for axis in "xyz")
    take = read_take(put("bones.csv", titles + "\n" + ",".join(map(str, range(12))) + "\n"))
    assert take.names == ("01-X", "02-X")


@pytest.mark.parametrize(
    "title",
    [
        *("{n}['{a}']", "{n}_{a}_world", "world_{a}_{n}", "{n}_{a}3d", "{n}_{a}_mean", "T{a}({n})", "p{a}.{n}"),
        *(
            "{n}.{a}_est",
            "{n}_dim{i}",
            "{n}_pos{i}",
            "{n}_coord{i}",
            "{n} {a} Pos.",
            "Coordonnée {a} {n}",
            "axis_{a}_{n}",
        ),
        *("{n} = {a}", "[{n}].{a}", "{a}({n})", "{n}; {a}"),
    ],
)
def test_what_stands_around_names_and_axes_is_no_part_of_them(put, title):
    titles = "\t".join(title.format(n=n, a=a, i="xyz".index(a)) for n in ("knee", "toe") for a in "xyz")
    take = read_take(put("around.tsv", f"{titles}\n{rows(delimiter=chr(9))}"))
    assert take.names == ("knee", "toe")
    np.testing.assert_allclose(take.positions, POSITIONS)


@pytest.mark.parametrize(
    "title", ["{n}:{a}:mm", "{n}.{a}.mm", "{n}_{a}, mm", "{n}_{a}_in_mm", "{n}_{a}_raw_mm", "{n}_{a} [mm] (raw)"]
)
def test_units_may_stand_behind_axes_in_other_ways(put, title):
    titles = "\t".join(title.format(n=n, a=a) for n in ("knee", "toe") for a in "xyz")
    take = read_take(put("units.tsv", f"{titles}\n{rows(delimiter=chr(9))}"))
    assert take.names == ("knee", "toe")
    assert not any("no length unit" in notice for notice in take.notices)
