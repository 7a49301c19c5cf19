"""The commands of the capture one after the other, as a user calls them: calibrated, then captured and recorded."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from skelgen_formats.c3d import read_c3d
from skelgen_formats.capture_settings import read_settings
from skelgen_formats.mfml import read_mfml

from skelgen.capture.simulated_rig import simulated_rig
from skelgen.cli import main
from skelgen.geometry.rotations import matrix_from_vector, vector_from_matrix

ROOT = Path(__file__).parents[2]
TARGETS = ("torso", "upper arm", "lower arm")
JOINTS = ("shoulder=torso:upper arm:ball", "elbow=upper arm:lower arm")
N_FRAMES, SEED = 30, 5
ANGLES = np.radians(0.3)  # rms; 0.1 px at 0.9 m propagate to 0.2 degrees, and the simulated noise is less


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    """A settings file in which cameras, then targets, then joints were written by the commands."""
    path = tmp_path_factory.mktemp("capture") / "settings.xml"
    assert main(["calibrate", "simulated", "--cameras-only", "-o", str(path)]) == 0
    for target in TARGETS:
        source = ["--source", f"simulated:arm?show={target}&frames=60&rate=12"]
        assert main(["calibrate", "body", str(path), "--name", target, *source, "-q"]) == 0
    wished = [word for joint in JOINTS for word in ("--joint", joint)]
    source = ["--source", "simulated:arm?frames=150&rate=12&seed=1"]
    assert main(["calibrate", "joints", str(path), *wished, *source, "-q"]) == 0
    return path


@pytest.fixture(scope="module")
def captured(settings, tmp_path_factory):
    """The table that motion-capture prints with those settings, by label, and the files that it records."""
    folder = tmp_path_factory.mktemp("recorded")
    files = [folder / "arm.mfml", folder / "arm.c3d"]
    record = [word for file in files for word in ("--record", str(file))]
    source = ["--source", f"simulated:arm?frames={N_FRAMES}&seed={SEED}"]
    out = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdout", out)
        assert main(["motion-capture", "-ns", "--errors", str(settings), *source, *record]) == 0
    labels, *rows = [line.split("\t") for line in out.getvalue().splitlines()]
    return dict(zip(labels, np.array(rows, float).T, strict=True)), files


@pytest.fixture(scope="module")
def truth():
    """Poses of the targets as they truly were, by name."""
    poses = simulated_rig("arm", n_frames=N_FRAMES, seed=SEED).scene.world_from_body
    return dict(zip(TARGETS, poses.swapaxes(0, 1), strict=True))


def columns(table, name, axes, unit, kind=""):
    return np.stack([table[f"{name}{axis} [{unit}]{kind}"] for axis in axes], axis=-1)


def test_targets_are_as_large_as_they_are(settings):
    known = {body.name: body.points for body in simulated_rig("arm", n_frames=1).settings.bodies}
    for body in read_settings(settings).bodies:
        lengths, wanted = (
            np.sort(np.linalg.norm(points[:, np.newaxis] - points, axis=2).ravel())
            for points in (body.points, known[body.name])
        )
        np.testing.assert_allclose(lengths, wanted, atol=0.3)  # mm; the torso is seen from one side only


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--start", "elbow=1,2,3"], "must be NAME=X,Y,Z:X,Y,Z in mm"),
        (["--start", "knee=1,2,3:4,5,6"], "names joint 'knee', which no --joint names"),
        (["--use-frames", "some"], "it must be a number of frames, or indices like 0,10,20"),
        (["--use-frames", "0,7"], "there is no frame 7: 4 were captured"),
    ],
)
def test_mistakes_in_start_values_and_frames_are_one_sentence(settings, words, sentence, capsys):
    source = ["--source", "simulated:arm?frames=4&rate=12"]
    assert main(["calibrate", "joints", str(settings), "--joint", JOINTS[1], *words, *source, "-q"]) == 2
    assert sentence in " ".join(capsys.readouterr().err.split())


def test_joints_are_those_that_were_wished(settings):
    joints = read_settings(settings).joints
    assert [(joint.name, joint.kind, joint.parent, joint.child) for joint in joints] == [
        ("shoulder", "ball", "torso", "upper arm"),
        ("elbow", "hinge", "upper arm", "lower arm"),
    ]


def test_noise_of_the_rig_is_that_of_its_images(settings):
    found = read_settings(settings)
    assert 0.005 < found.rig.noise < 0.03  # px; simulated centres err by 0.01, and 0.1 is what nobody has measured
    assert found.rig.noise == max(body.noise for body in found.bodies)


def test_stated_deviations_are_those_of_the_errors(captured, truth):
    """Each target's frame is where the calibration put it: errors are from the mean place in the true frame."""
    for name in ("upper arm", "lower arm"):
        poses = truth[name]
        places = columns(captured[0], name, (".x", ".y", ".z"), "mm")
        inside = np.einsum("fji,fj->fi", poses[:, :3, :3], places - poses[:, :3, 3])
        off = np.sqrt(((inside - np.nanmean(inside, axis=0)) ** 2).sum(axis=1))
        stated = columns(captured[0], name, (".x", ".y", ".z"), "mm", " std")
        assert 0.2 < np.median(off) / np.median(np.sqrt((stated**2).sum(axis=1))) < 2.0  # it was a tenth
        assert np.corrcoef(off, np.sqrt((stated**2).sum(axis=1)))[0, 1] > (0.8 if off.max() > 0.1 else -1.0)


