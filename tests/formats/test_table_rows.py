"""Rows of tables that say more than positions: flags of what is seen, and whose row it is."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

TITLES = "time,knee_x,knee_y,knee_z,{0},toe_x,toe_y,toe_z,{1}\n"


@pytest.mark.parametrize(("first", "second"), [("knee_valid", "toe_valid"), ("1.V", "2.V")])
def test_points_are_unseen_where_their_flag_is_0(put, first, second):
    content = TITLES.format(first, second) + "0,1,2,3,1,4,5,6,1\n0.01,1,2,3,0,4,5,6,1\n"
    take = read_take(put("flags.csv", content))
    assert take.seen.tolist() == [[True, True], [False, True]]
    assert "1 position is unseen, as the columns of flags say" in take.notices


def test_points_are_unseen_where_a_flag_calls_them_occluded(put):
    content = TITLES.format("knee_occluded", "toe_isOccluded") + "0,1,2,3,0,4,5,6,0\n0.01,1,2,3,1,4,5,6,0\n"
    assert read_take(put("flags.csv", content)).seen.tolist() == [[True, True], [False, True]]


def test_columns_that_are_no_flags_hide_nothing(put):
    content = TITLES.format("knee_v", "toe_v") + "0,1,2,3,0,4,5,6,0.5\n0.01,1,2,3,0.2,4,5,6,0\n"
    assert read_take(put("speeds.csv", content)).seen.all()


def test_row_of_a_tidy_table_is_unseen_where_its_flag_says_so(put):
    content = "frame,marker,x,y,z,tracking_valid\n1,a,1,2,3,True\n1,b,1,2,4,False\n2,a,1,2,3,1\n2,b,1,2,4,1\n"
    assert read_take(put("tidy.csv", content)).seen.tolist() == [[True, False], [True, True]]


@pytest.mark.parametrize("titles", ["frame,a_x,a_y,a_z,b_x,b_y,b_z", "frame,marker,x,y,z"])
@pytest.mark.parametrize("remark", ["# trigger", "// 5,trigger", "Mean,a,1,2,3,4,5", "End of file", "{}"])
def test_lines_that_are_no_rows_are_left_out(put, titles, remark):
    cells = ["1,2,3,4,5,6"] if "a_x" in titles else ["a,1,2,3", "b,4,5,6"]
    rows = ["".join(f"{frame},{cell}\n" for cell in cells) for frame in (1, 2)]
    take = read_take(put("remarks.csv", f"{titles}\n{rows[0]}{remark.format(titles)}\n{rows[1]}"))
    assert (take.n_frames, take.seen.all()) == (2, True)
    assert "1 line is no row of the table and left out: " + str(2 + len(cells)) in take.notices


def test_rows_of_words_that_stand_for_no_number_are_frames(put):
    take = read_take(put("words.csv", "a_x,a_y,a_z,b_x,b_y,b_z\n1,2,3,4,5,6\nNA,NA,NA,n/d,--,---\n7,8,9,1,2,3\n"))
    assert take.seen.tolist() == [[True, True], [False, False], [True, True]]


@pytest.mark.parametrize(
    "times",
    [
        ("12:00:59.98", "12:01:00.00"),
        ("2024-05-06T12:00:59.98Z", "2024-05-06T12:01:00Z"),
        ("0.98", "1.00"),
        ("0.98 sec", "1 sec"),
        ("0 days 00:00:59.98", "0 days 00:01:00"),
        ("5/6/2024 12:59:59.98 PM", "5/6/2024 1:00:00 PM"),
    ],
)
@pytest.mark.parametrize("titles", ["time,a_x,a_y,a_z,b_x,b_y,b_z", "time,marker,x,y,z"])
def test_times_of_a_clock_tell_the_rate(put, times, titles):
    cells = ["1,2,3,4,5,6"] if "a_x" in titles else ["a,1,2,3", "b,4,5,6"]
    rows = "".join(f"{time},{cell}\n" for time in times for cell in cells)
    take = read_take(put("clock.csv", f"{titles}\n{rows}"))
    assert (take.rate, take.names) == (pytest.approx(50.0), ("a", "b"))


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        ("X,Y,Z,X.1,Y.1,Z.1", ("0", "1")),
        ("hip_X7,hip_Y7,hip_Z7,toe_X8,toe_Y8,toe_Z8", ("hip", "toe")),
        ("hip_x1,hip_x2,hip_y1,hip_y2,hip_z1,hip_z2", ("hip 1", "hip 2")),
    ],
    ids=("pandas", "TRC", "blocks"),
)
def test_titles_with_numbers_name_points(put, titles, names):
    take = read_take(put("numbered.csv", f"{titles}\n1,2,3,4,5,6\n"))
    assert take.names == names


def test_points_of_several_people_are_told_apart_by_their_number(put):
    rows = "".join(f"0.0{frame},{body},{joint},1,2,{body}\n" for frame in (0, 1) for body in (1, 2) for joint in "ab")
    take = read_take(put("people.csv", f"time_seconds,body_id,joint_name,x,y,z\n{rows}"))
    assert take.names == ("1_a", "1_b", "2_a", "2_b")


def test_frame_numbers_that_go_back_are_told(put):
    rows = "".join(f"{frame},1,2,3,4,5,6\n" for frame in (1, 2, 3, 1, 2, 3))
    take = read_take(put("blocks.csv", f"frame_idx,a_x,a_y,a_z,b_x,b_y,b_z\n{rows}"))
    assert sum("frame numbers go back in line 5" in notice for notice in take.notices) == 1


def test_times_that_cannot_be_read_state_no_rate(put):
    rows = "".join(f"01:02:03:{frame:02},1,2,3,4,5,6\n" for frame in range(3))
    take = read_take(put("code.csv", f"time,a_x,a_y,a_z,b_x,b_y,b_z\n{rows}"))
    assert any("100 Hz is assumed" in notice for notice in take.notices)


@pytest.mark.parametrize(("frames", "places"), [((1, 2, 5, 6, 7), 1), ((0, 2, 4, 6), 0), ((4, 4, 5, 5), 0)])
def test_frames_that_are_left_out_are_told(put, frames, places):
    rows = "".join(f"{frame},1,2,3,4,5,6\n" for frame in frames)
    notices = read_take(put("frames.csv", f"frame,a_x,a_y,a_z,b_x,b_y,b_z\n{rows}")).notices
    assert sum("frame numbers leave some out in 1 place" in notice for notice in notices) == places


@pytest.mark.parametrize(("frames", "places"), [((1, 2, 5, 6, 7), 1), ((0, 2, 4, 6), 0)])
def test_frames_that_tidy_tables_leave_out_are_told(put, frames, places):
    rows = "".join(f"{frame},{name},1,2,{frame}\n" for frame in frames for name in "ab")
    notices = read_take(put("tidy.csv", f"frame,marker,x,y,z\n{rows}")).notices
    assert sum("frame numbers leave some out in 1 place" in notice for notice in notices) == places


def test_number_beyond_all_places_stands_for_an_unseen_point(put):
    """As NDI writes -3.697314e28."""
    gap = "2,-3.697314e28,-3.697314e28,-3.697314e28,4,5,6\n"
    take = read_take(put("ndi.csv", f"frame,a_x,a_y,a_z,b_x,b_y,b_z\n1,1,2,3,4,5,6\n{gap}"))
    assert take.seen.tolist() == [[True, True], [False, True]]
    assert any("1 position is -3.69731e+28 along x, y and z, and is taken as unseen" in one for one in take.notices)


@pytest.mark.parametrize(("unit", "mm"), [("mm", 1.0), ("m", 1000.0)])
def test_units_may_stand_in_cells(put, unit, mm):
    rows = "".join(f"{10 * n} ms,1.5 {unit},2 {unit},3{unit},4 {unit},5 {unit},6 {unit}\n" for n in range(3))
    take = read_take(put("cells.csv", f"time,a_x,a_y,a_z,b_x,b_y,b_z\n{rows}"))
    np.testing.assert_allclose(take.positions[0], np.array([[1.5, 2, 3], [4, 5, 6]]) * mm)
    assert take.rate == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("delimiter", "cells"),
    [
        ("\t", ["1,234.5", "-2,000", "950.25"]),
        (",", ['"1,234.5"', '"-2,000"', '"950.25"']),
        (";", ["1.234,5", "-2.000", "950,25"]),
        (";", ["1\u202f234,5", "-2\u202f000,0", "950,25"]),
        (";", ["1'234.5", "-2'000", "950.25"]),
    ],
)
def test_marks_between_thousands_are_left_out_where_something_tells_them_from_decimals(put, delimiter, cells):
    """As spreadsheets and Java write numbers: where one is told, all are."""
    titles = [f"{name}_{axis}" for name in ("knee", "hip") for axis in "xyz"]
    rows = [titles, [*cells, *cells[::-1]], [*cells[::-1], *cells]]
    take = read_take(put("marks.csv", "\n".join(map(delimiter.join, rows))), recorded_unit="mm")
    numbers = [1234.5, -2000.0, 950.25]
    assert take.positions.tolist() == [[numbers, numbers[::-1]], [numbers[::-1], numbers]]
    tidy = [["frame", "marker", "x", "y", "z"], *([str(n), one, *cells] for n in range(2) for one in ("hip", "knee"))]
    take = read_take(put("tidy.csv", "\n".join(map(delimiter.join, tidy))), recorded_unit="mm")
    assert take.positions.tolist() == [[numbers, numbers]] * 2


def test_marks_between_thousands_are_of_coordinates_alone(put):
    rows = "".join(f"{1 + n / 1000:.3f};1.00{k};1.234,5;3{n},25;95{k},5\n" for n in range(9) for k in range(2))
    take = read_take(put("tidy.csv", f"time;marker;x;y;z\n{rows}"), recorded_unit="mm")
    assert (take.names, take.rate) == (("1.000", "1.001"), pytest.approx(1000.0))
    assert take.positions[2].tolist() == [[1234.5, 32.25, 950.5], [1234.5, 32.25, 951.5]]
    rows = "".join(f"{1 + n / 1000:.3f};1.234,5;3{n},25;950,5;-2.000;0,5;{n},5\n" for n in range(9))
    titles = "time;" + ";".join(f"{name}_{axis}" for name in "ab" for axis in "xyz")
    take = read_take(put("wide.csv", f"{titles}\n{rows}"), recorded_unit="mm")
    assert (take.rate, take.positions[1, 1].tolist()) == (pytest.approx(1000.0), [-2000.0, 0.5, 1.5])


@pytest.mark.parametrize("tidy", [False, True])
def test_marks_between_thousands_that_begin_below_the_first_rows_are_left_out_of_all(put, tidy):
    heights = [*range(940, 1000), "1,000", "1,001.5", "1,002"]
    wide = "".join(f"{n}\t1\t2\t{z}\t4\t5\t6\n" for n, z in enumerate(heights))
    rows = "".join(f"{n}\ta\t1\t2\t{z}\n{n}\tb\t4\t5\t6\n" for n, z in enumerate(heights))
    text = f"frame\tname\tx\ty\tz\n{rows}" if tidy else f"frame\ta_x\ta_y\ta_z\tb_x\tb_y\tb_z\n{wide}"
    take = read_take(put("late.csv", text))
    np.testing.assert_allclose(take.positions[:, 0, 2], [*range(940, 1000), 1000, 1001.5, 1002])


@pytest.mark.parametrize(("stray", "cell"), [("1.234,5", "0.940"), ("1,234.5", "0,940")])
def test_marks_that_part_decimals_elsewhere_in_the_row_part_no_thousands(put, refused, stray, cell):
    rows = "".join(f"{n}\t1\t2\t{cell}\t4\t{stray if n == 80 else '1.400'}\t6\n" for n in range(90))
    assert "82: " in refused(put("stray.tsv", f"frame\ta_x\ta_y\ta_z\tb_x\tb_y\tb_z\n{rows}"))
