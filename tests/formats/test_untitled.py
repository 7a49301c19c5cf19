"""Poses of one body without titles: a turn about z and a place, as TUM, KITTI and others write them."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

PLACE, TURN = (0.1, 0.2, 0.3), np.array([[0.28, -0.96, 0], [0.96, 0.28, 0], [0, 0, 1]])
QUATERNION = "0.1 0.2 0.3 0 0 0.6 0.8"
FOUR = "0.28 -0.96 0 0.1\n0.96 0.28 0 0.2\n0 0 1 0.3\n0 0 0 1\n"
MATRIX = " ".join(f"{number:g}" for number in np.column_stack([TURN, PLACE]).ravel())


@pytest.mark.parametrize("row", [QUATERNION, QUATERNION.replace(" ", ", "), MATRIX, MATRIX + " 0 0 0 1"])
@pytest.mark.parametrize("is_timed", [False, True])
def test_pose_is_told_by_its_numbers(put, row, is_timed):
    parting = ", " if "," in row else " "
    times = [f"{1305031098.67 + frame / 50:.2f}{parting}" if is_timed else "" for frame in range(3)]
    path = put("pose.txt", "# ground truth\n" + "".join(f"{time}{row}\n" for time in times))
    take = read_take(path)
    assert recognise(path).name == "untitled-poses"
    assert (take.n_frames, take.rate) == (3, pytest.approx(50.0 if is_timed else 100.0))
    np.testing.assert_allclose(take.world_from_body[2, 0, :3], np.column_stack([TURN, [100, 200, 300]]), atol=1e-12)
    assert any("numbers without titles are taken as" in notice for notice in take.notices)
    assert any("`--recorded-rate` states another" in notice for notice in take.notices) != is_timed


@pytest.mark.parametrize("counters", ["", "0 0 1\n", "12.5\n"])
def test_matrices_may_stand_on_four_lines(refused, put, counters):
    text = "\n".join([counters + FOUR] * 30)
    take = read_take(put("hand.traj", text))
    np.testing.assert_allclose(take.world_from_body[29, 0, :3], np.column_stack([TURN, [100, 200, 300]]), atol=1e-12)
    assert refused(put("cut.traj", text[:-9])).endswith("belong; the file may be cut off")


def test_body_that_starts_at_the_origin_is_seen_there(put):
    take = read_take(put("kitti.txt", "".join(f"1 0 0 {frame / 9} 0 1 0 0 0 0 1 0\n" for frame in range(5))))
    assert np.isfinite(take.world_from_body).all()


@pytest.mark.parametrize("row", ["0 1.5 2.5 3 0.5 0 0 1", "1 0 0 5 0 1 0 6 0 0 2 7", "1 0 0 5 0 1 0 6 0 0 -1 7"])
def test_other_numbers_are_no_pose(refused, put, row):
    assert "numbers without titles" in refused(put("numbers.txt", f"{row}\n" * 3))
    assert "rows are no poses" in refused(put("numbers.tum", f"{row}\n" * 3))
