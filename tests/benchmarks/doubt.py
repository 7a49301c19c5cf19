"""Whether probabilities hold: ``python tests/benchmarks/doubt.py [n_takes] [--learn]``.

Simulated people (in marker sets that are known, and that are not, and with markers anywhere on their limbs), animals,
machines and random trees with soft tissue, and bodies that are seen without any error, 12 takes of each kind unless
told otherwise; real people (``../shared/data/bodies`` beside the project), and a shoulder
whose markers stand on pins in the bones (``../shared/data/bone_pin``). Nothing is given. Memberships of markers and
edges of trees are sorted by their probability; beside stand how many are right. A marker is right on a limb most of
whose markers are of its body, alone where no limb is of its body; an edge between neighbouring bodies or two parts of
one. With --learn the constants of skelgen/stages/limbs/membership.py and skelgen/stages/joints/costs.py are learned
anew, every kind alike, without takes of rigid bodies: the constants are about skin and noise.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import limbs as limb_benchmark
import numpy as np
from people import USUAL_PLACE, load, unknown_people
from real_recordings import BONE_PINS, BONES, CENTRE
from shown import show, show_machine
from sklearn.linear_model import LogisticRegression

import skelgen
from skelgen.benchmark.people import simulated_animal, simulated_person, without_names
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.simulation import SimulatedTake, simulate
from skelgen.stages.joints import costs as joint_costs
from skelgen.stages.joints import find_joints
from skelgen.stages.limbs import find_limbs, membership

BOUNDS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0 + 1e-9)
WANTED, AT = 0.93, 0.95  # of what is stated with so much and more
TREES = ("tree:8", "tree:15", "quadruped", "tree:10")
EXACT = ("human", "quadruped", "classic-human", "tree:8")
RIGID = ("exact", "bone pins")
"""Kinds of takes without soft tissue and noise to speak of."""


@dataclass(frozen=True, eq=False)
class Known:
    """A take, the bodies that each marker may be on, and the parent of each body, -1 for none."""

    kind: str
    take: Trajectories
    allowed: Bools
    parents: Ints


@dataclass(frozen=True, eq=False)
class Told:
    """What was stated of a take, and what is right; `tree` is the part of the joints between bodies that was found."""

    kind: str
    of_markers: Floats
    marker_is_right: Bools
    marker_features: Floats
    is_alone: Bools
    of_edges: Floats
    edge_is_right: Bools
    edge_features: Floats
    tree: float


def main() -> None:
    """Print the reliability of memberships and edges by kind."""
    arguments = [argument for argument in sys.argv[1:] if argument != "--learn"]
    n_takes = int(arguments[0]) if arguments else 12
    show_machine()
    told = [judged(known) for known in takes(n_takes)]
    for title, stated, right in (
        ("Markers on limbs", "of_markers", "marker_is_right"),
        ("Edges of trees", "of_edges", "edge_is_right"),
    ):
        rows = []
        for kind in dict.fromkeys(one.kind for one in told):
            own = [one for one in told if one.kind == kind]
            values, hits = (np.concatenate([getattr(one, name) for one in own]) for name in (stated, right))
            rows.append((kind, *cells(values, hits), share(hits[values >= AT])))
        bounds = [f"{low:.2f} to {min(high, 1):.2f}" for low, high in pairwise(BOUNDS)]
        show(f"{title}: right of stated, by probability; wanted {WANTED} at {AT}", ("", *bounds, "above"), rows)
    if "--learn" in sys.argv:
        learn(told)


def cells(values: Floats, hits: Bools) -> Iterator[str]:
    """Right of all between each two bounds."""
    for low, high in pairwise(BOUNDS):
        inside = (values >= low) & (values < high)
        yield f"{hits[inside].sum()}/{inside.sum()}" if inside.any() else ""


def share(hits: Bools) -> str:
    """Part that is right."""
    return f"{hits.mean():.3f}" if len(hits) else ""


def takes(n_takes: int) -> Iterator[Known]:
    """So many takes of each simulated kind, and real people."""
    machines = [case for key in ("small 2 mm", "noise") for case in limb_benchmark.ROWS[key].cases]
    for index in range(n_takes):
        yield simulated("person", simulated_person(index)[0])
        yield simulated("animal", simulated_animal(index)[0])
        case = machines[index * len(machines) // n_takes]
        options = case.options | {"n_frames": 400}
        yield simulated("machine", simulate(limb_benchmark.structure(case), seed=case.seed, **options))
        tissue, moved = (3.0, 8.0)[index % 2], (1.0, 0.5, 0.3)[index % 3]
        options = {"n_frames": 400, "noise": 0.5, "soft_tissue": tissue, "motion_range": moved}
        yield simulated("soft tree", simulate(TREES[index % len(TREES)], seed=2000 + index, **options))
        options = {"n_frames": 600, "noise": 0.3, "soft_tissue": "realistic"}
        yield simulated("anywhere", without_names(simulate("human", seed=100 + index, **options)))
        yield simulated("exact", simulate(EXACT[index % len(EXACT)], seed=3000 + index, n_frames=400))
    for _, _, who in unknown_people(n_takes):
        yield Known("unknown set", who.take, who.allowed, who.parents)
    for path in sorted(USUAL_PLACE.glob("*.truth.npz")):
        real = load(USUAL_PLACE, path.name.removesuffix(".truth.npz"))
        yield Known("real person", real.take, real.allowed, real.parents)
    pins = USUAL_PLACE.parent / BONE_PINS
    if pins.exists():
        yield on_bone_pins(pins)


def on_bone_pins(path: Path) -> Known:
    """A shoulder by the names of its markers; its joint's centre, one of the points, is on both bones."""
    take = skelgen.read(path)
    assert isinstance(take, Trajectories)
    bones = ("thorax", "scapula", "humerus")
    allowed = np.array([[BONES.get(name, "humerus") == bone for bone in bones] for name in take.names])
    allowed[take.names.index(CENTRE), 1:] = True
    return Known("bone pins", take, allowed, np.array([-1, 0, 1]))


