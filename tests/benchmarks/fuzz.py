"""Mutated files for every reader: ``python tests/benchmarks/fuzz.py --minutes 60``.

Each file is made from a sound one by the seed and its number, so that any can be made again, and is read in a worker
process. A reader may accept it, or refuse it with one sentence of ours. Anything else is found and kept: another
exception (a warning counts as one), a sentence of several lines or over 300 characters beside the name of the file, a
worker that dies, takes more than 1 GB, or is silent for 5 s. Ends with 1 if anything was found.
"""

from __future__ import annotations

import argparse
import mmap
import os
import random
import re
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from fuzz_mutations import CHANGES
from fuzz_readers import READERS, Reader, make_seeds
from shown import show, show_machine

from skelgen.errors import SkelgenError

HANG_S = 5.0
"""A worker that works on one file for so long hangs; processor time."""

BLOCKED_S = 60.0
"""A worker that does nothing for so long waits for something; on a busy machine it may wait for its turn."""

MEMORY_BYTES = 2**30
"""Of a worker process, all it has loaded included."""

LONGEST_SENTENCE = 301  # beside the name of the file and its colon
_STATE = struct.Struct("<4q")  # number of the file that is read; files done, refused and found
_STARTING_S = 60.0  # for what a worker loads


def main() -> int:
    """Read mutated files until the time is over; print how many, and what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--minutes", type=float, default=0.0)
    parser.add_argument("--reader", action="append", choices=[reader.name for reader in READERS])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first file")
    parser.add_argument("--files", type=int, default=0, help="stop after so many")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-found"), help="folder for files that were found")
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    readers = [reader for reader in READERS if reader.name in (given.reader or [each.name for each in READERS])]
    if given.worker:
        return _work(given.worker, readers, given.seed, given.first)
    show_machine()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_seeds(folder)
        run = _Run(folder, readers, given.seed, given.keep, given.first)
        until = time.monotonic() + (60 * given.minutes or given.seconds)
        while time.monotonic() < until and not (given.files and run.n_done >= given.files):
            run.watch_one(min(until, time.monotonic() + 600), given.files)
    return run.tell()


@dataclass
class _Run:
    """Workers one after the other, and what they found."""

    folder: Path
    readers: list[Reader]
    seed: int
    keep: Path
    first: int
    n_done: int = 0
    n_refused: int = 0
    found: list[tuple[str, str]] = field(default_factory=list)

    def watch_one(self, until: float, most: int) -> None:
        """Run a worker until the time is over, it ends, or it hangs; the next goes on behind its file."""
        (self.folder / "state").write_bytes(_STATE.pack(self.first, 0, 0, 0))
        names = [word for reader in self.readers for word in ("--reader", reader.name)]
        command = [sys.executable, __file__, "--worker", str(self.folder), "--seed", str(self.seed)]
        errors = (self.folder / "errors").open("wb")
        worker = subprocess.Popen(
            [*command, "--first", str(self.first), "--keep", str(self.keep), *names], stdout=errors, stderr=errors
        )
        number, seen, worked, why = -1, time.monotonic() + _STARTING_S, _STARTING_S, ""
        try:
            while not why and worker.poll() is None and time.monotonic() < until:
                time.sleep(0.1)
                state = self._state()
                if state[1] and state[0] != number:
                    number, seen, worked = state[0], time.monotonic(), _worked(worker.pid)
                if _worked(worker.pid) - worked > HANG_S or time.monotonic() - seen > BLOCKED_S:
                    why = f"hangs for {HANG_S:g} s"
                if most and self.n_done + state[1] >= most:
                    break
        finally:
            worker.kill()
            worker.wait()
            errors.close()
        number, done, refused, _ = self._state()
        said = (self.folder / "errors").read_text(errors="replace")
        if not why and worker.returncode != -9:
            why = f"the worker ended with {worker.returncode}: {' '.join(said.split())[-300:]}"
        self.n_done, self.n_refused, self.first = self.n_done + done, self.n_refused + refused, number + 1
        if why:
            self._found(number, why)
        self.found += [tuple(line.split("\t", 1)) for line in said.splitlines() if line.startswith("found-")]  # type: ignore[misc]

    def _state(self) -> tuple[int, int, int, int]:
        return _STATE.unpack((self.folder / "state").read_bytes())

    def _found(self, number: int, why: str) -> None:
        reader = self.readers[number % len(self.readers)]
        name, content = mutated(reader, self.folder, self.seed, number)
        self.found.append((kept(self.keep, number, name, content), f"{reader.name}: {why}"))

    def tell(self) -> int:
        """Print what was found; 1 if anything was."""
        counts = Counter(what.split(":")[0] for _, what in self.found)
        each = str(self.n_done // len(self.readers))
        rows = [(reader.name, each, str(counts[reader.name])) for reader in self.readers]
        show(f"{self.n_done} files, {self.n_refused} of them refused", ("reader", "files", "found"), rows)
        alike = {re.sub(r"[0-9]+|'.*'", "", what): (name, what) for name, what in reversed(self.found)}
        for name, what in alike.values():
            print(f"{self.keep / name}: {what}")
        return 1 if self.found else 0


def _worked(process: int) -> float:
    """Processor time of a process [s]."""
    try:
        words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has ended
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def mutated(reader: Reader, folder: Path, seed: int, number: int) -> tuple[str, bytes]:
    """Return the name of the sound file that a mutated one comes from, and its content."""
    dice = random.Random(f"{seed} {reader.name} {number}")
    name = dice.choice(reader.seeds)
    content = (folder / name).read_bytes()
    try:
        return name, dice.choice(CHANGES[reader.kind])(dice, content)
    except (
        IndexError,
        KeyError,
        ValueError,
        TypeError,
        AttributeError,
        zipfile.BadZipFile,
    ):  # a mutation that this file does not allow
        return name, CHANGES["bytes"][0](dice, content)


def kept(folder: Path, number: int, name: str, content: bytes) -> str:
    """Keep a file that was found, and return its name."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"found-{number}-{name}").write_bytes(content)
    return f"found-{number}-{name}"


