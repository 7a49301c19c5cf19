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


def test_parquet_with_a_column_twice_is_refused(refused, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    names = [f"{point}_{axis}" for point in ("nose", "tail") for axis in "xyz"] + ["nose_x"]
    table = pyarrow.Table.from_arrays([pyarrow.array([1.0, 2.0])] * len(names), names=names)
    parquet.write_table(table, tmp_path / "points.parquet")
    assert "two columns are called nose_x" in refused(tmp_path / "points.parquet")


def test_parquet_without_a_frame_is_refused(refused, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    names = [f"{point}_{axis}" for point in ("nose", "tail") for axis in "xyz"]
    table = pyarrow.table([pyarrow.array([], pyarrow.float64())] * len(names), names=names)
    parquet.write_table(table, tmp_path / "points.parquet")
    assert "holds no frame" in refused(tmp_path / "points.parquet")


def test_some_other_table_is_refused_with_the_formats(refused, put):
    assert "known are motive (.csv), nexus (.csv), tidy-csv (.csv), wide-csv (.csv)" in refused(
        put("a.csv", "name,age\nAnn,42\n")
    )


def test_quoted_cells_may_hold_commas(put):
    """FreeMoCap writes the times of all cameras into one cell of its files by trajectory."""
    rows = "".join(f"0.0{f},\"{{'a': 1, 'b': 2}}\",{f + 100},200,300,400,500,\"600\"\n" for f in range(3))
    titles = "timestamp,timestamp_by_camera,body_nose_x,body_nose_y,body_nose_z,toe_x,toe_y,toe_z\n"
    take = read_take(put("by_trajectory.csv", titles + rows))
    assert (take.names, take.rate) == (("body_nose", "toe"), 100.0)
    np.testing.assert_array_equal(take.positions[2], [[102, 200, 300], [400, 500, 600]])


@pytest.mark.parametrize("titles", ["x_nose,y_nose,z_nose,x_toe,y_toe,z_toe", "Xnose,Ynose,Znose,Xtoe,Ytoe,Ztoe"])
def test_axis_may_stand_before_the_name(put, titles):
    take = read_take(put("before.csv", f"{titles}\n" + "100,200,300,400,500,600\n" * 3))
    assert take.names == ("nose", "toe")
    np.testing.assert_array_equal(take.positions[0], [[100, 200, 300], [400, 500, 600]])


def test_titles_of_many_columns_are_read(put):
    """Four lines of titles that are longer than a sniffer of a few kB sees."""
    names = [f"bodypart{n}" for n in range(40) for _ in range(3)]
    scorer = "DLC_resnet50_project_of_a_long_nameshuffle1_500000"
    head = f"scorer,{','.join([scorer] * 120)}\nbodyparts,{','.join(names)}\ncoords{',x,y,z' * 40}\n"
    take = read_take(put("long.csv", head + "0" + ",1,2,3" * 40 + "\n1" + ",1,2,4" * 40 + "\n"))
    assert take.n_markers == 40


VISUAL3D = (
    "\ta.c3d" + "\ta.c3d" * 6 + "\n\tTIME" + "\tLASI" * 3 + "\tRASI" * 3 + "\n\tFRAME_NUMBERS" + "\tTARGET" * 6
) + ("\n\tORIGINAL" + "\tORIGINAL" * 6 + "\nITEM\tX" + "\tX\tY\tZ" * 2 + "\n")


def test_targets_of_visual3d_are_points(put):
    rates = "1\t0.00\t0.1\t0.2\t0.3\t0.4\t0.5\t0.6\n2\t0.02\t0.1\t0.2\t0.4\t\t\t\n"
    take = read_take(put("targets.txt", VISUAL3D + rates))
    assert (take.names, take.rate) == (("LASI", "RASI"), 50.0)
    np.testing.assert_allclose(take.positions[0], [[100, 200, 300], [400, 500, 600]])
    assert take.seen.tolist() == [[True, True], [True, False]]


def test_further_trials_of_visual3d_are_told(put):
    lines = VISUAL3D.replace("\ta.c3d\ta.c3d\ta.c3d\n", "\tb.c3d\tb.c3d\tb.c3d\n")
    take = read_take(put("two.txt", lines + "1\t0.00\t0.1\t0.2\t0.3\t0.4\t0.5\t0.6\n"))
    assert take.names == ("LASI",)
    assert "1 signals of further trials or folders are left out; export them alone" in take.notices


def test_angles_of_visual3d_say_what_to_export(refused, put):
    text = VISUAL3D.replace("TARGET", "LINK_MODEL_BASED") + "1\t0.00\t0.1\t0.2\t0.3\t0.4\t0.5\t0.6\n"
    assert "an ASCII export of Visual3D without targets" in refused(put("angles.txt", text))


@pytest.mark.parametrize("delimiter", [",", "\t", ";"])
def test_lines_before_the_titles_state_rate_and_unit(put, delimiter):
    """As NDI First Principles writes them for Optotrak."""
    head = "Number of frames:,2\nNumber of markers:,2\nFrequency:,60\nUnits:,cm\n\n"
    head += "Frame,M_1 x,M_1 y,M_1 z,M_2 x,M_2 y,M_2 z\n"
    take = read_take(put("ndi.csv", head.replace(",", delimiter) + rows(f"{{}}{delimiter}", delimiter=delimiter)))
    assert (take.names, take.rate, take.notices) == (("M_1", "M_2"), 60.0, ())
    np.testing.assert_allclose(take.positions, POSITIONS * 10)


@pytest.mark.parametrize("names", [("Acc", "Gyr"), ("ground_force_v", "ground_force_p"), ("hip_angle", "hip_moment")])
def test_forces_and_accelerations_are_no_points(refused, put, names):
    titles = ",".join(f"{name}_{axis}" for name in names for axis in "xyz")
    assert f"left out: {names[0]}, {names[1]}; nothing else" in refused(put("imu.csv", f"{titles}\n{rows()}"))


def test_velocities_beside_points_are_left_out(put):
    head = "nose_x,nose_y,nose_z,tail_x,tail_y,tail_z,nose_vel_x,nose_vel_y,nose_vel_z\n"
    take = read_take(put("both.csv", head + rows(after=",1,2,3")))
    assert take.names == ("nose", "tail")
    assert "no points, and left out: nose_vel" in take.notices


def test_file_of_a_byte_order_mark_alone_is_refused(refused, put):
    assert refused(put("a.csv", b"\xef\xbb\xbf"))
