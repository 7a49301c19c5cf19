"""Inputs are never outputs, and a file that nobody named is not replaced by surprise."""

from __future__ import annotations

from dataclasses import replace

import pytest
from skelgen_formats.registry import find_format

import skelgen
from skelgen.app.export import export_project
from skelgen.app.files import open_input
from skelgen.app.project_file.archive import save_project
from skelgen.cli import main
from skelgen.errors import WriteError


@pytest.fixture
def folder(small_project, waving, tmp_path, monkeypatch):
    """The current folder, with a recording and a project that was made of it, which also stands elsewhere."""
    monkeypatch.chdir(tmp_path)
    skelgen.write(waving, "walk.trc")
    (tmp_path / "elsewhere").mkdir()
    source = open_input("walk.trc").source
    for place in (".", "elsewhere"):
        save_project(replace(small_project, source=source), f"{place}/walk.skelgen")
    return tmp_path


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("command", "replaced"),
    [
        ("convert walk.skelgen walk.osim", "walk.trc"),
        ("convert walk.skelgen walk.osim --overwrite", "walk.trc"),  # it is what the project was made of
        ("convert walk.trc walk.trc", "walk.trc"),
        ("convert walk.trc ./elsewhere/../walk.trc --overwrite", "walk.trc"),
        ("convert walk.skelgen walk.trc", "walk.trc"),
        ("report walk.skelgen -o walk.skelgen", "walk.skelgen"),
        ("report walk.skelgen -o walk.trc", "walk.trc"),
        ("fill walk.skelgen -o walk.trc", "walk.trc"),
        ("config config.xml --write config.xml", "config.xml"),
        ("run result.xml -o . --overwrite", "result.xml"),
        ("limbs other.csm -o other --config other/other.xml", "other.xml"),
    ],
)
def test_input_is_never_an_output(folder, waving, capsys, command, replaced):
    main(["config", "--write", "config.xml"])
    skelgen.write(waving, "other.csm")
    (folder / "other").mkdir()
    main(["config", "--write", "other/other.xml"])
    skelgen.write(open_input("walk.skelgen"), "result.xml", xml_detail="all")
    before = contents(folder)
    capsys.readouterr()
    assert main(command.split()) == 2
    error = capsys.readouterr().err
    assert replaced in error
    assert "would be replaced" in error or "--overwrite" in error
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("command", "companion"),
    [
        ("convert elsewhere/walk.skelgen elsewhere/walk.osim", "walk.trc"),
        ("convert elsewhere/walk.skelgen elsewhere/walk.urdf", "walk.urdf.csv"),
        ("convert elsewhere/walk.skelgen elsewhere/walk.xsf", "walk.xaf"),
        ("convert elsewhere/walk.skelgen elsewhere/walk.csm --filled", "walk.filled.csv"),
        ("fill elsewhere/walk.skelgen -o elsewhere/walk.csm", "walk.filled.csv"),
        ("simulate rods --n-frames 20 -o elsewhere/walk.csm", "walk.truth.npz"),
        ("run walk.trc -o elsewhere/new", "new/walk.html"),
        ("limbs walk.trc -o elsewhere/new", "new/walk.json"),
        ("demo -o elsewhere/new", "new/demo.html"),
        ("calibrate skeleton walk.trc other.csm -o elsewhere/new", "new/skeleton.html"),
    ],
)
def test_file_that_nobody_named_is_refused(folder, waving, capsys, command, companion):
    skelgen.write(waving, "other.csm")
    (folder / "elsewhere" / "new").mkdir()
    (folder / "elsewhere" / companion).write_text("precious")
    before = contents(folder)
    assert main(command.split()) == 2
    error = capsys.readouterr().err
    assert f"{companion} is there already" in error and "--overwrite" in error
    assert contents(folder) == before


def test_companions_are_replaced_where_that_is_asked_for(folder):
    (folder / "elsewhere" / "walk.trc").write_text("old")
    command = "convert elsewhere/walk.skelgen elsewhere/walk.osim -q"
    assert main([*command.split(), "--overwrite"]) == 0
    assert (folder / "elsewhere" / "walk.trc").read_text() != "old"


def test_results_of_an_earlier_run_are_replaced(folder):
    command = ["run", "walk.trc", "--until", "limbs", "-q", "-o", "results"]
    assert [main(command), main(command)] == [0, 0]
    assert main(["limbs", "results", "-q"]) == 0  # a project grows in its place


def test_scripts_may_run_twice_and_replace_no_stranger(folder):
    project = skelgen.load("elsewhere")
    (folder / "elsewhere" / "new.trc").write_text("precious")
    with pytest.raises(WriteError, match=r"new\.trc is there already"):
        skelgen.write(project, "elsewhere/new.osim")
    (folder / "elsewhere" / "new.trc").unlink()
    for _ in range(2):
        skelgen.write(project, "elsewhere/new.osim")


def test_export_never_replaces_the_recording(folder):
    with pytest.raises(WriteError, match=r"walk\.trc is read by this command"):
        export_project(skelgen.load("walk.skelgen"), find_format("trc"), folder / "walk.trc", {})
