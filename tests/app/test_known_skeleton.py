"""One body, many takes: from the command line to the files, and several takes calibrated together."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.app.joint_calibration import calibrate_together
from skelgen.app.known_skeleton import apply_skeleton
from skelgen.cli import main
from skelgen.errors import InputError
from skelgen.evaluation import evaluate
from skelgen.model import Poses, Project
from skelgen.simulation import read_truth, simulate

FRAMES = 200
OPTIONS = {"n_frames": FRAMES, "noise": 1.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A range-of-motion take of the rods, reconstructed, and another take of them without names."""
    place = tmp_path_factory.mktemp("takes")
    words = ["--n-frames", str(FRAMES), "--noise", "0.3", "-q"]
    assert main(["simulate", "rods", "-o", str(place / "rom.c3d"), "--seed", "1", *words]) == 0
    assert main(["run", str(place / "rom.c3d"), "-o", str(place / "rom"), "-q"]) == 0
    assert main(["simulate", "rods", "-o", str(place / "walk.mfml"), "--seed", "2", "--no-labelled", *words]) == 0
    return place


@pytest.mark.parametrize("command", ["fit", "run"])
def test_take_is_fitted_by_the_skeleton_of_another_one(folder, tmp_path, command):
    words = [command, "--skeleton", str(folder / "rom"), str(folder / "walk.mfml"), "-o", str(tmp_path / "out"), "-q"]
    assert main(words) == 0
    project = skelgen.app.store.open_project(tmp_path / "out" / "walk.skelgen")
    scores = evaluate(project, read_truth(folder / "walk.truth.npz"))
    assert scores.labels.idf1 > 0.99
    assert scores.as_mapping()["summary"]["mean_joint_error"] < 1.0
    known = skelgen.app.store.open_project(folder / "rom" / "rom.skelgen")
    assert project.skeleton.lengths == known.skeleton.lengths
    assert {".xml", ".html", ".json"} <= {path.suffix for path in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["run", "--skeleton", "rom", "walk.mfml", "--n-limbs", "3"], "--n-limbs cannot be told beside --skeleton"),
        (["fit", "--skeleton", "walk.skelgen", "walk.mfml"], "walk.skelgen"),
        (["calibrate", "skeleton", "rom.c3d", "-o", "out"], "give at least two"),
        (["calibrate", "skeleton", "rom.c3d", "./rom.c3d", "-o", "out"], "two results would be called 'rom'"),
    ],
)
def test_what_cannot_be_done_is_refused(folder, monkeypatch, capsys, words, sentence):
    monkeypatch.chdir(folder)
    assert main(words) == 2
    assert sentence in capsys.readouterr().err


def test_takes_are_calibrated_together_from_the_command_line(folder, tmp_path):
    takes = [str(folder / name) for name in ("rom.c3d", "walk.mfml")]
    assert main(["calibrate", "skeleton", *takes, "-o", str(tmp_path), "-q"]) == 0
    projects = [
        skelgen.app.store.open_project(tmp_path / name)
        for name in ("skeleton.skelgen", "rom/rom.skelgen", "walk/walk.skelgen")
    ]
    assert [project.motion.n_frames for project in projects] == [2 * FRAMES, FRAMES, FRAMES]
    assert projects[1].skeleton.lengths == projects[2].skeleton.lengths == projects[0].skeleton.lengths


def test_two_takes_tell_lengths_better_than_one():
    errors = []
    for seed in (1, 2, 3):
        sims = [simulate("human", seed=seed + first, **OPTIONS) for first in (0, 100)]
        both = calibrate_together([one.take for one in sims])
        alone = [evaluate(skelgen.reconstruct(one.take), one.truth) for one in sims]
        together = [evaluate(project, one.truth) for project, one in zip(both.takes, sims, strict=True)]
        errors.append(
            [[one.as_mapping()["summary"]["mean_length_error"] for one in some] for some in (alone, together)]
        )
    alone, together = np.mean(errors, axis=(0, 2))
    assert together < 0.85 * alone  # twice the frames: 0.71 where the motions tell as much


def test_marker_that_slipped_between_takes_does_not_spoil_the_skeleton():
    first, second = (simulate("human", seed=seed, n_frames=FRAMES, noise=0.5) for seed in (1, 2))
    positions = np.array(second.take.positions)
    pose = second.truth.world_from_limb[:, 3, :3, :3]
    positions[:, 10] += pose @ np.array([0.0, 0.0, 25.0])
    moved = skelgen.Trajectories(positions, second.take.names, second.take.rate, "second")
    both = calibrate_together([first.take, moved])
    names = both.skeleton.trajectories.names
    assert "left upper arm 2" in names
    assert "left upper arm 2 in second" in names
    assert both.skeleton.skeleton.marker_std[names.index("left upper arm 2")] < 1.0


def test_bodies_with_orientation_are_refused():
    poses = Poses(np.tile(np.eye(4), (10, 2, 1, 1)), ("a", "b"), 50.0, "sensors")
    with pytest.raises(InputError, match="sensors: holds bodies with orientation"):
        apply_skeleton(Project(poses), Project(poses))
    with pytest.raises(InputError, match="sensors: holds bodies with orientation"):
        calibrate_together([poses, poses])
