from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from skelgen_formats.capture_settings import read_any_settings, read_settings, write_settings

from skelgen.capture.parameters import BodyParameters
from skelgen.errors import FormatError, WriteError
from skelgen.model.rig import BodyTarget, Camera, CameraRig, CaptureSettings, RoomSettings, StereoRig, TargetJoint
from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class Detection(StageParameters):
    stage: ClassVar[str] = "detection"

    dull_share: float = declare(0.2, "How much the dull quantile counts.", within=(0.0, 1.0))
    rows: int = declare(4, "Every so many rows.", within=(1, None))
    separate: bool = declare(True, "Whether touching balls are separated.")
    method: str = declare("plain", "What labels.", choices=("plain", "opencv"))


@pytest.fixture
def known():
    """Two cameras 480 mm apart, two bodies with awkward numbers, a hinge and a ball between them."""
    rng = np.random.default_rng(3)
    shift, turn = np.eye(4), np.eye(4)
    shift[0, 3] = -480.0 / 3
    angle = 0.2
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix = np.array([[832.79, 0, 316.69], [0, 833.76, 240.22], [0, 0, 1]])
    left = Camera(640, 480, matrix, rng.normal(size=5), name='le <ft> & "1"')
    right = Camera(640, 480, matrix + np.diag([3.1, 2.2, 0]), rng.normal(size=5), shift)
    bodies = [BodyTarget(name, rng.normal(size=(5, 3)) * 60, rng.uniform(size=(5, 3))) for name in ("upper", "lower")]
    std = rng.uniform(size=(2, 3))
    hinge = TargetJoint("elbow", "hinge", "upper", "lower", turn, shift, std, np.array([0.1, 1 / 3]))
    ball = TargetJoint("spare", "ball", "lower", "upper", shift, turn)
    bodies[1] = replace(bodies[1], noise=0.017)
    slopes = rng.normal(size=(30, 30))
    rig = StereoRig(left, right, 0.13, slopes @ slopes.T)
    return CaptureSettings(rig, bodies, [hinge, ball], "folder: a & b", {"rows": 8.0}, {"gap": 4.0})


@pytest.fixture
def path(known, tmp_path):
    write_settings(known, tmp_path / "settings.xml")
    return tmp_path / "settings.xml"


def refused(path, old, new, **options):
    """The error and its line after one change of the text, which must be there."""
    text = path.read_text()
    changed, count = re.subn(old, new, text, count=1)
    assert count == 1
    path.write_text(changed)
    with pytest.raises(FormatError) as error:
        read_settings(path, **options)
    assert str(error.value).startswith(f"{path}:{error.value.place}: ")
    return str(error.value), changed.splitlines()[int(error.value.place) - 1]


def same_camera(one, other):
    assert (one.size, one.name) == (other.size, other.name)
    for name in ("matrix", "distortion", "camera_from_world"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_what_is_written_is_read_bit_for_bit(known, path):
    found = read_settings(path, Detection)
    same_camera(found.rig.left, known.rig.left)
    same_camera(found.rig.right, known.rig.right)
    assert (found.rig.noise, found.source, dict(found.detection)) == (0.13, "folder: a & b", {"rows": 8.0})
    for one, other in zip(found.bodies, known.bodies, strict=True):
        assert one.name == other.name
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.std, other.std)
        assert one.noise == other.noise
    np.testing.assert_array_equal(found.rig.covariance, known.rig.covariance)
    assert dict(found.search) == {"gap": 4.0}
    for one, other in zip(found.joints, known.joints, strict=True):
        assert (one.name, one.kind, one.parent, one.child) == (other.name, other.kind, other.parent, other.child)
        for name in ("parent_from_joint", "child_from_joint", "std", "axis_std"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_settings_may_hold_the_cameras_alone(known, tmp_path):
    write_settings(CaptureSettings(known.rig), tmp_path / "rig.xml")
    found = read_settings(tmp_path / "rig.xml", Detection)
    assert (found.bodies, found.joints, found.source, dict(found.detection)) == ((), (), "", {})


def test_parameters_may_be_words_and_switches(known, tmp_path):
    detection = {"separate": False, "method": "opencv", "dull_share": 0.25, "rows": 3}
    write_settings(replace(known, detection=detection), tmp_path / "words.xml")
    assert dict(read_settings(tmp_path / "words.xml", Detection).detection) == detection
    assert read_settings(tmp_path / "words.xml").detection["method"] == "opencv"


def test_unknown_element_is_named_with_its_line_and_what_is_allowed(path):
    sentence, line = refused(path, "<source>(.*)</source>", r"<sorce>\1</sorce>")
    assert "<sorce>" in line
    assert "<sorce> is unknown in <capture>; it holds <source>, " in sentence


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('kind="hinge"', 'kind="hinge" colour="red"', "<joint> has no attribute 'colour'; it has "),
        ('width="640" ', "", "<left> lacks the attribute 'width'"),
        ('width="640"', 'width="640.5"', "width of <left> is 640.5; a whole number belongs there"),
        ('noise="0.13"', 'noise="none"', "noise of <rig> holds 'none' where a number belongs"),
        ('noise="0.13"', 'noise="-1"', "noise of the rig is -1 px; it must be above 0"),
        ('kind="hinge"', 'kind="saddle"', "it must be one of ball, hinge"),
        ('parent="upper"', 'parent="uper"', "the parent of joint 'elbow' is body 'uper', which is not there: upper"),
        ('name="lower"', 'name="upper"', "a second body is called 'upper', the first is in line "),
        ('name="spare"', 'name="elbow"', "a second joint is called 'elbow'"),
        ('unit="mm"', 'unit="m"', "unit is 'm'; only 'mm' can be read"),
        ("<distortion>", "<distortion>0 ", "<distortion> holds 6 where 5 numbers belong"),
        ("<distortion>[^ ]*", "<distortion>nan", "<distortion> holds 'nan'; numbers must be finite"),
        ('std="', 'std="-', "std of <point> is below 0"),
        ("</rig>", "</rig> 7", "<capture> holds text between its elements"),
        ("(<source>.*</source>)", r"\1\1", "a second <source> in <capture>, the first is in line 4; keep one"),
        ("<detection>", '<detection><parameter name="rows" value="1"/>', "a second parameter is called 'rows'"),
        ("<parent_from_joint[^>]*>", "<parent_from_joint> 9", "<parent_from_joint> holds 17 where 16 numbers belong"),
    ],
)
def test_each_mistake_is_one_sentence_with_the_line(path, old, new, sentence):
    said, _ = refused(path, old, new)
    assert sentence in said


