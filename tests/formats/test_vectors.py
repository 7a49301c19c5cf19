"""Tables whose cells are vectors: two points in two frames."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

STORAGE = """markers
DataRate=50.000000
DataType=Vec3
Units=m
endheader
time\t/markerset/knee|location\t/markerset/toe|location
0\t1,2,3\t4,5,6
0.02\t1,2,3\tnan,nan,nan
"""
DICTS = ((0, "\"{'x': 4, 'y': 5, 'z': 6}\""), (0.02, ""))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("storage.sto", STORAGE),
        ("tuples.csv", 'time (s),knee,toe\n0,"(1, 2, 3)","(4, 5, 6)"\n0.02,"(1, 2, 3)",None\n'),
        ("unity.csv", "time;knee;toe\n0;(1.0, 2.0, 3.0);(4.0, 5.0, 6.0)\n0.02;(1.0, 2.0, 3.0);\n"),
        ("unreal.csv", "time,knee,toe\n0,X=1.0 Y=2.0 Z=3.0,X=4.0 Y=5.0 Z=6.0\n0.02,X=1.0 Y=2.0 Z=3.0,\n"),
        ("cells.csv", "time;knee;toe\n0;x:1 y:2 z:3;(X=4,Y=5,Z=6)\n0.02;x:1 y:2 z:3;\n"),
        ("dicts.csv", "time,knee,toe\n" + "".join(f"{t},\"{{'x': 1, 'y': 2, 'z': 3}}\",{b}\n" for t, b in DICTS)),
        (
            "arrays.csv",
            "time,knee,toe,head\n0,[1. 2. 3.],[4. 5. 6.],[0 0 0 1]\n0.02,[1. 2. 3.],[nan nan nan],[0 0 0 1]\n",
        ),
    ],
)
def test_vectors_in_cells_are_points(put, name, content):
    path = put(name, content)
    take = read_take(path)
    assert recognise(path).name == "vector-csv"
    assert (take.names, round(take.rate, 9)) == (("knee", "toe"), 50.0)
    np.testing.assert_array_equal(take.positions[0], [[1000, 2000, 3000], [4000, 5000, 6000]])
    assert take.seen.tolist() == [[True, True], [True, False]]


def test_vector_that_is_unseen_in_the_first_row_is_a_point(put):
    content = "time;knee;toe\n0;None;(4, 5, 6)\n0.02;(1, 2, 3);(4, 5, 6)\n"
    assert read_take(put("late.csv", content)).names == ("knee", "toe")


@pytest.mark.parametrize("n_empty", [0, 60])
def test_lists_of_vectors_in_a_cell_are_points(put, n_empty):
    """As Python writes what it has of each frame, empty lists where that is nothing."""
    rows = [f"{frame / 50},[]" for frame in range(n_empty)]
    rows += [f'{(n_empty + frame) / 50},"[[{frame}, 2.0, 3.0], [4.0, 5.0, 6.0]]"' for frame in range(3)]
    take = read_take(put("lists.csv", "\n".join(["Timestamp,Pose", *rows])), recorded_unit="mm")
    assert (take.names, take.rate, take.n_frames) == (("Pose_1", "Pose_2"), 50.0, n_empty + 3)
    np.testing.assert_array_equal(take.positions[-1], [[2, 2, 3], [4, 5, 6]])
    assert int(take.seen.sum()) == 6


def test_row_that_is_too_short_is_refused_with_its_line(refused, put):
    message = refused(put("short.csv", "time;knee;toe\n0;(1, 2, 3);(4, 5, 6)\n0.02;(1, 2, 3)\n"))
    assert message.startswith(":3: 2 cells where 3 belong")


@pytest.mark.parametrize("title", ["{0}.position;{0}.rotation", "{0}Position;{0}Rotation", "{0} pos;{0} rot"])
def test_vectors_of_four_are_the_quaternions_of_bodies(put, title):
    """As Unity prints them."""
    titles = f"Time;{title.format('Head')};{title.format('Hand')}"
    rows = "".join(f"0.0{n};(0.1, 1.5, 0.2);(0, 0, 0, 1);(0.4, 1.0, 0.2);(0, 0, 0.6, 0.8)\n" for n in range(3))
    take = read_take(put("unity.csv", f"{titles}\n{rows}"))
    assert take.names == ("Head", "Hand")
    np.testing.assert_allclose(take.world_from_body[0, 1, :2, [0, 3]], [[0.28, 0.96], [400, 1000]])
    left_out = read_take(put("colours.csv", f"{titles}\n{rows}".replace("(0, 0, 0.6, 0.8)", "(1, 1, 0.6, 0.8)")))
    assert any(f"left out: {titles.rsplit(';', maxsplit=1)[-1]}" in notice for notice in left_out.notices)


def test_rows_of_nothing_are_no_titles(put):
    text = 'frame,a,b,turn\n0,"[null, null, null]","[1, 2, 3]","[null, null, null, null]"\n'
    text += "".join(f'{frame},"[1, 2, {frame}]","[4, 5, 6]","[1, 0, 0, 0]"\n' for frame in range(1, 4))
    take = read_take(put("lists.csv", text))
    assert take.seen[:, 0].tolist() == [False, True, True, True]


def test_places_of_unreal_are_read_beside_its_rotations(put):
    cells = [
        f'{t},{bone},"X={x}.5 Y=2.0 Z=3.0","P=0.0 Y=12.0 R=0.0"' for t in (0, 0.02) for x, bone in ((1, "a"), (4, "b"))
    ]
    take = read_take(put("bones.csv", "\n".join(["Time,Bone,Location,Rotation", *cells, ""])))
    assert (take.names, take.rate) == (("a", "b"), 50.0)
    np.testing.assert_array_equal(take.positions[0, 1], [4500, 2000, 3000])
