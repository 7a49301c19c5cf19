"""Kill a batch at random moments and resume it: ``python tests/benchmarks/batch_kills.py``.

Each trial starts a batch of small takes anew, kills it once at a moment that the seed chooses, and resumes it; the
results must be the same byte for byte, but for what records hold under ``run``. 50 kills take some 5 minutes of two
cores.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict

import skelgen
from skelgen.simulation import simulate

N_TAKES, N_FRAMES = 20, 150  # half of the time goes into starting, the other half into takes
N_KILLS = 50


def main() -> None:
    """Print at how many moments the batch was killed, and how many results differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=N_KILLS)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    show_machine()
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        for seed in range(N_TAKES):
            skelgen.write(simulate("rods", seed=seed, n_frames=N_FRAMES, noise=0.3).take, f"in/take{seed}.c3d")
        began = time.monotonic()
        run("whole")
        seconds = time.monotonic() - began
        wanted = contents(Path("whole"))
        rng = np.random.default_rng(given.seed)
        moments = (np.arange(given.kills) + rng.random(given.kills)) * seconds / given.kills  # one in each part
        trials = [trial(float(moment), wanted) for moment in moments]
    n_same = sum(same for same, _ in trials)
    found = np.bincount([n_done for _, n_done in trials], minlength=N_TAKES + 1)
    spread = ", ".join(f"{count} x {n_done}" for n_done, count in enumerate(found.tolist()) if count)
    row = (f"{given.kills}", spread, f"{n_same}", f"{given.kills}", verdict(n_same == given.kills))
    show(f"Killed within {seconds:.1f} s", ("kills", "takes finished then", "same as undisturbed", "wanted", ""), [row])


def trial(moment: float, wanted: dict[str, object]) -> tuple[bool, int]:
    """Whether a batch killed at a moment [s] ends as wanted, and how many takes were finished when it was killed."""
    shutil.rmtree("killed", ignore_errors=True)
    process = subprocess.Popen(command("killed"), stdout=subprocess.DEVNULL)
    time.sleep(moment)
    process.send_signal(signal.SIGKILL)
    process.wait()
    n_done = len(list(Path("killed").glob("*/take.json")))
    run("killed")
    return contents(Path("killed")) == wanted, n_done


def command(folder: str) -> list[str]:
    """The batch as a command."""
    return [sys.executable, "-m", "skelgen", "batch", "in", "-o", folder, "--jobs", "2", "--resume", "-q", "--json"]


def run(folder: str) -> None:
    """Run the batch to its end."""
    subprocess.run(command(folder), check=True, stdout=subprocess.DEVNULL)


def contents(folder: Path) -> dict[str, object]:
    """Every file's bytes, of records and the manifest what they say beside how the run went."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix == ".json":
            data = json.loads(path.read_text())
            for record in (data, *data.get("takes", ())):
                record.pop("run", None)
            found[str(path.relative_to(folder))] = data
        elif path.is_file():
            found[str(path.relative_to(folder))] = path.read_bytes()
    return found


if __name__ == "__main__":
    main()
