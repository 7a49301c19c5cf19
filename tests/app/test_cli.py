"""The command line: exit codes, one-sentence errors, files that appear whole or not at all."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import skelgen
from skelgen.app.configuration import parameters_class
from skelgen.app.project_file.archive import open_project
from skelgen.cli import main
from skelgen.cli.options import parameter_options, reader_options, writer_options
from skelgen.cli.screen import Screen
from skelgen.model import Trajectories
from skelgen.model.project import STAGES
from skelgen.simulation import read_truth


@pytest.fixture
def done(wave, tmp_path):
    """The folder with everything that a run writes."""
    assert main(["run", wave, "-o", "out", "-q"]) == 0
    return tmp_path / "out"


def names_in(folder):
    return sorted(file.name for file in folder.iterdir())


SUFFIXES = "angles.csv costs.txt html joints.csv json labels.c3d limbs.csv raw-joints.c3d skelgen tree.txt xaf xml xsf"
ALL_FILES = [f"wave.{suffix}" for suffix in SUFFIXES.split()]


class TestRunning:
    def test_run_writes_every_file(self, done):
        assert names_in(done) == ALL_FILES

    def test_results_open_in_other_readers(self, done):
        assert skelgen.read(done / "wave.labels.c3d").names == tuple("abcdef")
        assert skelgen.read(done / "wave.raw-joints.c3d").names == ("limb0-limb1",)

    def test_json_is_one_object_and_nothing_else(self, wave, capsys):
        assert main(["run", wave, "--json"]) == 0
        out, err = capsys.readouterr()
        data = json.loads(out)
        assert [row["limb"] for row in data["limbs"]] == [0, 1]
        assert len(data["files"]) == len(ALL_FILES)
        assert err == ""

    def test_quiet_run_says_nothing_on_stderr(self, wave, capsys):
        main(["run", wave, "--quiet"])
        assert capsys.readouterr().err == ""

    def test_stage_by_stage_gives_what_run_gives(self, wave, done, tmp_path):
        main(["labels", wave, "-o", "steps", "-q"])
        for command in ("limbs", "joints", "skeleton"):
            assert main([command, "steps/wave.skelgen", "-q"]) == 0
        assert names_in(tmp_path / "steps") == ALL_FILES
        whole, steps = (open_project(tmp_path / folder / "wave.skelgen") for folder in ("out", "steps"))
        np.testing.assert_array_equal(whole.motion.world_from_limb, steps.motion.world_from_limb)

    def test_stages_without_paths_use_the_configured_names(self, waving, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        skelgen.write(waving, tmp_path / "take.mfml")
        for command in ("labels", "limbs", "joints", "skeleton"):
            assert main([command, "-q"]) == 0
        found = names_in(tmp_path)
        assert {"labels.skelgen", "limbs.skelgen", "joints.skelgen", "result.skelgen", "result.xml"} <= set(found)

    def test_stage_option_reaches_the_stage(self, wave, tmp_path):
        main(["run", wave, "-o", "out", "-q", "--until", "limbs"])
        assert main(["joints", "out", "--alpha", "0.25", "-q"]) == 0
        assert open_project(tmp_path / "out" / "wave.skelgen").topology.alpha == 0.25

    def test_set_reaches_the_stage(self, wave, tmp_path):
        assert main(["run", wave, "-o", "out", "-q", "--set", "joints.alpha=0.75"]) == 0
        assert open_project(tmp_path / "out" / "wave.skelgen").topology.alpha == 0.75

    def test_run_from_a_stage_keeps_what_was_before(self, wave, tmp_path):
        main(["run", wave, "-o", "out", "-q", "--n-limbs", "3", "--until", "limbs"])
        assert main(["run", "out/wave.skelgen", "-q", "--from", "joints", "--until", "joints"]) == 0
        assert open_project(tmp_path / "out" / "wave.skelgen").limbs.n_limbs == 3

    def test_run_takes_the_number_of_bodies(self, wave, capsys):
        assert main(["run", wave, "-o", "out", "-q", "--n-bodies", "2", "--until", "limbs"]) == 2
        assert "2 bodies were asked for, but only 1 can be told apart" in capsys.readouterr().err

    def test_seed_is_kept_in_the_project(self, wave, tmp_path):
        main(["run", wave, "-o", "out", "-q", "--seed", "11"])
        main(["skeleton", "out", "-q"])
        assert open_project(tmp_path / "out" / "wave.skelgen").seed == 11

    def test_info_shows_format_and_gaps(self, wave, capsys):
        assert main(["info", wave, "--json"]) == 0
        data = json.loads(capsys.readouterr().out)
        assert data["format"] == "csm"
        assert data["columns"][0] == {"name": "a", "seen": 20, "gaps": 0, "longest_gap": 0}

    def test_info_of_bodies_calls_them_so(self, tmp_path, capsys):
        titles = ",".join(f"{name}_{axis}" for name in ("a", "b") for axis in ("x", "y", "z", "roll", "pitch", "yaw"))
        (tmp_path / "bodies.csv").write_text(titles + "\n" + "1,2,3,0,0,0,4,5,6,0,0,90\n" * 3)
        assert main(["info", str(tmp_path / "bodies.csv")]) == 0
        shown = capsys.readouterr().out
        assert "Bodies" in shown and "Markers" not in shown

    def test_info_counts_a_large_file_and_reads_a_sample_of_it(self, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        positions = np.zeros((40_000, 20, 3)) + np.arange(1, 61).reshape(20, 3)
        positions[:10_000, 3] = np.nan
        np.savez("take.npz", positions=positions, names=np.array([f"m{k}" for k in range(20)]), rate=100.0, unit="mm")
        assert main(["info", "take.npz", "--json"]) == 0
        data = json.loads(capsys.readouterr().out)
        assert (data["take"]["frames"], data["take"]["count"], data["take"]["seconds"]) == (40_000, 20, 399.99)
        assert data["take"]["sampled_frames"] == 2000
        assert data["columns"][3]["seen"] == pytest.approx(30_000, abs=20)
        assert data["columns"][3]["gaps"] is None
        assert main(["info", "take.npz", "--full", "--json"]) == 0
        data = json.loads(capsys.readouterr().out)
        assert data["columns"][3] == {"name": "m3", "seen": 30_000, "gaps": 1, "longest_gap": 10_000}

    def test_info_of_a_project_shows_its_results(self, done, capsys):
        capsys.readouterr()
        assert main(["info", str(done / "wave.skelgen")]) == 0
        shown = capsys.readouterr().out
        assert "limb0-limb1" in shown and "…" not in shown

    def test_report_goes_beside_the_project(self, done):
        (done / "wave.html").unlink()
        assert main(["report", "out", "-q"]) == 0
        assert (done / "wave.html").exists()

    def test_interrupted_run_leaves_what_was_there(self, wave, tmp_path, monkeypatch):
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / "wave.skelgen").write_text("precious")

        def interrupt(self, target):
            raise KeyboardInterrupt

        monkeypatch.setattr(Path, "replace", interrupt)
        assert main(["run", wave, "-o", "out", "-q"]) == 130
        assert names_in(tmp_path / "out") == ["wave.skelgen"]
        assert (tmp_path / "out" / "wave.skelgen").read_text() == "precious"

    @pytest.mark.parametrize("command", ["limbs", "cluster"])
    def test_limbs_are_found_from_a_take_with_names(self, wave, tmp_path, command):
        assert main([command, str(wave), "--output", str(tmp_path / command), "--quiet"]) == 0
        assert any(name.endswith(".limbs.csv") for name in names_in(tmp_path / command))

    def test_former_names_of_commands_still_work(self, wave, tmp_path, capsys):
        main(["label", wave, "-o", "out", "-q"])
        for command in ("cluster", "joints", "fit"):
            assert main([command, "out", "-q"]) == 0
        assert open_project(tmp_path / "out" / "wave.skelgen").has("skeleton")
        main(["--help"])
        assert "cluster" not in capsys.readouterr().out

    def test_every_parameter_is_listed(self, capsys):
        assert main(["config", "--json"]) == 0
        rows = json.loads(capsys.readouterr().out)["parameters"]
        assert {"stage": "joints", "name": "alpha"}.items() <= next(r for r in rows if r["name"] == "alpha").items()

    def test_declared_parameter_is_in_the_help(self, capsys, monkeypatch):
        monkeypatch.setenv("COLUMNS", "200")
        assert main(["joints", "--help"]) == 0
        out = capsys.readouterr().out
        assert "--alpha" in out
        assert "; ALPHA in config.xml" in out


def test_convert_keeps_markers(wave, waving, tmp_path):
    assert main(["convert", wave, "wave.trc", "-q"]) == 0
    np.testing.assert_allclose(skelgen.read(tmp_path / "wave.trc").positions, waving.positions, atol=1e-3)


def test_convert_says_what_the_format_cannot_hold(small_project, tmp_path, capsys):
    skelgen.write(small_project, tmp_path / "walk.skelgen")
    source = str(tmp_path / "walk.skelgen")
    assert main(["convert", source, str(tmp_path / "walk.bvh"), "--unit", "cm"]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "BVH cannot hold" in said
    assert "lengths are in cm" in said
    assert main(["convert", source, str(tmp_path / "copy.skelgen")]) == 0
    assert "cannot hold" not in capsys.readouterr().err


def test_convert_repeats_no_note_of_the_reader_of_a_project(small_project, tmp_path, capsys):
    noted = replace(small_project, take=replace(small_project.take, notices=("read with a guess",)))
    skelgen.write(noted, tmp_path / "noted.skelgen")
    assert main(["convert", str(tmp_path / "noted.skelgen"), str(tmp_path / "noted.bvh")]) == 0
    assert "BVH cannot hold" in (said := capsys.readouterr().err) and "read with a guess" not in said


def test_a_stage_repeats_no_note_of_the_reader_of_a_project(waving, tmp_path, capsys):
    noted = replace(waving, notices=("read with a guess",))
    skelgen.write(skelgen.reconstruct(noted, until="labels"), tmp_path / "noted.skelgen")
    assert main(["limbs", str(tmp_path / "noted.skelgen")]) == 0
    assert "read with a guess" not in capsys.readouterr().err


def test_convert_gives_options_of_both_sides_to_the_file_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    take = skelgen.simulate("rods", n_frames=20, labelled=False).take
    skelgen.write(take, "us.mfml")
    assert main(["convert", "us.mfml", "ms.mfml", "--timestamp-unit", "ms", "--id-width", "4", "-q"]) == 0
    assert skelgen.read("ms.mfml", timestamp_unit="ms").rate == pytest.approx(take.rate)
    back = ["convert", "ms.mfml", "us2.mfml", "--reading", "timestamp-unit=ms", "-q"]
    assert main(back) == 0
    assert skelgen.read("us2.mfml").rate == pytest.approx(take.rate)
    assert main([*back[:-2], "ms", "-q"]) == 2
    assert "name=value" in capsys.readouterr().err


def test_convert_writes_dropouts_of_csm_as_it_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    skelgen.write(skelgen.simulate("rods", n_frames=20, dropouts=0.3).take, "words.csm")
    assert main(["convert", "words.csm", "zeros.csm", "--dropout", "zero", "-q"]) == 0
    assert "DROPOUT" not in (tmp_path / "zeros.csm").read_text()


def test_convert_says_that_labels_are_lost(wave, tmp_path, capsys):
    assert main(["convert", wave, "wave.mfml"]) == 0
    assert "cannot hold the names of the markers" in " ".join(capsys.readouterr().err.split())


def test_convert_refuses_a_format_that_cannot_hold_it(wave, tmp_path, capsys):
    assert main(["convert", wave, "wave.xsf"]) == 2
    assert "skelgen: error:" in capsys.readouterr().err
    assert names_in(tmp_path) == [wave]


def test_a_motion_that_is_no_file_and_unknown_is_refused_with_those_known(tmp_path, capsys):
    assert main(["simulate", "--motion", "hop", "-o", str(tmp_path / "hop.c3d")]) != 0
    assert "neither a file nor one of walk, run, squat, reach, jump" in capsys.readouterr().err.replace("\n", " ")


def test_simulated_take_and_truth_lie_side_by_side(tmp_path):
    assert main(["simulate", "rods", "-o", str(tmp_path / "r.trc"), "--n-frames", "20", "--noise", "0.5", "-q"]) == 0
    assert names_in(tmp_path) == ["r.trc", "r.truth.npz"]


def test_take_in_a_format_without_names_is_simulated_without_labels(tmp_path, capsys):
    take, words = tmp_path / "r.mfml", ["-o", str(tmp_path / "r.mfml"), "--n-frames", "20", "-q", "--overwrite"]
    assert main(["simulate", "rods", *words]) == 0
    assert len(read_truth(tmp_path / "r.truth.npz").marker_of_point) == len(skelgen.read(take).points)
    assert main(["simulate", "rods", "--labelled", *words]) == 2
    assert "r.mfml holds points without labels" in capsys.readouterr().err


def test_formats_are_listed(capsys):
    assert main(["formats", "--json"]) == 0
    names = [row["name"] for row in json.loads(capsys.readouterr().out)["formats"]]
    assert {"c3d", "csm", "mfml", "skelgen"} <= set(names)


def test_duplicate_label_is_read_with_a_note(wave, tmp_path, capsys):
    lines = (tmp_path / wave).read_text().splitlines()
    order = next(index for index, line in enumerate(lines) if line.lower().startswith("$order")) + 1
    lines[order] = lines[order].replace("b", "a")
    (tmp_path / wave).write_text("\n".join(lines))
    assert main(["info", wave]) == 0
    told = capsys.readouterr()
    assert "a_2" in told.out + told.err


def test_help_and_version_exit_with_0(capsys):
    assert main(["--help"]) == 0
    assert main([]) == 0
    assert "Exit codes" in capsys.readouterr().out
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"skelgen {skelgen.__version__}\n"


def test_help_loads_nothing_heavy():
    heavy = ("scipy", "sklearn", "numba", "matplotlib", "ezc3d", "lxml")
    code = (
        f"import sys; from skelgen.cli import main; main(['--help']); print([m for m in {heavy} if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip().endswith("[]")


def test_help_tells_all_formats_and_choices_of_an_option_that_formats_share():
    axes = next(option for option in writer_options() if option.name == "axes").default
    assert "z-to-y" in axes.help and "auto" in axes.help and "bvh" in axes.help and "opensim" in axes.help


@pytest.mark.parametrize("stage", STAGES)
def test_no_stage_parameter_hides_a_reader_option(stage):
    declared = {option.name for option in parameter_options(parameters_class(stage))}
    assert not declared & {option.name for option in reader_options()}


def test_names_tell_the_terminal_nothing(waving, tmp_path, capsys):
    path = tmp_path / "\x1b]0;a\nb.csm"
    odd = Trajectories(waving.positions, ("\x1b[31mred", *waving.names[1:]), waving.rate)
    skelgen.write(odd, path)
    assert main(["info", str(path)]) == 0
    assert main(["convert", str(path), str(tmp_path / "\x1b[2J.trc")]) == 0
    printed = "".join(capsys.readouterr())
    assert "?[31mred" in printed and "\x1b" not in printed


def test_tables_show_no_digit_that_nothing_measures(capsys):
    Screen(quiet=False).table("Lengths", [{"length_mm": 425.57312, "turn_deg": -0.123456, "error_mm": 1e-12}])
    assert capsys.readouterr().out.splitlines()[-2].split()[1::2] == ["426", "-0.123", "0"]
