"""A room with many cameras from images on: calibration by command, points of a recording, live capture."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from scipy.spatial.distance import pdist

pytest.importorskip("cv2")

from skelgen_formats.capture_settings import read_any_settings, write_settings

from skelgen.app.capture import source_of
from skelgen.app.files import NamedFile, open_input
from skelgen.capture.reference_rig import reference_arm
from skelgen.capture.room.live import RoomCapture
from skelgen.capture.room.simulated import person_scene, room_rig
from skelgen.capture.room.sources import SimulatedRoom, open_room_source
from skelgen.capture.simulated_rig.scene import joints_of, targets_of
from skelgen.cli import main
from skelgen.errors import CaptureError, FormatError, InputError
from skelgen.model.rig import RoomSettings

WAVED = "room:wand?cameras=2&frames=150&rate=8&width=480"
LYING = "room:frame?cameras=2&frames=2&width=480"
SEEN = "room:human?cameras=3&frames=6&width=480"


@pytest.fixture
def settings(tmp_path):
    write_settings(RoomSettings(room_rig(3, (480, 360))), tmp_path / "room.xml")
    return tmp_path / "room.xml"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Images of six moments by three cameras, one of which lost the fourth."""
    import cv2

    folder = tmp_path_factory.mktemp("recording")
    with open_room_source(SEEN) as source:
        for frame in source:
            for name, image in zip(source.cameras, frame.images, strict=True):
                (folder / name).mkdir(exist_ok=True)
                cv2.imwrite(str(folder / name / f"{frame.index:03d}.png"), image)
    (folder / "camera 2" / "003.png").unlink()
    return folder


