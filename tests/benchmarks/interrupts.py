"""Kill, terminate and interrupt commands at random moments: ``python tests/benchmarks/interrupts.py``.

Each trial starts a command in an empty folder and sends it a signal at a moment that the seed chooses: SIGKILL,
SIGTERM, or SIGINT to the process, to its whole group as Ctrl-C does, or twice. Then every file must end as that of the
undisturbed command, and be readable; but for SIGKILL nothing temporary may be left, the exit code must be that of
docs/cli.md, and the error output without a traceback. No process may be left at all.

Before the program has loaded its first line (some 0.05 s), Python answers signals, as in every program that it runs:
such trials are counted apart, and only files and processes are looked at.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import skelgen
from skelgen.simulation import simulate

ROOT = Path(__file__).parents[2]
WORDS = ("Traceback", "Exception ignored", "resource_tracker", "Error:", "Fatal Python")
PATIENCE = 60.0  # s after which a command that does not end hangs
COMMANDS = {
    "run": "run {in}/a.c3d -o out",
    "run quietly": "run {in}/a.c3d -o out -q --json",
    "demo": "demo -o out",
    "convert": "convert {in}/long.c3d new/b.trc",
    "convert project": "convert {in}/done/a.skelgen new/b.bvh",
    "info": "info {in}/a.c3d",
    "report": "report {in}/done -o out.html",
    "fill": "fill {in}/done -o filled.c3d",
    "simulate": "simulate rods -o new/c.c3d --n-frames 600",
    "labels": "labels {in}/points.mfml -o out",
    "joints": "joints {in}/done -o out",
    "batch": "batch {in}/takes -o out --jobs 2",
    "two processes": "joints {in}/tree -o out --solver conjugate-gradient --jobs 2",
    "formats": "formats",
    "config": "config --write config.xml",
    "help": "run --help",
    "calibrate": "calibrate simulated",
    "capture": "motion-capture {in}/rig.xml -n --source simulated:arm?frames=40 --record new.mfml --record new.c3d",
}
SIGNALS = {
    "KILL": (signal.SIGKILL, 1, False),
    "TERM": (signal.SIGTERM, 1, False),
    "INT": (signal.SIGINT, 1, False),
    "INT of the group": (signal.SIGINT, 1, True),
    "INT twice": (signal.SIGINT, 2, False),
}


@dataclass
class Undisturbed:
    """What a command does if nobody disturbs it: its time [s], its files with how each of them ends."""

    seconds: float
    endings: dict[str, set[bytes]] = field(default_factory=dict)


@dataclass(frozen=True)
class Trial:
    """One command, one signal, one moment [s], and what was wrong afterwards."""

    command: str
    sent: str
    moment: float
    was_loaded: bool
    exit_code: int
    faults: tuple[str, ...]


def rods(n_frames: int, seed: int, labelled: bool = True) -> skelgen.PointCloud | skelgen.Trajectories:
    """A small take."""
    return simulate("rods", seed=seed, n_frames=n_frames, noise=0.3, labelled=labelled).take


INPUTS = {
    "a.c3d": lambda: rods(150, 0),
    "long.c3d": lambda: rods(20000, 1),
    "takes/1.c3d": lambda: rods(100, 2),
    "takes/2.c3d": lambda: rods(100, 3),
    "points.mfml": lambda: rods(200, 4, labelled=False),
    "done/a.skelgen": lambda: skelgen.reconstruct(rods(150, 0)),
    # limbs enough that processes are worth their start
    "tree/tree.skelgen": lambda: skelgen.reconstruct(simulate("tree:22", n_frames=30).take, until="limbs"),
    "rig.xml": lambda: skelgen.simulated_rig("arm", n_frames=1).settings,
}
"""What commands read, each made when the first command wants it."""


class Bench:
    """A folder with inputs, in which commands are disturbed."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._inputs = folder, folder / "inputs"
        self._known: dict[str, Undisturbed] = {}
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets what runs in the background ignore it

    def disturb(self, command: str, sent: str, share: float) -> Trial:
        """Send a signal after a share of the command's time and say what was wrong."""
        known = self._undisturbed(command)
        number, times, to_group = SIGNALS[sent]
        place = Path(tempfile.mkdtemp(dir=self._folder))
        moment = share * known.seconds
        with self._started(command, place) as process:
            time.sleep(moment)
            was_loaded = handles(process.pid, signal.SIGTERM) or process.poll() is not None
            for repeated in range(times):
                if process.poll() is None:
                    (os.killpg if to_group else os.kill)(process.pid, number)
                if repeated + 1 < times:
                    time.sleep(0.05)
            faults = [] if ended(process) else ["it hangs"]
        said = (place / "said").read_text(errors="replace")
        if number != signal.SIGKILL and was_loaded:
            if process.returncode not in {0, 128 + number, -number}:  # shells call the last two by one number
                faults.append(f"exit code {process.returncode}")
            faults += [f"says {said.strip()[-300:]!r}" for word in WORDS if word in said][:1]
        faults += self._faults_of(place / "work", known, complete=process.returncode == 0)
        if number != signal.SIGKILL:
            faults += [f"left {path}" for path in (*place.rglob(".skelgen-*"), *(place / "tmp").iterdir())]
            if known.endings and process.returncode != 0:
                faults += [f"left folder {path.name}" for path in (place / "work").iterdir() if is_empty(path)]
        faults += [] if group_ends(process.pid) else ["processes are left"]
        return Trial(command, sent, moment, was_loaded, process.returncode, tuple(faults))

    def _undisturbed(self, command: str) -> Undisturbed:
        """Run it twice: the first one may compile, both tell what differs from run to run."""
        if command not in self._known:
            for name, make in INPUTS.items():
                if f"{{in}}/{name.split('/')[0]}" in COMMANDS[command] and not (self._inputs / name).exists():
                    skelgen.write(make(), self._inputs / name)
            known = Undisturbed(0.0)
            for _ in range(2):
                place, began = Path(tempfile.mkdtemp(dir=self._folder)), time.monotonic()
                with self._started(command, place) as process:
                    process.wait()
                assert process.returncode == 0, (place / "said").read_text()
                known.seconds = time.monotonic() - began
                for path in files_in(place / "work"):
                    known.endings.setdefault(str(path.relative_to(place)), set()).add(ending(path))
            self._known[command] = known
        return self._known[command]

    def _started(self, command: str, place: Path) -> subprocess.Popen[bytes]:
        for name in ("work", "tmp"):
            (place / name).mkdir()
        words = COMMANDS[command].replace("{in}", str(self._inputs)).split()
        paths = os.pathsep.join(str(ROOT / name) for name in (".", "gui", "formats"))
        with (place / "said").open("wb") as said:
            return subprocess.Popen(
                [sys.executable, "-m", "skelgen", *words],
                cwd=place / "work",
                env=os.environ | {"PYTHONPATH": paths, "TMPDIR": str(place / "tmp")},
                stdout=subprocess.DEVNULL,
                stderr=said,
                start_new_session=True,
            )

    def _faults_of(self, work: Path, known: Undisturbed, *, complete: bool) -> list[str]:
        found = {str(path.relative_to(work.parent)): path for path in files_in(work)}
        unknown = [name for name in found if name not in known.endings]
        half = [
            name for name, path in found.items() if name in known.endings and not is_whole(path, known.endings[name])
        ]
        missing = [name for name in known.endings if complete and name not in found]
        return [f"{what}: {', '.join(names)}" for what, names in
                (("unknown", unknown), ("half-written", half), ("missing", missing)) if names]  # fmt: skip