def test_every_pair_has_a_line(captured):
    table, _ = captured
    np.testing.assert_array_equal(table["frame"], np.arange(N_FRAMES))
    np.testing.assert_allclose(table["time [s]"], np.arange(N_FRAMES) / 60, atol=1e-6)


def test_the_elbow_bends_as_it_truly_does(captured, truth):
    turns = truth["upper arm"][:, :3, :3].swapaxes(1, 2) @ truth["lower arm"][:, :3, :3]
    true = np.linalg.norm(vector_from_matrix(turns @ turns[0].T), axis=1)
    found = np.abs(captured[0]["elbow [rad]"] - captured[0]["elbow [rad]"][0])
    assert true.max() > np.radians(5)
    assert np.sqrt(np.mean((found - true) ** 2)) < ANGLES


def test_the_shoulder_turns_as_it_truly_does(captured, truth):
    turns = truth["torso"][:, :3, :3].swapaxes(1, 2) @ truth["upper arm"][:, :3, :3]
    found = matrix_from_vector(columns(captured[0], "shoulder.", "xyz", "rad"))
    angles = [np.linalg.norm(vector_from_matrix(each @ each[0].T), axis=1) for each in (found, turns)]
    assert angles[1].max() > np.radians(5)
    assert np.sqrt(np.mean((angles[0] - angles[1]) ** 2)) < ANGLES


def test_poses_move_as_the_targets_do(captured, truth):
    for name in TARGETS:
        turns = matrix_from_vector(columns(captured[0], f"{name}.", ("rx", "ry", "rz"), "rad"))
        at = np.linalg.solve(turns, (truth[name][:, :3, 3] - columns(captured[0], f"{name}.", "xyz", "mm"))[..., None])
        away = at - at.mean(axis=0)  # where the simulation's origin is in the calibrated target: it must not move
        assert np.sqrt((away**2).sum(axis=1).mean()) < 0.6  # mm; up to 100 mm from the balls


def test_deviations_are_stated_for_every_value(captured):
    table, _ = captured
    values = [label for label in table if label.endswith("]") and label not in ("frame", "time [s]")]
    assert all(f"{label} std" in table for label in values)
    assert all((table[f"{label} std"] > 0).all() for label in values)


def test_recordings_hold_every_pair(captured, settings):
    _, (mfml, c3d) = captured
    assert read_mfml(mfml).n_frames == N_FRAMES
    take = read_c3d(c3d)
    assert (take.n_frames, take.rate) == (N_FRAMES, 60.0)
    assert take.names[0] == "torso:1"
    truth = simulated_rig("arm", n_frames=N_FRAMES, seed=SEED).scene.points
    gaps = np.linalg.norm(take.positions[:, :, np.newaxis] - truth[:, np.newaxis], axis=3).min(axis=2)
    assert np.nanquantile(gaps, 0.95) < 0.5  # mm: recorded balls are where some were, but for those that overlap


def test_ctrl_c_ends_the_capture_and_keeps_every_pair(settings, tmp_path):
    files = [tmp_path / "arm.mfml", tmp_path / "arm.c3d"]
    record = [word for file in files for word in ("--record", str(file))]
    source = "simulated:arm?frames=100000&paced=yes"
    command = [sys.executable, "-m", "skelgen", "motion-capture", "-nl", str(settings), "--source", source, *record]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as running:
        lines = [running.stdout.readline() for _ in range(5)]
        running.send_signal(signal.SIGINT)
        rest, said = running.communicate(timeout=60)
    lines += rest.splitlines()
    assert running.returncode == 0, said
    assert read_mfml(files[0]).n_frames == len(lines)
    last = int(lines[-1].split("\t")[0])
    assert read_c3d(files[1]).n_frames == last + 1  # lost pairs are empty frames
    assert f"{len(lines)} pairs captured, " in said.splitlines()[-1]
    assert f"recorded: {files[0]}, {files[1]}" in said.splitlines()[-1]
