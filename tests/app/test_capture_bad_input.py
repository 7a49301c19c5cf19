"""What a user gets from `skelgen motion-capture` when cameras, images or settings are not what they should be."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from skelgen_formats.capture_settings import write_settings
from skelgen_formats.mfml import read_mfml

from skelgen.capture.simulated_rig import simulated_rig
from skelgen.cli import main
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model.rig import StereoRig

N_FRAMES = 70  # more than twice the half second over which it is judged whether both images fit together


@pytest.fixture(scope="module")
def images():
    """Pairs of the reference arm, and the settings that fit them."""
    source = simulated_rig("arm", n_frames=N_FRAMES)
    return [(pair.left, pair.right) for pair in source], source.settings


@pytest.fixture
def capture(images, tmp_path, capsys):
    """A function that captures a folder of images and records it: exit code, both outputs, and the recording's path."""
    pairs, known = images

    def run(left=None, right=None, settings=known, n_frames=N_FRAMES):
        folder = tmp_path / "images"
        folder.mkdir()
        for index, (one, other) in enumerate(pairs[:n_frames]):
            for side, image in (
                ("left", left(one, other) if left else one),
                ("right", right(one, other) if right else other),
            ):
                if image is not None:
                    cv2.imwrite(str(folder / f"{side}{index:03}.png"), image)
        write_settings(replace(settings, source=f"folder:{folder}?rate=60"), tmp_path / "settings.xml")
        recording = tmp_path / "take.mfml"
        code = main(["motion-capture", "-ns", str(tmp_path / "settings.xml"), "--record", str(recording)])
        out, err = capsys.readouterr()
        return code, out.splitlines(), err.splitlines(), recording if recording.exists() else None

    return run


def test_good_images_are_captured_without_a_word(capture):
    code, out, err, take = capture(n_frames=10)
    assert (code, len(out), err) == (0, 11, [])
    assert read_mfml(take).n_frames == 10


def test_swapped_cameras_are_told_once(capture):
    code, _, err, take = capture(left=lambda _, right: right, right=lambda left, _: left)
    assert code == 0
    assert err[0] == "note: hardly any ball fits both images, but they do if exchanged: the cameras are swapped"
    assert read_mfml(take).n_frames == N_FRAMES


def test_settings_of_another_rig_are_told_once(capture, images):
    rig = images[1].rig
    turned = rig.right.camera_from_world.copy()
    turned[:3, :3] = matrix_from_vector(np.array([0.15, 0.0, 0.0])) @ turned[:3, :3]
    other = replace(images[1], rig=StereoRig(rig.left, replace(rig.right, camera_from_world=turned)))
    code, _, err, take = capture(settings=other)
    assert code == 0
    assert err[0].startswith("note: hardly any ball fits both images: the cameras have moved, or the settings are of ")
    assert read_mfml(take).n_frames == N_FRAMES


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda image, _: np.full_like(image, 3), "note: left image: the image shows no balls"),
        (lambda image, _: np.full_like(image, 255), "note: left image: the image is over-exposed"),
        (
            lambda image, _: np.where(image > 9, image, 240).astype(np.uint8),
            "note: left image: the image is over-exposed",
        ),
    ],
)
def test_images_without_balls_say_why_and_the_capture_goes_on(capture, change, sentence):
    code, out, err, _ = capture(left=change, n_frames=6)
    assert code == 0
    assert len(out) == 7
    assert err[0].startswith(sentence)
    assert [line for line in err if line.startswith("note: left")] == err[:1]


def test_targets_that_were_never_found_are_named_at_the_end(capture):
    *_, err, _ = capture(left=lambda image, _: np.full_like(image, 3), n_frames=6)
    assert err[-1] == "note: never found: torso, upper arm, lower arm"


def test_images_of_another_size_than_the_calibrated_ones_end_it(capture):
    half = lambda image: cv2.resize(image, (320, 240))  # noqa: E731
    code, out, err, take = capture(lambda left, _: half(left), lambda _, right: half(right), n_frames=3)
    assert (code, out, take) == (2, [], None)
    assert "the left camera sends 320 x 240 pixels, and its calibration is for 640 x 480" in err[-1]


def test_images_of_two_sizes_end_it(capture):
    code, _, err, _ = capture(right=lambda _, right: cv2.resize(right, (320, 240)), n_frames=3)
    assert code == 2
    assert "320 x 240" in err[-1]
    assert "640 x 480" in err[-1]


def test_one_camera_alone_is_refused(capture):
    code, out, err, take = capture(right=lambda *_: None, n_frames=3)
    assert (code, out, take) == (2, [], None)
    assert "right" in err[-1]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('parent="torso"', 'parent="trunk"', "the parent of joint 'upper arm' is body 'trunk', which is not there"),
        ("<body name", "<limb name", "broken XML"),
        ('kind="hinge"', 'kind="hinge" limit="90"', "<joint> has no attribute 'limit'"),
    ],
)
def test_unknown_names_in_the_settings_are_told_with_their_line(images, tmp_path, capsys, old, new, sentence):
    path = tmp_path / "settings.xml"
    write_settings(replace(images[1], source="simulated:arm"), path)
    text = path.read_text()
    path.write_text(text.replace(old, new, 1))
    assert main(["motion-capture", "-n", str(path)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    line = text[: text.index(old)].count("\n") + 1
    assert sentence in said
    if "XML" not in sentence:
        assert f"settings.xml:{line}: " in said
