from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import WriteError
from skelgen.model import PointCloud, Trajectories

HEADER_OF_NONE = (
    "PathFileType\t4\t(X/Y/Z)\tcloud.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\n"
    "100\t100\t3\t0\tmm\t100\nFrame#\tTime\t\n\t\tX1\tY1\tZ1\n\n"
)


@pytest.fixture
def text(valid_file) -> str:
    return valid_file("trc").read_text()


def test_metres_become_millimetres(edited, text, walk):
    back = read_take(edited("m.trc", text, "\tmm\t", "\tm\t"))
    np.testing.assert_allclose(back.positions, walk.positions * 1000)


def test_unknown_unit_is_named(refused, edited, text):
    assert "'parsec'" in refused(edited("u.trc", text, "\tmm\t", "\tparsec\t"))


def test_windows_line_ends_byte_order_mark_and_comments_change_nothing(put, text, walk):
    lines = text.split("\n")
    lines.insert(8, "# a remark")
    content = b"\xef\xbb\xbf" + "\r\n".join(lines).encode()
    np.testing.assert_array_equal(read_take(put("dos.trc", content)).positions, walk.positions)


def test_names_one_column_off_are_found_in_order(edited, text, walk):
    assert read_take(edited("off.trc", text, "Time\tLFHD", "Time\t\tLFHD")).names == walk.names


def test_wrong_number_of_cells_names_the_line(refused, put, text):
    lines = text.split("\n")
    lines[8] = lines[8].rpartition("\t")[0]
    assert refused(put("short.trc", "\n".join(lines))).startswith(":9: 19 cells where 20 belong")


def test_word_for_a_number_names_the_line_and_value(refused, put, text):
    lines = text.split("\n")
    cells = lines[6].split("\t")
    cells[5] = "abc"
    lines[6] = "\t".join(cells)
    assert refused(put("word.trc", "\n".join(lines))).startswith(":7: 'abc' in value 6")


def test_names_count_where_the_header_announces_more(edited, text):
    take = read_take(edited("n.trc", text, "\t6\tmm", "\t66\tmm"))
    assert take.n_markers == 6
    assert "NumMarkers says 66, 6 markers are named, and 6 have columns" in take.notices


def test_names_beyond_those_announced_are_virtual_markers(edited, text):
    path = edited("virtual.trc", text, "\t6\tmm", "\t4\tmm")
    measured, every = read_take(path), read_take(path, points="all")
    assert (measured.n_markers, every.n_markers) == (4, 6)
    assert measured.names == every.names[:4]
    np.testing.assert_array_equal(measured.positions, every.positions[:, :4])
    assert any("a model computed them (`--points all` takes them): T10, STRN" in notice for notice in measured.notices)


def test_columns_without_a_name_are_left_out(edited, text):
    take = read_take(edited("unnamed.trc", text, "\t\t\tSTRN", "\t\t\t"))
    assert take.n_markers == 5
    assert any("unlabelled: unlabelled 6" in notice for notice in take.notices)


def test_columns_without_any_names_are_a_cloud(put):
    rows = "1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.01\t1.1\t2.1\t3.1\n3\t0.02\t7\t8\t9\t4.2\t5.2\t6.2\n"
    take = read_take(put("cloud.trc", f"{HEADER_OF_NONE}{rows}"))
    assert isinstance(take, PointCloud)
    assert take.points_per_frame.tolist() == [2, 1, 2]
    np.testing.assert_array_equal(take.frame(1), [[1.1, 2.1, 3.1]])


def test_rows_of_very_different_lengths_take_no_memory(refused, put):
    rows = "1\t0\t" + "1\t" * 30_000 + "\n" + "2\t0\t1\t2\t3\n" * 3_000
    assert "far shorter" in refused(put("steep.trc", f"{HEADER_OF_NONE}{rows}"))


