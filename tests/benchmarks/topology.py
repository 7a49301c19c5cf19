"""Trees found with true labels and limbs given: ``python tests/benchmarks/topology.py [n_seeds]``."""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
from shown import show, show_machine

from skelgen.model import Limbs, PointCloud, Trajectories
from skelgen.model.arrays import Ints
from skelgen.simulation import SimulatedTake, simulate
from skelgen.stages.joints import find_joints

STRUCTURES = ("human", "classic-human", "quadruped", "tree:8", "tree:10", "tree:30", "rods")
FAULTS: dict[str, dict[str, Any]] = {
    "0.3 mm": {"noise": 0.3},
    "1 mm": {"noise": 1.0},
    "1 mm, 6 cameras": {"noise": 1.0, "n_cameras": 6},
    "3 mm tissue": {"noise": 0.5, "soft_tissue": 3.0},
    "3 mm tissue, 6 cameras": {"noise": 0.5, "soft_tissue": 3.0, "n_cameras": 6},
}
PAIRS = (("human", "human"), ("human", "rods"), ("tree:8", "quadruped"))
APART = 900.0  # mm between two bodies


def main() -> None:
    """Print the part of exact trees per structure and fault, then of pairs of bodies that are told apart."""
    n_seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    show_machine()
    rows = [(name, *(cell(name, faults, n_seeds) for faults in FAULTS.values())) for name in STRUCTURES]
    show("Exact trees, limbs given, 1000 frames", ("structure", *FAULTS), rows)
    pairs = [
        (" + ".join(names), f"{sum(are_apart(names, seed) for seed in range(n_seeds))}/{n_seeds}") for names in PAIRS
    ]
    show("Two bodies in one take are two exact trees, 1 mm", ("bodies", "takes"), pairs)


def cell(name: str, faults: dict[str, Any], n_seeds: int) -> str:
    """Exact trees and mean time."""
    exact, started = 0, time.process_time()
    spent = 0.0
    for seed in range(n_seeds):
        case = simulate(name, seed=seed, n_frames=1000, **faults)
        started = time.process_time()
        exact += tree(case.take, case.truth.limb_of_marker) == true_tree(case)
        spent += time.process_time() - started
    return f"{exact}/{n_seeds} ({spent / n_seeds:.2f} s)"


def are_apart(names: tuple[str, str], seed: int) -> bool:
    """Whether two bodies that are always seen together are two trees, both exact."""
    first, second = simulate(names[0], seed=seed, noise=1.0), simulate(names[1], seed=seed + 50, noise=1.0)
    assert isinstance(first.take, Trajectories)
    assert isinstance(second.take, Trajectories)
    n_limbs = len(first.truth.limb_names)
    owner = np.concatenate([first.truth.limb_of_marker, second.truth.limb_of_marker + n_limbs])
    positions = np.concatenate([first.take.positions, second.take.positions + APART], axis=1)
    take = Trajectories(positions, tuple(map(str, range(len(owner)))), first.take.rate)
    shifted = {frozenset(limb + n_limbs for limb in edge) for edge in true_tree(second)}
    return tree(take, owner) == true_tree(first) | shifted


def tree(take: Trajectories | PointCloud, limb_of_marker: Ints) -> set[frozenset[int]]:
    """Edges found."""
    assert isinstance(take, Trajectories)
    topology = find_joints(take, Limbs(limb_of_marker, np.zeros((len(limb_of_marker),) * 2)))
    return {frozenset(edge) for edge in topology.edges.tolist()}


def true_tree(case: SimulatedTake) -> set[frozenset[int]]:
    """Edges that are true."""
    return {frozenset(edge) for edge in case.truth.edges.tolist()}


if __name__ == "__main__":
    main()
