"""Takes that nobody would record, reconstructed: ``python tests/benchmarks/cuts.py --cuts 300 --seed 1``.

Cuts of recordings (3 to 3000 frames, some of the markers, with labels and without), simulated takes of 3 to 50 frames,
parameters at their bounds, and what readers accept of mutated files. Each must give finite results without a warning,
or an error of skelgen's in a sentence. What else happens is an escape: it is printed with the seed that makes it.
Cases run in processes with limits of time and memory; `tests/test_cuts.py` runs some of them in every test run.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
import random
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_mutations import mutated_bytes, mutated_text

import skelgen
from skelgen.app.configuration import Settings
from skelgen.model.project import STAGES

RECORDINGS = Path(__file__).parents[3] / "shared" / "data"
SUFFIXES = {".c3d", ".trc", ".tsv"}
FOLDERS = ("arm", "bodies", "bone_pin", "hand", "human", "mouse", "rods_pendulum", "wheelchair")
STRUCTURES = ("rods", "human", "quadruped", "classic-human", "tree:2", "tree:5", "tree:9")
FORMATS = ("trc", "c3d", "mfml", "csm", "labels.xml", "skelgen")
TEXTS = {"trc", "csm", "labels.xml"}
LONGEST_SENTENCE = 300
UNBOUNDED = 1e300
SECONDS, GIGABYTES = 60.0, 4.0


@dataclass(frozen=True, eq=False)
class Case:
    """A take and what is asked of it."""

    take: Any
    asked: dict[str, Any] = field(default_factory=dict)
    about: str = ""


def recordings() -> list[Path]:
    """Recordings of markers beside the project; none where the folder is absent."""
    found = (path for folder in FOLDERS for path in (RECORDINGS / folder).glob("*") if path.suffix in SUFFIXES)
    return sorted(found)


def cut(seed: int) -> Case:
    """Some frames and markers of a recording, its labels perhaps left out."""
    rng = np.random.default_rng(seed)
    path = recordings()[rng.integers(len(recordings()))]
    take = skelgen.read(path)
    n_frames = min(round(10 ** rng.uniform(np.log10(3), np.log10(3000))), take.n_frames)
    start = int(rng.integers(take.n_frames - n_frames + 1))
    n_markers = int(rng.integers(1, take.n_markers + 1)) if rng.random() < 0.7 else take.n_markers
    markers = np.sort(rng.permutation(take.n_markers)[:n_markers])
    positions = np.array(take.positions[start : start + n_frames][:, markers])
    names = tuple(take.names[marker] for marker in markers)
    is_cloud = rng.random() < 0.3 and n_frames * n_markers < 40_000
    asked = {"n_limbs": int(rng.integers(1, n_markers + 2))} if rng.random() < 0.2 else {}
    about = f"{path.name}, frames {start} to {start + n_frames - 1}, {n_markers} markers, {asked}"
    if not is_cloud:
        return Case(replace(take, positions=positions, names=names), asked, about)
    shown = [rng.permutation(frame[~np.isnan(frame[:, 0])]) for frame in positions]
    starts = np.cumsum([0, *(len(frame) for frame in shown)])
    cloud = skelgen.PointCloud(np.concatenate(shown), starts, np.arange(n_frames) / take.rate)
    return Case(cloud, asked, f"{about}, without labels")


def short(seed: int) -> Case:
    """A simulated take of 3 to 50 frames."""
    rng = np.random.default_rng(seed)
    labelled = rng.random() < 0.6
    options: dict[str, Any] = {
        "n_frames": int(rng.integers(3, 51)) if rng.random() < 0.6 else int(rng.integers(3, 8)),
        "noise": float(rng.choice([0.0, 0.0, 0.1, 0.3, 2.0])),
        "dropouts": float(rng.choice([0.0, 0.0, 0.1, 0.4, 0.8])),
        "motion_range": float(rng.choice([0.0, 0.1, 1.0, 1.0])),
        "soft_tissue": float(rng.choice([0.0, 0.0, 3.0])),
        "labelled": labelled,
    }
    if not labelled:
        options["ghosts"] = float(rng.choice([0.0, 0.5, 3.0]))
    name = str(rng.choice(STRUCTURES))
    asked: dict[str, Any] = {"n_limbs": int(rng.integers(1, 25))} if rng.random() < 0.3 else {}
    if not labelled and rng.random() < 0.3:
        asked["n_markers"] = int(rng.integers(1, 60))
    return Case(skelgen.simulate(name, seed=seed, **options).take, asked, f"{name} {options} {asked}")


def extremes() -> list[tuple[str, str, Any]]:
    """Every parameter of the stages at its bounds, or at every choice."""
    found: list[tuple[str, str, Any]] = []
    for stage in STAGES:
        for one in Settings().of(stage).declarations():
            if one.choices or one.kind is bool:
                values: tuple[Any, ...] = one.choices or (False, True)
            elif one.kind is str:
                continue
            else:
                low = -UNBOUNDED if one.low is None else one.low
                high = UNBOUNDED if one.high is None else one.high
                values = tuple(int(value) if one.kind is int else value for value in (low, high))
            found += [(stage, one.name, value) for value in values]
    return found


def bounds(seed: int) -> Case:
    """One parameter, or a few, at a bound; seeds below the number of `extremes` go through all of them."""
    rng, every = np.random.default_rng(seed), extremes()
    chosen = [every[seed % len(every)]]
    if seed >= len(every):
        chosen += [every[index] for index in rng.integers(len(every), size=rng.integers(0, 4))]
    parameters: dict[str, dict[str, Any]] = {}
    for stage, name, value in chosen:
        parameters.setdefault(stage, {})[name] = value
    labelled = chosen[0][0] != "labels" and rng.random() < 0.8
    options = {"n_frames": 60, "noise": float(rng.choice([0.0, 0.3])), "dropouts": 0.1, "labelled": labelled}
    name = str(rng.choice(["rods", "tree:5"]))
    return Case(skelgen.simulate(name, seed=seed, **options).take, {"parameters": parameters}, f"{name} {parameters}")


def accepted(seed: int) -> Case | None:
    """What a reader makes of a mutated file, or None if it refuses it; seeds have new files until one is accepted."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        for attempt in range(20):
            suffix = rng.choice(FORMATS)
            path = Path(folder) / f"take{attempt}.{suffix}"
            labelled = suffix not in {"mfml", "csm"} or rng.random() < 0.3
            options = {"n_frames": rng.randint(3, 60), "noise": rng.choice([0.0, 0.3]), "labelled": labelled}
            name = rng.choice(["rods", "tree:4"])
            try:
                skelgen.write(skelgen.simulate(name, seed=seed, **options).take, path)
            except skelgen.SkelgenError:
                continue
            change = mutated_text if suffix in TEXTS else mutated_bytes
            path.write_bytes(change(rng, path.read_bytes()))
            with warnings.catch_warnings(), contextlib.suppress(skelgen.SkelgenError):
                warnings.simplefilter("ignore")
                return Case(skelgen.read(path), {}, f"{name}.{suffix} {options}, mutation {attempt}")
    return None


