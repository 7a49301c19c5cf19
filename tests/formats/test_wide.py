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


def test_signals_of_inertial_sensors_and_force_plates_are_no_points(refused, put):
    assert "a table needs titles" in refused(put("imu.csv", "t,ax,ay,az,gx,gy,gz\n" + rows("{1},")))


def test_rates_and_scales_beside_points_are_left_out(put):
    axes = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "wx", "wy", "wz", "sx", "sy", "sz")
    text = ",".join(f"{name}_{axis}" for name in ("knee", "hip") for axis in axes) + "\n"
    assert read_take(put("rates.csv", text + ",".join("123" * 10) + "\n")).names == ("knee", "hip")
    assert read_take(put("bodies.csv", text.replace("_v", "_r") + ",".join("123" * 10) + "\n")).n_bodies == 2


@pytest.mark.parametrize(
    "titles",
    [
        ["FreeAcc_X", "FreeAcc_Y", "FreeAcc_Z", "Acc_X", "Acc_Y", "Acc_Z"],
        ["Lumbar/Accelerometer/X", "Lumbar/Accelerometer/Y", "Lumbar/Accelerometer/Z", "dv[1]", "dv[2]", "dv[3]"],
        ["v_x", "v_y", "v_z", "Mag_X", "Mag_Y", "Mag_Z"],
        [f"FP{n}_{what}{axis}" for n in (1, 2) for what in "FM" for axis in "xyz"],
    ],
)
def test_sensors_and_force_plates_are_no_points(refused, put, titles):
    assert refused(put("sensors.csv", ",".join(["time", *titles]) + "\n" + ",".join("1" * (len(titles) + 1)) + "\n"))


def test_outputs_of_models_are_no_points_unless_asked_for(put):
    names = ("LASI", "RASI", "LHipAngles", "Ann:RKneeMoment", "LAnklePower")
    text = ",".join(f"{name}_{axis}" for name in names for axis in "xyz") + "\n"
    path = put("outputs.csv", text + ",".join(map(str, range(15))) + "\n")
    assert read_take(path).names == ("LASI", "RASI")
    assert read_take(path, points="all").n_markers == 5


def test_velocities_beside_points_are_left_out(put):
    head = "nose_x,nose_y,nose_z,tail_x,tail_y,tail_z,nose_vel_x,nose_vel_y,nose_vel_z\n"
    take = read_take(put("both.csv", head + rows(after=",1,2,3")))
    assert take.names == ("nose", "tail")
    assert "no points, and left out: nose_vel" in take.notices


def test_file_of_a_byte_order_mark_alone_is_refused(refused, put):
    assert refused(put("a.csv", b"\xef\xbb\xbf"))


