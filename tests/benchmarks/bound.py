"""Joint errors beside the Cramer-Rao bound and SCoRE: ``python tests/benchmarks/bound.py``.

SCoRE, the symmetrical centre of rotation estimation (Ehrig, Taylor, Duda and Heller 2006), is the peer: joints of given
limbs and tree by linear least squares on the limbs' poses.
"""

from __future__ import annotations

import sys

import numpy as np
from shown import show, show_machine, verdict

import skelgen
from skelgen.benchmark.accuracy import is_exact, score_error
from skelgen.evaluation import evaluate
from skelgen.simulation import simulate

NOISE_CASES = (
    ("human", 1000, 0.5),
    ("human", 1000, 1.0),
    ("tree:8", 1000, 0.3),
    ("tree:8", 1000, 1.0),
    ("tree:30", 600, 0.5),
)
TISSUE_CASES = (("human", 2000, 3.0),)
TISSUE_NOISE = 0.5  # mm, beside the soft tissue
SEEDS = (0, 1)
WANTED_TIMES_BOUND = 1.05
WANTED_OF_SCORE = 0.9
WANTED_COVERAGE = (0.90, 0.98)


def main() -> None:
    """Print both tables."""
    show_machine()
    seeds = tuple(int(one) for one in sys.argv[1:]) or SEEDS
    show_noise(seeds)
    show_tissue(seeds)


def show_noise(seeds: tuple[int, ...]) -> None:
    """White noise: errors in units of the bound, and the coverage."""
    rows = []
    for name, n_frames, noise in NOISE_CASES:
        for seed in seeds:
            case = simulate(name, seed=seed, n_frames=n_frames, noise=noise)
            score = evaluate(skelgen.reconstruct(case.take, seed=seed), case.truth)
            reached = is_exact(score) and (score.times_bound or np.inf) <= WANTED_TIMES_BOUND
            reached = reached and WANTED_COVERAGE[0] <= (score.coverage or 0.0) <= WANTED_COVERAGE[1]
            figures = (score.mean_joint_error, score.mean_joint_bound, score.times_bound, score.coverage)
            rows.append((name, f"{noise}", str(seed), *texts(figures), f"{score_error(case):.3f}", verdict(reached)))
    columns = (
        "structure",
        "noise [mm]",
        "seed",
        "mean error [mm]",
        "bound [mm]",
        "times bound",
        "coverage",
        "SCoRE [mm]",
        "",
    )
    show(f"White noise; wanted: exact, <= {WANTED_TIMES_BOUND} times the bound, coverage 0.90 to 0.98", columns, rows)


def show_tissue(seeds: tuple[int, ...]) -> None:
    """Soft tissue: errors beside SCoRE's."""
    rows = []
    for name, n_frames, tissue in TISSUE_CASES:
        for seed in seeds:
            case = simulate(name, seed=seed, n_frames=n_frames, noise=TISSUE_NOISE, soft_tissue=tissue)
            score, peer = evaluate(skelgen.reconstruct(case.take, seed=seed), case.truth), score_error(case)
            share = (score.mean_joint_error or np.inf) / peer
            figures = (score.mean_joint_error, peer, share, score.coverage)
            rows.append(
                (name, f"{tissue}", str(seed), *texts(figures), verdict(is_exact(score) and share <= WANTED_OF_SCORE))
            )
    columns = ("structure", "soft tissue [mm]", "seed", "mean error [mm]", "SCoRE [mm]", "of SCoRE", "coverage", "")
    show(f"Soft tissue; wanted: exact, <= {WANTED_OF_SCORE} of SCoRE with limbs and tree given", columns, rows)


def texts(figures: tuple[float | None, ...]) -> tuple[str, ...]:
    """Figures for a table."""
    return tuple("-" if one is None else f"{one:.3f}" for one in figures)


if __name__ == "__main__":
    main()
