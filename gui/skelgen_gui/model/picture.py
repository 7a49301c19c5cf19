"""A frame as it lies in the picture: which parts are shown, their places and depths, trails of markers."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen_gui.model.scene import Snapshot, State
from skelgen_gui.model.view_state import Shown
from skelgen_gui.model.viewpoint import Viewpoint

_OUTLINE = np.linspace(0.0, 2 * np.pi, 33)[:-1]
_BEHIND = 1 + 1e-6  # bones lie behind the joints and markers at their ends
_LARGEST = 2000.0  # px, half an ellipse's axis: one that is larger is cut off rather than painted for seconds

# Corners of names from the marker, right of it and left, above and below: gaps [px], and parts of the name's size
_NAME_GAPS = np.array([(8.0, 2.0), (8.0, -2.0), (-8.0, 2.0), (-8.0, -2.0)])
_NAME_SIDES = np.array([(0.0, -1.0), (0.0, 0.0), (-1.0, -1.0), (-1.0, 0.0)])

N_AGES = 4
"""Steps in which a trail fades."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Places [px] and depths [mm]; NaN for what is hidden, unknown or behind the viewer.

    Attributes
    ----------
    markers, unlabelled, joints : ndarray, shape (n, 2), px
        As in the snapshot.
    marker_depths, unlabelled_depths, joint_depths, bone_depths : ndarray, shape (n,), mm
        Distance along the line of sight; of bones, their farther ends', and a little more.
    bones, axes : ndarray, shape (n, 2, 2), px
        Both ends of each line.
    ellipses : ndarray, shape (n_joints, 4, 32, 2), px
        The joints' uncertainty: the outline of each ellipsoid, and its three main sections.
    bodies : ndarray, shape (n_bodies, 3, 2, 2), px
        The axes of bodies.
    """

    markers: Floats
    marker_depths: Floats
    unlabelled: Floats
    unlabelled_depths: Floats
    joints: Floats
    joint_depths: Floats
    bones: Floats
    bone_depths: Floats
    axes: Floats
    ellipses: Floats
    bodies: Floats


@dataclass(frozen=True)
class Canvas:
    """A viewpoint and the size of its picture.

    Attributes
    ----------
    viewpoint : Viewpoint
        Where the viewer stands.
    width, height : int, px
        Size of the picture.
    """

    viewpoint: Viewpoint
    width: int
    height: int

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Project points of any shape (..., 3) [mm]: places (..., 2) [px] and depths (...) [mm]."""
        places, depths = self.viewpoint.project(points.reshape(-1, 3), self.width, self.height)
        return places.reshape(*points.shape[:-1], 2), depths.reshape(points.shape[:-1])


@dataclass(frozen=True)
class FrameView:
    """A picture to paint: its frame, the viewpoint, and the parts that are drawn.

    Attributes
    ----------
    frame : int
        From 0.
    canvas : Canvas
        The viewer, and the size of the picture.
    shown : Shown
        What is shown.
    """

    frame: int
    canvas: Canvas
    shown: Shown


def take_picture(
    snapshot: Snapshot,
    canvas: Canvas,
    shown: Shown,
    axis_length: float,
    magnification: float,
    uncertain: Iterable[int] = (),
) -> Picture:
    """Project what is shown of a snapshot.

    Parameters
    ----------
    snapshot : Snapshot
        One frame.
    canvas : Canvas
        From where, and how large.
    shown : Shown
        What is hidden gets no place.
    axis_length : float, mm
        Half the length of drawn axes.
    magnification : float
        Half axes of ellipsoids in standard deviations.
    uncertain : iterable of int
        Joints whose ellipsoids are drawn although those of others are not.
    """
    markers, marker_depths = canvas.project(snapshot.markers)
    markers[~np.where(snapshot.state == State.FILLED, shown.filled, shown.markers)] = np.nan
    unlabelled, unlabelled_depths = canvas.project(_only(snapshot.unlabelled, shown.markers))
    joints, joint_depths = canvas.project(snapshot.joints)
    ellipses = _ellipses(snapshot, canvas, joints, joint_depths, magnification)
    if not shown.uncertainty:
        ellipses[~np.isin(np.arange(len(ellipses)), list(uncertain))] = np.nan
    bones, bone_depths = canvas.project(_only(snapshot.bones, shown.bones))
    if not shown.joints:
        joints[:] = np.nan
    return Picture(
        markers,
        marker_depths,
        unlabelled,
        unlabelled_depths,
        joints,
        joint_depths,
        bones,
        bone_depths.max(axis=1) * _BEHIND,
        canvas.project(_axis_ends(_only(snapshot.axes, shown.axes), axis_length))[0],
        ellipses,
        canvas.project(_body_axes(_only(snapshot.bodies, shown.axes), axis_length))[0],
    )