KINDS: dict[str, Callable[[int], Case | None]] = {
    "cuts": cut, "short": short, "bounds": bounds, "accepted": accepted
}  # fmt: skip


def outcome(kind: str, seed: int) -> str:
    """Return ``result``, ``refused: Class``, or in other words what escaped."""
    about = "while it was made"
    try:
        case = KINDS[kind](seed)
        if case is None:
            return "not accepted by readers"
        about = case.about
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            project = skelgen.reconstruct(case.take, seed=seed % 7, **case.asked)
    except skelgen.SkelgenError as error:
        said = str(error)
        is_sentence = 10 <= len(said) <= LONGEST_SENTENCE and "\n" not in said
        return f"refused: {type(error).__name__}" if is_sentence else f"escape, no sentence: {said!r} ({about})"
    except MemoryError:
        return f"escape, out of memory ({about})"
    except Exception as error:
        place = [frame for frame in traceback.extract_tb(error.__traceback__) if "skelgen" in frame.filename][-1:]
        where = ", ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in place)
        return f"escape, {type(error).__name__}: {str(error)[:120]} at {where} ({about})"
    return "result" if is_finite(project) else f"escape, a result that is not finite ({about})"


def is_finite(project: skelgen.Project) -> bool:
    """Whether all numbers of a skeleton and its motion are."""
    motion, skeleton = project.motion, project.skeleton
    kept = skeleton.limb_of_marker >= 0
    arrays = [
        motion.joint_positions,
        motion.world_from_limb,
        motion.marker_positions[:, kept],
        skeleton.marker_offsets[kept],
    ]
    arrays += [array for joint in skeleton.joints for array in (joint.position_in_parent, joint.std)]
    return all(bool(np.isfinite(array).all()) for array in arrays)