def simulated(kind: str, made: SimulatedTake) -> Known:
    """A take and its truth."""
    assert isinstance(made.take, Trajectories)
    n_bodies = len(made.truth.limb_names)
    parents = np.full(n_bodies, -1)
    for parent, child in made.truth.edges.tolist():
        parents[child] = parent
    return Known(kind, made.take, made.truth.limb_of_marker[:, np.newaxis] == np.arange(n_bodies), parents)


def judged(known: Known) -> Told:
    """State probabilities of a take and compare with the truth."""
    limbs = find_limbs(known.take)
    topology = find_joints(known.take, limbs)
    assert topology.edge_probability is not None
    bodies = [bodies_of(known, limbs, limb) for limb in range(limbs.n_limbs)]
    on_limb = np.flatnonzero(limbs.limb_of_marker >= 0)
    is_member = limbs.limb_of_marker[on_limb, np.newaxis] == np.arange(limbs.n_limbs)
    alone = membership.is_alone(is_member)
    right = []
    for marker, is_alone in zip(on_limb.tolist(), alone.tolist(), strict=True):
        own, limb = set(np.flatnonzero(known.allowed[marker]).tolist()), int(limbs.limb_of_marker[marker])
        others = [other for number, other in enumerate(bodies) if number != limb]
        right.append(not any(own & other for other in others) if is_alone else bool(own & bodies[limb]))
    near = neighbours(known)
    joined = [{frozenset((a, b)) for a in bodies[parent] for b in bodies[child]}
              for parent, child in topology.edges.tolist()]  # fmt: skip
    edges, found = [bool(one & near) for one in joined], set().union(*joined)
    suits = membership.limb_odds(known.take.positions[:, on_limb], is_member)
    return Told(
        known.kind,
        limbs.probability[on_limb],
        np.array(right, dtype=np.bool_),
        np.stack([membership.leads(suits, is_member), membership.relative_sizes(is_member)], axis=1),
        alone,
        topology.edge_probability,
        np.array(edges, dtype=np.bool_),
        edge_features(topology, limbs),
        float(np.mean([edge in found for edge in joints_of(known)])),
    )


