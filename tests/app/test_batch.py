"""Batches: records that make a take finished, workers that die, outputs that cannot be written."""

from __future__ import annotations

import errno
import hashlib
import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from unittest.mock import ANY

import numpy as np
import pytest

import skelgen
from skelgen.app.batch import work
from skelgen.app.batch.records import finished_record, manifest_of
from skelgen.app.batch.run import read_manifest, result_rows, run_batch, write_page
from skelgen.app.batch.takes import find_entries
from skelgen.app.batch.work import Job
from skelgen.app.batch.workers import in_processes
from skelgen.app.project_file.archive import open_project
from skelgen.app.stage_summary import has_doubts
from skelgen.cli import main
from skelgen.errors import InputError, ParameterError, WriteError
from skelgen.model import Trajectories
from skelgen.model.project import STAGES

ROOT = Path(__file__).parents[2]


@pytest.fixture
def waves(waving, tmp_path, monkeypatch):
    """Four takes of a swinging arm in the folder ``in``, each a little slower, and one file that is none."""
    monkeypatch.chdir(tmp_path)
    for index in range(4):
        still, turned = waving.positions[:, :3], waving.positions[:, 3:]
        positions = np.concatenate([still, turned[:: index % 2 * 2 - 1] + index], axis=1)
        skelgen.write(Trajectories(positions, waving.names, waving.rate), f"in/wave{index}.csm")
    Path("in/wave2b.c3d").write_bytes(b"\x01\x50 not much of a recording")
    return tmp_path / "in"


def here(job, entries):
    """A pool without processes."""
    for entry in entries:
        yield work.work_on(entry, job)