def _work(folder: Path, readers: list[Reader], seed: int, first: int) -> int:
    """Read files until somebody ends this process."""
    warnings.simplefilter("error")
    keep = Path(sys.argv[sys.argv.index("--keep") + 1])
    with (folder / "state").open("r+b") as stream, tempfile.TemporaryDirectory(dir=folder) as name:
        state = mmap.mmap(stream.fileno(), _STATE.size)
        place, done, refused, found = Path(name), 0, 0, 0
        for seed_file in ("motion.asf", "motion.amc"):
            (place / seed_file).write_bytes((folder / seed_file).read_bytes())
        for reader in readers:  # what they load is none of the first file's time and memory
            _read(reader, folder / reader.seeds[0], 0)
        _limit_memory()
        parent, number = os.getppid(), first - 1
        while os.getppid() == parent:
            number += 1
            reader = readers[number % len(readers)]
            seed_name, content = mutated(reader, folder, seed, number)
            path = place / seed_name
            path.write_bytes(content)
            state[:] = _STATE.pack(number, max(done, 1), refused, found)
            why, was_refused = _read(reader, path, zlib.crc32(str(number).encode()))
            if why:
                found += 1
                print(f"{kept(keep, number, seed_name, content)}\t{reader.name}: {why}", flush=True)
            if seed_name.startswith("motion."):  # its partner must be sound
                path.write_bytes((folder / seed_name).read_bytes())
            done, refused = done + 1, refused + was_refused
            state[:] = _STATE.pack(number, done, refused, found)
    return 0


def _read(reader: Reader, path: Path, turn: int) -> tuple[str, bool]:
    """Why a file is found, if it is, and whether it was refused."""
    try:
        reader.read(path, turn)
    except SkelgenError as error:
        sentence = str(error).replace(str(path), "").replace(str(path.parent), "")
        if "\n" in sentence or len(sentence) > LONGEST_SENTENCE:
            return f"a sentence of {len(sentence)} characters: {sentence[:200]!r}", True
        return "", True
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        what = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        return f"{what} ({Path(last.filename).name}:{last.lineno})", False
    return "", False


def _limit_memory() -> None:
    """Let this process grow to a gigabyte; what it has mapped and never touched is not counted."""
    import resource

    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines() if ":" in line)
    virtual, real = (1024 * int(status[name].split()[0]) for name in ("VmSize", "VmRSS"))
    limit = virtual - real + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