def bodies_of(known: Known, limbs: Limbs, limb: int) -> set[int]:
    """Bodies that most markers of a limb may be on."""
    votes = known.allowed[limbs.markers_of(limb)].sum(axis=0)
    return set(np.flatnonzero((votes == votes.max()) & (votes > 0)).tolist())


def neighbours(known: Known) -> set[frozenset[int]]:
    """Bodies that are joined, by way of bodies without markers too, and each body with itself."""
    carried = known.allowed.any(axis=0)
    found = {frozenset((body,)) for body in range(len(carried))}
    for body, parent in enumerate(known.parents.tolist()):
        above = parent
        while above >= 0 and not carried[above]:
            above = int(known.parents[above])
        found |= {frozenset((body, above)), frozenset((body, parent))}
    return found


def joints_of(known: Known) -> list[frozenset[int]]:
    """Bodies with markers that are parent and child."""
    carried = known.allowed.any(axis=0)
    pairs = enumerate(known.parents.tolist())
    return [frozenset((body, parent)) for body, parent in pairs if parent >= 0 and carried[body] and carried[parent]]


def edge_features(topology: Topology, limbs: Limbs) -> Floats:
    """Features of edges; turns, which are no result, as they follow from the probabilities, shape (n_joints, 4)."""
    assert topology.edge_probability is not None
    features = joint_costs.edge_features(topology, np.full(topology.joint_costs.shape, np.nan), limbs)
    stated = topology.edge_probability * (1 + np.exp(-features[:, 0] / joint_costs.TIE))
    odds = np.log(stated / (1 - stated))
    features[:, 1] = (odds - joint_costs.BIAS - features @ joint_costs.WEIGHTS) / joint_costs.WEIGHTS[1]
    return features


def learn(told: list[Told]) -> None:
    """Print the constants that these takes give; every kind weighs alike, and every take of a kind."""
    told = [one for one in told if one.kind not in RIGID]
    part = {kind: 1 / sum(one.kind == kind for one in told) for kind in {one.kind for one in told}}
    features = np.concatenate([one.marker_features for one in told])
    right, alone = (np.concatenate([getattr(one, name) for one in told]) for name in ("marker_is_right", "is_alone"))
    weight = np.concatenate([np.full(len(one.of_markers), part[one.kind] / len(one.of_markers)) for one in told])
    print("BIAS, OF_LEAD, OF_SIZE =", fitted(features[~alone], right[~alone], weight[~alone]))
    print("BIAS_ALONE, OF_LEAD_ALONE =", fitted(features[alone, :1], right[alone], weight[alone]))
    features, right = (
        np.concatenate([getattr(one, name) for one in told]) for name in ("edge_features", "edge_is_right")
    )
    weight = np.concatenate([np.full(len(one.of_edges), part[one.kind]) for one in told])
    print("BIAS, WEIGHTS =", fitted(features, right, weight))


def fitted(features: Floats, right: Bools, weight: Floats) -> str:
    """Constant and weights of a logistic regression; none where all are right, or all wrong."""
    if right.all() or not right.any():
        return f"nothing to learn of {len(right)} that are {'right' if right.all() else 'wrong'}"
    fit = LogisticRegression(C=10).fit(features, right, sample_weight=weight * len(weight) / weight.sum())
    return ", ".join(f"{value:.2f}" for value in (fit.intercept_[0], *fit.coef_[0]))


if __name__ == "__main__":
    main()
