"""The skeleton in its reference pose, seen from two sides at right angles, with markers, joints and bones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import svg
from skelgen.app.drawing.colours import limb_colour
from skelgen.app.drawing.poses import Bones, View, find_bones, find_views, reference_joints, reference_markers
from skelgen.app.drawing.scales import round_below
from skelgen.app.drawing.wording import plain
from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats

_SIDE = 560.0  # px, of the longer side of a view
_MARGIN = 34.0
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
    bones: Bones
    lines: Floats  # both ends of each bone

    @classmethod
    def of(cls, project: Project) -> _Body:
        skeleton = project.skeleton
        markers, joints = reference_markers(skeleton), reference_joints(skeleton)
        edges = np.array([(joint.parent, joint.child) for joint in skeleton.joints], dtype=np.intp).reshape(-1, 2)
        bones = find_bones(edges, skeleton.limb_of_marker)
        return cls(markers, joints, bones, bones.place(joints, markers))

    @property
    def points(self) -> Floats:
        everything = np.vstack([self.markers, self.joints])
        return everything[~np.isnan(everything[:, 0])]

    def seen(self, view: View, scale: float) -> _Body:
        """Return the body in a view, to the right and down [px]; its box begins at the origin."""
        plane = np.stack([view.across, -view.up], axis=1) * scale
        corner = (self.points @ plane).min(axis=0)
        markers, joints = (places @ plane - corner for places in (self.markers, self.joints))
        return _Body(markers, joints, self.bones, self.lines @ plane - corner)

    def moved(self, across: float, down: float) -> _Body:
        by = np.array([across, down])
        return _Body(self.markers + by, self.joints + by, self.bones, self.lines + by)


def pose_figures(project: Project) -> list[tuple[str, Markup]]:
    """Draw the widest and the narrowest side of the reference pose, at one scale.

    Returns
    -------
    list of tuple
        Title and drawing of each view.
    """
    body = _Body.of(project)
    views = find_views(body.points, project.motion.marker_positions)
    size = max(float(np.ptp(body.seen(view, 1.0).points, axis=0).max()) for view in views)
    scale = _SIDE / max(size, 1e-9)
    return [(view.title, _view(project, body.seen(view, scale), view, scale)) for view in views]


def small_figure(project: Project, side: float) -> str:
    """Draw the widest side of the reference pose, limbs and joints alone, as a file of its own.

    Parameters
    ----------
    project : Project
        With a skeleton.
    side : float, px
        Of the square that it fills.
    """
    body = _Body.of(project)
    front, _ = find_views(body.points, project.motion.marker_positions)
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


def _view(project: Project, body: _Body, view: View, scale: float) -> Markup:
    size = np.ptp(body.points, axis=0)
    width, height = max(size[0] + 2 * _MARGIN, _LEAST_WIDTH), size[1] + 2 * _MARGIN + _TRIAD
    body = body.moved((width - size[0]) / 2, _MARGIN)
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
    if joint.is_fully_determined:
        return svg.circle(x, y, 3.5, "joint", f"joint J{index}")
    along = " along its axis" if joint.is_determined else ""
    return svg.circle(x, y, 3.5, "joint open", f"joint J{index}: its place{along} is a choice")


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


def _triad(view: View, x: float, y: float) -> Markup:
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