def files_in(folder: Path) -> list[Path]:
    """All files below a folder but the temporary ones."""
    return [path for path in sorted(folder.rglob("*")) if path.is_file() and ".skelgen-" not in str(path)]


def ending(path: Path) -> bytes:
    """The last bytes of a file."""
    return path.read_bytes()[-12:]


def is_whole(path: Path, endings: set[bytes]) -> bool:
    """Whether a file can be read, or, where that says less, ends as the undisturbed one."""
    if path.suffix == ".skelgen":
        return zipfile.ZipFile(path).testzip() is None
    if path.suffix == ".json":
        return bool(json.loads(path.read_text()))
    if path.name.startswith("new."):  # recordings of a capture, as long as that went
        return bool(skelgen.read(path).n_frames)
    return ending(path) in endings


def is_empty(path: Path) -> bool:
    """Whether this is a folder with nothing in it."""
    return path.is_dir() and not any(path.iterdir())


def handles(pid: int, number: int) -> bool:
    """Whether a process answers a signal itself."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
    caught = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(caught, 16) >> (number - 1) & 1)


def ended(process: subprocess.Popen[bytes]) -> bool:
    """Wait for a process; one that hangs is killed."""
    try:
        process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return False
    return True


def group_ends(group: int) -> bool:
    """Whether all processes of a group end within some seconds; those that do not are killed."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    os.killpg(group, signal.SIGKILL)
    return False


def plan(counts: dict[str, int], commands: list[str], seed: int) -> list[tuple[str, str, float]]:
    """Commands, signals and moments: the commands in turn, each moment anywhere, every third one early."""
    rng = np.random.default_rng(seed)
    found = []
    for sent, count in counts.items():
        for index in range(count):
            share = float(rng.uniform(0.0, 1.05)) * (0.2 if index % 3 == 2 else 1.0)
            found.append((commands[int(rng.integers(len(commands)))], sent, share))
    return found


def main() -> None:
    """Print what was wrong, and how many trials there were of each signal."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--terms", type=int, default=20)
    parser.add_argument("--ints", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--command", action="append", choices=COMMANDS, help="only this one; may be repeated")
    given = parser.parse_args()
    third = given.ints // 3
    counts = {"KILL": given.kills, "TERM": given.terms, "INT": given.ints - 2 * third}
    counts |= {"INT of the group": third, "INT twice": third}
    trials = []
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(Path(name))
        for command, sent, share in plan(counts, given.command or list(COMMANDS), given.seed):
            trial = bench.disturb(command, sent, share)
            trials.append(trial)
            if trial.faults:
                print(
                    f"{trial.command}, {trial.sent} after {trial.moment:.3f} s: {'; '.join(trial.faults)}", flush=True
                )
    for sent in counts:
        own = [trial for trial in trials if trial.sent == sent]
        codes = Counter(trial.exit_code for trial in own)
        early, bad = sum(not trial.was_loaded for trial in own), sum(bool(trial.faults) for trial in own)
        print(
            f"{sent}: {len(own)} trials, {early} before the program was loaded, {bad} faults; exit codes {dict(codes)}"
        )
    sys.exit(any(trial.faults for trial in trials))


if __name__ == "__main__":
    main()
