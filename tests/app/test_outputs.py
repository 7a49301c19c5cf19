"""The files of a run arrive together or not at all."""

from __future__ import annotations

import csv
from dataclasses import replace

import pytest
from skelgen_formats.registry import find_format, write_file

import skelgen
from skelgen.app.export import export_project
from skelgen.app.files import open_input
from skelgen.app.limb_names import read_limb_names, with_stated_names
from skelgen.app.outputs import OUTPUTS, Output, stem_of, write_outputs
from skelgen.app.pipeline import CollectingMonitor
from skelgen.app.project_file.archive import save_project
from skelgen.cli import main
from skelgen.errors import FormatError, WriteError
from skelgen.progress import SILENT

SIMPLE = (
    Output(".skelgen", "", save_project),
    next(output for output in OUTPUTS if output.suffix == ".limbs.csv"),
    Output(".xml", "skeleton", lambda project, path: path.write_text("<a/>")),
)


def failing_last(error):
    """Outputs of which the last one writes half a file and raises."""

    def write(project, path):
        path.write_text("half")
        raise error

    return (*SIMPLE[:2], Output(".xml", "skeleton", write))


def test_all_files_carry_the_stem(small_project, tmp_path):
    files = write_outputs(small_project, tmp_path / "out", "walk", outputs=SIMPLE)
    assert [file.name for file in files] == ["walk.limbs.csv", "walk.skelgen", "walk.xml"]
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [file.name for file in files]


def test_results_may_have_a_name_of_their_own(small_project, tmp_path):
    files = write_outputs(small_project, tmp_path, "walk", result_name="result.xml", outputs=SIMPLE)
    assert "result.xml" in [file.name for file in files]


def test_limbs_are_listed_by_marker(small_project, tmp_path):
    write_outputs(small_project, tmp_path, "a", outputs=SIMPLE[1:2])
    with (tmp_path / "a.limbs.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows[:2] == [["marker", "limb", "name"], ["M<0>&", "0", "limb0"]]
    assert rows[-1] == ["M<9>&", "-1", ""]


def test_names_of_limbs_are_read_back_from_the_table(small_project, tmp_path):
    named = small_project.with_limb_names(("=left, forearm", "limb1", "chest"))
    write_outputs(named, tmp_path, "a", outputs=SIMPLE[1:2])
    said = read_limb_names(tmp_path / "a.limbs.csv")
    assert list(said.values()) == ["=left, forearm", "chest"]
    assert with_stated_names(small_project, said).limbs.names[::2] == named.limbs.names[::2]
    (tmp_path / "cut.csv").write_text("marker,limb,name\nLTHI,0\n")
    with pytest.raises(FormatError, match="2 cells where marker"):
        read_limb_names(tmp_path / "cut.csv")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ZeroDivisionError(), OSError(28, "No space left on device")])
def test_failure_leaves_everything_as_it_was(small_project, tmp_path, error):
    (tmp_path / "walk.skelgen").write_text("precious")
    with pytest.raises((KeyboardInterrupt, ZeroDivisionError, WriteError)):
        write_outputs(small_project, tmp_path, "walk", outputs=failing_last(error))
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("walk.skelgen", "precious")]


def test_raw_joints_say_in_their_descriptions_which_motion_does_not_determine(small_project, tmp_path):
    joints = tuple(replace(joint, open_directions=3) for joint in small_project.skeleton.joints)
    project = replace(small_project, _skeleton=replace(small_project.skeleton, joints=joints))
    raw = tuple(output for output in OUTPUTS if output.suffix == ".raw-joints.c3d")
    write_outputs(project, tmp_path, "a", outputs=raw)
    assert (tmp_path / "a.raw-joints.c3d").read_bytes().count(b"the motion does not determine it") == len(joints)


def test_failure_removes_the_folders_it_made(small_project, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        write_outputs(small_project, tmp_path / "a" / "b", "walk", outputs=failing_last(KeyboardInterrupt()))
    assert list(tmp_path.iterdir()) == []


def test_format_that_cannot_hold_the_project_is_left_out_with_a_notice(small_project, tmp_path):
    outputs = failing_last(WriteError("no more than 5 limbs"))
    notices = []
    monitor = type("M", (), {"notice": lambda self, text: notices.append(text)})
    monitor.begin = monitor.advance = lambda *values: None
    files = write_outputs(small_project, tmp_path, "walk", outputs=outputs, monitor=monitor())
    assert [file.name for file in files] == ["walk.limbs.csv", "walk.skelgen"]
    assert notices == ["walk.xml is not written: no more than 5 limbs"]


def test_notice_of_a_file_that_is_left_out_names_no_temporary_folder(small_project, tmp_path):
    monitor = CollectingMonitor(SILENT)
    names = ("a\x1bb", *small_project.limbs.names[1:])
    write_outputs(small_project.with_limb_names(names), tmp_path, "walk", monitor=monitor)
    assert [notice for notice in monitor.notices if ".skelgen-" in notice] == []
    assert any(notice.startswith("walk.xml is not written: the name") for notice in monitor.notices)


def test_folder_that_is_a_file_is_a_write_error(small_project, tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(WriteError, match="out: cannot be"):
        write_outputs(small_project, tmp_path / "out", "walk")


@pytest.mark.parametrize(("name", "stem"), [("a/walk.c3d", "walk"), ("b/walk.1.trc", "walk.1"), ("w.skelgen", "w")])
def test_stem_is_the_name_without_suffix(name, stem):
    assert stem_of(name) == stem


def test_names_that_spreadsheets_would_compute_are_text_in_every_table(small_project, tmp_path):
    take = small_project.take
    odd = replace(take, names=("=HYPERLINK(1)", "+1", "-1", "@x", "\tx", *take.names[5:]))
    project = replace(small_project, take=odd, _trajectories=odd)
    write_outputs(project, tmp_path, "a", outputs=[output for output in OUTPUTS if output.suffix.endswith(".csv")])
    write_file(project, tmp_path / "a.table.csv", "table-csv")
    write_file(project, tmp_path / "a.trc", filled=True)
    for table in tmp_path.glob("*.csv"):
        with table.open(newline="") as stream:
            texts = [cell for row in csv.reader(stream) for cell in row if not is_number(cell)]
        assert texts
        assert not [text for text in texts if text.startswith(("=", "+", "-", "@", "\t"))], table.name


def is_number(text):
    """Whether a cell is a number, which may begin with a sign."""
    try:
        float(text)
    except ValueError:
        return False
    return text[:1] not in "+'"


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


@pytest.mark.parametrize("output", ["walk.trc", "walk.trc/results/first"])
def test_a_folder_that_is_a_file_is_told_before_a_run_begins(folder, capsys, output):
    assert main(["run", "walk.trc", "-o", output]) == 2
    assert capsys.readouterr().err == "skelgen: error: walk.trc: cannot be created: there is a file of this name\n"


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
    with pytest.raises(WriteError, match=r"walk\.trc is what is read"):
        export_project(skelgen.load("walk.skelgen"), find_format("trc"), folder / "walk.trc", {})