@pytest.mark.parametrize(
    "titles",
    [
        "{0} [X],{0} [Y],{0} [Z],{1} [X],{1} [Y],{1} [Z]",
        "{0} (x),{0} (y),{0} (z),{1} (x),{1} (y),{1} (z)",
        "{0} X / mm,{0} Y / mm,{0} Z / mm,{1} X / mm,{1} Y / mm,{1} Z / mm",
        "{0}_position_x,{0}_position_y,{0}_position_z,{1}_position_x,{1}_position_y,{1}_position_z",
        "{0}_tx,{0}_ty,{0}_tz,{1}_tx,{1}_ty,{1}_tz",
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


def test_blanks_part_cells_of_a_table_without_another_delimiter(put):
    text = "# time nose_x nose_y nose_z tail_x tail_y tail_z\n0.00 1 2 3 4 5 6\n0.02 1 2 3 nan nan nan\n"
    take = read_take(put("points.txt", text), recorded_unit="mm")
    assert (take.names, take.rate, take.seen.tolist()) == (("nose", "tail"), 50.0, [[True, True], [True, False]])


def test_name_of_the_index_of_pandas_is_no_frame(put):
    titles = ",nose,nose,nose,tail,tail,tail\n,x,y,z,x,y,z\nframe,,,,,,\n"
    assert read_take(put("pandas.csv", titles + rows("{},"))).n_frames == 2


@pytest.mark.parametrize(
    ("title", "times"),
    [
        ("t(s)", (0, 0.02)),
        ("Time (Seconds)", (0, 0.02)),
        ("time_ms", (0, 20)),
        ("Elapsed Time (ms)", (0, 20)),
        ("time [milliseconds]", (0, 20)),
        ("time_microseconds", (0, 20_000)),
        ("time", (0, 20)),
        ("%time", (1_600_000_000_000_000_000, 1_600_000_000_020_000_000)),
    ],
)
def test_times_are_read_in_their_unit(put, title, times):
    text = f"{title},nose_x,nose_y,nose_z,tail_x,tail_y,tail_z\n" + "".join(f"{t},1,2,3,4,5,6\n" for t in times)
    assert read_take(put("times.csv", text)).rate == 50.0


@pytest.mark.parametrize("last", ["inf", "-1e308", "nan"])
def test_times_that_are_none_state_no_rate(put, last):
    text = "time,a_x,a_y,a_z,b_x,b_y,b_z\n1e308,1,2,3,4,5,6\n" + f"{last},1,2,3,4,5,6\n"
    assert "100 Hz is assumed" in " ".join(read_take(put("times.csv", text)).notices)


def test_column_of_times_that_counts_frames_states_no_rate(put):
    text = "time,a_x,a_y,a_z,b_x,b_y,b_z\n" + "".join(f"{n},1,2,3,4,5,6\n" for n in range(3))
    assert "100 Hz is assumed" in " ".join(read_take(put("counted.csv", text)).notices)


@pytest.mark.parametrize("gap", ["-9999", "-1", "9999999", "-3.697314E+28", "NA", "-1.#IND", "1.#QNAN0"])
def test_numbers_and_words_that_stand_for_gaps_are_unseen(put, gap):
    text = "a_x,a_y,a_z,b_x,b_y,b_z\n100,200,300,400,500,600\n" + f"100,200,300,{gap},{gap},{gap}\n" * 2
    take = read_take(put("gaps.csv", text))
    assert take.seen.tolist() == [[True, True], [True, False], [True, False]]


def test_point_that_stands_still_where_its_coordinates_are_equal_is_seen(put):
    text = "a_x,a_y,a_z,b_x,b_y,b_z\n" + "100,200,300,500,500,500\n" * 3
    assert read_take(put("still.csv", text)).seen.all()


def test_points_that_move_along_a_diagonal_are_seen(put):
    text = "a_x,a_y,a_z,b_x,b_y,b_z\n" + "".join(f"{n % 9},{n % 9},{n % 9},1,2,3\n" for n in range(1, 40))
    assert read_take(put("diagonal.csv", text)).positions[3, 0].tolist() == [4000.0] * 3


def test_lines_before_the_titles_may_have_many_cells(put):
    """As a recorder of NDI's Aurora writes them: the date, and a sensor's letter behind each title."""
    text = (
        "Test Date: \nday, month, year\n2, 2, 2021 \n\nSample:,ms,Xa,Ya,Za,qoa,qxa,qya,qza,Xb,Yb,Zb,qob,qxb,qyb,qzb\n"
    )
    text += "1, 20,0, 0, 0, 0, 0, 0, 0, 99.52 , -18.33 , -286.52, 1, 0 , 0, 0, \n" * 2
    text += "3, 60,99.52 , -18.33 , -286.52, 1, 0 , 0, 0, 99.52 , -18.33 , -286.52, 1, 0 , 0, 0, \n"
    take = read_take(put("aurora.csv", text))
    assert take.names == ("a", "b")
    assert np.isnan(take.world_from_body[:, 0, 0, 0]).tolist() == [True, True, False]


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_export_of_mokka_is_read(put, delimiter):
    """Rate and events before the titles, units between names and axes, another table behind a blank line."""
    text = "Frame number,2\nPoint frequency,50\nAnalog frequency,1000\n\nLeft_Foot Strike,0.05,0.25,0.45\n\n"
    text += "Time,nose,,,tail,,\ns,cm,cm,cm,cm,cm,cm\n,X,Y,Z,X,Y,Z\n0,1,2,3,4,5,6\n0.02,1,2,3,0,0,0\n\n"
    text += "Time,Fx,Fy\ns,N,N\n0,1,2\n0.001,1,2\n"
    take = read_take(put("mokka.txt", text.replace(",", delimiter)))
    assert (take.names, take.rate, take.seen.tolist()) == (("nose", "tail"), 50.0, [[True, True], [True, False]])
    np.testing.assert_array_equal(take.positions[0], [[10, 20, 30], [40, 50, 60]])
    assert "another table, which begins in line 13, is left out" in take.notices


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


def test_orientations_without_positions_are_no_points(refused, put):
    titles = ",".join(f"{name}.{axis}" for name in ("Head", "Arm") for axis in "wxyz")
    text = f"timestamp,{titles}\n" + "".join(f"{n / 50},0.6,0.8,0,0,1,0,0,0\n" for n in range(3))
    assert "quaternions without positions" in refused(put("pose.csv", text))


def test_places_and_quaternions_may_have_words_of_their_own(put):
    """As Axis Studio and loggers of Azure Kinect write them."""
    titles = (
        ",".join(f"Hips-Joint-Posi-{axis}" for axis in "xyz") + "," + ",".join(f"A-Joint-Posi-{axis}" for axis in "xyz")
    )
    velocities = ",".join(f"Hips-Joint-Velo-{axis}" for axis in "xyz")
    text = f"timestamp_usec,{titles},{velocities}\n" + "".join(f"{n * 20000},1,2,3,4,5,6,7,8,9\n" for n in range(3))
    take = read_take(put("axis.csv", text))
    assert (take.names, take.rate) == (("Hips-Joint", "A-Joint"), 50.0)


def test_rows_that_end_early_are_unseen_there(put):
    """As a recorder of UWB writes a position of one tag per row, with the tags above and times of the clock."""
    text = ",a,a,a,b,b,b,\nTimestamp (ns),Pos_x (mm), Pos_y (mm), Pos_z (mm),Pos_x (mm), Pos_y (mm), Pos_z (mm),\n"
    text += "".join(f"15946566556{n}7508831,{n},2,3,\n15946566556{n + 2}9132997,,,,4,5,6,\n" for n in (1, 5))
    take = read_take(put("uwb.csv", text))
    assert (take.names, take.seen.tolist()) == (("a", "b"), [[True, False], [False, True]] * 2)
    assert "2 rows end before the last column; what has no cells is unseen there" in take.notices


def test_last_row_that_is_cut_off_is_left_out(put):
    take = read_take(put("cut.csv", UNITS + "0.04,1,2"))
    assert take.n_frames == 2
    assert any("is cut off and left out" in notice for notice in take.notices)


def test_last_of_two_lines_of_titles_counts(put):
    """Venus3D names the points twice; rate and unit stand before, with an empty cell between."""
    text = "#Venus3D CSV Data\n#Sample Rate,,120.0\n#Units,,mm\n#Point Type,,,P1(X),P1(Y),P1(Z),P2(X),P2(Y),P2(Z)\n"
    text += "ID,Sample,Time,1(X),1(Y),1(Z),2(X),2(Y),2(Z)\n" + "".join(
        f"{n},{n},{n / 120},1,2,3,4,5,6\n" for n in range(3)
    )
    take = read_take(put("venus.csv", text))
    assert (take.names, take.rate, take.n_frames) == (("1", "2"), 120.0, 3)
    np.testing.assert_array_equal(take.positions[2], [[1, 2, 3], [4, 5, 6]])


def test_line_of_comment_marks_alone_is_no_line_of_titles(put):
    assert read_take(put("marks.csv", "%\n#\n" + UNITS)).names == ("nose", "tail.base")


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


def test_derivatives_and_channels_of_force_plates_are_no_points(put):
    """As D-Flow writes force plates."""
    names = ("LASI.Pos", "RASI.Pos", "FP1.Cop", "FP1.For", "FP2.Mom", "hand_jerk")
    titles = ",".join(f"{name}{axis}" for name in names for axis in "XYZ")
    take = read_take(put("dflow.csv", f"{titles}\n0.1,0.9,0,-0.1,0.9,0,{'700,' * 12}\n"))
    assert take.names == ("LASI", "RASI")
    assert take.positions[0, 0].tolist() == [100, 900, 0]


def test_directions_beside_points_are_left_out(put):
    titles = ",".join(f"{name}_{axis}" for name in ("head", "hand", "gaze") for axis in "xyz")
    rows = "".join(f"0.1,1.6,0.{n},0.4,1.1,0.{n},0,0.6,0.8\n" for n in range(3))
    take = read_take(put("gaze.csv", f"{titles}\n{rows}"))
    assert take.names == ("head", "hand")
    assert any("directions" in notice and "gaze" in notice for notice in take.notices)


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


@pytest.mark.parametrize("gap", [".", "missing", "undefined", "inf", "<NA>"])
def test_other_words_stand_for_gaps_too(put, gap):
    content = f"a_x,a_y,a_z,b_x,b_y,b_z\n101,102,103,{gap},{gap},{gap}\n101,102,103,104,105,106\n"
    assert read_take(put("gaps.csv", content)).seen.tolist() == [[True, False], [True, True]]


def test_strokes_may_part_cells(put):
    take = read_take(
        put("strokes.txt", "nose_x|nose_y|nose_z|tail.base_x|tail.base_y|tail.base_z\n" + rows(delimiter="|"))
    )
    np.testing.assert_allclose(take.positions, POSITIONS)


def test_deviations_of_positions_are_no_points(put):
    titles = "a_x,a_y,a_z,b_x,b_y,b_z,b_std_x,b_std_y,b_std_z"
    assert read_take(put("std.csv", f"{titles}\n" + rows(after=",1,2,3"))).names == ("a", "b")