def work(pipe: Connection, gigabytes: float) -> None:
    """Run cases that come through a pipe."""
    if gigabytes:
        import resource  # which Windows lacks

        resource.setrlimit(resource.RLIMIT_AS, (int(gigabytes * 2**30),) * 2)
    while True:
        try:
            case = pipe.recv()
        except EOFError:  # there are no more
            return
        began = time.process_time()
        pipe.send((outcome(*case), time.process_time() - began))


@dataclass(eq=False)
class Worker:
    """A process that runs one case after the other, and is replaced when one takes too long."""

    gigabytes: float
    case: tuple[str, int] | None = None
    began: float = 0.0
    process: BaseProcess | None = None
    pipe: Connection | None = None

    def start(self, case: tuple[str, int]) -> None:
        """Begin a case."""
        if self.process is None or self.pipe is None:
            context = multiprocessing.get_context("spawn")
            self.pipe, there = context.Pipe()
            self.process = context.Process(target=work, args=(there, self.gigabytes), daemon=True)
            self.process.start()
            there.close()
        self.case, self.began = case, time.monotonic()
        self.pipe.send(case)

    def finished(self, seconds: float) -> tuple[str, float] | None:
        """What came of the case and its time on a processor [s], or None while it runs."""
        if self.pipe is None or self.process is None:
            return None
        try:
            if self.pipe.poll():
                said, used = self.pipe.recv()
                return str(said), float(used)
        except EOFError:
            return self._end("escape, the process died")
        late = time.monotonic() - self.began > seconds
        return self._end(f"escape, more than {seconds:.0f} s") if late else None

    def _end(self, said: str) -> tuple[str, float]:
        if self.process is not None:
            self.process.kill()
            self.process.join()
        self.process = self.pipe = None
        return said, time.monotonic() - self.began


def run(
    cases: Iterator[tuple[str, int]], workers: list[Worker], seconds: float
) -> Iterator[tuple[str, int, str, float]]:
    """Run cases abreast; yields kind, seed, outcome and time [s] of each."""
    busy: list[Worker] = []
    idle = list(workers)
    while True:
        while idle and (case := next(cases, None)):
            busy.append(idle.pop())
            busy[-1].start(case)
        if not busy:
            return
        wait([worker.pipe for worker in busy if worker.pipe], timeout=1.0)
        for worker in list(busy):
            ended = worker.finished(seconds)
            if ended is not None and worker.case:
                yield *worker.case, *ended
                busy.remove(worker)
                idle.append(worker)


def main() -> None:
    """Print how many cases of each kind came to what, and every escape with its seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    for kind in KINDS:
        parser.add_argument(f"--{kind}", type=int, default=0, help="how many")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="limit for each")
    parser.add_argument("--gigabytes", type=float, default=GIGABYTES, help="limit for each process")
    given = vars(parser.parse_args())
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    every = [(kind, given["seed"] + number) for kind in KINDS for number in range(given[kind])]
    workers = [Worker(given["gigabytes"]) for _ in range(given["jobs"])]
    counts: Counter[tuple[str, str]] = Counter()
    slowest: dict[str, tuple[float, int]] = {}
    for kind, seed, said, seconds in run(iter(every), workers, given["seconds"]):
        is_escape = said.startswith("escape")
        counts[kind, "escape" if is_escape else said] += 1
        slowest[kind] = max(slowest.get(kind, (0.0, 0)), (seconds, seed))
        if is_escape:
            print(f"--{kind} 1 --seed {seed}: {said}", flush=True)
    for (kind, said), count in sorted(counts.items()):
        print(f"{kind:10} {count:6} {said}")
    for kind, (seconds, seed) in slowest.items():
        print(f"{kind:10} slowest {seconds:.1f} s (seed {seed})")


if __name__ == "__main__":
    main()
