"""Limbs and trees of real people beside an expert's: ``python tests/benchmarks/people.py [take ...]``.

The takes lie in ``../shared/data/bodies`` beside the project. Two rows each: everything found, and the tree with the
expert's limbs given. Purity is the part of markers that lie on a limb of their own body, edges the part of joints that
join neighbouring bodies (or parts of one), tree the part of the expert's joints that are found.
"""

from __future__ import annotations

import sys
import time
from itertools import product
from pathlib import Path

import numpy as np
from shown import show, show_machine

import skelgen
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Bools, Ints
from skelgen.stages.joints import find_joints
from skelgen.stages.limbs import find_limbs

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "bodies"


def main() -> None:
    """Print the table."""
    show_machine()
    rows = []
    for name in sys.argv[1:] or sorted(path.name.split(".")[0] for path in FOLDER.glob("*.truth.npz")):
        take, allowed, parents = person(name)
        for title in ("found", "limbs given"):
            started = time.process_time()
            limbs = find_limbs(take) if title == "found" else given(allowed)
            edges = find_joints(take, limbs).edges.tolist()
            rows.append((name, title, *scores(limbs, edges, allowed, parents), f"{time.process_time() - started:.1f}"))
    show("Real people", ("take", "", "purity", "limbs", "bodies", "edges", "tree", "s"), rows)


def person(name: str) -> tuple[Trajectories, Bools, Ints]:
    """Markers, the bodies that each may be on, shape (n_markers, n_bodies), and the parents of bodies."""
    truth = np.load(FOLDER / f"{name}.truth.npz")
    take = skelgen.read(next(path for path in FOLDER.glob(f"{name}.*") if path.suffix != ".npz"))
    assert isinstance(take, Trajectories)
    index = {plain(label): marker for marker, label in enumerate(take.names)}
    kept = [index[plain(label)] for label in truth["labels"].tolist()]
    names = tuple(f"M{number}" for number in range(len(kept)))
    return Trajectories(take.positions[:, kept], names, take.rate), truth["allowed"], truth["parent"]


def plain(label: str) -> str:
    """A marker's name without its subject."""
    return label.rsplit(":", maxsplit=1)[-1].strip().lower()


def given(allowed: Bools) -> Limbs:
    """The expert's limbs; a marker on two is on the first."""
    limb_of_marker = np.unique(allowed.argmax(axis=1), return_inverse=True)[1]
    return Limbs(limb_of_marker, np.zeros((len(allowed), len(allowed))))


def scores(limbs: Limbs, edges: list[list[int]], allowed: Bools, parents: Ints) -> tuple[str, ...]:
    """Purity, limbs found, bodies that have a limb with most of their own markers, right edges, tree found."""
    shares = [allowed[limbs.markers_of(limb)].sum(axis=0) for limb in range(limbs.n_limbs)]
    bodies = [set(np.flatnonzero(share == share.max()).tolist()) for share in shares]
    own = allowed[allowed.sum(axis=1) == 1].sum(axis=0)
    limb_of = limbs.limb_of_marker.tolist()
    pure = [limb >= 0 and any(row[body] for body in bodies[limb]) for limb, row in zip(limb_of, allowed, strict=True)]
    carried = set(np.flatnonzero(allowed.any(axis=0)).tolist())
    whole = [
        body
        for body in carried
        if any(body in best and share[body] >= own[body] / 2 for best, share in zip(bodies, shares, strict=True))
    ]
    joined = [{frozenset(pair) for pair in product(bodies[one], bodies[other])} for one, other in edges]
    true = {frozenset((body, int(parents[body]))) for body in carried if parents[body] in carried}
    near = true | {frozenset((body,)) for body in carried}
    right = np.mean([bool(pairs & near) for pairs in joined])
    found = len(true & set().union(*joined)) / len(true)
    counts = (f"{limbs.n_limbs} of {len(carried)}", f"{len(whole)} of {len(carried)}")
    return f"{np.mean(pure):.3f}", *counts, f"{right:.3f}", f"{found:.3f}"


if __name__ == "__main__":
    main()
