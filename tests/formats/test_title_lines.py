"""Lines above tables of points as recorders and scripts write them: units, names of three columns, numbered rows."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

from skelgen.model import Poses
from tests.formats.wide_rows import POSITIONS, rows

TITLES = "a_X,a_Y,a_Z,b_X,b_Y,b_Z"


def check(take, names=("a", "b")):
    assert take.names == names
    np.testing.assert_allclose(take.positions[0], POSITIONS[0])


@pytest.mark.parametrize("units", ["[-],[s]" + ",[mm]" * 6, "(),(s)" + ",(mm)" * 6, "-,s" + ",mm" * 6])
def test_units_may_stand_below_the_titles_in_brackets(put, units):
    take = read_take(put("units.csv", f"Frame,Time,{TITLES}\n{units}\n" + rows("{0},{1},")))
    check(take)
    assert take.rate == pytest.approx(50.0)


def test_text_of_codamotion_is_read(put):
    titles = "\t".join(f"{name}.{what}" for name in "ab" for what in "XYZV")
    units = "\t".join(["(mm)", "(mm)", "(mm)", "()"] * 2)
    numbers = "".join(f"{time}\t1\t2\t3\t1\t4\t5\t6\t{seen}\n" for time, seen in ((0.0, 0), (0.005, 1)))
    head = "CODAmotion Analysis Text\nSave of: Acquisition.1\nTime\tMarker Positions\t\t\t\t\t\t\t\n"
    take = read_take(put("coda.txt", f"{head}Time\t{titles}\n(s)\t{units}\n{numbers}"))
    assert (take.names, take.rate, take.seen.tolist()) == (("a", "b"), 200.0, [[True, False], [True, True]])


def test_measurement_of_labview_is_read(put):
    keys = (
        "Writer_Version\t2",
        "Separator\tTab",
        "X_Columns\tOne",
        "Time_Pref\tRelative",
        "Operator\tme",
        "Date\t2024",
    )
    head = "\n".join(("LabVIEW Measurement\t", *keys, "Time\t10:11:12", "***End_of_Header***\t", ""))
    channels = ("Channels\t6", "Samples" + "\t2" * 6, "Date" + "\t2024/03/04" * 6, "Time" + "\t10:11:12.5" * 6)
    more = ("X_Dimension" + "\tTime" * 6, "X0" + "\t0" * 6, "Delta_X" + "\t0.02" * 6, "***End_of_Header***" + "\t" * 6)
    titles = "X_Value\t" + TITLES.replace(",", "\t") + "\tComment\n"
    take = read_take(put("take.lvm", "\n".join((head, *channels, *more, titles)) + rows("{1}\t", delimiter="\t")))
    check(take)
    assert take.rate == pytest.approx(50.0)


@pytest.mark.parametrize("delimiter", [",", " "])
def test_rows_of_r_begin_with_their_number(put, delimiter):
    cells = [["frame", *TITLES.split(",")], *(["1", "1", *map(str, range(100, 106))], ["2", "2", *map(str, range(6))])]
    text = "\n".join(delimiter.join(f'"{cell}"' if at == 0 or n == 0 else cell for at, cell in enumerate(row))
                     for n, row in enumerate(cells))  # fmt: skip
    take = read_take(put("r.txt", text + "\n"))
    assert take.names == ("a", "b")
    np.testing.assert_array_equal(take.positions[0], [[100, 101, 102], [103, 104, 105]])


def test_rows_of_tidy_tables_of_r_begin_with_their_number(put):
    lines = [f'"{2 * frame + at + 1}" {frame} "{name}" 1 2 3' for frame in range(3) for at, name in enumerate("ab")]
    take = read_take(put("r.txt", "\n".join(['"frame" "marker" "x" "y" "z"', *lines, ""])))
    assert (take.names, take.n_frames) == (("a", "b"), 3)


@pytest.mark.parametrize(("titles", "before"), [("a,b", ""), ("frame,time,a,b", "{0},{1},"), ("markers:,a,b", "")])
def test_each_name_may_stand_for_three_columns(put, titles, before):
    take = read_take(put("names.csv", f"{titles}\n" + rows(before)))
    check(take)
    assert "each name stands for three columns, x, y and z" in take.notices


def test_rate_and_unit_may_stand_in_one_line(put):
    take = read_take(put("pairs.csv", f"Frequency,120,Unit,mm\nSample,{TITLES}\n" + rows("{0},")))
    check(take)
    assert take.rate == 120.0


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        ("knee_x_L,knee_y_L,knee_z_L,knee_x_R,knee_y_R,knee_z_R", ("knee_L", "knee_R")),
        ("頭 X座標,頭 Y座標,頭 Z座標,腰 X座標,腰 Y座標,腰 Z座標", ("頭", "腰")),
        ("/mocap/set/a/x,/mocap/set/a/y,/mocap/set/a/z,/mocap/set/b/x,/mocap/set/b/y,/mocap/set/b/z", ("a", "b")),
        ("Main.Out.a.r[0],Main.Out.a.r[1],Main.Out.a.r[2],Main.Out.b.r[0],Main.Out.b.r[1],Main.Out.b.r[2]", ("a", "b")),
        ("a_X(ML),a_Y(AP),a_Z(V),b_X(ML),b_Y(AP),b_Z(V)", ("a", "b")),
        ("a_pos[mm]_x,a_pos[mm]_y,a_pos[mm]_z,b_pos[mm]_x,b_pos[mm]_y,b_pos[mm]_z", ("a", "b")),
        ("X [mm] a,Y [mm] a,Z [mm] a,X [mm] b,Y [mm] b,Z [mm] b", ("a", "b")),
        (TITLES + ",a.scale.x,a.scale.y,a.scale.z", ("a", "b")),
    ],
)
def test_titles_of_further_forms_are_read(put, titles, names):
    check(read_take(put("forms.csv", f"時間,{titles}\n".encode("cp932") + rows("{1},").encode())), names)


def test_sides_that_all_names_begin_with_are_kept(put):
    titles = TITLES.replace("a_", "R.a_").replace("b_", "R.b_")
    assert read_take(put("side.csv", f"{titles}\n" + rows())).names == ("R.a", "R.b")


def test_units_of_numbers_without_one_are_passed_over(put):
    titles = ",".join(f"Sensor {n} {what}" for n in (1, 2) for what in ("X [mm]", "Y [mm]", "Z [mm]", "Q0 []"))
    titles += "".join(f",Sensor {n} Q{axis} []" for n in (1, 2) for axis in "xyz")
    take = read_take(
        put("wave.csv", f"Time [s],{titles}\n" + "".join(f"{t},1,2,3,1,4,5,6,1,0,0,0,0,0,0\n" for t in (0, 0.01)))
    )
    assert (take.names, take.rate) == (("Sensor 1", "Sensor 2"), 100.0)
    np.testing.assert_array_equal(take.world_from_body[0, :, :3, 3], [[1, 2, 3], [4, 5, 6]])


def test_tags_behind_the_rows_are_no_frames(put):
    take = read_take(
        put("net.pts", f"Frame#\t{TITLES}\n".replace(",", "\t") + rows("{0}\t", delimiter="\t") + "</Data>\n</Set>\n")
    )
    assert take.n_frames == 2


def test_times_of_takes_that_follow_each_other_tell_the_rate(put):
    lines = "".join(f"{n / 50:.2f},1,2,3,4,5,6\n" for n in range(30)) * 2
    take = read_take(put("takes.csv", f"time,{TITLES}\n{lines}"))
    assert (take.rate, take.n_frames) == (pytest.approx(50.0), 60)
    assert any("times go back in line 32: rows of several takes" in notice for notice in take.notices)


def test_table_in_markdown_is_read(put):
    table = f"Frame,{TITLES}\n{'---,' * 6}---\n" + rows("{0},")
    take = read_take(put("table.md", "".join(f"| {line.replace(',', ' | ')} |\n" for line in table.splitlines())))
    check(take)
    assert take.n_frames == 2


@pytest.mark.parametrize("word", ["?", "*", "\\N", "#VALUE!", "occluded", "ERR", "void"])
def test_words_for_what_is_unseen_are_understood(put, word):
    take = read_take(put("words.csv", f"Frame,{TITLES}\n0,1,2,3,4,5,6\n1,1,2,3,{word},{word},{word}\n"))
    assert take.seen.tolist() == [[True, True], [True, False]]


@pytest.mark.parametrize("numbers", ['"0,125","-12,5"', "0.125,\u221212.5", "1.25D-01,-1.25D+01"])
def test_numbers_of_other_spellings_are_understood(put, numbers):
    text = f"Frame,{TITLES}\n" + "".join(f"{frame},{numbers},3,4,5,6\n" for frame in range(2))
    np.testing.assert_array_equal(read_take(put("n.csv", text), recorded_unit="mm").positions[1, 0], [0.125, -12.5, 3])


def test_marks_between_thousands_are_no_decimal_commas(refused, put):
    assert "is not a number" in refused(put("n.csv", f"Frame,{TITLES}\n" + '0,"1,250",2,3,4,5,6\n' * 2))


@pytest.mark.parametrize(
    "titles",
    [
        ",".join(f"{name}-{axis}-mm" for name in "ab" for axis in "XYZ"),
        ",".join(f"{axis} of {name}" for name in "ab" for axis in "xyz"),
    ],
)
def test_units_behind_hyphens_and_axes_of_names_are_understood(put, titles):
    check(read_take(put("spelt.csv", f"Time-s,{titles}\n" + rows("{1},"))))


def test_of_two_versions_of_a_coordinate_the_first_counts(put):
    titles = ",".join(f"{name}_{axis}_{version}" for version in ("raw", "filt") for name in "ab" for axis in "xyz")
    take = read_take(put("two.csv", f"Frame,{titles}\n" + "".join(f"{n},1,2,3,4,5,6,1,2,3,4,5,7\n" for n in range(2))))
    assert take.names == ("a", "b")
    assert any("second versions of coordinates are left out: a_x_filt" in notice for notice in take.notices)


def test_words_of_flags_are_understood(put):
    titles = ",".join(f"{name}_{what}" for name in "ab" for what in ("x", "y", "z", "visible"))
    lines = "0,1,2,3,True,4,5,6,True\n1,1,2,3,True,4,5,6,False\n"
    assert read_take(put("flags.csv", f"Frame,{titles}\n{lines}")).seen.tolist() == [[True, True], [True, False]]


def test_bodies_count_more_than_a_single_point(put):
    titles = ",".join([*(f"head_{what}" for what in ("x", "y", "z", "qx", "qy", "qz", "qw")), "gaze_x,gaze_y,gaze_z"])
    take = read_take(put("gaze.csv", f"Frame,{titles}\n" + "".join(f"{n},1,2,3,0,0,0,1,4,5,{n}\n" for n in range(3))))
    assert isinstance(take, Poses)
    assert "1 point without a rotation is left out" in take.notices


@pytest.mark.parametrize(
    "line",
    [
        *("# sampling_rate_hz: 50", "Sample rate (samples/sec),50", "FPS 50", "Hz,50", "Rate,50,Hz", "Bildrate,50"),
        *(
            "Fréquence d'échantillonnage,50",
            "采样频率,50",
            "# frame rate known\nHz,50",
            "dt,0.02",
            "Sampling interval (ms): 20",
            "period,20 ms",
        ),
    ],
)
def test_rate_above_the_titles_may_be_written_in_many_ways(put, line):
    take = read_take(put("rate.csv", f"{line}\na_x,a_y,a_z,b_x,b_y,b_z\n" + "1,2,3,4,5,6\n" * 3))
    assert take.rate == pytest.approx(50.0)


@pytest.mark.parametrize("merged", [False, True])
def test_level_above_the_names_tells_subjects_apart(put, merged):
    above = ",S1,,,S2,," if merged else ",S1,S1,S1,S2,S2,S2"
    take = read_take(put("subjects.csv", f"{above}\n,knee,knee,knee,knee,knee,knee\n,x,y,z,x,y,z\n" + rows("{0},")))
    check(take, ("S1:knee", "S2:knee"))


def test_level_above_the_names_tells_velocities(put):
    lines = [",pos,,,,,,vel,,,,,", ",a,,,b,,,a,,,b,,", "t" + ",x,y,z" * 4]
    cells = [line.removesuffix("\n") for line in rows("{1},").splitlines()]
    take = read_take(put("kinds.csv", "\n".join([*lines, *(line + ",1,2,3,4,5,6" for line in cells)]) + "\n"))
    check(take)


def test_words_above_other_columns_are_no_level_of_titles(put):
    take = read_take(put("above.csv", f"Subject,Anna,Date,Monday,,,\nframe,{TITLES}\n" + rows("{0},")))
    check(take)


def test_level_of_axes_may_stand_above_the_names(put):
    cells = [",".join(f"{x:g}" for x in POSITIONS[0].T.ravel())] * 2
    take = read_take(put("axes.csv", ",x,x,y,y,z,z\n,a,b,a,b,a,b\n0," + cells[0] + "\n1," + cells[1] + "\n"))
    check(take)


@pytest.mark.parametrize("axis", ["{}-axis", "{} Coord", "{}pos", "{}.", "-{}", "{}-Koordinate"])
def test_axes_below_names_may_be_spelt_in_other_ways(put, axis):
    axes = ",".join(axis.format(one) for one in "XYZXYZ")
    take = read_take(put("axes.csv", f"frame,time,a,,,b,,\n,,{axes}\n" + rows("{0},{1},")))
    check(take)
    assert take.rate == pytest.approx(50.0)


@pytest.mark.parametrize("between", [",,1,1,1,2,2,2", ",,Position,Position,Position,Position,Position,Position"])
def test_lines_between_names_and_axes_take_no_names(put, between):
    take = read_take(put("ids.csv", f"frame,time,a,,,b,,\n{between}\n,,X,Y,Z,X,Y,Z\n" + rows("{0},{1},")))
    check(take)
    assert take.rate == pytest.approx(50.0)


def test_words_for_axes_may_stand_below_names(put):
    check(read_take(put("words.csv", "time,a,,,b,,\n,AP,ML,V,AP,ML,V\n" + rows("{1},"))))


@pytest.mark.parametrize(
    "line", ["Cut-off frequency: 6", "Low pass frequency,6", "Analog rate,6", "Baudrate,6", "heart rate,6"]
)
def test_rates_of_other_things_are_none_of_frames(put, line):
    take = read_take(put("other.csv", f"{line}\nframe rate,50\na_x,a_y,a_z,b_x,b_y,b_z\n" + "1,2,3,4,5,6\n" * 3))
    assert take.rate == pytest.approx(50.0)


def in_lines(heads, cells):
    return "\n".join(heads) + "\n" + "".join(f"{n},{n / 50},{cells}\n" for n in range(5))


@pytest.mark.parametrize("names", [("Rotula", "Tobillo", "Posterior"), ("Origin", "Centre", "Position")])
def test_names_that_begin_as_words_for_rotations_are_points(put, names):
    heads = [",,S1,,,,,,,,", ",," + "".join(f"{name},,," for name in names), "Frame,Time" + ",X,Y,Z" * 3]
    take = read_take(put("points.csv", in_lines(heads, "100,200,300,400,500,600,700,800,900")))
    np.testing.assert_allclose(take.positions[0], [[100, 200, 300], [400, 500, 600], [700, 800, 900]])


def test_velocities_beside_positions_below_names_are_left_out(put):
    words = ",,A,,,,,,B,,,,,", ",,Position,,,Velocity,,,Position,,,Velocity,,", "Frame,Time" + ",X,Y,Z" * 4
    take = read_take(put("points.csv", in_lines(words, "100,200,300,1,2,3,400,500,600,1,2,3")))
    assert (take.names, take.rate) == (("A", "B"), pytest.approx(50.0))
    np.testing.assert_allclose(take.positions[0], [[100, 200, 300], [400, 500, 600]])


@pytest.mark.parametrize("unit", ["(°)", "[deg]"])
def test_small_angles_below_names_are_in_the_unit_that_stands_behind_their_word(put, unit):
    heads = ",,hand,,,,,", f",,Position (m),,,Rotation {unit},,", "Frame,Time,X,Y,Z,X,Y,Z"
    take = read_take(put("hand.csv", in_lines(heads, "1,2,3,0,0,2")))
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [np.cos(np.pi / 90), np.sin(np.pi / 90)])


@pytest.mark.parametrize("words", [",,Position,,,Rotation,,,", ",,pos,pos,pos,quat,quat,quat,quat"])
def test_words_for_place_and_rotation_need_no_name_above_them(put, words):
    take = read_take(put("body.csv", in_lines([words, "Frame,Time,X,Y,Z,X,Y,Z,W"], "100,200,300,0,0,0.6,0.8")))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 3], [100, 200, 300])
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [0.28, 0.96])


@pytest.mark.parametrize("first", ["0,0,0.7,0.7", "-1,-1,-1,-1"])
def test_quaternions_of_one_digit_or_of_a_lost_body_are_no_points(put, refused, first):
    rows = "".join(f"{n},{n / 50},100,200,300,{first if n < 4 else '0,0,0.6,0.8'}\n" for n in range(8))
    assert "no unit quaternion" in refused(put("body.csv", f"frame,time,x,y,z,x,y,z,w\n{rows}"))


@pytest.mark.parametrize("title", ["{}_{n}_{axis}", "{}{n}_{axis}", "{}_marker{n}_{axis}"])
def test_vectors_of_opencv_may_have_a_marker_within_their_titles(put, title):
    titles = [title.format(word, n=n, axis=axis) for n in (4, 7) for word in ("tvec", "rvec") for axis in "xyz"]
    cells = f"0.1,0.2,0.3,0,0,{np.pi / 2:.6f},0.4,0.5,0.6,0,0,0"
    take = read_take(put("aruco.csv", in_lines([f"frame,time,{','.join(titles)}"], cells)))
    assert [name.removeprefix("marker") for name in take.names] == ["4", "7"]
    np.testing.assert_allclose(take.world_from_body[0, :, :3, 3], [[100, 200, 300], [400, 500, 600]])
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [0, 1], atol=1e-6)
