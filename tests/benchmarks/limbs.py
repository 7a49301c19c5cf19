"""Which limbs are found when nothing is given, and what hangs on what: ``python tests/benchmarks/limbs.py [row ...]``.

Every row names its takes by structure and seed, so that each can be simulated again. Rows: see `ROWS`.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from shown import show, show_machine, verdict

from skelgen.model import Limbs, Trajectories
from skelgen.simulation import SimulatedTake, simulate
from skelgen.simulation.articulated import LimbModel, Structure, markers_around
from skelgen.simulation.structures import find_structure
from skelgen.stages.joints import find_joints
from skelgen.stages.labels import LabelParameters, label_markers
from skelgen.stages.limbs import LimbParameters, find_limbs

MIXED = ("human", "classic-human", "quadruped", "tree:8", "tree:15")
NOISE = 0.5  # mm
STANDOFF = 10.0  # mm: of a marker's centre from the skin, as the simulation has it
SMALL = ("head", "left hand", "right hand", "left foot", "right foot")


class Case(NamedTuple):
    """One take: a structure by name or built here, a seed, what befalls it."""

    structure: str
    seed: int
    options: dict[str, float]


class Row(NamedTuple):
    """Takes of one kind: how many must be right, whether the tree is asked for, whether labels are taken away."""

    title: str
    cases: tuple[Case, ...]
    wanted: int
    with_tree: bool = False
    unlabelled: bool = False
    is_exact_wanted: bool = True  # otherwise only the number of limbs


def cases(structures: Iterable[str], seeds: Iterable[int], **options: float) -> tuple[Case, ...]:
    """Every structure with every seed."""
    seeds = tuple(seeds)
    return tuple(
        Case(name, seed, {"n_frames": 1000, "noise": NOISE} | options) for name in structures for seed in seeds
    )


def mixed_cases(first_seed: int) -> tuple[Case, ...]:
    """Forty takes of five structures with 0 to 3 mm of soft tissue."""
    tissues = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.0)
    return tuple(
        case
        for number, name in enumerate(MIXED)
        for seed, tissue in enumerate(tissues)
        for case in cases([name], [first_seed + 10 * number + seed], soft_tissue=tissue)
    )


ROWS = {
    "tissue": Row("3 mm soft tissue, human", cases(["human"], range(6), n_frames=2000, soft_tissue=3.0), 6, True),
    "noise": Row(
        "noise only, 0.3 / 0.6 / 1 mm",
        tuple(
            case
            for name in ("human", "tree:8", "tree:30")
            for seed, noise in enumerate((0.3, 0.6, 1.0))
            for case in cases([name], [seed], noise=noise)
        ),
        9,
        True,
    ),
    "trees": Row(
        "tree:30, 1 mm; hinges whose axes meet, markers beside axes",
        cases(["tree:30"], (9, 21, 37, 61, 73, 75, *range(200, 206)), noise=1.0),
        12,
        True,
    ),
    "small": Row(
        "two-marker hands, feet, head; a rod with one marker",
        cases(["human, small limbs of 2"], range(10)) + cases(["rods, one of 1"], range(10)),
        18,
        True,
    ),
    "small tissue": Row(
        "the same with 1 mm soft tissue",
        cases(["human, small limbs of 2"], range(10), soft_tissue=1.0)
        + cases(["rods, one of 1"], range(10), soft_tissue=1.0),
        18,
        True,
    ),
    "small 2 mm": Row(
        "the same with 2 mm and other seeds",
        cases(["human, small limbs of 2", "rods, one of 1"], range(40, 50), soft_tissue=2.0),
        18,
        True,
    ),
    "mixed": Row("mixed structures, 0 to 3 mm soft tissue", mixed_cases(100), 36, is_exact_wanted=False),
    "mixed again": Row("the same with other seeds", mixed_cases(500), 36, is_exact_wanted=False),
    "mixed 700": Row("the same with seeds from 700", mixed_cases(700), 36, is_exact_wanted=False),
    "mixed 900": Row("the same with seeds from 900", mixed_cases(900), 36, is_exact_wanted=False),
    "unseen": Row("20 % unseen, 1 mm soft tissue", cases(MIXED, range(4), dropouts=0.2, soft_tissue=1.0), 18),
    "short": Row("classic-human, 400 frames", cases(["classic-human"], range(10), n_frames=400), 9),
    "unlabelled": Row(
        "labels found first, 2 % dropouts", cases(["human", "rods"], range(2), dropouts=0.02), 4, unlabelled=True
    ),
}

METHODS = {
    "rigid bodies (default)": LimbParameters(),
    "distances": LimbParameters(method="distances"),
    "spectral, count by rigidity": LimbParameters(method="spectral", count="rigidity"),
    "spectral, count by rotation": LimbParameters(method="spectral", count="rotation"),
    "spectral, count by eigengap": LimbParameters(method="spectral", count="eigengap"),
    "spectral, count rising": LimbParameters(method="spectral", count="rising"),
}
METHODS_KEY = "methods"  # the word that asks for the comparison, beside the rows


def main() -> None:
    """Print one line per row, then every take that is not right, then the methods beside each other."""
    show_machine()
    wanted = sys.argv[1:] or [*ROWS, METHODS_KEY]
    if rows := [key for key in wanted if key != METHODS_KEY]:
        show_rows(rows)
    if METHODS_KEY in wanted:
        show_methods(ROWS["mixed"])


def show_rows(keys: Iterable[str]) -> None:
    """Print one line per row, then every take that is not right."""
    rows, failures = [], []
    for key in keys:
        row = ROWS[key]
        outcomes = [(case, *judged(case, row)) for case in row.cases]
        right = sum(is_exact for _, _, is_exact, _, _ in outcomes)
        counted = sum(difference == 0 for _, difference, *_ in outcomes)
        trees = f"{sum(tree for *_, tree, _ in outcomes)}/{len(outcomes)}" if row.with_tree else "-"
        worst = max(abs(difference) for _, difference, *_ in outcomes)
        seconds = np.mean([seconds for *_, seconds in outcomes])
        is_enough = (right if row.is_exact_wanted else counted) >= row.wanted and worst <= 1
        counts = (f"{right}/{len(outcomes)}", f"{counted}/{len(outcomes)}", str(row.wanted), trees, str(worst))
        figures = (*counts, f"{1000 * seconds:.0f}", verdict(is_enough))
        rows.append((row.title, *figures))
        failures += [
            (case.structure, str(case.seed), str(case.options), f"{difference:+d}", str(tree))
            for case, difference, is_exact, tree, _ in outcomes
            if not is_exact or (row.with_tree and not tree)
        ]
    columns = ("takes", "limbs exact", "number right", "wanted", "tree exact", "worst count off by", "ms", "")
    show("Limbs, nothing given", columns, rows)
    show("Not right", ("structure", "seed", "options", "limbs off by", "tree"), failures or [("none", *[""] * 4)])


def show_methods(row: Row) -> None:
    """Print how often each way to the limbs and their number is right on the same takes."""
    rows = []
    for title, parameters in METHODS.items():
        outcomes = [judged(case, row, parameters) for case in row.cases]
        differences = np.array([difference for difference, *_ in outcomes])
        right = f"{sum(is_exact for _, is_exact, *_ in outcomes)}/{len(outcomes)}"
        counted, near = (f"{(abs(differences) <= off).sum()}/{len(outcomes)}" for off in (0, 1))
        seconds = np.mean([seconds for *_, seconds in outcomes])
        rows.append((title, right, counted, near, f"{1000 * seconds:.0f}"))
    show(f"Methods: {row.title}", ("method", "limbs exact", "number right", "off by at most 1", "ms"), rows)


def judged(case: Case, row: Row, parameters: LimbParameters | None = None) -> tuple[int, bool, bool, float]:
    """Difference in the number of limbs, whether all are right, whether the tree is, seconds for the limbs."""
    simulated = simulate(structure(case), seed=case.seed, **case.options, labelled=not row.unlabelled)
    take, owner = markers_and_limbs(simulated)
    started = time.process_time()
    limbs = find_limbs(take, parameters or LimbParameters())
    seconds = time.process_time() - started
    known = owner >= 0
    is_exact = same_groups(limbs.limb_of_marker[known], owner[known])
    tree = row.with_tree and is_exact and has_true_tree(take, limbs, simulated)
    return limbs.n_limbs - len(np.unique(owner[known])), is_exact, tree, seconds


def markers_and_limbs(simulated: SimulatedTake) -> tuple[Trajectories, np.ndarray]:
    """Markers and the limb that each is truly on; without labels, that of most of its points."""
    take, truth = simulated.take, simulated.truth
    if isinstance(take, Trajectories):
        return take, truth.limb_of_marker
    found = label_markers(take, LabelParameters())[0]
    owner = np.full(found.n_markers, -1)
    for marker in range(found.n_markers):
        gap = np.linalg.norm(truth.marker_positions - found.positions[:, marker : marker + 1], axis=2)
        seen = ~np.isnan(gap[:, 0])
        owner[marker] = truth.limb_of_marker[np.bincount(gap[seen].argmin(axis=1)).argmax()]
    return found, owner


def same_groups(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two labellings group the same markers."""
    pairs = np.unique(np.stack([first, second]), axis=1).shape[1]
    return len(np.unique(first)) == len(np.unique(second)) == pairs


