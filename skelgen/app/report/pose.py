"""The skeleton in its reference pose, seen from two sides at right angles, with markers, joints and bones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import svg
from skelgen.app.drawing.colours import limb_colour
from skelgen.app.drawing.poses import View, find_views, reference_joints, reference_markers
from skelgen.app.drawing.scales import round_below
from skelgen.app.drawing.wording import plain
from skelgen.model import Project
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
    markers: Floats
    joints: Floats

    @property
    def points(self) -> Floats:
        everything = np.vstack([self.markers, self.joints])
        return everything[~np.isnan(everything[:, 0])]


def pose_figures(project: Project) -> list[tuple[str, Markup]]:
    """Draw the widest and the narrowest side of the reference pose, at one scale.

    Returns
    -------
    list of tuple
        Title and drawing of each view.
    """
    skeleton = project.skeleton
    body = _Body(reference_markers(skeleton), reference_joints(skeleton))
    views = find_views(body.points, project.motion.marker_positions)
    spans = [np.ptp(body.points @ np.stack([view.across, view.up], axis=1), axis=0) for view in views]
    scale = _SIDE / max(float(np.max(spans)), 1e-9)
    return [(view.title, _view(project, body, view, scale)) for view in views]


def small_figure(project: Project, side: float) -> str:
    """Draw the widest side of the reference pose, limbs and joints alone, as a file of its own.

    Parameters
    ----------
    project : Project
        With a skeleton.
    side : float, px
        Of the square that it fills.
    """
    skeleton = project.skeleton
    body = _Body(reference_markers(skeleton), reference_joints(skeleton))
    front, _ = find_views(body.points, project.motion.marker_positions)
    plane = np.stack([front.across, -front.up], axis=1)
    low, size = (body.points @ plane).min(axis=0), np.ptp(body.points @ plane, axis=0)
    scale = side * _FILLED / max(float(size.max()), 1e-9)
    corner = low * scale - (side - size * scale) / 2
    markers, joints = body.markers @ plane * scale - corner, body.joints @ plane * scale - corner
    limbs = range(skeleton.n_limbs)
    colours = "".join(_SMALL_TINT.format(limb, limb_colour(limb)) for limb in limbs)
    parts = [
        svg.tag("style", Markup(colours + _SMALL_STYLE)),
        *[_limb(project, limb, markers, joints) for limb in limbs],
        *[svg.circle(x, y, 1.5, "joint") for x, y in joints.tolist()],
    ]
    return str(svg.drawing(side, side, project.name or "skeleton", *parts))


def _view(project: Project, body: _Body, view: View, scale: float) -> Markup:
    plane = np.stack([view.across, -view.up], axis=1) * scale
    low = (body.points @ plane).min(axis=0)
    size = np.ptp(body.points @ plane, axis=0)
    width = max(size[0] + 2 * _MARGIN, _LEAST_WIDTH)
    corner = low - np.array([(width - size[0]) / 2, _MARGIN])
    markers, joints = body.markers @ plane - corner, body.joints @ plane - corner
    height = size[1] + 2 * _MARGIN + _TRIAD
    parts = [
        *[_limb(project, limb, markers, joints) for limb in range(project.skeleton.n_limbs)],
        *[svg.circle(x, y, 3.5, "joint", f"joint J{index}") for index, (x, y) in enumerate(joints.tolist())],
        *[_limb_number(project, limb, markers, joints) for limb in range(project.skeleton.n_limbs)],
        _triad(view, _TRIAD + 14, height - 12),
        _scale_bar(scale, width, height - 8),
    ]
    return svg.drawing(width, height, view.title, *parts, least=width)


def _limb(project: Project, limb: int, markers: Floats, joints: Floats) -> Markup:
    own = project.skeleton.markers_of(limb)
    bones = _bones(project, limb, markers, joints)
    lines = [
        svg.line(start[0], start[1], end[0], end[1], "bone" if firm else "bone loose") for start, end, firm in bones
    ]
    names = project.trajectories.names
    dots = [
        svg.circle(x, y, 3, "fill dot", names[marker])
        for marker, (x, y) in zip(own, markers[own].tolist(), strict=True)
    ]
    return svg.group(*lines, *dots, cls=f"limb{limb}")


def _bones(project: Project, limb: int, markers: Floats, joints: Floats) -> list[tuple[list[float], list[float], bool]]:
    """Lines of one limb: from its parent joint to each further joint; a leaf's points to the middle of its markers."""
    skeleton = project.skeleton
    own = [index for index, _ in skeleton.joints_of(limb)]
    middle = _middle(project, limb, markers, joints).tolist()
    inward = [index for index in own if skeleton.joints[index].child == limb]
    outward = [joints[index].tolist() for index in own if index not in inward]
    if inward and outward:
        return [(joints[inward[0]].tolist(), end, True) for end in outward]
    if len(outward) == 2:
        return [(outward[0], outward[1], True)]
    return [(middle, joints[index].tolist(), len(own) > 2) for index in own]


def _middle(project: Project, limb: int, markers: Floats, joints: Floats) -> Floats:
    """Middle of a root's joints where it has several, otherwise of the limb's markers."""
    own = [index for index, _ in project.skeleton.joints_of(limb)]
    places = joints[own] if len(own) > 2 else markers[project.skeleton.markers_of(limb)]
    return np.asarray(places.mean(axis=0) if len(places) else np.zeros(2))


def _limb_number(project: Project, limb: int, markers: Floats, joints: Floats) -> Markup:
    """The limb's number beside the middle of its first bone."""
    bones = _bones(project, limb, markers, joints)
    if not bones:
        x, y = _middle(project, limb, markers, joints).tolist()
        return svg.text(x, y - _LABEL_DISTANCE, str(limb), f"halo tint limb{limb}", anchor="middle")
    start, end = np.array(bones[0][0]), np.array(bones[0][1])
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
