"""The graph of joint costs: joints of the tree with their margins, joints that were tried, signs of joint types."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen.kinematics.inverse.motion import AngleRange, angle_ranges
from skelgen.model import Project, Topology
from skelgen.model.arrays import Floats, Ints
from skelgen.model.limbs import DOUBTFUL


@dataclass(frozen=True, eq=False)
class JointCost:
    """What a joint of the tree costs, and how sure it is.

    Attributes
    ----------
    parent, child : int
        Limbs.
    cost, margin : float, mm^2
        Its cost, and how much worse the best tree without it is; NaN where there is no other.
    rival : tuple of int or None
        The limbs that the cheapest other joint would connect.
    probability, rival_probability : float
        That the limbs of this joint are neighbours, and that those of the rival are instead; NaN where not estimated.
    kind : str
        Type of the joint; empty before the skeleton.
    ranges : tuple of AngleRange
        Range of each angle; none before the skeleton.
    """

    parent: int
    child: int
    cost: float
    margin: float
    rival: tuple[int, int] | None
    probability: float
    rival_probability: float
    kind: str
    ranges: tuple[AngleRange, ...]

    @property
    def ratio(self) -> float:
        """Cost of the best other joint over its own; infinite where there is no other, or where its own is 0."""
        if self.rival is None or self.cost <= 0:
            return np.inf
        return (self.cost + self.margin) / self.cost

    @property
    def is_doubtful(self) -> bool:
        """Whether its limbs are perhaps no neighbours."""
        return self.probability < DOUBTFUL


@dataclass(frozen=True, eq=False)
class CostGraph:
    """The tree and the joints that were tried.

    Attributes
    ----------
    topology : Topology
        Of the project.
    joints : tuple of JointCost
        In the order of the topology's children.
    pairs : ndarray of intp, shape (n_pairs, 2)
        Limbs between which a joint was tried and not taken, the cheapest first.
    strengths : ndarray, shape (n_pairs,)
        1 for the cheapest pair, 0 for the dearest.
    """

    topology: Topology
    joints: tuple[JointCost, ...]
    pairs: Ints
    strengths: Floats


def find_cost_graph(project: Project) -> CostGraph:
    """Return the graph of a project with joints; types and ranges of joints are known with its skeleton."""
    topology = project.topology
    margins, rivals = topology.margins, topology.rivals
    unknown = np.full(topology.n_joints, np.nan)
    own = unknown if topology.edge_probability is None else topology.edge_probability
    others = unknown if topology.rival_probability is None else topology.rival_probability
    ranges: tuple[tuple[AngleRange, ...], ...] = ((),) * topology.n_joints
    if project.has("skeleton"):
        ranges = angle_ranges(project.skeleton, project.motion, project.trajectories.positions)
    joints = tuple(
        JointCost(
            parent,
            child,
            float(topology.joint_costs[parent, child]),
            float(margins[joint]),
            None if rivals[joint, 0] < 0 else (int(rivals[joint, 0]), int(rivals[joint, 1])),
            float(own[joint]),
            float(others[joint]),
            project.skeleton.joints[joint].kind if project.has("skeleton") else "",
            ranges[joint],
        )
        for joint, (parent, child) in enumerate(topology.edges.tolist())
    )
    pairs = _tried_pairs(topology)
    return CostGraph(topology, joints, pairs, _strengths(topology.joint_costs[pairs[:, 0], pairs[:, 1]]))


def _tried_pairs(topology: Topology) -> Ints:
    """Return the limbs between which a joint was tried and not taken, the cheapest first, shape (n_pairs, 2)."""
    known = np.triu(~np.isnan(topology.joint_costs), 1)
    for parent, child in topology.edges.tolist():
        known[min(parent, child), max(parent, child)] = False
    pairs = np.argwhere(known)
    costs = topology.joint_costs[pairs[:, 0], pairs[:, 1]]
    return pairs[np.argsort(costs, kind="stable")]


def _strengths(costs: Floats) -> Floats:
    """1 for the smallest cost, 0 for the largest, by their logarithms."""
    positive = np.maximum(costs, np.finfo(np.float64).tiny)
    if not len(costs) or positive.max() <= positive.min():
        return np.ones(len(costs))
    logs = np.log(positive)
    return np.asarray((logs.max() - logs) / (logs.max() - logs.min()))


class Disc(NamedTuple):
    """A disc of a radius, or a ring around a hole."""

    radius: float
    hole: float = 0.0


class Bar(NamedTuple):
    """An upright rectangle; both halves of its size, and the radius of its corners."""

    half_width: float
    half_height: float
    corner: float = 0.0


_SIGNS: dict[str, tuple[Disc | Bar, ...]] = {
    "ball": (Disc(1.0),),
    "hinge": (Bar(0.45, 1.2, 0.33),),
    "universal": (Bar(0.4, 1.2, 0.33), Bar(1.2, 0.4, 0.33)),
    "rigid": (Bar(0.9, 0.9),),
}


def joint_sign(kind: str) -> tuple[Disc | Bar, ...]:
    """Return the sign of a type of joint, about 0: a disc, a bar, a cross, a square; a ring where it is not known."""
    return _SIGNS.get(kind, (Disc(1.0, hole=0.5),))
