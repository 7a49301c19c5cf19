from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from skelgen_formats.c3d import read_c3d
from skelgen_formats.capture_settings import read_settings, write_settings
from skelgen_formats.mfml import read_mfml

from skelgen.app.capture import calibrate_body_of, calibrate_joints_of, capture, source_of, with_joints
from skelgen.capture.calibration.joints import JointCalibration
from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig
from skelgen.capture.simulated_rig.scene import scene_of_bodies
from skelgen.capture.sources import open_source
from skelgen.cli import main
from skelgen.errors import CaptureError, InputError, SkelgenError
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import BodyTarget, CaptureSettings, StereoRig

NAMES = {"upper arm": "shoulder", "lower arm": "elbow"}


@pytest.fixture(scope="module")
def known():
    """Settings that a perfect calibration of the reference arm would find; the joints have names of their own."""
    settings = simulated_rig("arm", n_frames=2).settings
    joints = [replace(joint, name=NAMES[joint.name]) for joint in settings.joints]
    return replace(settings, joints=joints, source="simulated:arm?frames=6")


@pytest.fixture
def path(known, tmp_path):
    write_settings(known, tmp_path / "settings.xml")
    return tmp_path / "settings.xml"


@pytest.fixture
def unplugged():
    """A source that delivers five pairs, two of them after a gap of three, and then breaks off."""
    rig = simulated_rig("arm", n_frames=20)

    def pairs():
        for index, dropped in ((0, 0), (1, 0), (2, 0), (6, 3), (7, 0)):
            yield rig.render(index, dropped)[0]
        raise SkelgenError("the left camera is gone: was it unplugged?")

    class Source:
        name, cameras, rate, n_frames = "cameras", ("left", "right"), 60.0, None

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self.closed = True

        def __iter__(self):
            return pairs()

    return Source()


def test_what_was_recorded_is_kept_when_the_source_breaks_off(known, unplugged, tmp_path):
    files = [tmp_path / "arm.mfml", tmp_path / "arm.c3d"]
    with pytest.raises(SkelgenError, match="unplugged"):
        list(capture(known, unplugged, files))
    assert unplugged.closed
    assert read_mfml(files[0]).n_frames == 5
    take = read_c3d(files[1])
    assert take.n_frames == 8  # the three that were lost are empty
    assert np.isnan(take.positions[3:6]).all()
    assert take.names[:2] == ("torso:1", "torso:2")


def test_recorded_balls_are_where_they_are(known, tmp_path):
    source = simulated_rig("arm", n_frames=6)
    list(capture(known, source, [tmp_path / "arm.c3d"]))
    take = read_c3d(tmp_path / "arm.c3d")
    truth = source.scene.points[:6]
    assert take.names == tuple(f"{body.name}:{ball + 1}" for body in known.bodies for ball in range(5))
    assert np.nanmax(np.abs(take.positions - truth)) < 1.0  # mm: four deviations in depth


def test_closing_the_iterator_ends_the_capture(known, unplugged, tmp_path):
    stream = capture(known, unplugged, [tmp_path / "arm.mfml"])
    next(stream)
    stream.close()
    assert unplugged.closed
    assert read_mfml(tmp_path / "arm.mfml").n_frames == 1


def test_other_recordings_are_refused_before_anything_starts(known, tmp_path):
    with pytest.raises(InputError, match=r"arm.txt cannot be recorded: its suffix must be one of .mfml, .c3d"):
        next(capture(known, simulated_rig("arm", n_frames=2), [tmp_path / "arm.txt"]))
    bare = CaptureSettings(known.rig)
    with pytest.raises(InputError, match="there are no targets whose balls could be named"):
        next(capture(bare, simulated_rig("arm", n_frames=2), [tmp_path / "arm.c3d"]))
    assert list(tmp_path.iterdir()) == []