def test_commas_for_tabs_are_understood(put, text, walk):
    commas = text.replace("\t", ",").replace("\n\n", "\n" + "," * 19 + "\n", 1)
    back = read_take(put("commas.trc", commas))
    np.testing.assert_array_equal(back.positions, walk.positions)
    assert back.names == walk.names


def test_semicolons_and_decimal_commas_are_understood(put, text):
    """As spreadsheets save TRC where a comma is the decimal point."""
    back = read_take(put("semicolons.trc", text.replace(".", ",").replace("\t", ";")))
    np.testing.assert_allclose(back.positions, read_take(put("tabs.trc", text)).positions)


def test_doubled_tabs_are_single_ones(put):
    doubled = HEADER_OF_NONE.replace("\t0\tmm", "\t2\tmm").replace("Time\t", "Time\tA\t\t\tB\t\t").replace("\t", "\t\t")
    take = read_take(put("doubled.trc", doubled + "1\t\t0\t\t1\t\t2\t\t3\t\t4\t\t5\t\t6\n"))
    assert take.names == ("A", "B")
    np.testing.assert_array_equal(take.positions[0], [[1, 2, 3], [4, 5, 6]])
    assert any("doubled tabs" in notice for notice in take.notices)


def test_label_that_stands_twice_gets_a_number(edited, text):
    take = read_take(edited("two.trc", text, "RFHD", "C7"))
    assert take.names[:3] == ("LFHD", "C7", "C7_2")
    assert "labels that stand twice got numbers: C7_2 was C7" in take.notices


def test_shortened_file_reads_with_a_notice(put, text):
    shortened = "\n".join(text.split("\n")[:10]) + "\n"
    back = read_take(put("short.trc", shortened))
    assert back.n_frames == 4
    assert any("announces 12" in notice for notice in back.notices)


def test_marker_at_a_cut_end_is_unseen(put, text):
    back = read_take(put("cut.trc", text[: text.index("\n9\t") - 3]))
    assert np.isnan(back.positions[-1, -1]).all()
    assert not np.isnan(back.positions[-1, :-1]).any()


def test_absurd_position_is_a_format_error(refused, put, text):
    lines = text.split("\n")
    lines[6] = "\t".join([*lines[6].split("\t")[:-1], "1e300"])
    assert "frame 1" in refused(put("far.trc", "\n".join(lines)))


def test_name_with_a_tab_cannot_be_written(tmp_path):
    with pytest.raises(WriteError, match="rename"):
        write_file(Trajectories(np.ones((2, 1, 3)), ("a\tb",), 50.0), tmp_path / "tab.trc")


@pytest.mark.parametrize(
    ("name", "shape"), [("human/markers_Squat2.trc", (460, 61)), ("bone_pin/abdbonepin.trc", (1991, 11))]
)
def test_real_recordings_have_human_size_in_millimetres(recording, name, shape):
    take = read_take(recording(name))
    assert take.positions.shape[:2] == shape
    assert 200 < np.nanmax(np.abs(take.positions)) < 3000


def test_cell_of_an_unseen_marker_at_the_end_of_a_line_is_blank_but_there(walk, tmp_path):
    last = walk.positions.copy()
    last[2, -1] = np.nan
    path = write_file(replace(walk, positions=last), tmp_path / "walk.trc")[0]
    line = path.read_text().split("\n")[6 + 2]
    assert line.endswith("\t\t\t ")  # OpenSim drops cells at the end that hold nothing
    assert np.isnan(read_take(path).positions[2, -1]).all()


KEYS = "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
ODD = (
    f"PathFileType\t4\t(X/Y/Z)\todd.trc\n{KEYS}50.0\t50.0\t2\t2\tm\t50.0\t1\t2\nFrame#\tTime\tknee\t\t\tankle\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0.00\t0.1\t0.2\t0.3\t0.4\t0.5\t0.6\n2\t0.02\t0.2\t0.3\t0.4\t0.5\t0.6\t0.7\n"
)
PER_AXIS = "Frame#\tTime\tknee_x\tknee_y\tknee_z\tankle_x\tankle_y\tankle_z"


