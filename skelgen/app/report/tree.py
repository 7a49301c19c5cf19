"""The tree drawn from its roots outward: one box per limb, one joint sign per edge, lengths of the limbs between."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.graph import Bar, CostGraph, Disc, JointCost, joint_sign
from skelgen.app.drawing.wording import as_many_as_fit, clipped, counted, digits
from skelgen.model import Project

_BOX_WIDTH, _BOX_HEIGHT = 148.0, 36.0
_COLUMN, _ROW = 190.0, 62.0
_MARGIN = 8.0
_SIGN = 5.5  # px, half the height of a joint's sign
_LABEL_SPACE = 20.0  # above a box, for its joint
_NAME_ROOM = 18  # characters beside the limb's number
_LEAST_COMMON = 4  # characters that make a common beginning a name
_LEAST_SCALE = 0.8  # below this the labels are no longer readable: the drawing scrolls instead


@dataclass(frozen=True)
class _Place:
    x: float
    y: float


def tree_figure(project: Project, lengths: list[measures.Length]) -> Markup:
    """Draw the tree of limbs.

    Parameters
    ----------
    project : Project
        With joints; the types of joints appear when the skeleton is there too.
    lengths : list of Length
        What `measures.joint_lengths` gives.
    """
    parents = project.topology.parents
    depths, rows = measures.tidy_places(parents)
    places = [
        _Place(_MARGIN + _COLUMN * depth, _MARGIN + _LABEL_SPACE + _ROW * row)
        for depth, row in zip(depths.tolist(), rows.tolist(), strict=True)
    ]
    width = max(place.x for place in places) + _BOX_WIDTH + _MARGIN
    height = max(place.y for place in places) + _BOX_HEIGHT + _MARGIN
    edges = [_edge(project, lengths, places, joint) for joint in range(project.topology.n_joints)]
    boxes = [_box(project, limb, place) for limb, place in enumerate(places)]
    label = f"Tree of {counted(len(parents), 'limb')}"
    return svg.drawing(width, height, label, *edges, *boxes, least=_LEAST_SCALE * width)


def sign_figure(kind: str, x: float, y: float) -> Markup:
    """Draw the sign of a type of joint, centred at a place [px].

    Parameters
    ----------
    kind : str
        Type of the joint; empty where it is not known.
    x, y : float, px
        Its middle.
    """
    parts = joint_sign(kind)
    outlines = [_sign_part(part, x, y, "sign") for part in parts]
    inside = [_sign_part(part, x, y, "sign", style="stroke:none") for part in parts]  # no seams where parts cross
    return svg.group(*outlines, *inside) if len(parts) > 1 else outlines[0]


def _sign_part(part: Disc | Bar, x: float, y: float, cls: str, **attributes: str) -> Markup:
    if isinstance(part, Disc):
        return svg.circle(x, y, _SIGN * part.radius, "sign-open" if part.hole else cls)
    half_width, half_height = _SIGN * part.half_width, _SIGN * part.half_height
    corner = _SIGN * part.corner
    return svg.rect(x - half_width, y - half_height, 2 * half_width, 2 * half_height, cls, rx=corner, **attributes)


def _box(project: Project, limb: int, place: _Place) -> Markup:
    markers = project.limbs.markers_of(limb)
    names = [project.trajectories.names[marker] for marker in markers]
    middle = place.y + _BOX_HEIGHT / 2
    parts = [
        svg.tag("title", f"{project.limbs.called(limb)}: {', '.join(names)}"),
        svg.rect(place.x, place.y, _BOX_WIDTH, _BOX_HEIGHT, "box outline", rx=7),
        svg.circle(place.x + 20, middle, 12, "fill"),
        svg.text(place.x + 20, middle + 4, str(limb), "on-fill", anchor="middle"),
        svg.text(place.x + 38, middle - 3, counted(len(markers), "marker"), "strong"),
        svg.text(place.x + 38, middle + 10, _caption(names), "small"),
    ]
    return svg.group(*parts, cls=f"limb{limb}")


def _caption(names: list[str]) -> str:
    """What the markers' names have in common, where that says something, otherwise the first names."""
    same = itertools.takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    common = "".join(letters[0] for letters in same).rstrip(" 0123456789_-.:")
    if len(names) > 1 and len(common) >= _LEAST_COMMON:
        return clipped(common, _NAME_ROOM)
    return as_many_as_fit(names, _NAME_ROOM)


