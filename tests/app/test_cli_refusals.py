"""Refusals of the command line: one sentence and an exit code, and no file that was not there before."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import skelgen
from skelgen.app.configuration import write_defaults
from skelgen.cli import main
from skelgen.model import Trajectories


def bad_files(waving):
    """Each way of being bad: file name and content, or a take to be written."""
    positions = waving.positions
    return {
        "empty": ("bad.c3d", b""),
        "wrong magic": ("bad.c3d", b"GIF89a" * 200),
        "unknown": ("bad.xyz", b"\x00\x01\x02 nothing that anybody knows"),
        "truncated": ("bad.skelgen", b"PK\x03\x04" + bytes(300)),
        "binary nonsense": ("bad.mfml", b"\xff" * 500),
        "nothing seen": ("bad.csm", Trajectories(positions * np.nan, waving.names, 50.0)),
        "one marker": ("bad.csm", Trajectories(positions[:, 3:4], ("a",), 50.0)),
        "two frames": ("bad.csm", Trajectories(positions[:2], waving.names, 50.0)),
        "no motion": ("bad.trc", Trajectories(np.tile(positions[:1], (9, 1, 1)), waving.names, 50.0)),
    }


@pytest.fixture(params=list(bad_files(Trajectories(np.zeros((3, 6, 3)), tuple("abcdef"), 1.0))))
def bad_file(request, waving, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name, content = bad_files(waving)[request.param]
    if isinstance(content, bytes):
        (tmp_path / name).write_bytes(content)
    else:
        skelgen.write(content, tmp_path / name)
    return name


def test_bad_file_is_one_sentence_with_its_name_and_exit_code_2(bad_file, tmp_path, capsys):
    assert main(["run", bad_file, "-o", "out", "-q"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("skelgen: error: ")
    assert bad_file in err
    assert err.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == [bad_file]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run"], "Missing argument 'TAKE'; `skelgen run --help`"),
        (["run", "a.c3d", "--n-limbs", "0"], "`skelgen run --help`"),
        (["calibrate", "stereo"], "`skelgen calibrate stereo --help`"),
        (["calibrate"], "Missing command; `skelgen calibrate --help`"),
        (["walk"], "`skelgen --help`"),
    ],
)
def test_wrong_usage_names_the_help_of_its_command(words, said, capsys):
    assert main(words) == 2
    assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    "words",
    [
        ["walk"],
        ["run"],
        ["run", "absent.c3d"],
        ["run", "absent.c3d", "--jobs", "0"],
        ["run", "absent.c3d", "--set", "joints"],
        ["info", "x" * 300],
        ["report", "x" * 300],
        ["simulate", "octopus", "-o", "a.c3d"],
        ["simulate", "rods", "-o", "a.c3d", "--seed", "-1"],
        ["simulate", "rods", "-o", ".", "--n-frames", "5"],
        ["simulate", "rods", "-o", "a.unknown", "--n-frames", "5"],
        ["evaluate", ".", "absent.npz"],
        ["config", "absent.xml"],
    ],
    ids=" ".join,
)
def test_wrong_usage_is_one_sentence_and_exit_code_2(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    err = capsys.readouterr().err
    assert err.startswith("skelgen: error: ")
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_bug_is_one_sentence_and_exit_code_1(tmp_path):
    (tmp_path / "lxml").mkdir()
    (tmp_path / "lxml" / "__init__.py").write_text("1 / 0\n")
    roots = os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", "")))
    write_defaults(tmp_path / "config.xml")
    command = [sys.executable, "-m", "skelgen", "run", "walk.c3d", "--config", str(tmp_path / "config.xml")]
    result = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": roots}, capture_output=True, text=True, check=False
    )
    assert result.returncode == 1
    assert result.stderr.startswith("skelgen: internal error: ZeroDivisionError")
    assert result.stderr.count("\n") == 1


MEMORY = 900 * 2**20  # bytes of address space: enough to start, not enough for the file below


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit memory so")
def test_memory_that_does_not_suffice_is_told_as_that(waving, tmp_path):
    path = skelgen.write(waving, tmp_path / "long.c3d")[0]
    content, n_frames = bytearray(path.read_bytes()), 2**27 // waving.n_markers
    stated = content.index(b"ACTUAL_END_FIELD") + len("ACTUAL_END_FIELD") + 5
    content[stated : stated + 4] = n_frames.to_bytes(4, "little")
    path.write_bytes(content)
    os.truncate(path, 2**31 + 2**20)  # takes no place on most disks
    code = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({MEMORY}, {MEMORY}))\n"
    code += f"import sys; from skelgen.cli import main; sys.exit(main(['info', '--full', {str(path)!r}]))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr.count("\n")) == (2, 1), result.stderr
    assert "the memory of this computer does not suffice" in result.stderr


def test_long_error_loses_its_middle(tmp_path, capsys):
    path = tmp_path / ("w" * 200 + ".trc")
    path.write_text("PathFileType\t4\n" + "\t".join(f"key{number}" for number in range(999)) + "\n\n\n\n")
    assert main(["info", str(path)]) == 2
    sentence = capsys.readouterr().err.strip().removeprefix(f"skelgen: error: {path}")
    assert len(sentence) <= 310
    assert "does not name" in sentence or "where the line above names" in sentence
