#!/usr/bin/env python3
"""Names by shape and motion: takes whose marker names are hidden, against the names that the markers tell.

    python tests/benchmarks/shapes.py [people|quadruped|hand] [--takes 20] [--leave-out] [--files TAKE ...]

A tree is right if the limbs are those of the body and its joints join neighbours. Of takes with right trees, and of the
others, it counts those with all names right, limbs with the right name, takes without names, and wrong sides. With
--leave-out the shape of the marker set that a simulated person wears is not known.
"""

import argparse

import numpy as np

import skelgen
from skelgen.marker_sets import MARKER_SETS
from skelgen.simulation import simulate
from skelgen.simulation.people import MOTIONS
from skelgen.stages.limbs import worn_sets
from skelgen.stages.names import PARENTS, name_limbs, recognised_set

_PARTS = {"proximal": "1", "middle": "2", "distal": "3"}


def hidden(take):
    """Return the take with names that say nothing."""
    names = [f"M{marker:03d}" for marker in range(take.positions.shape[1])]
    return skelgen.Trajectories(take.positions, names, take.rate)


def of_markers(project, own):
    """Return the names of limbs that the hidden names of markers tell."""
    names = [own[int(name[1:4])] for name in project.trajectories.names]
    return name_limbs(project.limbs, names, recognised_set(names))


def of_all(truth):
    """Return what a shape calls each simulated limb."""
    if "palm" not in truth.limb_names:
        return truth.limb_names
    parts = [name.partition(" ") for name in truth.limb_names]
    return [f"right {finger} {_PARTS[part]}" if part else "right hand" for finger, _, part in parts]


def is_right(project, wanted, edges=None):
    """Whether limbs are the body's and joined to one tree as they are; pieces of a person's segment count as one."""
    plain = [name if edges else name.rstrip("0123456789 ") for name in wanted]
    joined = {frozenset((plain[joint.parent], plain[joint.child])) for joint in project.skeleton.joints}
    if edges is not None:
        return joined == edges
    if len(project.skeleton.roots) > 1:
        return False
    return joined <= {frozenset((name, inward(name, plain))) for name in plain} | {frozenset((name,)) for name in plain}


def inward(name, names):
    """Return the next segment towards the pelvis that is one of some names."""
    while name in PARENTS:
        name = PARENTS[name]
        if name in names:
            break
    return name


def sides(name):
    """Return the side in a name."""
    return next((side for side in ("left", "right") if name.startswith(f"{side} ")), "")


def judged(project, wanted, edges=None):
    """Return whether the tree is right, and how many limbs are right, neutral, and on the wrong side, of how many."""
    found = project.limbs.names
    plain = [name.rstrip("0123456789 ") if edges is None else name for name in wanted]
    called = [name.rstrip("0123456789 ") if edges is None else name for name in found]
    pairs = list(zip(called, plain, strict=True))
    wrong = sum(bool(sides(one)) and bool(sides(other)) and sides(one) != sides(other) for one, other in pairs)
    neutral = sum(name.startswith("limb") or name.endswith((" A", " B")) for name in found)
    return is_right(project, wanted, edges), sum(one == other for one, other in pairs), neutral, wrong, len(found)


def take_of(kind, seed):
    """Return a simulated take."""
    if kind != "people":
        return simulate(kind, n_frames=600, seed=seed, noise=0.02 if kind == "hand" else 0.3)
    motions = sorted(MOTIONS)
    motion, worn = motions[(seed + seed // len(MARKER_SETS)) % len(motions)], MARKER_SETS[seed % len(MARKER_SETS)]
    options = {"motion": motion, "marker_set": worn, "soft_tissue": "realistic"}
    return simulate("human", n_frames=500, seed=seed, noise=0.3, **options)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", nargs="?", default="people", choices=["people", "quadruped", "hand"])
    parser.add_argument("--takes", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--leave-out", action="store_true")
    parser.add_argument("--files", nargs="*", default=())
    wanted = parser.parse_args()
    rows, shapes_of_sets = [], worn_sets.worn_sets()
    for what in wanted.files or range(wanted.first, wanted.first + wanted.takes):
        if wanted.files:
            take = skelgen.read(what)
            project = skelgen.reconstruct(hidden(take))
            row = judged(project, of_markers(project, take.names))
        else:
            simulated = take_of(wanted.kind, what)
            if wanted.leave_out:
                unknown = MARKER_SETS[what % len(MARKER_SETS)]
                known = tuple(one for one in shapes_of_sets if one.name != unknown)
                worn_sets.worn_sets = lambda known=known: known
            project = skelgen.reconstruct(hidden(simulated.take))
            if wanted.kind == "people":
                row = judged(project, of_markers(project, simulated.take.names))
            else:
                truth, called = simulated.truth, of_all(simulated.truth)
                carried = [int(project.limbs.markers_of(limb)[0]) for limb in range(project.limbs.n_limbs)]
                edges = {frozenset((called[one], called[other])) for one, other in truth.edges}
                row = judged(project, [called[truth.limb_of_marker[marker]] for marker in carried], edges)
        rows.append(row)
        tree, right, neutral, wrong, n_limbs = row
        told = f"{right} of {n_limbs} names right, {neutral} neutral, {wrong} wrong sides"
        print(f"{what}: tree {'right' if tree else 'wrong'}, {told}", flush=True)
    table = np.array(rows)
    for title, part in (("right trees", table[table[:, 0] == 1]), ("wrong trees", table[table[:, 0] == 0])):
        if len(part):
            whole, limbs, sided = (part[:, 1] == part[:, 4]).sum(), part[:, 1].sum(), (part[:, 3] > 0).sum()
            unnamed = (part[:, 2] == part[:, 4]).sum()
            told = f"{limbs} of {part[:, 4].sum()} limbs, {unnamed} takes without names, {sided} with a wrong side"
            print(f"{title}: {whole} of {len(part)} takes all right, {told}")


if __name__ == "__main__":
    main()