def _edge(project: Project, lengths: list[measures.Length], places: list[_Place], joint: int) -> Markup:
    parent, child = project.topology.edges[joint].tolist()
    start = _Place(places[parent].x + _BOX_WIDTH, places[parent].y + _BOX_HEIGHT / 2)
    end = _Place(places[child].x, places[child].y + _BOX_HEIGHT / 2)
    bend = svg.number((start.x + end.x) / 2)
    across, down, until, final = (svg.number(value) for value in (start.x, start.y, end.x, end.y))
    curve = f"M{across} {down}C{bend} {down} {bend} {final} {until} {final}"
    length = measures.bone_length(lengths, project.topology, joint)
    kind = project.skeleton.joints[joint].kind if project.has("skeleton") else ""
    words = [f"J{joint}", kind, "" if np.isnan(length) else f"{digits(length)} mm"]
    is_doubtful = joint in project.topology.doubtful
    if is_doubtful and project.topology.edge_probability is not None:
        words.append(f"{100 * project.topology.edge_probability[joint]:.0f} %")
    parts = [
        svg.tag("path", d=curve, cls="edge doubtful" if is_doubtful else "edge"),
        sign_figure(kind, end.x - 12, end.y),
        svg.text(
            places[child].x + 2,
            places[child].y - 6,
            " · ".join(filter(None, words)),
            "small doubtful" if is_doubtful else "small",
        ),
    ]
    return svg.group(*parts)


_SIDE = 440.0
_RADIUS = 175.0
_NODE = 14.0
_LABEL_PLACE = 0.4  # along a line from the child: the middle of a longer one may lie behind another limb
_CHARACTER = 6.0  # px, width of a digit in a label
_STRONGEST, _FAINTEST = 0.55, 0.05  # opacity of the cheapest and the dearest joint that was not kept
_CANDIDATES_PER_LIMB = 6  # drawn beside the tree: dearer joints would only blacken the picture


def graph_figure(project: Project, graph: CostGraph) -> Markup:
    """Draw the limbs as nodes, cheap candidate joints as faint lines, and the spanning tree as strong ones.

    Parameters
    ----------
    project : Project
        With joints.
    graph : CostGraph
        What `find_cost_graph` gives.
    """
    order = measures.limb_order(project)
    places = {limb: _on_circle(index, len(order)) for index, limb in enumerate(order)}
    nodes = [_node(limb, *place) for limb, place in places.items()]
    tree = [
        svg.line(*places[joint.parent], *places[joint.child], "tree doubtful" if joint.is_doubtful else "tree")
        for joint in graph.joints
    ]
    labels = [_cost_label(joint, places[joint.parent], places[joint.child]) for joint in graph.joints]
    label = "Joint costs between limbs with the spanning tree"
    return svg.drawing(_SIDE, _SIDE, label, *_candidates(graph, places), *tree, *nodes, *labels, least=300)


def _on_circle(index: int, count: int) -> tuple[float, float]:
    angle = 2 * math.pi * index / count - math.pi / 2
    return _SIDE / 2 + _RADIUS * math.cos(angle), _SIDE / 2 + _RADIUS * math.sin(angle)


def _candidates(graph: CostGraph, places: dict[int, tuple[float, float]]) -> list[Markup]:
    shown = graph.pairs[: _CANDIDATES_PER_LIMB * len(places)].tolist()
    lines = []
    for rank, (first, second) in enumerate(shown):
        opacity = _STRONGEST + (_FAINTEST - _STRONGEST) * (rank / max(len(shown) - 1, 1)) ** 0.5
        lines.append(svg.line(*places[first], *places[second], "candidate", stroke_opacity=f"{opacity:.2f}"))
    return lines[::-1]


def _cost_label(joint: JointCost, far: tuple[float, float], near: tuple[float, float]) -> Markup:
    x, y = (end + _LABEL_PLACE * (start - end) for start, end in zip(far, near, strict=True))
    label = digits(joint.cost, 2)
    width = _CHARACTER * len(label) + 6
    plate = svg.rect(x - width / 2, y - 7, width, 14, "plate", rx=7)
    return svg.group(plate, svg.text(x, y + 4, label, "small", anchor="middle"))


def _node(limb: int, x: float, y: float) -> Markup:
    parts = [svg.circle(x, y, _NODE, "fill"), svg.text(x, y + 4, str(limb), "on-fill", anchor="middle")]
    return svg.group(*parts, cls=f"limb{limb}")
