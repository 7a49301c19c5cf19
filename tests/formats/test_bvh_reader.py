"""bvhio is the judge of where the bones are; what no reader can take is refused with the line."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_motion, recognise, write_file

from skelgen.errors import FormatError, ParameterError

bvhio = pytest.importorskip("bvhio", reason="pip install bvhio, the judge of BVH files")

POSITION_MM = 0.01  # bvhio poses in single precision, with steps of 0.0002 mm at 2 m

ODD_ORDERS = """HIERARCHY
ROOT Hips {
  OFFSET 0 0 0
  CHANNELS 6 Yrotation Xrotation Zrotation Zposition Xposition Yposition
  JOINT Left Leg
  {
    OFFSET 100 -50 0
    CHANNELS 3 Xrotation Yrotation Zrotation
    JOINT Foot
    {
      OFFSET 0 -400 20
      CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
      End Site
      {
        OFFSET 0 -30 150
      }
    }
  }
  JOINT Head
  {
    OFFSET 0 500 0
    CHANNELS 1 Yrotation
    End Site { OFFSET 0 200 0 }
  }
}
MOTION
Frames:\t3
Frame Time: 0.008333
10 -20 30 5 900 7  11 12 13  0 -400 20 14 15 16  50
11 -21 33 6 901 8\t21 22 23  0 -400 20 24 25 26  60
12 -22 36 7 902 9  31 32 33  0 -400 20 34 35 36  70
"""


def played(path):
    """The bones as bvhio has them, which wants one statement per line."""
    tidy = path.with_suffix(".tidy.bvh")
    tidy.write_text(path.read_text().replace("{", "\n{\n").replace("{\n\n", "{\n").replace(" }", "\n}"))
    return bvhio.readAsHierarchy(str(tidy))


def judged(path, n_frames) -> dict[str, np.ndarray]:
    """World position of every bone as bvhio has it, by name, shape (n_frames, 3)."""
    root = played(path)
    places: dict[str, list[np.ndarray]] = {}
    for frame in range(n_frames):
        root.loadPose(frame)
        for joint, *_ in root.layout():
            places.setdefault(joint.Name, []).append(np.array(joint.PositionWorld.to_tuple()))
    return {name: np.array(frames, dtype=float) for name, frames in places.items()}


@pytest.fixture
def written(tmp_path):
    def write(text=ODD_ORDERS, name="walk.bvh"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def deviation(motion, path) -> float:
    places = judged(path, motion.n_frames)
    poses = motion.world_from_bone
    names = [name.split()[0] for name in motion.names]  # bvhio knows no blanks in names
    return max(np.abs(poses[:, bone, :3, 3] - places[name]).max() for bone, name in enumerate(names))


def test_channels_in_any_order_pose_the_bones_where_bvhio_has_them(written):
    path = written()
    motion = read_motion(path, unit="mm")
    assert deviation(motion, path) < POSITION_MM
    assert motion.names == ("Hips", "Left Leg", "Foot", "Head")
    assert motion.parents.tolist() == [-1, 0, 1, 0]


def test_turns_are_those_of_bvhio(written):
    path = written()
    motion, root = read_motion(path, unit="mm"), played(path)
    first, last = [], []
    for frame, poses in ((0, first), (2, last)):
        root.loadPose(frame)
        poses += [np.array(joint.SpaceWorld.to_list(), dtype=float).T[:3, :3] for joint, *_ in root.layout()]
    for bone in range(motion.n_bones):
        # Importers give bones rest poses of their own: the turn since the first frame is what all agree on.
        ours = motion.world_from_bone[:, bone, :3, :3]
        np.testing.assert_allclose(ours[2] @ ours[0].T, last[bone] @ first[bone].T, rtol=0, atol=1e-5)


def test_our_own_files_come_back(small_project, tmp_path):
    (path,) = write_file(small_project, tmp_path / "walk.bvh")
    motion, poses = read_motion(path, unit="mm"), small_project.motion.world_from_limb
    for bone, name in enumerate(motion.names):
        back = motion.world_from_bone[:, bone, :3, 3]
        np.testing.assert_allclose(back, poses[:, int(name[4:]), :3, 3], rtol=0, atol=1e-4)  # seven decimals of degrees


def test_several_roots_come_back_under_the_world(make_project, tmp_path):
    project = make_project(parents=(3, -1, 0, -1, 2, 1), n_frames=20)
    (path,) = write_file(project, tmp_path / "walk.bvh")
    assert deviation(read_motion(path, unit="mm"), path) < POSITION_MM


def test_position_channels_that_add_to_the_offset_are_recognised(written):
    replaced = read_motion(written(), unit="mm")
    added = read_motion(written(ODD_ORDERS.replace(" 0 -400 20 ", " 0 0 0 ")), unit="mm")
    np.testing.assert_array_equal(added.world_from_bone, replaced.world_from_bone)


@pytest.mark.parametrize(
    ("text", "rate"),
    [("0.008333", 120.0), (".033333", 30.0), ("0.01", 100.0), ("0.0417083", 1 / 0.0417083), ("2", 0.5)],
)
def test_frame_time_is_a_whole_rate_where_its_digits_allow(written, text, rate):
    assert read_motion(written(ODD_ORDERS.replace("0.008333", text)), unit="mm").rate == rate


@pytest.mark.parametrize(("text", "rate"), [("30", 30.0), ("29.97", 29.97), ("8.3333", 120.0), ("33.333", 30.0)])
def test_frame_time_that_is_a_rate_or_in_ms_is_read_as_such_and_noticed(written, text, rate):
    motion = read_motion(written(ODD_ORDERS.replace("0.008333", text)), unit="mm")
    assert motion.rate == rate
    assert any(f"the frame time {float(text):g} is taken as" in notice for notice in motion.notices)


def test_rate_can_be_stated(written):
    assert read_motion(written(), rate=24.0).rate == 24.0


@pytest.mark.parametrize(("unit", "factor"), [("cm", 10.0), ("in", 25.4), ("56.4", 56.4), ("M", 1000.0)])
def test_lengths_are_in_the_unit_stated(written, unit, factor):
    plain, scaled = read_motion(written(), unit="mm"), read_motion(written(), unit=unit)
    np.testing.assert_allclose(scaled.places, factor * plain.places)
    np.testing.assert_allclose(scaled.tips[2], [[0, -30 * factor, 150 * factor]])
    assert scaled.notices == ()


@pytest.mark.parametrize("factor", [1.0, 0.1, 0.001])
def test_unit_is_told_from_the_size_of_the_body_and_said(small_project, tmp_path, factor):
    unit = {1.0: "mm", 0.1: "cm", 0.001: "m"}[factor]
    (path,) = write_file(small_project, tmp_path / "walk.bvh", unit=unit)
    (said,) = read_motion(path).notices
    assert f"taken as {unit}," in said


def test_bones_of_one_name_are_told_apart(written):
    assert read_motion(written(ODD_ORDERS.replace("Head", "Foot"))).names == ("Hips", "Left Leg", "Foot", "Foot 2")


BROKEN = [
    ("HIERARCHY\nROOT", "walk", 1, "not BVH"),
    ("  OFFSET 100 -50 0\n", "", 5, "'Left Leg' has no OFFSET line"),
    ("    CHANNELS 1 Yrotation\n", "", 19, "'Head' has no CHANNELS line"),
    ("CHANNELS 3 Xrotation", "CHANNELS 4 Xrotation", 8, "3 channels are named where 4"),
    ("CHANNELS 1 Yrotation", "CHANNELS 1 Yscale", 22, "no channel 'Yscale'"),
    ("3 Xrotation Yrotation Zrotation", "3 Xrotation Yrotation Xrotation", 8, "named twice"),
    ("OFFSET 0 500 0", "OFFSET 0 500", 21, "2 numbers after OFFSET"),
    ("OFFSET 0 500 0", "OFFSET 0 nan 0", 21, "finite number"),
    ("    End Site { OFFSET 0 200 0 }\n  }\n}\nMOTION", "MOTION", 23, "'}' is missing"),
    ("}\nMOTION", "}\n}\nMOTION", 26, "closes nothing"),
    ("  JOINT Head\n  {", "  JOINT Head\n", 21, "'{' belongs here"),
    ("JOINT Head", "ROOT Head", 19, "within another bone"),
    ("JOINT Head", "JOINT", 19, "without a name"),
    ("JOINT Head", "BONE Head", 19, "where a line of the hierarchy belongs"),
    ("MOTION\n", "", 26, "where a line of the hierarchy belongs"),
    ("Frames:\t3", "Frames: 4", 31, "3 frames where 4 are announced; the file may be cut off"),
    ("Frames:\t3", "Frames: 2", 31, "more frames than the 2"),
    ("Frames:\t3", "Frames: 0", 27, "nothing moves"),
    ("Frames:\t3", "Frames: many", 27, "a number belongs there"),
    ("0.008333", "0", 28, "frame time is 0 s"),
    (" 60\n", "\n", 30, "15 cells where 16 belong"),
    (" 60\n", " nan\n", 30, "not a number"),
    (" 60\n", " 1e300\n", 30, "larger than anything that moves"),
]


@pytest.mark.parametrize(("old", "new", "line", "what"), BROKEN)
def test_broken_file_is_refused_with_the_line(written, old, new, line, what):
    assert old in ODD_ORDERS
    with pytest.raises(FormatError, match=what) as error:
        read_motion(written(ODD_ORDERS.replace(old, new, 1)))
    assert error.value.place == line


def test_file_without_motion_is_refused(written):
    with pytest.raises(FormatError, match="without a MOTION line; the file may be cut off"):
        read_motion(written(ODD_ORDERS.partition("MOTION")[0]))


def test_wrong_options_are_refused(written):
    with pytest.raises(ParameterError, match="holds its skeleton itself"):
        read_motion(written(), skeleton="walk.asf")
    for unit in ("parsec", "-1", "nan"):
        with pytest.raises(ParameterError, match="motion-unit"):
            read_motion(written(), unit=unit)


def test_motion_is_no_take_and_a_take_no_motion(written):
    with pytest.raises(FormatError, match=r"simulate --motion walk\.bvh"):
        recognise(written())
    with pytest.raises(FormatError, match=r"there are BVH \(\.bvh\)"):
        read_motion(written(name="walk.c3d"))


def test_blank_may_stand_before_the_colon(written):
    text = ODD_ORDERS.replace("Frames:", "Frames :").replace("Frame Time:", "Frame Time :")
    assert len(read_motion(written(text)).places) == len(read_motion(written()).places)