def test_file_without_names_and_rows_is_refused(refused, put):
    head = ODD[: ODD.index("Frame#")].replace("\t2\tm", "\t0\tm")
    assert "no marker is named" in refused(put("empty.trc", head + "Frame#\tTime\n\t\n\n"))


@pytest.mark.parametrize(
    "content",
    [
        ODD,
        ODD.replace("\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n", ""),
        ODD.replace("\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n", "").replace("Frame#\tTime\tknee\t\t\tankle\t\t", PER_AXIS),
        ODD.replace("Frame#\tTime\tknee\t\t\tankle\t\t", PER_AXIS),
        ODD.replace("\t", "  "),
        ODD.replace("m\t50.0\t1\t2", "m   50.0  1  2"),
        "# made by hand\n" + ODD,
        ODD.replace("\t50.0\t1\t2\n", "\t50.0\t1\n"),
        ODD.replace("\tTime\t", "\tTimes\t"),
    ],
    ids=(
        "plain",
        "no axes",
        "names over every column alone",
        "and axes",
        "blanks",
        "blanks in values",
        "comment",
        "a value less",
        "another title of times",
    ),
)
def test_titles_that_scripts_write_in_other_ways_name_the_same_points(put, content):
    """Two frames of two points in metres, whatever the titles."""
    take = read_take(put("odd.trc", content))
    assert (take.names, take.n_frames, take.rate) == (("knee", "ankle"), 2, 50.0)
    np.testing.assert_allclose(take.positions[0], [[100, 200, 300], [400, 500, 600]], rtol=1e-12)


@pytest.mark.parametrize("first", ["", "pathfiletype\t4\t(X/Y/Z)\twalk.trc\n"])
def test_first_line_may_be_missing_or_in_small_letters(put, text, walk, first):
    take = read_take(put("first.trc", first + text.partition("\n")[2]))
    assert (take.names, take.rate) == (walk.names, walk.rate)


def test_names_that_blanks_part_are_two(edited, text, walk):
    tabs = "\t\t\t".join(walk.names[-2:])
    assert read_take(edited("blanks.trc", text, tabs, "          ".join(walk.names[-2:]))).names == walk.names


@pytest.mark.parametrize("stated", ["0", "30"])
def test_times_count_where_the_header_states_another_rate(put, text, walk, stated):
    lines = text.split("\n")
    lines[2] = stated + lines[2][lines[2].index("\t") :]
    take = read_take(put("rate.trc", "\n".join(lines)))
    assert take.rate == walk.rate
    assert any(f"DataRate says {stated} Hz" in notice for notice in take.notices)


def test_number_that_stands_for_a_gap_is_unseen(edited, text, walk):
    row = text.split("\n")[6].split("\t")
    path = edited("gap.trc", text, "\t".join(row[2:8]), "\t".join(["-9999"] * 6))
    assert read_take(path).seen[0, :3].tolist() == [False, False, True]


def test_names_in_columns_of_blanks_above_rows_that_begin_with_a_tab_are_read(put, text, walk):
    """As scripts write them that compute hip centres for OpenSim."""
    lines = text.split("\n")
    lines[3] = "Frame#\tTime            " + "".join(name.ljust(33) for name in walk.names)
    lines[5:] = [f"\t{line}" if line else "" for line in lines[5:]]
    take = read_take(put("columns.trc", "\n".join(lines)))
    assert (take.names, take.rate) == (walk.names, walk.rate)
    np.testing.assert_array_equal(take.positions, walk.positions)


def test_frame_numbers_may_be_missing(put, text, walk):
    lines = text.split("\n")
    at = next(number for number, line in enumerate(lines) if line.startswith("Frame#"))
    rows = [line.partition("\t")[2] for line in lines[at:]]
    take = read_take(put("times.trc", "\n".join([*lines[:at], *rows])))
    np.testing.assert_array_equal(take.positions, walk.positions)
    assert (take.names, take.rate) == (walk.names, walk.rate)


