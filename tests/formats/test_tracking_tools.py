"""The CSV of OptiTrack's Tracking Tools, Arena and first Motive, which lists in each frame what is tracked."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

from skelgen.model import PointCloud, Poses

HEAD = 'comment,NaturalPoint\nrighthanded\ninfo,version,1.1\ninfo,framecount,3\nrigidbody,"Wand",7,3\n'
POSE = "7,0.1,0.2,0.3,0,0.6,0,0.8,0,0,0"


def frame(number, bodies=(), markers=()) -> str:
    cells = ["frame", number, number / 120, len(bodies), *bodies, len(markers), *markers]
    return ",".join(map(str, cells)) + "\n"


def marker(x, name) -> str:
    return f"{x},0.2,0.3,1,{name}"


def test_markers_with_names_are_trajectories(put):
    both = [marker(0.1, "M1"), marker(0.4, "M2")]
    path = put("old.csv", HEAD + frame(0, [POSE], both) + frame(1, [], both[1:]) + frame(2, [], both[::-1]))
    take = read_take(path)
    assert recognise(path).name == "tracking-tools"
    assert (take.names, take.rate) == (("M1", "M2"), 120.0)
    np.testing.assert_allclose(take.positions[:, :, 0], [[100, 400], [np.nan, 400], [100, 400]])


@pytest.mark.parametrize("cells", ["0.1,0.2,0.3", "0.1,0.2,0.3,5", "0.1,0.2,0.3,5,"])
def test_markers_without_names_are_points(put, cells):
    take = read_take(put("cloud.csv", HEAD + frame(0, [], [cells]) + frame(1, [], [cells] * 2)))
    assert isinstance(take, PointCloud)
    np.testing.assert_array_equal(take.frame_starts, [0, 1, 3])


@pytest.mark.parametrize("hand", ["righthanded", "lefthanded"])
def test_bodies_are_read_where_there_are_no_markers_or_they_are_wanted(put, hand):
    head = HEAD.replace("righthanded", hand)
    take = read_take(put("bodies.csv", head + frame(0, [POSE]) + frame(1) + frame(2, [POSE])))
    assert isinstance(take, Poses)
    assert (take.names, np.isnan(take.world_from_body[:, 0, 0, 0]).tolist()) == (("Wand",), [False, True, False])
    side = 1 if hand == "righthanded" else -1
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 3], [100, 200, 300 * side])
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 2], [0.96 * side, 0, 0.28], atol=1e-9)
    path = put("both.csv", head + frame(0, [POSE], [marker(0.1, "M1")]))
    assert isinstance(read_take(path, bodies=True), Poses)


@pytest.mark.parametrize("line", ["frame,0,0.0,2,7,0.1\n", "frame,0,0.0,0,3,0.1,0.2,0.3\n", "frame,0\n"])
def test_frame_that_holds_less_than_it_announces_is_refused_with_its_line(refused, put, line):
    assert refused(put("cut.csv", HEAD + line)).startswith(":6: ")
