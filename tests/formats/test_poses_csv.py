from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.options import Options
from skelgen_formats.registry import find_format, read_take, write_file

from skelgen.errors import WriteError
from skelgen.model import Poses

ROUNDING = 1e-12  # matrix -> quaternion -> matrix costs a few of 16 digits; positions are exact


@pytest.fixture
def text(valid_file) -> str:
    return valid_file("poses-csv").read_text()


def test_written_poses_read_back(sensors, tmp_path):
    path = tmp_path / "sensors.poses.csv"
    write_file(sensors, path)
    back = read_take(path)
    assert isinstance(back, Poses)
    np.testing.assert_allclose(back.world_from_body, sensors.world_from_body, atol=ROUNDING)
    np.testing.assert_array_equal(back.world_from_body[..., :3, 3], sensors.world_from_body[..., :3, 3])
    assert (back.names, back.rate) == (sensors.names, sensors.rate)


def test_quarter_turn_about_z_takes_body_x_to_world_y(put, text):
    header = "skelgen-poses,1\nrate,60.0,Hz\nunit,cm\nframe,time,s.x,s.y,s.z,s.qw,s.qx,s.qy,s.qz\n"
    take = read_take(put("turn.poses.csv", header + "0,0,1,2,3,0.7071,0,0,0.7071\n"))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 0], [0, 1, 0], atol=ROUNDING)
    np.testing.assert_array_equal(take.world_from_body[0, 0, :3, 3], [10, 20, 30])


def test_names_with_commas_and_dots_survive(sensors, tmp_path):
    path = tmp_path / "odd.poses.csv"
    write_file(Poses(sensors.world_from_body, ("a,b", "c.d"), 60.0), path)
    assert read_take(path).names == ("a,b", "c.d")


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("skelgen-poses,1", "skelgen-poses,2", ":1:"),
        ("rate,60.0", "rate,-1", ":2:"),
        ("unit,mm", "unit,furlong", ":3:"),
        ("pelvis.qw", "pelvis.qq", ":4:"),
        ("left thigh", "pelvis", ":4:"),
    ],
)
def test_wrong_header_names_its_line(refused, edited, text, old, new, place):
    changed = text.replace(old, new)
    assert changed != text
    assert refused(edited("bad.poses.csv", changed, new, new), "poses-csv").startswith(place)


def test_quaternion_that_is_no_rotation_names_the_frame(refused, put, text):
    lines = text.split("\n")
    cells = lines[6].split(",")
    cells[5:9] = ["2", "0", "0", "0"]
    lines[6] = ",".join(cells)
    assert refused(put("long.poses.csv", "\n".join(lines))).startswith(":frame 3: body 1")


def test_half_a_body_is_a_format_error(refused, put, text):
    lines = text.split("\n")
    cells = lines[6].split(",")
    cells[3] = ""
    lines[6] = ",".join(cells)
    assert refused(put("half.poses.csv", "\n".join(lines))).startswith(":frame 3: body 1")


def test_no_frame_is_a_format_error(refused, put, text):
    assert "no frame" in refused(put("none.poses.csv", "\n".join(text.split("\n")[:4])))


def test_markers_are_refused_with_advice(walk, tmp_path):
    with pytest.raises(WriteError, match="c3d, trc or csm"):
        write_file(walk, tmp_path / "walk.poses.csv")


def test_names_that_spreadsheets_would_compute_are_defused_and_come_back(sensors, tmp_path):
    names = ("=cmd|' /C calc'!A0", "'+1")
    take = Poses(sensors.world_from_body, names, sensors.rate)
    path = write_file(take, tmp_path / "odd.poses.csv")[0]
    cells = path.read_text().splitlines()[3].split(",")
    assert not [cell for cell in cells if cell.startswith(("=", "+", "-", "@"))]
    assert read_take(path).names == names


def test_limbs_of_a_project_come_back_as_bodies(small_project, tmp_path):
    back = read_take(*write_file(small_project, tmp_path / "walk.poses.csv"))
    motion = small_project.motion
    assert back.names == tuple(f"limb{limb}" for limb in range(3))
    assert back.rate == motion.rate
    assert np.isnan(back.world_from_body[~motion.limb_seen]).all()
    apart = back.world_from_body[motion.limb_seen] - motion.world_from_limb[motion.limb_seen]
    assert np.abs(apart).max() < 1e-12  # of quaternions


def test_limbs_that_are_not_seen_are_said_to_be_empty(small_project):
    (sentence,) = find_format("poses-csv").remarks(small_project, Options())
    assert "in 1 of 12 frames some limb is not seen" in sentence