@pytest.mark.parametrize("new", ["\t\t", "\t"])
def test_missing_unit_is_found_by_size_with_a_notice(edited, text, walk, new):
    take = read_take(edited("none.trc", text, "\tmm\t", new))
    np.testing.assert_array_equal(take.positions, walk.positions)
    assert any("names no length unit; mm is assumed" in notice for notice in take.notices)


def test_blanks_may_part_frame_number_and_time(put, text, walk):
    lines = text.split("\n")
    lines[6:] = [line.replace("\t", "      ", 1) for line in lines[6:]]
    take = read_take(put("blanks.trc", "\n".join(lines)))
    np.testing.assert_array_equal(take.positions, walk.positions)


def test_unit_can_be_stated_where_the_file_names_none(edited, text, walk):
    take = read_take(edited("none.trc", text, "\tmm\t", "\t\t"), recorded_unit="cm")
    np.testing.assert_allclose(take.positions, walk.positions * 10)
    assert not any("length unit" in notice for notice in take.notices)


def test_stated_unit_that_the_file_contradicts_is_told(edited, text, walk):
    take = read_take(edited("mm.trc", text, "", ""), recorded_unit="cm")
    np.testing.assert_array_equal(take.positions, walk.positions)
    assert any("`--recorded-unit cm` is for files that name none" in notice for notice in take.notices)
    same = read_take(edited("mm.trc", text, "", ""), recorded_unit="mm")
    assert not any("--recorded-unit" in notice for notice in same.notices)


@pytest.mark.parametrize("n_markers", ["\t", f"\t{3}"])
def test_header_may_leave_counts_empty(put, text, walk, n_markers):
    lines = text.split("\n")
    cells = lines[2].split("\t")
    cells[2:4] = "", cells[3] * (n_markers != "\t")
    take = read_take(put("template.trc", "\n".join([*lines[:2], "\t".join(cells), *lines[3:]])))
    np.testing.assert_array_equal(take.positions, walk.positions)


def test_times_in_other_units_leave_the_stated_rate(put, text, walk):
    lines = text.split("\n")
    rows = [line.split("\t", 2) for line in lines[6:] if line]
    counted = ["\t".join([number, str(40 * int(number)), rest]) for number, _, rest in rows]
    assert read_take(put("ms.trc", "\n".join([*lines[:6], *counted, ""]))).rate == walk.rate


def test_times_may_be_timecodes(put, text, walk):
    lines = text.splitlines()
    rows = [line.split("\t", 2) for line in lines[6:]]
    coded = ["\t".join([number, f"00:00:{n // 25:02}:{n % 25:02}", rest]) for n, (number, _, rest) in enumerate(rows)]
    take = read_take(put("codes.trc", "\n".join(lines[:6] + coded)))
    np.testing.assert_allclose(take.positions, walk.positions)
    assert take.rate == walk.rate


def test_blanks_may_part_all_cells_of_rows(put, text, walk):
    lines = text.splitlines()
    rows = [" ".join(cell.strip() or "NaN" for cell in line.split("\t")) for line in lines[6:]]
    np.testing.assert_allclose(read_take(put("blanks.trc", "\n".join(lines[:6] + rows))).positions, walk.positions)


@pytest.mark.parametrize("parting", ["=", "\t"])
@pytest.mark.parametrize("between", ["\t", "\n"])
def test_keys_of_the_header_may_stand_before_their_values(put, text, walk, parting, between):
    magic, keys, values, *rest = text.split("\n")
    pairs = between.join(map(parting.join, zip(keys.split("\t"), values.split("\t"), strict=True)))
    back = read_take(put("pairs.trc", "\n".join([magic, pairs, *rest])))
    assert (back.names, back.rate) == (walk.names, walk.rate)
    np.testing.assert_array_equal(back.positions, walk.positions)