def test_a_wand_and_a_frame_become_settings_in_one_command(tmp_path, capsys):
    path = tmp_path / "room.xml"
    assert main(["calibrate", "room", WAVED, "--ground", LYING, "-o", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["grade"] == "usable"
    assert told["point_std_mm"] < 1.0
    found, true = read_any_settings(path).rig, room_rig(2, (480, 360))
    np.testing.assert_allclose(found.places, true.places, atol=15.0)  # mm; images of 480 x 360, 44 views
    assert found.std.any()


def test_a_folder_of_folders_becomes_points(recorded, settings):
    take = open_input(NamedFile(settings, options={"source": f"{recorded}"})).take
    assert take.n_frames == 6
    rig = room_rig(3, (480, 360))
    truth = person_scene(rig, 6).positions
    off = [
        np.linalg.norm(points[:, np.newaxis] - truth[frame], axis=2).min(axis=1) for frame, points in enumerate(take)
    ]
    assert np.median(np.concatenate(off)) < 1.0
    assert take.attributes["n_blobs"].max() == 3
    assert any("camera 2 lost 1 of 6 images" in notice for notice in take.notices)


def test_motion_capture_writes_a_line_for_each_moment(settings, capsys, tmp_path):
    record = tmp_path / "take.mfml"
    assert main(["motion-capture", str(settings), "--source", SEEN, "-s", "-n", "--record", str(record)]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1 + 6
    assert record.exists()


def test_targets_and_joints_are_found_by_many_cameras():
    rig, arm = room_rig(4, (1280, 960)), reference_arm()
    scene = person_scene(rig, 6, arm, walk=0.0)
    known = RoomSettings(rig, targets_of(arm), joints_of(arm))
    with RoomCapture(known) as capture, SimulatedRoom(scene, rig) as source:
        captured = list(capture.run(source))
    assert set(captured[-1].bodies) == {"torso", "upper arm", "lower arm"}
    assert set(captured[-1].angles) == {"upper arm", "lower arm"}
    place = captured[-1].bodies["torso"].world_from_body[:3, 3]
    assert scene.truth is not None
    np.testing.assert_allclose(place, scene.truth.world_from_limb[-1, 0, :3, 3], atol=2.0)


def test_targets_and_joints_are_calibrated_by_the_cameras_of_a_room(tmp_path, capsys):
    seen = "room:arm?cameras=4&frames=24&rate=8"
    path, known = tmp_path / "room.xml", open_room_source(seen).settings
    write_settings(RoomSettings(known.rig, known.bodies[:1]), path)
    for name in ("upper arm", "lower arm"):
        assert main(["calibrate", "body", str(path), "--name", name, "--source", f"{seen}&show={name}"]) == 0
    found = read_any_settings(path)
    assert [body.name for body in found.bodies] == ["torso", "upper arm", "lower arm"]
    for body, true in zip(found.bodies, known.bodies, strict=True):
        assert sorted(pdist(body.points)) == pytest.approx(sorted(pdist(true.points)), abs=0.3)  # mm
    assert main(["calibrate", "joints", str(path), "--joint", "elbow=upper arm:lower arm:hinge", "--source", seen]) == 0
    assert [joint.name for joint in read_any_settings(path).joints] == ["elbow"]
    assert "its place known to" in capsys.readouterr().out
    with pytest.raises(InputError, match="no target 'hand' to show; it has torso, upper arm, lower arm"):
        open_room_source("room:arm?show=hand")


def test_a_source_with_other_cameras_is_told(settings):
    with pytest.raises(InputError, match=r"has 4 cameras \(camera 1, .*the settings have 3"):
        source_of(read_any_settings(settings), "room:human?cameras=4&frames=1")


def test_images_of_another_size_are_told(settings):
    with pytest.raises(InputError, match="camera 1 sends 320 x 240 pixels, and its calibration is for 480 x 360"):
        open_input(NamedFile(settings, options={"source": "room:human?cameras=3&frames=1&width=320"}))


def test_a_folder_without_folders_is_told(tmp_path, recorded):
    with pytest.raises(CaptureError, match="0 folders with images; make one for each camera"):
        open_room_source(str(tmp_path))
    shutil.copytree(recorded / "camera 1", tmp_path / "one")
    with pytest.raises(CaptureError, match="1 cameras; give the images of each camera"):
        open_room_source(str(tmp_path))


def test_sources_of_several_kinds_are_one_room(recorded):
    source = open_room_source(f"folder:{recorded}+room:human?cameras=2&frames=9&width=480")
    assert source.cameras == ("camera 1 of 1", "camera 2 of 1", "camera 3", "camera 1 of 2", "camera 2 of 2")
    with source as sets:
        frames = list(sets)
    assert len(frames) == source.n_frames == 9
    assert [image is None for image in frames[3].images] == [False, True, False, False, False]
    assert [image is None for image in frames[8].images] == [True, True, True, False, False]
    with pytest.raises(InputError, match="cameras that run and recordings"):
        open_room_source(f"folder:{recorded}+gige:10.0.0.2")
    with pytest.raises(CaptureError, match="different rates"):
        open_room_source(f"folder:{recorded}?rate=50+room:human?cameras=2&rate=100")


def test_videos_that_are_none_are_told(tmp_path):
    (tmp_path / "a.avi").write_bytes(b"no video")
    with pytest.raises(FormatError, match="is no video that can be read"):
        open_room_source(f"video:{tmp_path / 'a.avi'},{tmp_path / 'b.avi'}")


def test_an_unknown_source_names_those_that_are_known():
    with pytest.raises(InputError, match="known are folder:recording, video:"):
        open_room_source("radio:bbc")


@pytest.mark.parametrize("option", [("--wand", "180"), ("--arms", "600;400")])
def test_numbers_of_wand_and_frame_are_checked(option, capsys, tmp_path):
    assert main(["calibrate", "room", WAVED, *option, "-o", str(tmp_path / "room.xml")]) == 2
    assert "two or three numbers in mm" in capsys.readouterr().err


def test_what_needs_two_cameras_says_so(settings, capsys):
    assert main(["evaluate", "rig", str(settings)]) == 2
    assert "holds 3 cameras of a room" in capsys.readouterr().err