def has_true_tree(take: Trajectories, limbs: Limbs, simulated: SimulatedTake) -> bool:
    """Whether limbs that are right are also joined as they truly are."""
    truth = simulated.truth
    true_of = [int(truth.limb_of_marker[limbs.markers_of(limb)[0]]) for limb in range(limbs.n_limbs)]
    found = {frozenset((true_of[one], true_of[other])) for one, other in find_joints(take, limbs).edges}
    return found == {frozenset((child, int(parent))) for child, parent in enumerate(truth.parents) if parent >= 0}


def structure(case: Case) -> Structure | str:
    """The structure of a case; those with few markers are built here."""
    name, _, change = case.structure.partition(", ")
    if not change:
        return name
    body = find_structure(name)
    small = SMALL if name == "human" else body.limb_names[-1:]
    limbs = tuple(with_fewer(limb, 2 if name == "human" else 1) if limb.name in small else limb for limb in body.limbs)
    return Structure(case.structure, limbs)


def with_fewer(limb: LimbModel, n_markers: int) -> LimbModel:
    """The same limb with two markers wound around its axis, or with the last of its own."""
    if n_markers == 1:
        return dataclasses.replace(limb, markers=limb.markers[-1:])
    phase = float(len(limb.name) + len(limb.parent))
    return dataclasses.replace(limb, markers=markers_around(limb.segment, limb.radius + STANDOFF, n_markers, phase))


if __name__ == "__main__":
    main()