def test_target_is_calibrated_from_images_and_joins_the_others(known):
    rng = np.random.default_rng(0)
    turns = matrix_from_vector(rng.uniform(-0.6, 0.6, (20, 3)))
    poses = transform_from(turns, np.array([-150.0, 0.0, 900.0]) + rng.uniform(-60, 60, (20, 3)))
    target = BodyTarget("wand", np.array([[0.0, 0, 0], [97, 0, 0], [21, 78, 0], [-43, 25, 10], [50, 48, -22]]))
    source = SimulatedRig(scene_of_bodies([target], poses[:, np.newaxis]), known.rig)
    settings, done = calibrate_body_of(known, source, "wand")
    assert [body.name for body in settings.bodies] == ["torso", "upper arm", "lower arm", "wand"]
    lengths, wanted = (
        np.sort(np.linalg.norm(points[:, np.newaxis] - points, axis=2).ravel())
        for points in (done.target.points, target.points)
    )
    np.testing.assert_allclose(lengths, wanted, atol=0.4)  # mm: 0.1 px at 0.9 m, from twenty frames
    again, _ = calibrate_body_of(settings, source, "wand")
    assert len(again.bodies) == 4


def test_joints_are_calibrated_from_images(known):
    settings, done = calibrate_joints_of(replace(known, joints=()), simulated_rig("arm", n_frames=240))
    assert {joint.kind for joint in settings.joints} == {"ball", "hinge"}
    (ball,) = (joint for joint in done.joints if joint.kind == "ball")
    true = {joint.name: joint for joint in known.joints}["shoulder"]
    wanted = {"torso": true.parent_from_joint, "upper arm": true.child_from_joint}
    for name, place in ((ball.parent, ball.parent_from_joint), (ball.child, ball.child_from_joint)):
        np.testing.assert_allclose(place[:3, 3], wanted[name][:3, 3], atol=0.5)


def test_joints_without_targets_are_refused(known):
    with pytest.raises(InputError, match="calibrate them first: skelgen calibrate body"):
        calibrate_joints_of(CaptureSettings(known.rig), simulated_rig("arm", n_frames=2))


def lines(capsys):
    out, err = capsys.readouterr()
    return SimpleNamespace(out=[line.split("\t") for line in out.splitlines()], err=err)


def test_command_writes_labels_poses_and_angles_and_residuals_beside(path, capsys):
    assert main(["motion-capture", "-n", str(path)]) == 0
    said = lines(capsys)
    assert said.out[0][:3] == ["frame", "time [s]", "torso.x [mm]"]
    assert said.out[0][-4:] == ["shoulder.x [rad]", "shoulder.y [rad]", "shoulder.z [rad]", "elbow [rad]"]
    assert [len(line) for line in said.out] == [2 + 3 * 6 + 4] * 7
    assert np.isfinite(np.array(said.out[1:], float)).all()
    assert "0: torso 0." in said.err
    assert said.err.endswith("6 pairs captured, 0 lost\n")


@pytest.mark.parametrize(
    ("options", "n_columns", "n_lines"),
    [
        (["-nsl"], 24, 6),
        (["-nslr"], 6, 6),
        (["-nsla"], 20, 6),
        (["-nslra"], 2, 6),
        (["-ns", "--errors"], 2 + 2 * 22, 7),
        (["-ns", "--predict"], 24, 7),
        (["-ns", "--frames", "2"], 24, 3),
    ],
)
def test_options_leave_out_what_they_say(path, capsys, options, n_columns, n_lines):
    assert main(["motion-capture", *options, str(path)]) == 0
    said = lines(capsys)
    assert [len(line) for line in said.out] == [n_columns] * n_lines
    assert said.err == ""


def test_interactive_mode_writes_when_a_key_is_hit(path, capsys, monkeypatch):
    import io

    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert main(["motion-capture", "-nsli", str(path)]) == 0
    assert len(lines(capsys).out) == 1


def test_errors_stand_behind_the_values(path, capsys):
    main(["motion-capture", "-nsr", "--errors", str(path)])
    said = lines(capsys)
    assert said.out[0][2:8] == [f"shoulder.{axis} [rad]{kind}" for kind in ("", " std") for axis in "xyz"]
    assert 0 < float(said.out[1][-1]) < np.deg2rad(0.5)


