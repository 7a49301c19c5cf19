from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skelgen_formats.csm import read_csm
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import WriteError
from skelgen.model import Trajectories

# As House of Moves delivers it: other keywords, capitals, two spaces between markers, names ending in a blank.
DELIVERED = (
    "$Date 07/18/00\r\n$Time 23:47:32\r\n$Actor HOMie\r\n\r\n$Comments\r\nMotion capture\r\n\r\n$FirstFrame 7\r\n"
    "$LastFrame 9\r\n$Rate 30.000000\r\n\r\n$Order\r\nLFWT LBWT \r\nRBWT \r\n\r\n$Points\r\n"
    "7  115.438 -93.475 1083.692  113.279 97.176 1091.121  -155.031 81.281 1096.477\r\n"
    "8  DROPOUT  113.192 97.176 1091.207  DROPOUT DROPOUT\r\n"
    "9  1.0 2.0 3.0  0.000 0.000 0.000  4.0 5.0 6.0\r\n"
)


@pytest.fixture
def delivered() -> str:
    return DELIVERED.replace("DROPOUT DROPOUT\r\n", "DROPOUT\r\n")


def test_delivered_file_reads(put, delivered):
    take = read_take(put("delivered.csm", delivered))
    assert (take.names, take.rate, take.n_frames) == (("LFWT", "LBWT", "RBWT"), 30.0, 3)
    np.testing.assert_array_equal(take.positions[0, 1], [113.279, 97.176, 1091.121])


def test_one_word_per_marker_and_zeros_are_dropouts(put, delivered):
    seen = read_take(put("delivered.csm", delivered)).seen
    assert seen.tolist() == [[True, True, True], [False, True, False], [True, False, True]]


def test_three_words_per_marker_are_one_dropout(edited, delivered):
    triple = "DROPOUT DROPOUT DROPOUT"
    once = delivered.replace("1091.207  DROPOUT", f"1091.207  {triple}")
    take = read_take(edited("triple.csm", once, "8  DROPOUT", f"8  {triple}"))
    assert take.seen[1].tolist() == [False, True, False]


def test_wrong_number_of_numbers_names_the_line(refused, edited, delivered):
    assert refused(edited("short.csm", delivered, " 1096.477", "")).startswith(":17: 9 numbers where 10 numbers belong")


def test_missing_frame_names_the_line(refused, put, delivered):
    lines = delivered.split("\r\n")
    del lines[17]
    assert ":18: frame 9 follows frame 7" in refused(put("gap.csm", "\r\n".join(lines)))


def test_frames_before_the_end_of_a_cut_file_are_taken(put, delivered):
    whole = read_take(put("whole.csm", delivered))
    take = read_take(put("cut.csm", delivered[: delivered.index("9  1.0")]))
    np.testing.assert_array_equal(take.positions, whole.positions[:2])
    assert any("3 frames are announced and 2" in notice for notice in take.notices)
    halved = read_take(put("half.csm", delivered[: delivered.index("9  1.0") + 6]))
    np.testing.assert_array_equal(halved.positions, take.positions)


@pytest.mark.parametrize("keyword", ["$Rate", "$Order", "$FirstFrame", "$LastFrame", "$Points"])
def test_missing_keyword_is_named(refused, edited, delivered, keyword):
    assert keyword.lower() in refused(edited("no.csm", delivered, keyword, "$Other")).lower()


def test_rate_of_zero_is_an_error(refused, edited, delivered):
    assert ":10: $Rate is 0 Hz" in refused(edited("zero.csm", delivered, "30.000000", "0"))


def test_duplicate_label_gets_a_number(edited, delivered):
    take = read_take(edited("two.csm", delivered, "RBWT", "LFWT"))
    assert {"LFWT", "LFWT_2"} <= set(take.names)
    assert any("LFWT" in notice for notice in take.notices)


def test_dropouts_are_written_as_asked(walk, tmp_path):
    for choice, mark in (("word", "DROPOUT"), ("zero", "0 0 0")):
        path = tmp_path / f"{choice}.csm"
        write_file(walk, path, dropout=choice)
        assert path.read_text().count(mark) == 4
        np.testing.assert_array_equal(read_take(path).seen, walk.seen)


def test_blanks_in_names_become_underscores(tmp_path):
    path = tmp_path / "blank.csm"
    write_file(Trajectories(np.ones((2, 1, 3)), ("left hip",), 50.0), path)
    assert read_take(path).names == ("left_hip",)


def test_name_of_which_nothing_is_left_cannot_be_written(tmp_path):
    with pytest.raises(WriteError, match="rename"):
        write_file(Trajectories(np.ones((2, 1, 3)), ("$",), 50.0), tmp_path / "dollar.csm")


@settings(max_examples=30, derandomize=True, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6).filter(bool), min_size=3, max_size=3))
def test_every_float_survives_the_text(tmp_path_factory, numbers):
    path = tmp_path_factory.mktemp("csm") / "exact.csm"
    take = Trajectories(np.array([[numbers]]), ("a",), 120.0)
    write_file(take, path)
    np.testing.assert_array_equal(read_csm(path).positions, take.positions)
