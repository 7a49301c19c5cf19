"""What the graph tells of joints that were taken, and of those that were not."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from PySide6.QtCore import QCoreApplication

from skelgen.app.report.wording import digits, fixed, listed
from skelgen.kinematics.joint_motion import AngleRange, angle_ranges
from skelgen.model import Project, Topology
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.joints.tree import SMALL_MARGIN

translate = QCoreApplication.translate


@dataclass(frozen=True, eq=False)
class JointFact:
    """What is told of a joint of the tree.

    Attributes
    ----------
    parent, child : int
        Limbs.
    cost, margin : float, mm^2
        Its cost, and how much worse the best tree without it is; NaN where there is no other.
    rival : tuple of int or None
        The limbs that the cheapest other joint would connect.
    kind : str
        Empty before the skeleton.
    ranges : tuple of AngleRange
        Of each angle; none before the skeleton.
    """

    parent: int
    child: int
    cost: float
    margin: float
    rival: tuple[int, int] | None
    kind: str
    ranges: tuple[AngleRange, ...]

    @property
    def ratio(self) -> float:
        """Cost of the best other joint over its own; infinite where there is no other or nothing is lost here."""
        if self.rival is None or self.cost <= 0:
            return np.inf
        return (self.cost + self.margin) / self.cost

    @property
    def is_doubtful(self) -> bool:
        """Whether another joint would do nearly as well."""
        return self.ratio < SMALL_MARGIN

    @property
    def label(self) -> str:
        """How many times dearer the best other joint is; empty where there is none."""
        if not np.isfinite(self.ratio):
            return ""
        return f"{digits(self.ratio, 2)}×"

    @property
    def sentences(self) -> str:
        """All that is told, a line each."""
        lines = [_pair(self.parent, self.child) + (": " + translate("Graph", self.kind) if self.kind else "")]
        lines.append(translate("Graph", "cost {0} mm²").format(digits(self.cost)))
        if self.rival is None:
            lines.append(translate("Graph", "no other joint could connect the two sides"))
        else:
            best = translate("Graph", "best other joint: {0}, {1} mm²")
            lines.append(best.format(_pair(*self.rival), digits(self.cost + self.margin)))
            doubtful, sure = translate("Graph", "margin {0} mm²: hardly any"), translate("Graph", "margin {0} mm²")
            lines.append((doubtful if self.is_doubtful else sure).format(digits(self.margin)))
        for angle in self.ranges:
            low, high = (fixed(float(np.degrees(end)), 0) for end in (angle.low, angle.high))
            lines.append(f"{angle.name}: {low}° … {high}°")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class GraphFacts:
    """What the graph shows.

    Attributes
    ----------
    topology : Topology
        Of the project.
    joints : tuple of JointFact
        In the order of the topology's children.
    pairs : ndarray of intp, shape (n_pairs, 2)
        Limbs between which a joint was tried and not taken, the cheapest first.
    strengths : ndarray, shape (n_pairs,)
        1 for the cheapest pair, 0 for the dearest.
    """

    topology: Topology
    joints: tuple[JointFact, ...]
    pairs: Ints
    strengths: Floats

    def sentence_of_pair(self, first: int, second: int) -> str:
        """Say why the tree does not join two limbs."""
        costs = self.topology.joint_costs
        lines = [translate("Graph", "{0}: not in the tree").format(_pair(first, second))]
        lines.append(translate("Graph", "cost {0} mm²").format(digits(float(costs[first, second]))))
        if (first, second) in self.topology.loops or (second, first) in self.topology.loops:
            lines.append(translate("Graph", "seems to be a joint as well: it closes a ring"))
        return "\n".join([*lines, self._way(first, second)])

    def _way(self, first: int, second: int) -> str:
        """How the tree joins two limbs."""
        costs, path = self.topology.joint_costs, tree_path(self.topology.parents, first, second)
        if not path:
            return translate("Graph", "the two limbs belong to separate bodies")
        dearest = max(float(costs[one, other]) for one, other in pairwise(path))
        way = listed([str(limb) for limb in path[1:-1]])
        told = translate("Graph", "the tree joins them by way of {0}, at no joint for more than {1} mm²")
        return told.format(way, digits(dearest))


def _pair(first: int, second: int) -> str:
    return translate("Graph", "limb {0} – limb {1}").format(first, second)


def find_graph(project: Project) -> GraphFacts:
    """Return what the graph of a project with joints shows."""
    topology = project.topology
    margins, rivals = topology.margins, topology.rivals
    ranges: tuple[tuple[AngleRange, ...], ...] = ((),) * topology.n_joints
    if project.has("skeleton"):
        ranges = angle_ranges(project.skeleton, project.motion, project.trajectories.positions)
    joints = tuple(
        JointFact(
            parent,
            child,
            float(topology.joint_costs[parent, child]),
            float(margins[joint]),
            None if rivals[joint, 0] < 0 else (int(rivals[joint, 0]), int(rivals[joint, 1])),
            project.skeleton.joints[joint].kind if project.has("skeleton") else "",
            ranges[joint],
        )
        for joint, (parent, child) in enumerate(topology.edges.tolist())
    )
    pairs = _other_pairs(topology)
    return GraphFacts(topology, joints, pairs, _strengths(topology.joint_costs[pairs[:, 0], pairs[:, 1]]))


def tree_path(parents: Ints, first: int, second: int) -> list[int]:
    """Return the limbs from one to another along the tree, both included; none between separate bodies."""
    to_root = [_upward(parents, limb) for limb in (first, second)]
    shared = next((limb for limb in to_root[0] if limb in to_root[1]), None)
    if shared is None:
        return []
    there, back = (way[: way.index(shared)] for way in to_root)
    return [*there, shared, *reversed(back)]


def _upward(parents: Ints, limb: int) -> list[int]:
    way = [limb]
    while parents[way[-1]] >= 0:
        way.append(int(parents[way[-1]]))
    return way


def _other_pairs(topology: Topology) -> Ints:
    """Pairs with a known cost that are no joints of the tree, the cheapest first."""
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
