from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skelgen_formats.registry import read_take, recognise

from skelgen.model import PointCloud, Poses

TURN = Rotation.from_euler("XYZ", [20, -40, 70], degrees=True).as_matrix()
MATRIX = " ".join(f"{x:.6f}" for x in TURN.T.ravel())  # column by column
STILL = "1 0 0 0 1 0 0 0 1"


def frame(number: int, *lines: str) -> str:
    return "\n".join([f"fr {number}", f"ts {39596 + number / 60:.6f}", "6dcal 2", *lines]) + "\n"


BOTH = f"6d 2 [0 1.000][10 20 30 20 -40 70][{MATRIX}] [2 1.000][1 2 3 0 0 0][{STILL}]"
FIRST = f"6d 1 [0 1.000][11 20 30 20 -40 70][{MATRIX}]"
SINGLE = "3d 2 [79 1.000][210.5 -90 -108] [83 1.000][1 2 3]"


def test_bodies_are_read_with_their_matrices(put):
    path = put("hand.txt", frame(7, BOTH, SINGLE) + frame(8, FIRST) + frame(9, "6d 0"))
    take = read_take(path)
    assert isinstance(take, Poses)
    assert recognise(path).name == "dtrack"
    assert (take.names, round(take.rate, 3)) == (("body 1", "body 3"), 60.0)
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, :3], TURN, atol=1e-6)
    np.testing.assert_array_equal(take.world_from_body[0, :, :3, 3], [[10, 20, 30], [1, 2, 3]])
    assert np.isnan(take.world_from_body[:, :, 0, 0]).tolist() == [[False, False], [False, True], [True, True]]


def test_bodies_that_are_not_tracked_and_hybrid_ones_are_told_apart(put):
    lines = (f"6d 1 [0 -1.000][0 0 0 0 0 0][{STILL}]", f"6di 1 [4 2 0.1][5 6 7][{MATRIX}]")
    take = read_take(put("hybrid.txt", frame(1, *lines) + frame(2, *lines)))
    assert take.names == ("body 5",)


def test_single_markers_are_a_cloud(put):
    take = read_take(put("markers.txt", frame(1, SINGLE, "6d 0") + frame(2, "3d 1 [79 1.000][211 -90 -108]")))
    assert isinstance(take, PointCloud)
    assert [len(take.frame(n)) for n in range(2)] == [2, 1]


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        (BOTH[:-30], "the file may be cut off"),
        (BOTH.replace("10 20", "10 x"), "a word is no number"),
        (BOTH.replace(f"[{STILL}]", "[1 0 0]"), "where position, angles and a matrix belong"),
        ("3d 1 [79 1.000][211 -90]", "a marker has 2 numbers where three belong"),
        ("6d 0", "lists no body (6d) and no single marker (3d)"),
    ],
)
def test_lines_that_cannot_be_read_are_told(refused, put, line, sentence):
    assert sentence in refused(put("odd.txt", frame(1, line)))
