"""Batches on a dask cluster: a scheduler and two workers on loopback, each a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import skelgen
from skelgen.app.batch.run import run_batch
from skelgen.app.batch.workers import on_cluster
from skelgen.cli import main
from skelgen.model import Trajectories

pytest.importorskip("distributed", reason="the extra skelgen-mocap[batch] is not installed")

ROOT = Path(__file__).parents[2]
OTHER_VERSION = "import skelgen\nskelgen.__version__ = '0.0.9'\n"
ENVIRONMENT = os.environ | {
    "PYTHONPATH": os.pathsep.join(str(ROOT / name) for name in (".", "gui", "formats")),
    "OMP_NUM_THREADS": "1",
}
PATIENCE = 60.0  # s until a process on a busy machine must have begun


class Cluster:
    """A scheduler and its workers, ended by the fixture."""

    def __init__(self, folder):
        self.processes = []
        self._file = folder / "scheduler.json"
        self._log = (folder / "dask.log").open("w")
        self._start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(self._file))
        self._wait(self._is_written)

    @property
    def address(self):
        return json.loads(self._file.read_text())["address"]

    def add_worker(self, *options):
        given = ("--scheduler-file", str(self._file), "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1")
        return self._start("dask_worker", *given, *options)

    def wait_for(self, n_workers):
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(n_workers, timeout=PATIENCE)

    def end(self):
        for process in reversed(self.processes):
            process.kill()
            process.wait()
        self._log.close()

    def _is_written(self):
        """Whether the scheduler has written its whole file."""
        return self._file.exists() and self._file.read_text().rstrip().endswith("}")

    def _start(self, module, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.{module}", "--no-dashboard", *arguments]
        process = subprocess.Popen(command, env=ENVIRONMENT, stdout=self._log, stderr=self._log)
        self.processes.append(process)
        return process

    def _wait(self, is_there):
        end = time.monotonic() + PATIENCE
        while not is_there():
            assert time.monotonic() < end, "the scheduler does not begin"
            time.sleep(0.05)


@pytest.fixture
def cluster(tmp_path):
    made = Cluster(tmp_path)
    yield made
    made.end()


@pytest.fixture
def waves(waving, tmp_path):
    """Twelve takes of a swinging arm."""
    for index in range(12):
        positions = waving.positions + index * np.linspace(0, 1, waving.n_frames)[:, np.newaxis, np.newaxis]
        skelgen.write(Trajectories(positions, waving.names, waving.rate), tmp_path / f"in/wave{index:02}.csm")
    return tmp_path / "in"


def batch(waves, cluster, folder):
    return ["batch", str(waves), "-o", str(folder), "--scheduler", cluster.address, "-q"]


def test_a_worker_killed_in_the_middle_costs_and_doubles_nothing(waves, cluster, tmp_path):
    first, _ = cluster.add_worker(), cluster.add_worker()
    cluster.wait_for(2)
    pool = partial(on_cluster, address=cluster.address, shared=tmp_path / "out/manifest.json")
    seen = []

    def killing(job, entries):
        for outcome in pool(job, entries):
            seen.append(outcome.record["name"])
            if len(seen) == 2:
                first.kill()
            yield outcome

    result = run_batch([waves], tmp_path / "out", pool=killing)
    assert (result.n_done, len(result.records)) == (12, 12)
    assert sorted(seen) == [f"wave{index:02}" for index in range(12)]
    again = run_batch([waves], tmp_path / "out", pool=pool, resume=True)
    assert again.n_kept == 12
    assert not list((tmp_path / "out").rglob(".skelgen-*"))


def test_a_worker_of_another_version_is_told(waves, cluster, tmp_path, capsys):
    (tmp_path / "other.py").write_text(OTHER_VERSION)
    cluster.add_worker("--preload", str(tmp_path / "other.py"))
    cluster.wait_for(1)
    assert main(batch(waves, cluster, tmp_path / "out")) == 2
    assert f"runs skelgen 0.0.9, this is {skelgen.__version__}" in capsys.readouterr().err


def test_a_scheduler_without_workers_is_told(waves, cluster, tmp_path, capsys):
    assert main(batch(waves, cluster, tmp_path / "out")) == 2
    assert "has no workers" in capsys.readouterr().err


def test_a_scheduler_that_goes_is_told_and_finished_work_kept(waves, cluster, tmp_path):
    cluster.add_worker()
    cluster.wait_for(1)
    pool = partial(on_cluster, address=cluster.address, shared=tmp_path / "out/manifest.json")

    def killing(job, entries):
        for index, outcome in enumerate(pool(job, entries)):
            if index == 1:
                cluster.end()
            yield outcome

    with pytest.raises(skelgen.SkelgenError, match=r"connection to the scheduler.*lost.*of 12 takes are finished"):
        run_batch([waves], tmp_path / "out", pool=killing)


@pytest.mark.parametrize("address", ["nonsense", "", "foo://a:1", "tls://127.0.0.1:9"])
def test_an_address_that_is_none_is_one_sentence_and_leaves_nothing(waves, tmp_path, address):
    words = [sys.executable, "-m", "skelgen", "batch", str(waves), "-o", "new/out", "--scheduler", address]
    done = subprocess.run(words, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert "there is no dask scheduler at" in done.stderr
    assert not (tmp_path / "new").exists()


def test_a_scheduler_that_is_not_there_is_told(waves, tmp_path):
    pool = partial(on_cluster, address="tcp://127.0.0.1:9", shared=tmp_path / "out/manifest.json", timeout=1.0)
    with pytest.raises(skelgen.InputError, match=r"there is no dask scheduler at tcp://127.0.0.1:9"):
        run_batch([waves], tmp_path / "out", pool=pool)
    assert not (tmp_path / "out").exists()
