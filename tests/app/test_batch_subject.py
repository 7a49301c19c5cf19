"""Batches of takes of one body, whose skeleton is known from another take."""

from pathlib import Path

import pytest

from skelgen.app.batch.run import read_manifest
from skelgen.app.batch.work import Job, SubjectFile, subject_in
from skelgen.app.project_file.archive import open_project
from skelgen.cli import main
from skelgen.errors import InputError
from skelgen.evaluation import evaluate
from skelgen.simulation import read_truth


@pytest.fixture
def rods(tmp_path, monkeypatch):
    """A calibrated take of the rods in ``rom``, and two other takes of them, without names, in ``in``."""
    monkeypatch.chdir(tmp_path)
    words = ["--n-frames", "150", "--noise", "0.3", "-q"]
    assert main(["simulate", "rods", "-o", "rom.c3d", *words]) == 0
    assert main(["run", "rom.c3d", "-o", "rom", "-q"]) == 0
    for seed in ("1", "2"):
        assert main(["simulate", "rods", "-o", f"in/{seed}.mfml", "--seed", seed, "--no-labelled", *words]) == 0
    return tmp_path


def test_every_take_has_its_lengths(rods):
    assert main(["batch", "in", "-o", "out", "--skeleton", "rom", "--jobs", "2", "-q"]) == 0
    known = open_project(rods / "rom" / "rom.skelgen")
    for take in ("1", "2"):
        done = open_project(rods / "out" / take / f"{take}.skelgen")
        assert done.skeleton.lengths == known.skeleton.lengths
        scores = evaluate(done, read_truth(rods / "in" / f"{take}.truth.npz"))
        assert scores.labels.idf1 > 0.99
    assert main(["skeleton", "--skeleton", "rom", "in/1.mfml", "-o", "alone", "-q"]) == 0
    alone = Path("alone/1.joints.csv").read_bytes()
    assert Path("out/1/1.joints.csv").read_bytes() == alone


def test_takes_of_two_bodies_are_labelled_by_both_skeletons(rods):
    words = ["--no-labelled", "--subjects", "2", "--n-frames", "150", "--noise", "0.3", "-q"]
    assert main(["simulate", "rods", "-o", "pairs/both.mfml", *words]) == 0
    assert main(["batch", "pairs", "-o", "out", "--skeleton", "rom", "--skeleton", "rom", "-q"]) == 0
    done, alone = open_project(rods / "out" / "both" / "both.skelgen"), open_project(rods / "rom" / "rom.skelgen")
    assert done.skeleton.n_limbs == 2 * alone.skeleton.n_limbs
    assert evaluate(done, read_truth(rods / "pairs" / "both.truth.npz")).labels.idf1 > 0.99
    assert [Path(one["path"]).name for one in read_manifest("out")["job"]["skeleton"]] == ["rom.skelgen"] * 2


def test_a_take_of_another_body_stops_nothing(rods, capsys):
    assert main(["simulate", "quadruped", "-o", "in/dog.c3d", "--n-frames", "60", "-q"]) == 0
    assert main(["batch", "in", "-o", "out", "--skeleton", "rom", "-q"]) == 3
    [failed] = [one for one in read_manifest("out")["takes"] if one["outcome"] == "failed"]
    assert failed["name"] == "dog"
    assert "another body" in failed["error"]


def test_another_skeleton_is_another_job(rods):
    first, other = (Job(subjects=(SubjectFile("rom.skelgen", sum_of),)) for sum_of in ("1", "2"))
    assert first.fingerprint != other.fingerprint
    Path("rom/rom.skelgen").touch()
    with pytest.raises(InputError, match="not the skeleton with which the batch began"):
        subject_in((SubjectFile(str(rods / "rom" / "rom.skelgen"), "1"),))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--skeleton", "in/1.mfml"], "1.mfml"),
        (["--skeleton", "nowhere.skelgen"], "nowhere.skelgen"),
        (["--skeleton", "rom", "--n-limbs", "3"], "--n-limbs cannot be given beside --skeleton"),
        (["--skeleton", "rom", "--until", "limbs"], "--until cannot be given beside --skeleton"),
    ],
)
def test_what_cannot_be_done_is_told_before_any_take(rods, capsys, words, sentence):
    assert main(["batch", "in", "-o", "out", *words]) == 2
    assert sentence in capsys.readouterr().err
    assert not Path("out").exists()
