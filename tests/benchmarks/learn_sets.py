"""Learn skelgen/stages/limbs/tables/worn_sets.npz, shapes of marker sets: ``python tests/benchmarks/learn_sets.py``.

Each set is worn by simulated people of all sizes, with soft tissue as measured, in all natural motions. Kept are means
of the logarithms of distances and of how much they vary, and standard deviations between people, with what simulation
does not vary: where exactly a marker is stuck.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import skelgen.stages.limbs.worn_sets as module
from skelgen.model.arrays import Floats
from skelgen.simulation import simulate
from skelgen.simulation.people import LABORATORY_SETS, MARKER_SETS, MOTIONS

N_PEOPLE, FIRST_SEED, N_FRAMES = 15, 7000, 200  # of each set
STUCK, MOVED = 0.12, 0.5  # least standard deviations of both logarithms


def main() -> None:
    """Write the table."""
    table = {}
    for marker_set in (*MARKER_SETS, *LABORATORY_SETS):
        shapes: list[tuple[Floats, Floats]] = []
        for person in range(N_PEOPLE):
            case = simulate(
                "human", seed=FIRST_SEED + person, motion=MOTIONS[person % len(MOTIONS)], marker_set=marker_set,
                n_frames=N_FRAMES, soft_tissue="realistic", noise=0.3,
            )  # fmt: skip
            shape = module.shape_of(np.asarray(case.take.positions))
            shapes.append((shape.distances, shape.motions))
        found = np.array(shapes)
        least = np.array([STUCK, MOVED])[:, np.newaxis, np.newaxis]
        table[f"{marker_set}/mean"] = found.mean(axis=0).astype(np.float16)
        table[f"{marker_set}/spread"] = np.sqrt(found.var(axis=0) + least**2).astype(np.float16)
        table[f"{marker_set}/markers"] = np.array(case.take.names)
        table[f"{marker_set}/segments"] = case.truth.limb_of_marker.astype(np.uint8)
        print(marker_set, len(case.truth.limb_of_marker), flush=True)
    np.savez_compressed(Path(module.__file__).with_name("tables") / "worn_sets.npz", **table)


if __name__ == "__main__":
    main()
