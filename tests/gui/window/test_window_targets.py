"""Targets and joints are calibrated in the window as a person does it, from nothing to joint angles."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog
from skelgen_formats.capture_settings import read_settings, write_settings

from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig
from skelgen.capture.simulated_rig.scene import Wandering, scene_of_bodies, wandering_poses
from skelgen.capture.sources import open_source
from skelgen.cli import main
from skelgen.model.rig import BodyTarget, CaptureSettings, StereoRig

WAIT = 120_000  # ms; what is compiled for the first time takes a minute
TORSO = "simulated:target?frames=40&rate=6&show=torso"
ARM = "simulated:arm?frames=120&rate=15"
PYRAMID = np.array([[0.0, 0, 0], [80, 0, 0], [80, 80, 0], [0, 80, 0], [40, 40, 50]])


@pytest.fixture
def page(window):
    return window.pages.page("capture")


@pytest.fixture
def path(tmp_path):
    """Settings with the simulated cameras only, as their calibration writes them."""
    path = tmp_path / "rig.xml"
    write_settings(CaptureSettings(reference_rig()), path)
    return path


@pytest.fixture
def arm(tmp_path):
    """Settings with the simulated cameras and all three targets."""
    path = tmp_path / "arm.xml"
    known = simulated_rig("arm", n_frames=1).settings
    write_settings(CaptureSettings(known.rig, known.bodies), path)
    return path


@pytest.fixture
def clicks(qtbot, window):
    """Click, and wait until what that begins has ended."""

    def click(button):
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
        qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)

    return click


@pytest.fixture
def takes(page, clicks):
    """Take frames of a source with a step, until it ends."""

    def take(step, source, settings=""):
        page.tabs.setCurrentWidget(step)
        step.form.settings.show_path(str(settings))
        step.form.source.show_source(source)
        clicks(step.go)

    return take


def texts(table):
    return [
        [table.item(row, column).text() for column in range(table.columnCount())] for row in range(table.rowCount())
    ]


def test_a_target_is_taken_judged_and_added_as_the_command_does_it(qtbot, page, takes, clicks, path, tmp_path):
    step = page.target
    qtbot.keyClicks(step.form.name, "torso")
    takes(step, TORSO, path)
    assert step.verdict.text().startswith("Good: its balls are known to 0.0")
    assert "from 40 of 40 frames" in step.verdict.text()
    assert "of 40 pairs of images" in step.state.text()
    assert "Its design is not ambiguous." in step.verdict.text()
    assert texts(step.balls)[0] == ["1", "0.00", "0.00", "0.00"]
    assert " ± 0.0" in texts(step.balls)[3][3]
    assert read_settings(path).bodies == ()  # nothing is written before somebody says so
    clicks(step.add)
    assert f"Added to {path}." in step.state.text()
    said = tmp_path / "said.xml"
    write_settings(CaptureSettings(reference_rig()), said)
    assert main(["calibrate", "body", str(said), "--name", "torso", "--source", TORSO, "--quiet"]) == 0
    assert path.read_bytes() == said.read_bytes()


def test_joints_are_taken_judged_and_added_as_the_command_does_it(page, takes, clicks, arm, tmp_path):
    step = page.joints
    said = tmp_path / "said.xml"
    said.write_bytes(arm.read_bytes())
    takes(step, ARM, arm)
    assert len(texts(step.motions)) == 2
    assert step.state.text().startswith("120 pairs of images.")
    assert "is a ball, turned by" in step.verdict.text()
    assert "is a hinge, turned by" in step.verdict.text()
    assert " ± 0." in texts(step.joints)[1][1]
    step.form.use_frames.setText("60")
    clicks(step.calibrate)
    clicks(step.add)
    assert main(["calibrate", "joints", str(said), "--source", ARM, "--use-frames", "60", "--quiet"]) == 0
    assert arm.read_bytes() == said.read_bytes()


def test_from_nothing_to_joint_angles_on_the_simulated_rig(qtbot, page, takes, clicks, tmp_path, monkeypatch):
    saved = tmp_path / "rig.xml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *args: (str(saved), ""))
    for name in ("torso", "upper arm", "lower arm"):
        page.target.form.name.setText(name)
        takes(page.target, f"simulated:target?frames=30&rate=5&show={name}", page.live.choice.settings.path)
        clicks(page.target.add)
    takes(page.joints, ARM, page.live.choice.settings.path)
    clicks(page.joints.add)
    settings = read_settings(saved)
    assert [body.name for body in settings.bodies] == ["torso", "upper arm", "lower arm"]
    assert sorted(joint.kind for joint in settings.joints) == ["ball", "hinge"]
    page.tabs.setCurrentWidget(page.live)
    assert page.live.choice.settings.path == str(saved)
    page.live.choice.source.show_source("simulated:arm?frames=20")
    with qtbot.waitSignal(page.live.ended, timeout=WAIT):
        qtbot.mouseClick(page.live.go, Qt.MouseButton.LeftButton)
    assert any(row[1] != "–" for row in texts(page.live.angles))


def test_a_simulated_target_is_one_choice_away(qtbot, page, window):
    (torso, *_) = page.target.form.targets.actions()
    with qtbot.waitSignal(page.target.shot, timeout=WAIT):
        torso.trigger()
    assert page.target.form.name.text() == "torso"
    qtbot.waitUntil(lambda: "5 balls, seen alone in" in page.target.state.text(), timeout=WAIT)
    qtbot.mouseClick(page.target.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)
    assert page.target.verdict.text()
    assert page.target.go.text() == "Start"


def test_an_ambiguous_design_is_refused_with_the_reason(page, takes, path, tmp_path):
    cv2 = pytest.importorskip("cv2")
    poses = wandering_poses(reference_rig(), 12, 1, Wandering(distance=900.0, spread=60.0), rate=3.0)
    rig = SimulatedRig(scene_of_bodies([BodyTarget("pyramid", PYRAMID - PYRAMID.mean(axis=0))], poses))
    for index in range(12):
        pair, _ = rig.render(index)
        cv2.imwrite(str(tmp_path / f"left{index:02}.png"), pair.left)
        cv2.imwrite(str(tmp_path / f"right{index:02}.png"), pair.right)
    page.target.form.name.setText("pyramid")
    takes(page.target, f"folder:{tmp_path}", path)
    assert "body 'pyramid' is ambiguous" in page.target.verdict.text()
    assert "near equal" in page.target.verdict.text()
    assert not page.target.add.isEnabled()
    assert read_settings(path).bodies == ()


def test_a_target_is_named_after_it_was_taken(qtbot, page, takes, clicks, path):
    takes(page.target, TORSO, path)
    assert not page.target.add.isEnabled()
    qtbot.keyClicks(page.target.form.name, "chest")
    clicks(page.target.add)
    assert [body.name for body in read_settings(path).bodies] == ["chest"]


def test_a_target_that_is_there_under_another_name_is_not_added(page, takes, arm):
    page.target.form.name.setText("chest")
    takes(page.target, TORSO, arm)
    assert "body 'chest' can be taken for 'torso'" in page.target.verdict.text()
    assert not page.target.add.isEnabled()


def test_a_target_that_is_added_anew_names_the_joints_that_rest_on_it(page, takes, clicks, tmp_path):
    path = tmp_path / "known.xml"
    write_settings(simulated_rig("arm", n_frames=1).settings, path)
    page.target.form.name.setText("torso")
    takes(page.target, TORSO, path)
    clicks(page.target.add)
    assert "rest on the body 'torso' before: upper arm; calibrate them again" in page.target.state.text()


def test_named_joints_have_their_names_and_kinds(qtbot, page, takes, clicks, arm):
    step = page.joints
    page.tabs.setCurrentWidget(step)
    step.form.settings.show_path(str(arm))
    requests = step.requests
    qtbot.waitUntil(lambda: requests.parent_box.count() == 3, timeout=WAIT)
    for name, parent, child, kind in (
        ("shoulder", "torso", "upper arm", "ball"),
        ("elbow", "upper arm", "lower arm", "type is found"),
        ("wrist", "lower arm", "torso", "hinge"),
    ):
        qtbot.keyClicks(requests.name, name)
        requests.parent_box.setCurrentText(parent)
        requests.child_box.setCurrentText(child)
        requests.kind.setCurrentText(kind)
        qtbot.mouseClick(requests.more, Qt.MouseButton.LeftButton)
    requests.table.selectRow(2)
    qtbot.keyClick(requests.table, Qt.Key.Key_Delete)
    takes(step, ARM, arm)
    clicks(step.add)
    joints = read_settings(arm).joints
    assert [(joint.name, joint.kind, joint.parent) for joint in joints] == [
        ("shoulder", "ball", "torso"),
        ("elbow", "hinge", "upper arm"),
    ]


def test_joints_without_targets_give_a_sentence(page, takes, path):
    takes(page.joints, ARM, path)
    assert page.joints.verdict.text() == "joints are between two targets; calibrate these first"


def test_a_joint_that_hardly_moves_is_told(page, takes, arm):
    requests = page.joints.requests
    requests.show_targets(["torso", "upper arm", "lower arm"])
    requests.name.setText("elbow")
    requests.parent_box.setCurrentText("upper arm")
    requests.child_box.setCurrentText("lower arm")
    requests.kind.setCurrentText("hinge")
    requests.more.click()
    takes(page.joints, "simulated:arm?frames=30&rate=200", arm)
    assert "move the joint further" in page.joints.verdict.text()
    assert "Lower arm turned by" in page.joints.verdict.text()


def test_a_source_that_breaks_off_keeps_what_was_taken(page, takes, clicks, path, tmp_path):
    cv2 = pytest.importorskip("cv2")
    images = tmp_path / "images"
    images.mkdir()
    with open_source(TORSO) as pairs:
        for number, pair in enumerate(islice(pairs, 25)):
            for side, image in (("left", pair.left), ("right", pair.right)):
                cv2.imwrite(str(images / f"{side}{number:02}.png"), image)
    for side in ("left", "right"):
        (images / f"{side}25.png").write_bytes(b"no image")
    page.target.form.name.setText("torso")
    takes(page.target, f"folder:{images}", path)
    assert "left25.png" in page.target.verdict.text()
    clicks(page.target.calibrate)
    assert "from 25 of 25 frames" in page.target.verdict.text()


def test_settings_of_other_cameras_are_not_written_to(page, takes, clicks, path):
    page.target.form.name.setText("torso")
    takes(page.target, TORSO, path)
    rig = reference_rig()
    write_settings(CaptureSettings(StereoRig(rig.right, rig.left)), path)
    before = path.read_bytes()
    clicks(page.target.add)
    assert "are others than those that this was measured with" in page.target.verdict.text()
    assert path.read_bytes() == before


def test_without_settings_and_source_the_steps_say_what_to_choose(page, takes):
    for step in (page.target, page.joints):
        takes(step, "")
        assert step.verdict.text().startswith("choose a settings file")
        assert not step.calibrate.isEnabled()


def test_what_is_cancelled_can_be_calibrated_with_what_is_there(qtbot, window, page, clicks, path):
    step = page.target
    step.form.settings.show_path(str(path))
    step.form.name.setText("torso")
    step.form.source.show_source("simulated:target?frames=2000&rate=10&show=torso")
    qtbot.mouseClick(step.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: "That is enough." in step.state.text(), timeout=WAIT)
    window.jobs.cancel()
    qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)
    assert step.found is None
    clicks(step.calibrate)
    assert step.found.n_frames >= 10


def test_all_steps_use_one_settings_file_and_the_simulated_rig_leaves_it(page):
    page.target.form.settings.show_path("one.xml")
    assert page.live.choice.settings.path == page.joints.form.settings.path == "one.xml"
    page.live.choice.settings.show_path("")
    assert page.target.form.settings.path == "one.xml"
