from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import WriteError
from skelgen.model import Trajectories


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


def test_number_of_names_must_be_the_announced_one(refused, edited, text):
    assert "6 marker names where NumMarkers says 7" in refused(edited("n.trc", text, "\t6\tmm", "\t7\tmm"))


def test_duplicate_label_is_named(refused, edited, text):
    assert "'C7'" in refused(edited("two.trc", text, "RFHD", "C7"))


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