@pytest.mark.parametrize(
    ("new", "sentence"),
    [
        ('name="row" value="8"', "the detection has no parameter 'row'; it has rows, "),
        ('name="rows" value="0"', "rows is 0; it must lie in 1 .. inf"),
    ],
)
def test_parameters_of_the_detection_are_those_that_it_declares(path, new, sentence):
    said, line = refused(path, 'name="rows" value="8.0"', new, detection=Detection)
    assert sentence in said
    assert new in line


def test_missing_part_is_named(path):
    text = re.sub("(?s)<right .*</right>", "", path.read_text())
    path.write_text(text)
    with pytest.raises(FormatError, match="<rig> lacks <right>; it holds <right>, <covariance>, <left>"):
        read_settings(path)


@pytest.mark.parametrize(
    "content", ["", "no xml", "<capture", "<other/>", "<!DOCTYPE capture [<!ENTITY a 'b'>]><capture/>"]
)
def test_what_is_no_settings_file_is_a_format_error(tmp_path, content):
    (tmp_path / "settings.xml").write_text(content)
    with pytest.raises(FormatError):
        read_settings(tmp_path / "settings.xml")


def test_absent_file_is_a_format_error(tmp_path):
    with pytest.raises(FormatError, match="cannot be read"):
        read_settings(tmp_path / "none.xml")


def test_failed_writing_leaves_the_file_as_it_was(known, path):
    before = path.read_bytes()
    broken = CaptureSettings(known.rig, [BodyTarget("bell\a", np.eye(3))])
    with pytest.raises(WriteError, match="XML forbids"):
        write_settings(broken, path)
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == ["settings.xml"]


@pytest.fixture
def room(known):
    names, places = ("a", "b", "c"), np.eye(3) * 1000
    cameras = [replace(known.rig.left, name=name) for name in names]
    poses = [np.block([[np.eye(3), place[:, np.newaxis]], [np.zeros(3), 1]]) for place in places]
    cameras = [replace(camera, camera_from_world=pose) for camera, pose in zip(cameras, poses, strict=True)]
    std = np.arange(45.0).reshape(3, 15) / 7
    return RoomSettings(CameraRig(cameras, 0.07, std), known.bodies, known.joints, "folder: a & b", {"rows": 8.0})


def test_cameras_of_a_room_are_read_as_they_were_written(room, tmp_path):
    write_settings(room, tmp_path / "room.xml")
    found = read_any_settings(tmp_path / "room.xml", Detection)
    assert isinstance(found, RoomSettings)
    for one, other in zip(found.rig.cameras, room.rig.cameras, strict=True):
        same_camera(one, other)
    np.testing.assert_array_equal(found.rig.std, room.rig.std)
    assert (found.rig.noise, found.source, len(found.bodies), len(found.joints)) == (0.07, room.source, 2, 2)


def test_settings_of_two_cameras_are_read_as_such(known, path):
    assert isinstance(read_any_settings(path, Detection), CaptureSettings)


def test_what_needs_two_cameras_says_so_of_a_room(room, tmp_path):
    write_settings(room, tmp_path / "room.xml")
    with pytest.raises(FormatError, match="holds 3 cameras of a room; this needs a <left> and a <right> one"):
        read_settings(tmp_path / "room.xml")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('<camera name="b"', '<camera name="a"', "two cameras are called .a.; names must differ"),
        ('<camera name="b"', "<camera", "<camera> lacks the attribute 'name'"),
        ("<std>[^ ]*", "<std>", "<std> holds 14 where 15 numbers belong"),
        ("<std>0.0", "<std>-1", "std of the cameras is below 0"),
    ],
)
def test_mistakes_in_cameras_of_a_room_have_a_line(room, tmp_path, old, new, sentence):
    write_settings(room, tmp_path / "room.xml")
    (tmp_path / "room.xml").write_text(re.sub(old, new, (tmp_path / "room.xml").read_text(), count=1))
    with pytest.raises(FormatError, match=sentence):
        read_any_settings(tmp_path / "room.xml")


def test_limits_of_the_search_are_checked_with_their_line(known, tmp_path):
    path = tmp_path / "settings.xml"
    write_settings(replace(known, search={"max_distance": 2.5, "penalty": 2.0, "queue": 30}), path)
    found = read_settings(path, search=BodyParameters).search
    assert dict(found) == {"max_distance": 2.5, "penalty": 2.0, "queue": 30}
    message, line = refused(path, 'value="30"', 'value="0"', search=BodyParameters)
    assert "queue" in message
    assert "queue" in line
    message, _ = refused(path, "max_distance", "max_distanse", search=BodyParameters)
    assert "the search has no parameter 'max_distanse'; it has max_distance" in message
