"""From a simulated take to every file, with the real stages."""

from __future__ import annotations

import json
import zipfile

import pytest

import skelgen
from skelgen.app.configuration import Settings, all_parameter_classes, write_defaults
from skelgen.cli import main

MEAN_JOINT_ERROR = 0.6  # mm: noise of 0.5 mm on three markers per limb, averaged over many frames


@pytest.fixture(scope="module")
def rods(tmp_path_factory):
    """A folder with the seed's chain of three rods, 400 frames with 0.5 mm of noise, and its results in `out`."""
    folder = tmp_path_factory.mktemp("rods")
    assert main(["simulate", "rods", "-o", str(folder / "r.c3d"), "--n-frames", "400", "--noise", "0.5", "-q"]) == 0
    assert main(["run", str(folder / "r.c3d"), "-o", str(folder / "out"), "-q"]) == 0
    return folder


def members(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist() if name != "run.json"}


def test_chain_of_rods_is_found(rods, capsys):
    assert main(["evaluate", str(rods / "out"), str(rods / "r.truth.npz"), "--json"]) == 0
    scores = json.loads(capsys.readouterr().out)
    assert scores["limbs"]["adjusted_rand"] == 1
    assert scores["summary"]["mean_joint_error"] < MEAN_JOINT_ERROR


def test_every_output_is_there(rods):
    suffixes = {file.name.removeprefix("r.") for file in (rods / "out").iterdir()}
    drawn = {"labels.c3d", "limbs.csv", "raw-joints.c3d", "xml", "xsf", "xaf", "joints.csv", "angles.csv", "json"}
    assert suffixes == drawn | {"html", "skelgen", "costs.txt", "tree.txt"}


def test_same_take_and_seed_give_the_same_bytes(rods):
    main(["run", str(rods / "r.c3d"), "-o", str(rods / "again"), "-q"])
    assert members(rods / "again" / "r.skelgen") == members(rods / "out" / "r.skelgen")


def test_labelled_c3d_of_a_run_leads_to_the_same_limbs(rods):
    project = skelgen.reconstruct(skelgen.read(rods / "out" / "r.labels.c3d"))
    assert sorted(project.limbs.limb_of_marker.tolist()) == [0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_unlabelled_points_become_the_same_limbs(tmp_path, capsys):
    take = str(tmp_path / "r.mfml")
    main(["simulate", "rods", "-o", take, "--n-frames", "400", "--no-labelled", "-q"])
    assert main(["run", take, "-o", str(tmp_path / "out"), "-q"]) == 0
    capsys.readouterr()
    main(["evaluate", str(tmp_path / "out"), str(tmp_path / "r.truth.npz"), "--json"])
    scores = json.loads(capsys.readouterr().out)
    assert scores["labels"]["idf1"] > 0.99
    assert scores["limbs"]["adjusted_rand"] == 1


def test_demo_finds_the_human(tmp_path, capsys):
    assert main(["demo", "-o", str(tmp_path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["evaluation"]["limbs"]["adjusted_rand"] == 1
    assert result["evaluation"]["topology"]["missed"] == []
    assert {"demo.html", "demo.truth.npz"} <= {file.name for file in tmp_path.iterdir()}


def test_config_with_all_defaults_changes_nothing(tmp_path):
    write_defaults(tmp_path / "config.xml")
    settings = Settings(tmp_path / "config.xml")
    assert [settings.of(cls.stage) for cls in all_parameter_classes()] == [cls() for cls in all_parameter_classes()]


def test_wrong_line_of_a_config_is_named(rods, tmp_path, capsys):
    write_defaults(tmp_path / "config.xml")
    lines = (tmp_path / "config.xml").read_text().splitlines()
    number = next(index for index, line in enumerate(lines) if "<ALPHA" in line)
    lines[number] = '<ALPHA value="a lot" type="double"/>'
    (tmp_path / "config.xml").write_text("\n".join(lines))
    assert main(["run", str(rods / "r.c3d"), "--config", str(tmp_path / "config.xml")]) == 2
    assert f"config.xml:{number + 1}: " in capsys.readouterr().err
