"""Rows of tables that say more than positions: flags of what is seen, and whose row it is."""

from __future__ import annotations

import pytest
from skelgen_formats.registry import read_take

TITLES = "time,knee_x,knee_y,knee_z,{0},toe_x,toe_y,toe_z,{1}\n"


@pytest.mark.parametrize(("first", "second"), [("knee_valid", "toe_valid"), ("1.V", "2.V")])
def test_points_are_unseen_where_their_flag_is_0(put, first, second):
    content = TITLES.format(first, second) + "0,1,2,3,1,4,5,6,1\n0.01,1,2,3,0,4,5,6,1\n"
    take = read_take(put("flags.csv", content))
    assert take.seen.tolist() == [[True, True], [False, True]]
    assert "1 position is unseen, as the columns of flags say" in take.notices


def test_columns_that_are_no_flags_hide_nothing(put):
    content = TITLES.format("knee_v", "toe_v") + "0,1,2,3,0,4,5,6,0.5\n0.01,1,2,3,0.2,4,5,6,0\n"
    assert read_take(put("speeds.csv", content)).seen.all()


def test_row_of_a_tidy_table_is_unseen_where_its_flag_says_so(put):
    content = "frame,marker,x,y,z,tracking_valid\n1,a,1,2,3,True\n1,b,1,2,4,False\n2,a,1,2,3,1\n2,b,1,2,4,1\n"
    assert read_take(put("tidy.csv", content)).seen.tolist() == [[True, False], [True, True]]


def test_rows_of_people_that_take_turns_are_refused(refused, put):
    titles = "time,BodyID,knee_x,knee_y,knee_z,toe_x,toe_y,toe_z\n"
    rows = "".join(f"0.0{frame},{body},1,2,3,4,5,6\n" for frame in range(3) for body in (7, 8))
    assert "by the column BodyID; write a file for each" in refused(put("two.csv", titles + rows))
    assert read_take(put("one.csv", titles + rows.replace(",8,", ",7,"))).n_frames == 6
