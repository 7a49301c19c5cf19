"""The demonstration: simulate a human, find its skeleton, compare both."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from skelgen.app.face import reconstruct
from skelgen.app.outputs import write_outputs
from skelgen.model import Project
from skelgen.progress import SILENT, Monitor

if TYPE_CHECKING:
    from skelgen.evaluation import Evaluation

STEM = "demo"
"""Beginning of the names of all files."""

STRUCTURE = "human"
N_FRAMES = 1000  # ten seconds: every joint bends several times
NOISE = 0.5  # mm, what a good optical tracker delivers
DROPOUTS = 0.05  # part of the positions: what a real suit loses


@dataclass(frozen=True, eq=False)
class Demonstration:
    """What the demonstration made.

    Attributes
    ----------
    project : Project
        The reconstruction.
    evaluation : Evaluation
        Its scores against the simulated truth.
    files : list of Path
        What was written.
    """

    project: Project
    evaluation: Evaluation
    files: list[Path]


def run_demo(folder: Path, *, seed: int = 0, n_jobs: int = 1, monitor: Monitor = SILENT) -> Demonstration:
    """Simulate, reconstruct, evaluate, and write every file.

    Parameters
    ----------
    folder : Path
        Where the files go.
    seed : int
        Seed of the simulation and of the reconstruction.
    n_jobs : int
        Number of processes.
    monitor : Monitor
        Receives progress.
    """
    from skelgen.evaluation import evaluate  # noqa: PLC0415 - loads scipy
    from skelgen.simulation import TRUTH_SUFFIX, simulate, write_truth  # noqa: PLC0415 - loads scipy

    monitor.begin("simulating")
    simulated = simulate(STRUCTURE, seed=seed, n_frames=N_FRAMES, noise=NOISE, dropouts=DROPOUTS)
    project = reconstruct(simulated.take, seed=seed, monitor=monitor, n_jobs=n_jobs)
    evaluation = evaluate(project, simulated.truth)
    files = write_outputs(project, folder, STEM, monitor=monitor)
    truth_file = write_truth(simulated.truth, folder / f"{STEM}{TRUTH_SUFFIX}")
    return Demonstration(project, evaluation, [*files, truth_file])