def contents(folder):
    """Bytes of every file by its place, records and manifest without what tells how a run went."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix == ".json":
            data = json.loads(path.read_text())
            for record in (data, *data.get("takes", ())):
                record.pop("run", None)
            found[path.relative_to(folder)] = data
        elif path.is_file():
            found[path.relative_to(folder)] = path.read_bytes()
    return found


def test_results_are_no_takes(waves, tmp_path):
    main(["run", str(waves / "wave0.csm"), "-o", str(waves), "-q"])
    run_batch([waves / "wave1.csm"], waves / "earlier", pool=here)
    assert [entry.name for entry in find_entries([waves], tmp_path / "out")] == [
        "wave0", "wave1", "wave2", "wave2b", "wave3"
    ]  # fmt: skip


class TestOutcome:
    def test_a_broken_take_stops_nothing(self, waves, tmp_path):
        result = run_batch([waves], tmp_path / "out", pool=here)
        assert [record["outcome"] for record in result.records] == ["done", "done", "done", "failed", "done"]
        assert "wave2b.c3d" in result.failed[0]["error"]
        assert open_project(tmp_path / "out/wave3/wave3.skelgen").has("skeleton")

    def test_what_is_doubtful_is_said_beside_done(self, tmp_path):
        skelgen.write(skelgen.simulate("human", n_frames=30, motion="walk", noise=1.0).take, tmp_path / "walk.c3d")
        result = run_batch([tmp_path / "walk.c3d"], tmp_path / "out", pool=here)
        project = open_project(tmp_path / "out/walk/walk.skelgen")
        doubtful = [stage for stage in STAGES if has_doubts(project, stage)]
        assert "skeleton" in doubtful
        assert [row.outcome for row in result_rows(result)] == [f"done, doubtful: {', '.join(doubtful)}"]

    def test_a_bug_stops_nothing(self, waves, tmp_path):
        wrong = Job(reader_options=3)  # no mapping, which no check expects
        result = run_batch([waves / "wave*.csm"], tmp_path / "out", wrong, pool=here)
        assert len(result.failed) == 4
        assert all(record["error"].startswith("internal error: ") for record in result.failed)

    def test_the_page_has_a_row_and_a_picture_for_each_take(self, waves, tmp_path):
        page = run_batch([waves], tmp_path / "out", pool=here).page.read_text()
        assert page.count("<img") == 4
        assert 'src="wave0/wave0.svg"' in page
        assert page.count("<tr>") == 6
        assert (tmp_path / "out/wave0/wave0.svg").read_text().startswith("<svg")

    def test_the_manifest_has_checksums_of_all_files(self, waves, tmp_path):
        manifest = json.loads(run_batch([waves], tmp_path / "out", pool=here).manifest.read_text())
        assert manifest["counts"] == {"done": 4, "failed": 1, "waiting": 0}
        record = manifest["takes"][0]
        names = {path.name for path in (tmp_path / "out/wave0").iterdir()}
        assert set(record["files"]) == names - {"take.json"}
        assert all(len(facts["sha256"]) == 64 for facts in (record["source"], *record["files"].values()))

    def test_further_formats_and_the_report_are_written_on_demand(self, waves, tmp_path):
        job = Job(formats=("trc", "report"))
        run_batch([waves / "wave0.csm"], tmp_path / "out", job, pool=here)
        assert {"wave0.trc", "wave0.html"} <= {path.name for path in (tmp_path / "out/wave0").iterdir()}
        page = (tmp_path / "out/index.html").read_text(encoding="utf-8")
        assert '<a href="wave0/wave0.html#play" title="play"><img' in page
        assert '<section id="play">' in (tmp_path / "out/wave0/wave0.html").read_text(encoding="utf-8")

    @pytest.mark.parametrize(("arguments", "code"), [(["in"], 3), (["in/wave2b.c3d"], 2), (["in/wave0.csm"], 0)])
    def test_exit_codes_tell_how_it_went(self, waves, arguments, code, capsys):
        assert main(["batch", *arguments, "-o", "out", "-q"]) == code
        assert ("wave2b" in capsys.readouterr().out) == (code != 0)

    @pytest.mark.parametrize(
        ("options", "word"),
        [(["--to", "nonsense"], "nonsense"), (["--until", "nothing"], "nothing"), (["--set", "joints.x=1"], "'x'")],
    )
    def test_bad_options_are_told_before_any_take(self, waves, options, word, capsys):
        assert main(["batch", str(waves), "-o", "out", *options]) == 2
        assert word in capsys.readouterr().err
        assert not Path("out").exists()


ODD = (None, [], {}, "", "x", -1, 0.5, 10**400, float("nan"), float("inf"), [[]], {"a": 1}, True, [3])
"""What no fact of a record is, or not in most places."""


class TestResume:
    def test_a_finished_batch_is_kept_whole(self, waves, tmp_path):
        first = run_batch([waves / "wave*.csm"], tmp_path / "out", pool=here)
        before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out/wave0").iterdir()}
        again = run_batch([waves / "wave*.csm"], tmp_path / "out", pool=here, resume=True)
        assert (first.n_kept, again.n_kept, again.n_done) == (0, 4, 4)
        assert before == {path: path.stat().st_mtime_ns for path in (tmp_path / "out/wave0").iterdir()}

    def test_without_resume_a_batch_is_not_touched(self, waves, tmp_path):
        run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here)
        with pytest.raises(InputError, match="--resume"):
            run_batch([waves], tmp_path / "out", pool=here)

    @pytest.mark.parametrize("harm", ["record", "file", "missing", "source", "cut record"])
    def test_what_is_harmed_is_done_again(self, waves, tmp_path, harm):
        run_batch([waves / "wave*.csm"], tmp_path / "out", pool=here)
        whole = contents(tmp_path / "out")
        folder = tmp_path / "out/wave1"
        if harm == "record":
            (folder / "take.json").unlink()
        elif harm == "cut record":
            (folder / "take.json").write_text((folder / "take.json").read_text()[:300])
        elif harm == "file":
            (folder / "wave1.joints.csv").write_text("half")
        elif harm == "missing":
            (folder / "wave1.skelgen").unlink()
        else:
            whole.clear()
            skelgen.write(skelgen.read(waves / "wave2.csm"), waves / "wave1.csm")
        result = run_batch([waves / "wave*.csm"], tmp_path / "out", pool=here, resume=True)
        assert (result.n_kept, result.n_done) == (3, 4)
        assert not whole or contents(tmp_path / "out") == whole

    def test_another_job_is_done_again_and_leaves_no_old_file(self, waves, tmp_path):
        run_batch([waves / "wave0.csm"], tmp_path / "out", Job(formats=("trc",)), pool=here)
        result = run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here, resume=True)
        assert result.n_kept == 0
        assert not (tmp_path / "out/wave0/wave0.trc").exists()

    def test_what_a_killed_run_left_is_taken_away(self, waves, tmp_path):
        run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here)
        whole = contents(tmp_path / "out")
        for place in ("out/wave0/.skelgen-abc", "out/.skelgen-def"):
            (tmp_path / place).mkdir()
            (tmp_path / place / "half.c3d").write_text("x")
        (tmp_path / "out/wave0/.skelgen-take.json.xyz.json").write_text("{")
        run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here, resume=True)
        assert contents(tmp_path / "out") == whole
        assert not list((tmp_path / "out").rglob(".skelgen-*"))

    def test_records_of_another_version_are_not_believed(self, waves, tmp_path):
        run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here)
        record = json.loads((tmp_path / "out/wave0/take.json").read_text())
        [entry] = find_entries([waves / "wave0.csm"], tmp_path / "out")
        for version, expected in ((skelgen.__version__, record), ("0.0.9", None)):
            blank = work.blank_record(entry, Job(version=version)) | {"source": record["source"]}
            assert finished_record(tmp_path / "out/wave0", blank) == expected

    def test_no_altered_record_blocks_what_follows(self, waves, tmp_path):
        [record] = run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here).records
        [entry] = find_entries([waves / "wave0.csm"], tmp_path / "out")
        blank = work.blank_record(entry, Job()) | {"source": record["source"]}
        altered = [record | {name: value} for name in record for value in ODD]
        for part in ("facts", "source"):
            altered += [record | {part: record[part] | {name: value}} for name in record[part] for value in ODD]
        for one in altered:
            (tmp_path / "out/wave0/take.json").write_text(json.dumps(one))
            found = finished_record(tmp_path / "out/wave0", blank)
            assert found is None or found | {"facts": ANY, "run": ANY} == record | {"facts": ANY, "run": ANY}
            write_page(manifest_of({}, [found or record]), tmp_path / "page.html")

    @pytest.mark.parametrize("name", ["..", "", ".", "folder", "a\0b", "/etc/passwd", "../../in/wave1.csm"])
    def test_a_record_of_files_that_are_none_takes_nothing_away(self, waves, tmp_path, name):
        [record] = run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here).records
        (tmp_path / "out/wave0/folder").mkdir()
        (tmp_path / "out/wave0/take.json").write_text(json.dumps(record | {"files": {name: {}}}))
        result = run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here, resume=True)
        assert (result.n_kept, result.n_done) == (0, 1)
        assert (waves / "wave1.csm").exists()

    @pytest.mark.parametrize(
        "name", ["../wave0", "/tmp/wave0", "a/../../b", "..", "", ".", "a//b", "a\0b", 3, None, [1]]
    )
    def test_a_manifest_that_leads_out_of_the_folder_is_refused(self, waves, tmp_path, name):
        run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here)
        manifest = read_manifest(tmp_path / "out")
        manifest["takes"][0]["name"] = name
        (tmp_path / "out/manifest.json").write_text(json.dumps(manifest))
        before = contents(tmp_path)
        with pytest.raises(InputError, match="somebody altered the manifest"):
            run_batch([waves / "wave0.csm"], tmp_path / "out", pool=here, resume=True)
        assert contents(tmp_path) == before

    def test_two_takes_that_a_manifest_calls_alike_are_both_done(self, waves, tmp_path):
        run_batch([waves / "wave0.csm", waves / "wave1.csm"], tmp_path / "out", pool=here)
        manifest = read_manifest(tmp_path / "out")
        manifest["takes"][1]["name"] = "Wave0"
        (tmp_path / "out/manifest.json").write_text(json.dumps(manifest))
        result = run_batch([waves / "wave0.csm", waves / "wave1.csm"], tmp_path / "out", pool=here, resume=True)
        assert [record["name"] for record in result.records] == ["wave0", "wave1"]
        assert result.n_kept == 2

    def test_batches_of_version_0_1_0_are_continued(self):
        options = dict.fromkeys(("n_markers", "n_limbs", "hierarchy", "root")) | {"n_jobs": 1}
        facts = dict.fromkeys(("seed", "until", "format_name", "skeleton"))
        before = facts | {"settings": {}, "reader_options": {}, "wishes": options, "formats": ()}
        text = json.dumps(before | {"version": skelgen.__version__}, sort_keys=True)
        assert Job().fingerprint == hashlib.sha256(text.encode()).hexdigest()
        assert Job().as_mapping()["options"] == options


class TestWriting:
    def test_a_full_disk_stops_the_batch_and_keeps_what_is_finished(self, waves, tmp_path, monkeypatch):
        whole = Path.replace

        def full(self, target):
            if "wave2" in str(target):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return whole(self, target)

        monkeypatch.setattr(Path, "replace", full)
        with pytest.raises(WriteError, match=r"No space left.*2 of 4 takes are finished and kept.*--resume"):
            run_batch([waves / "wave*.csm"], tmp_path / "out", pool=here)
        monkeypatch.undo()
        assert not list((tmp_path / "out").rglob(".skelgen-*"))
        assert run_batch([waves / "wave*.csm"], tmp_path / "out", pool=here, resume=True).n_kept == 2

    def test_an_output_that_cannot_be_written_is_told(self, waves, tmp_path, capsys):
        (tmp_path / "file").write_text("in the way")
        assert main(["batch", str(waves), "-o", str(tmp_path / "file" / "out")]) == 2
        assert "cannot be written" in capsys.readouterr().err

    def test_a_worker_of_another_version_stops_the_batch(self, waves, tmp_path):
        with pytest.raises(WriteError, match=r"runs skelgen 0.1.0, the batch 0.0.9"):
            run_batch([waves], tmp_path / "out", Job(version="0.0.9"), pool=here)


class TestProcesses:
    def test_two_processes_give_the_same_as_none(self, waves, tmp_path):
        two = run_batch([waves], tmp_path / "two", pool=partial(in_processes, n_workers=2))
        run_batch([waves], tmp_path / "none", pool=here)
        assert two.n_done == 4
        assert contents(tmp_path / "two") == contents(tmp_path / "none")

    def test_a_take_whose_worker_dies_again_and_again_fails_alone(self, waves, tmp_path):
        job = Job(until=Deadly("limbs"))
        result = run_batch([waves / "wave0.csm", waves / "wave2b.c3d"], tmp_path / "out", job, pool=in_processes)
        assert [record["outcome"] for record in result.records] == ["failed", "failed"]
        assert "signal 9" in result.records[0]["error"]

    def test_no_more_processes_are_started_than_there_are_takes(self, waves, tmp_path):
        entries = find_entries([waves / "wave0.csm"], tmp_path / "out")
        outcomes = in_processes(Job(), entries, n_workers=50)
        assert next(outcomes).record["outcome"] == "done"
        assert len(multiprocessing.active_children()) <= 1
        outcomes.close()

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names")
    def test_a_pipe_is_no_take(self, waves, tmp_path):
        os.mkfifo(tmp_path / "pipe.c3d")
        result = run_batch([tmp_path / "pipe.c3d"], tmp_path / "out", pool=here)
        assert "pipe" in result.failed[0]["error"]

    def test_a_take_that_hangs_is_given_up_alone(self, waves, tmp_path):
        paths = [waves / "wave0.csm", waves / "wave1.csm"]
        pool = partial(in_processes, timeout=1.0)
        hanging = run_batch(paths, tmp_path / "out", Job(until=Hanging("limbs")), pool=pool)
        assert [record["error"] for record in hanging.records] == ["it was not done after 1 s (--timeout)"] * 2
        assert read_manifest(tmp_path / "out")["counts"] == {"done": 0, "failed": 2, "waiting": 0}
        assert not list((tmp_path / "out").rglob(".skelgen-*"))

    @pytest.mark.parametrize("timeout", [0.0, -1.0, math.nan, math.inf])
    def test_a_time_that_is_none_is_told_before_any_take(self, waves, tmp_path, timeout):
        with pytest.raises(ParameterError, match="--timeout"):
            skelgen.run_batch([waves], tmp_path / "out", timeout=timeout)
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize("n_workers", [0, -1, 1.5])
    def test_a_number_of_processes_that_is_none_is_told_before_any_take(self, waves, tmp_path, n_workers):
        with pytest.raises(ParameterError, match="n_workers is"):
            skelgen.run_batch([waves], tmp_path / "out", n_workers=n_workers)
        assert not (tmp_path / "out").exists()


class Hanging(str):
    """The name of a stage at which the process that looks it up never arrives."""

    __slots__ = ()
    __hash__ = None

    def __eq__(self, other):
        while multiprocessing.parent_process() is not None:
            time.sleep(1)
        return str(self) == other


class Deadly(str):
    """The name of a stage that kills the process that looks it up."""

    __slots__ = ()
    __hash__ = None

    def __eq__(self, other):
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_script_whose_workers_start_it_again_is_told_so(waves, tmp_path):
    script = tmp_path / "script.py"
    script.write_text("import skelgen\nskelgen.run_batch(['in/wave0.csm'], 'out')\n")
    command = [sys.executable, script]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300, check=False)
    assert 'below `if __name__ == "__main__":`' in ended.stderr.splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_killed_at_any_moment_and_resumed_gives_the_same(waves, tmp_path):
    command = [sys.executable, "-m", "skelgen", "batch", str(waves), "-q", "--resume", "--jobs", "2", "-o"]
    paths = {"PYTHONPATH": os.pathsep.join(str(ROOT / name) for name in (".", "gui", "formats"))}
    environment = os.environ | paths
    began = time.monotonic()
    assert subprocess.run([*command, "whole"], env=environment, check=False, capture_output=True).returncode == 3
    seconds = time.monotonic() - began
    for share in (0.6, 0.8, 0.9):
        process = subprocess.Popen([*command, "killed"], env=environment, stdout=subprocess.DEVNULL)
        time.sleep(share * seconds)
        process.kill()
        process.wait()
    assert subprocess.run([*command, "killed"], env=environment, check=False, capture_output=True).returncode == 3
    found, wanted = contents(tmp_path / "killed"), contents(tmp_path / "whole")
    assert sorted(found) == sorted(wanted)
    assert [path for path in wanted if found[path] != wanted[path]] == []
