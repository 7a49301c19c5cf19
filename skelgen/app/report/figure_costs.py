"""The graph of joint costs: limbs on a circle in the order of the tree, every candidate joint, the tree on top."""

from __future__ import annotations

import math

import numpy as np
from markupsafe import Markup

from skelgen.app.report import measures, svg
from skelgen.app.report.wording import digits
from skelgen.model import Project

_SIDE = 440.0
_RADIUS = 175.0
_NODE = 14.0
_LABEL_PLACE = 0.4  # along a line from the child: the middle of a longer one may lie behind another limb
_CHARACTER = 6.0  # px, width of a digit in a label
_STRONGEST, _FAINTEST = 0.55, 0.05  # opacity of the cheapest and the dearest joint that was not kept
_CANDIDATES_PER_LIMB = 6  # drawn beside the tree: dearer joints would only blacken the picture


def cost_graph(project: Project) -> Markup:
    """Draw the limbs as nodes, cheap candidate joints as faint lines, and the spanning tree as strong ones.

    Parameters
    ----------
    project : Project
        With joints.
    """
    order = measures.limb_order(project)
    places = {limb: _on_circle(index, len(order)) for index, limb in enumerate(order)}
    nodes = [_node(limb, *place) for limb, place in places.items()]
    tree = [_kept(project, places, joint) for joint in range(project.topology.n_joints)]
    labels = [_cost_label(project, places, joint) for joint in range(project.topology.n_joints)]
    label = "Joint costs between limbs with the spanning tree"
    return svg.drawing(_SIDE, _SIDE, label, *_candidates(project, places), *tree, *nodes, *labels, least=300)


def _on_circle(index: int, count: int) -> tuple[float, float]:
    angle = 2 * math.pi * index / count - math.pi / 2
    return _SIDE / 2 + _RADIUS * math.cos(angle), _SIDE / 2 + _RADIUS * math.sin(angle)


def _candidates(project: Project, places: dict[int, tuple[float, float]]) -> list[Markup]:
    topology = project.topology
    kept = {frozenset(edge) for edge in topology.edges.tolist()}
    first, second = np.triu_indices(topology.n_limbs, 1)
    costs = topology.joint_costs[first, second]
    cheapest_first = np.argsort(costs, kind="stable").tolist()
    known = [pair for pair in cheapest_first if not np.isnan(costs[pair])]
    shown = [pair for pair in known if {int(first[pair]), int(second[pair])} not in kept][
        : _CANDIDATES_PER_LIMB * topology.n_limbs
    ]
    lines = []
    for rank, pair in enumerate(shown):
        opacity = _STRONGEST + (_FAINTEST - _STRONGEST) * (rank / max(len(shown) - 1, 1)) ** 0.5
        ends = (*places[int(first[pair])], *places[int(second[pair])])
        lines.append(svg.line(*ends, "candidate", stroke_opacity=f"{opacity:.2f}"))
    return lines[::-1]


def _kept(project: Project, places: dict[int, tuple[float, float]], joint: int) -> Markup:
    parent, child = project.topology.edges[joint].tolist()
    return svg.line(*places[parent], *places[child], "tree")


def _cost_label(project: Project, places: dict[int, tuple[float, float]], joint: int) -> Markup:
    parent, child = project.topology.edges[joint].tolist()
    near, far = places[child], places[parent]
    x, y = (end + _LABEL_PLACE * (start - end) for start, end in zip(far, near, strict=True))
    label = digits(project.topology.joint_costs[parent, child], 2)
    width = _CHARACTER * len(label) + 6
    return svg.group(
        svg.rect(x - width / 2, y - 7, width, 14, "plate", rx=7), svg.text(x, y + 4, label, "small", anchor="middle")
    )


def _node(limb: int, x: float, y: float) -> Markup:
    parts = [svg.circle(x, y, _NODE, "fill"), svg.text(x, y + 4, str(limb), "on-fill", anchor="middle")]
    return svg.group(*parts, cls=f"limb{limb}")
