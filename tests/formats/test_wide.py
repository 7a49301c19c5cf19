"""Wide tables: what stands above, beside and in the rows of points."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

from tests.formats.wide_rows import POSITIONS, UNITS, rows

ANIPOSE = "nose_x,nose_y,nose_z,tail.base_x,tail.base_y,tail.base_z,nose_error,fnum\n" + rows(after=",0.1,0")
FREEMOCAP = "frame,timestamp,nose_x,nose_y,nose_z,tail.base_x,tail.base_y,tail.base_z\n" + rows("{},{},")
BLANKS = "Time (s);nose X;nose Y;nose Z;tail.base X;tail.base Y;tail.base Z\n" + rows("{1};", delimiter=";")
UNDER = "nose,,,tail.base,,\nX,Y,Z,X,Y,Z\n" + rows()
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


def test_points_of_deeplabcut_without_a_likelihood_are_unseen(put):
    head = "scorer" + ",net" * 8 + "\nbodyparts" + ",nose" * 4 + ",tail" * 4 + "\ncoords" + ",x,y,z,likelihood" * 2
    rows = "0,1,2,3,0.9,4,5,6,0.0\n1,1,2,3,,4,5,7,0.8\n"
    take = read_take(put("sure.csv", f"{head}\n{rows}"))
    assert take.seen.tolist() == [[True, False], [False, True]]


def test_points_in_images_say_what_to_do(refused, put):
    head = "scorer,net,net,net\nbodyparts,nose,nose,nose\ncoords,x,y,likelihood\n0,10,20,0.9\n"
    assert "2D; triangulate" in refused(put("2d.csv", head))


def test_some_other_table_is_refused_with_the_formats(refused, put):
    assert "known are motive (.csv), nexus (.csv), tracking-tools (.csv), tidy-csv (.csv), wide-csv (.csv)" in refused(
        put("a.csv", "name,age\nAnn,42\n")
    )


def test_quoted_cells_may_hold_commas(put):
    """FreeMoCap writes the times of all cameras into one cell of its files by trajectory."""
    rows = "".join(f"0.0{f},\"{{'a': 1, 'b': 2}}\",{f + 100},200,300,400,500,\"600\"\n" for f in range(3))
    titles = "timestamp,timestamp_by_camera,body_nose_x,body_nose_y,body_nose_z,toe_x,toe_y,toe_z\n"
    take = read_take(put("by_trajectory.csv", titles + rows))
    assert (take.names, take.rate) == (("body_nose", "toe"), 100.0)
    np.testing.assert_array_equal(take.positions[2], [[102, 200, 300], [400, 500, 600]])


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


def test_file_of_a_byte_order_mark_alone_is_refused(refused, put):
    assert refused(put("a.csv", b"\xef\xbb\xbf"))


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
    assert "the times of the file tell no frame rate; 100 Hz is assumed" in " ".join(
        read_take(put("times.csv", text)).notices
    )


@pytest.mark.parametrize("frames", [(0, 1, 2), (83, 84, 87, 88, 89, 91, 92)])
def test_column_of_times_that_counts_frames_states_no_rate(put, frames):
    text = "time,a_x,a_y,a_z,b_x,b_y,b_z\n" + "".join(f"{n},1,2,3,4,5,6\n" for n in frames)
    assert "100 Hz is assumed" in " ".join(read_take(put("counted.csv", text)).notices)


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


def test_line_of_comment_marks_alone_is_no_line_of_titles(put):
    assert read_take(put("marks.csv", "%\n#\n" + UNITS)).names == ("nose", "tail.base")


def test_strokes_may_part_cells(put):
    take = read_take(
        put("strokes.txt", "nose_x|nose_y|nose_z|tail.base_x|tail.base_y|tail.base_z\n" + rows(delimiter="|"))
    )
    np.testing.assert_allclose(take.positions, POSITIONS)


def test_statements_may_stand_in_one_line(put):
    head = "Number of frames: 2,Frequency (Hz): 60,Units: cm\n\nFrame,a x,a y,a z,b x,b y,b z\n"
    take = read_take(put("one.csv", head + rows("{},")))
    assert (take.rate, take.notices) == (60.0, ())
    np.testing.assert_allclose(take.positions, POSITIONS * 10)


def test_units_may_stand_under_places_alone_and_columns_behind_the_last_axis(put):
    """As The Captury writes joints, their rotations and measures of the gait."""
    text = "Unknown recording time\nFrames;2\n;;LWristPositions;;;LWristAngles;;;;HeadPosition;;;Knee Ratio;\n"
    text += "Frame;Annotations;X;Y;Z;X;Y;Z;W;X;Y;Z;;\n;;cm;cm;cm;;;;;cm;cm;cm;Ratio;\n"
    text += "".join(f"{frame};; 1; 2; 3;0;0;0.6;0.8; 4;5;6;1.4;\n" for frame in range(2))
    take = read_take(put("captury.csv", text))
    assert (take.names, take.n_frames) == (("LWrist", "Head"), 2)
    np.testing.assert_allclose(take.positions[1], [[10, 20, 30], [40, 50, 60]])


@pytest.mark.parametrize(
    ("encoding", "time", "names"),
    [
        ("gb18030", "时间", ("头", "手")),
        ("cp932", "時間", ("頭", "手")),
        ("cp949", "시간", ("머리", "손")),
        ("cp1251", "Время", ("Голова", "Рука")),
        ("cp1252", "Zeit", ("Hüfte", "Fuß")),
    ],
)
def test_titles_may_be_in_the_encoding_of_an_older_windows(put, encoding, time, names):
    titles = ";".join([time, *(f"{name}_{axis}" for name in names for axis in "XYZ")])
    take = read_take(put("old.csv", f"{titles}\n{rows('{1};', delimiter=';')}".encode(encoding)))
    assert (take.names, take.rate) == (names, pytest.approx(50.0))