def test_without_a_display_pictures_are_missed_in_one_sentence(path, capsys, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert main(["motion-capture", "-s", "--frames", "1", str(path)]) == 0
    assert "there is no display, so that no pictures are shown (-n says so)" in capsys.readouterr().err


def test_recordings_are_listed_and_not_overwritten(path, tmp_path, capsys):
    file = tmp_path / "arm.mfml"
    assert main(["motion-capture", "-n", str(path), "--record", str(file)]) == 0
    assert f"recorded: {file}" in capsys.readouterr().err
    assert main(["motion-capture", "-n", str(path), "--record", str(file)]) == 2
    assert "there is such a recording already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("<source>[^<]*</source>", "", "the settings name no source of images"),
        ("simulated:arm", "telepathy:arm", "telepathy"),
        ('parent="torso"', 'parent="trunk"', "the parent of joint 'shoulder' is body 'trunk', which is not there"),
        ("<body", "<bodi", "broken XML"),
        ("<source>", '<detection><parameter name="glow" value="1"/></detection><source>', "no parameter 'glow'"),
    ],
)
def test_bad_settings_are_one_sentence(path, capsys, old, new, sentence):
    import re

    path.write_text(re.sub(old, new, path.read_text(), count=1))
    assert main(["motion-capture", "-n", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""  # nor labels, which would go into a file of data
    assert len(err.splitlines()) == 1
    assert sentence in err


def test_ambiguous_targets_end_the_command_with_the_reason(known, tmp_path, capsys):
    pyramid = np.array([[0.0, 0, 0], [80, 0, 0], [80, 80, 0], [0, 80, 0], [40, 40, 50]])
    settings = CaptureSettings(known.rig, [BodyTarget("pyramid", pyramid)], source=known.source)
    write_settings(settings, tmp_path / "bad.xml")
    assert main(["motion-capture", "-nl", str(tmp_path / "bad.xml"), "--record", str(tmp_path / "x.c3d")]) == 2
    assert "body 'pyramid' is ambiguous" in capsys.readouterr().err
    assert not (tmp_path / "x.c3d").exists()


def test_calibrate_joints_writes_into_the_settings(known, path, capsys):
    write_settings(replace(known, joints=()), path)
    options = ["--source", "simulated:arm?frames=120", "--joint", "elbow=upper arm:lower arm:hinge", "-q"]
    assert main(["calibrate", "joints", str(path), *options]) == 0
    assert "written:" in capsys.readouterr().out
    (joint,) = read_settings(path).joints
    assert (joint.name, joint.kind) == ("elbow", "hinge")
    assert joint.std.max() > 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["joints", "--joint", "elbow"], "it must be NAME=PARENT:CHILD or NAME=PARENT:CHILD:KIND"),
        (["joints", "--joint", "elbow=upper:lower"], "there is no body 'upper'; bodies are torso"),
        (["joints", "--joint", "elbow=torso:upper arm:saddle"], "types are ball, hinge"),
        (["body", "--name", "wand", "--balls", "5"], "no frame shows exactly 5 points"),
        (
            ["body", "--name", "wand"],
            "The pictures show 15 balls at once; if those are not all of body 'wand', cover the",
        ),
    ],
)
def test_calibrations_refuse_in_one_sentence_and_leave_the_settings(path, capsys, arguments, sentence):
    before = path.read_bytes()
    assert main(["calibrate", arguments[0], str(path), *arguments[1:], "-q"]) == 2
    assert sentence in capsys.readouterr().err
    assert path.read_bytes() == before


def test_a_target_that_is_calibrated_anew_names_the_joints_that_rest_on_it(known):
    source = open_source("simulated:target?frames=12&rate=5&show=upper arm")
    settings, done = calibrate_body_of(known, source, "upper arm")
    assert len(settings.joints) == 2
    assert done.notices[-1] == (
        "joints of the settings rest on the body 'upper arm' before: shoulder, elbow; calibrate them again"
    )


def test_settings_without_a_new_joint_are_refused(known):
    with pytest.raises(InputError, match="no joint was found: the targets move as one"):
        with_joints(known, JointCalibration((), (), float("nan"), (), ()))


def test_producer_in_settings_is_loaded_only_where_it_is_named_by_hand(known, tmp_path):
    text = f"gentl:{tmp_path / 'evil.cti'}"
    (tmp_path / "evil.cti").write_text("a program")
    settings = replace(known, source=text)
    with pytest.raises(CaptureError, match="--source"):
        source_of(settings)
    assert source_of(settings, text).name == text


@pytest.mark.parametrize("what", ["body", "joints"])
def test_exchanged_cameras_are_told_by_the_calibration(what, known):
    rig = known.rig
    exchanged = replace(known, rig=StereoRig(rig.right, rig.left, rig.noise))
    source = simulated_rig("arm", n_frames=12)
    with pytest.raises(InputError, match="they do if exchanged: the cameras are swapped"):
        if what == "body":
            calibrate_body_of(exchanged, source, "torso")
        else:
            calibrate_joints_of(exchanged, source)