def _only(values: Floats, is_shown: bool) -> Floats:
    """The values, or none of them."""
    return values if is_shown else np.full_like(values, np.nan)


def _axis_ends(axes: Floats, length: float) -> Floats:
    middle, along = axes[:, :1], axes[:, 1:]
    return np.concatenate([middle - length * along, middle + length * along], axis=1)


def _body_axes(bodies: Floats, length: float) -> Floats:
    origins = np.repeat(bodies[:, None, :3, 3], 3, axis=1)
    return np.stack([origins, origins + length * bodies[:, :3, :3].swapaxes(1, 2)], axis=2)


def _ellipses(snapshot: Snapshot, canvas: Canvas, joints: Floats, depths: Floats, magnification: float) -> Floats:
    """Outlines of the covariances, projected as if the line of sight were the same all over each ellipsoid."""
    n_joints = len(snapshot.covariances)
    if not n_joints:
        return np.full((n_joints, 4, len(_OUTLINE), 2), np.nan)
    right, up, _ = canvas.viewpoint.basis
    plane = np.stack([right, -up])
    scales = magnification * canvas.viewpoint.focal(canvas.height) / depths
    axes = _half_axes(snapshot.covariances)
    outline = _half_axes(plane @ snapshot.covariances @ plane.T)
    sections = plane @ np.stack([axes[..., pair] for pair in ((0, 1), (1, 2), (2, 0))], axis=1)
    half = np.concatenate([outline[:, np.newaxis], sections], axis=1) * scales[:, np.newaxis, np.newaxis, np.newaxis]
    circle = np.stack([np.cos(_OUTLINE), np.sin(_OUTLINE)])
    curves = (np.clip(half, -_LARGEST, _LARGEST) @ circle).swapaxes(2, 3)
    return np.asarray(joints[:, np.newaxis, np.newaxis] + curves)


def _half_axes(covariances: Floats) -> Floats:
    """Main axes, one a column, as long as their standard deviations."""
    values, vectors = np.linalg.eigh(covariances)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[:, np.newaxis, :])


def place_names(markers: Floats, sizes: Floats) -> Floats:
    """Place names beside markers so that none covers another one: those that find no room are left out.

    Parameters
    ----------
    markers : ndarray, shape (n, 2), px
        Markers, the most important first.
    sizes : ndarray, shape (n, 2), px
        Width and height of their names.

    Returns
    -------
    ndarray, shape (n, 2), px
        Upper left corner of each name; NaN where it is left out.
    """
    corners = np.full((len(markers), 2), np.nan)
    placed = np.zeros((0, 4))  # left, top, right, bottom
    for index, (place, size) in enumerate(zip(markers, sizes, strict=True)):
        tried = place + _NAME_GAPS + _NAME_SIDES * size
        boxes = np.concatenate([tried, tried + size], axis=1)[:, np.newaxis]
        covers = (boxes[..., :2] < placed[:, 2:]) & (boxes[..., 2:] > placed[:, :2])
        is_covering = np.all(covers, axis=2)
        free = np.flatnonzero(~np.any(is_covering, axis=1))
        if len(free):
            corners[index] = tried[free[0]]
            placed = np.concatenate([placed, boxes[free[0]]])
    return corners


def trail_lines(places: Floats, limb_of_marker: Ints) -> list[tuple[int, int, Floats]]:
    """Cut trails into lines that share a colour.

    Parameters
    ----------
    places : ndarray, shape (n_steps, n_markers, 2), px
        Where each marker was, the present last; NaN breaks the line.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker.

    Returns
    -------
    list of (int, int, ndarray of shape (n_lines, 2, 2))
        Limb, age from 0 = old to `N_AGES` - 1 = fresh, and the lines.
    """
    n_lines = len(places) - 1
    if n_lines < 1 or not len(limb_of_marker):
        return []
    order = np.argsort(limb_of_marker, kind="stable")
    lines = np.stack([places[:-1, order], places[1:, order]], axis=2).swapaxes(0, 1)
    limbs, starts = np.unique(limb_of_marker[order], return_index=True)
    stops = [*starts[1:].tolist(), len(order)]
    ages = np.linspace(0, n_lines, N_AGES + 1).round().astype(np.intp).tolist()
    return [
        (int(limb), age, _known(lines[start:stop, ages[age] : ages[age + 1]].reshape(-1, 2, 2)))
        for limb, start, stop in zip(limbs, starts, stops, strict=True)
        for age in range(N_AGES)
    ]


def _known(lines: Floats) -> Floats:
    return lines[~np.isnan(lines).any(axis=(1, 2))]
