"""The skeleton drawn twice: as a tree from its roots outward, and in its reference pose.

The tree has one box per limb, with its name if it has one, one joint sign per edge, and lengths of the limbs between.
The pose is seen from two sides at right angles, with markers, joints and bones.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures, poses, svg
from skelgen.app.drawing.graph import Bar, CostGraph, Disc, JointCost, joint_sign
from skelgen.app.drawing.scales import limb_colour, round_below
from skelgen.app.drawing.wording import as_many_as_fit, clipped, digits, plain
from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats
from skelgen.model.limbs import body_and_limb
from skelgen.model.placed_joints import place_of
from skelgen.progress import counted

_BOX_WIDTH, _BOX_HEIGHT = 148.0, 36.0
_COLUMN, _ROW = 190.0, 62.0
_MARGIN = 8.0
_SIGN = 5.5  # px, half the height of a joint's sign
_LABEL_SPACE = 20.0  # above a box, for its joint
_NAME_ROOM = 18  # characters beside the limb's number
_STRONG_ROOM = 15  # bold ones, which are wider
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
    called, count = project.limbs.called(limb), counted(len(markers), "marker")
    is_named = called == project.limbs.names[limb]
    own = called if project.topology.parents[limb] < 0 else body_and_limb(called)[1]  # its root names the body
    strong, small = (clipped(own, _STRONG_ROOM), count) if is_named else (count, _caption(names))
    parts = [
        svg.tag("title", f"{called}: {', '.join(names)}"),
        svg.rect(place.x, place.y, _BOX_WIDTH, _BOX_HEIGHT, "box outline", rx=7),
        svg.circle(place.x + 20, middle, 12, "fill"),
        svg.text(place.x + 20, middle + 4, str(limb), "on-fill", anchor="middle"),
        svg.text(place.x + 38, middle - 3, strong, "strong"),
        svg.text(place.x + 38, middle + 10, small, "small"),
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
    fitted = project.skeleton.joints[joint] if project.has("skeleton") else None
    kind = "" if fitted is None else fitted.kind
    words = [f"J{joint}", kind, "" if np.isnan(length) else f"{digits(length)} mm"]
    is_doubtful = joint in project.topology.doubtful
    if is_doubtful and project.topology.edge_probability is not None:
        words.append(f"{100 * project.topology.edge_probability[joint]:.0f} %")
    is_open = fitted is not None and not fitted.is_determined
    parts = [
        svg.tag("title", _joint_title(fitted, joint)),
        svg.tag("path", d=curve, cls="edge doubtful" if is_doubtful else "edge"),
        sign_figure(kind, end.x - 12, end.y),
        svg.text(
            places[child].x + 2,
            places[child].y - 6,
            " · ".join(filter(None, words)),
            "small doubtful" if is_doubtful or is_open else "small",
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


_LONGER_SIDE = 560.0  # px, of the longer side of a view
_POSE_MARGIN = 34.0
_LEAST_WIDTH = 150.0  # px: a slim side view still needs room for its scale bar
_TRIAD = 22.0
_AXES = ("X", "Y", "Z")
_LABEL_DISTANCE = 13.0
_BAR_SHARE = 0.45  # of the width, the longest scale bar
_FILLED = 0.88  # of a small figure's side; the rest is margin
_SMALL_STYLE = (
    ".bone{stroke-width:2.5;stroke-linecap:round}.bone.loose{stroke-width:1.2;stroke-dasharray:1 3}"
    ".dot{r:1.3px}.joint{fill:#fff;stroke:#444;stroke-width:.8}"
)
_SMALL_TINT = ".limb{0} .bone{{stroke:{1}}}.limb{0} .dot{{fill:{1}}}"
_NEARLY_IN_PLANE = 0.85  # of an axis's length: more oblique ones would only be misread


@dataclass(frozen=True, eq=False)
class _Body:
    """What is drawn of a skeleton: places in mm of the world, or in px of a view."""

    markers: Floats
    joints: Floats
    bones: poses.Bones
    lines: Floats  # both ends of each bone

    @classmethod
    def of(cls, project: Project) -> _Body:
        skeleton = project.skeleton
        markers, joints = poses.reference_markers(skeleton), poses.reference_joints(skeleton)
        edges = np.array([(joint.parent, joint.child) for joint in skeleton.joints], dtype=np.intp).reshape(-1, 2)
        bones = poses.find_bones(edges, skeleton.limb_of_marker)
        return cls(markers, joints, bones, bones.place(joints, markers))

    @property
    def points(self) -> Floats:
        everything = np.vstack([self.markers, self.joints])
        return everything[~np.isnan(everything[:, 0])]

    def seen(self, view: poses.View, scale: float) -> _Body:
        """Return the body in a view, to the right and down [px]; its box begins at the origin."""
        plane = np.stack([view.across, -view.up], axis=1) * scale
        corner = (self.points @ plane).min(axis=0)
        markers, joints = (places @ plane - corner for places in (self.markers, self.joints))
        return _Body(markers, joints, self.bones, self.lines @ plane - corner)

    def moved(self, across: float, down: float) -> _Body:
        by = np.array([across, down])
        return _Body(self.markers + by, self.joints + by, self.bones, self.lines + by)


def pose_figures(project: Project) -> list[tuple[str, Markup]]:
    """Draw the front and the side of the reference pose, at one scale; the front is the widest side if none is known.

    Returns
    -------
    list of tuple
        Title and drawing of each view.
    """
    body = _Body.of(project)
    views = poses.find_views(body.points, project.motion.marker_positions, poses.left_side(project.skeleton))
    size = max(float(np.ptp(body.seen(view, 1.0).points, axis=0).max()) for view in views)
    scale = _LONGER_SIDE / max(size, 1e-9)
    return [(view.title, _view(project, body.seen(view, scale), view, scale)) for view in views]


def small_figure(project: Project, side: float) -> str:
    """Draw the front of the reference pose, limbs and joints alone, as a file of its own.

    Parameters
    ----------
    project : Project
        With a skeleton.
    side : float, px
        Of the square that it fills.
    """
    body = _Body.of(project)
    front, _ = poses.find_views(body.points, project.motion.marker_positions, poses.left_side(project.skeleton))
    scale = side * _FILLED / max(float(np.ptp(body.seen(front, 1.0).points, axis=0).max()), 1e-9)
    flat = body.seen(front, scale)
    flat = flat.moved(*((side - np.ptp(flat.points, axis=0)) / 2).tolist())
    limbs = range(project.skeleton.n_limbs)
    colours = "".join(_SMALL_TINT.format(limb, limb_colour(limb)) for limb in limbs)
    parts = [
        svg.tag("style", Markup(colours + _SMALL_STYLE)),
        *[_limb(project, limb, flat) for limb in limbs],
        *[svg.circle(x, y, 1.5, "joint") for x, y in flat.joints.tolist()],
    ]
    return str(svg.drawing(side, side, project.name or "skeleton", *parts))


def _view(project: Project, body: _Body, view: poses.View, scale: float) -> Markup:
    size = np.ptp(body.points, axis=0)
    width, height = max(size[0] + 2 * _POSE_MARGIN, _LEAST_WIDTH), size[1] + 2 * _POSE_MARGIN + _TRIAD
    body = body.moved((width - size[0]) / 2, _POSE_MARGIN)
    limbs = range(project.skeleton.n_limbs)
    parts = [
        *[_limb(project, limb, body) for limb in limbs],
        *[_joint(project.skeleton.joints[index], index, x, y) for index, (x, y) in enumerate(body.joints.tolist())],
        *[_limb_number(limb, body.lines[body.bones.limb == limb]) for limb in limbs],
        _triad(view, _TRIAD + 14, height - 12),
        _scale_bar(scale, width, height - 8),
    ]
    return svg.drawing(width, height, view.title, *parts, least=width)


def _joint(joint: Joint, index: int, x: float, y: float) -> Markup:
    """A ring; dashed where the motion does not determine the place, or that of a hinge along its axis."""
    cls = "joint" if joint.is_fully_determined else "joint open"
    return svg.circle(x, y, 3.5, cls, _joint_title(joint, index))


def _joint_title(joint: Joint | None, index: int) -> str:
    """The tooltip of a joint: its number, and what places it where the motion does not, if there is a skeleton."""
    words = "" if joint is None else place_of(joint).words
    return f"joint J{index}: {words}" if words else f"joint J{index}"


def _limb(project: Project, limb: int, body: _Body) -> Markup:
    own = body.bones.limb == limb
    lines = [
        svg.line(x1, y1, x2, y2, "bone loose" if is_spoke else "bone")
        for ((x1, y1), (x2, y2)), is_spoke in zip(body.lines[own].tolist(), body.bones.is_spoke[own], strict=True)
    ]
    markers = project.skeleton.markers_of(limb)
    names = [project.trajectories.names[marker] for marker in markers]
    places = zip(names, body.markers[markers].tolist(), strict=True)
    return svg.group(*lines, *[svg.circle(x, y, 3, "fill dot", name) for name, (x, y) in places], cls=f"limb{limb}")


def _limb_number(limb: int, lines: Floats) -> Markup:
    """The limb's number beside the middle of its longest bone; bones are given by both ends [px]."""
    if not len(lines):
        return Markup("")
    start, end = lines[int(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).argmax())]
    along = end - start
    size = float(np.linalg.norm(along))
    aside = np.array([along[1], -along[0]]) / size if size > 0 else np.array([1.0, 0.0])
    x, y = ((start + end) / 2 + aside * _LABEL_DISTANCE).tolist()
    return svg.text(x, y + 4, str(limb), f"halo tint limb{limb}", anchor="middle")


def _triad(view: poses.View, x: float, y: float) -> Markup:
    """The world's axes that lie nearly in the plane of this view."""
    parts = []
    for name, axis in zip(_AXES, np.eye(3), strict=True):
        across, up = float(axis @ view.across), float(axis @ view.up)
        if np.hypot(across, up) < _NEARLY_IN_PLANE:
            continue
        tip = (x + _TRIAD * across, y - _TRIAD * up)
        label = (x + (_TRIAD + 8) * across, y - (_TRIAD + 8) * up + 3.5)
        parts += [svg.line(x, y, *tip, "axis"), svg.text(*label, name, "small", anchor="middle")]
    return svg.group(*parts)


def _scale_bar(scale: float, width: float, y: float) -> Markup:
    length = round_below(_BAR_SHARE * width / scale)
    right = width - 10
    left = right - length * scale
    return svg.group(
        svg.line(left, y, right, y, "axis thick"),
        svg.text((left + right) / 2, y - 5, f"{plain(length)} mm", "small", anchor="middle"),
    )
