"""Lines of the 3-D view: bones, trails of markers, frustums of cameras; and how far a place is from lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Bones:
    """The lines of all limbs, as places in a list of joints, then markers, then middles of limbs.

    Attributes
    ----------
    ends : ndarray of intp, shape (n_bones, 2)
        Both ends of each line.
    limb : ndarray of intp, shape (n_bones,)
        The limb that it belongs to.
    is_spoke : ndarray of bool, shape (n_bones,)
        Whether it goes to a marker, and not to a joint.
    members : tuple of ndarray of intp
        For each limb, the joints or markers whose middle its own place stands for; empty where that is not needed.
    """

    ends: Ints
    limb: Ints
    is_spoke: Bools
    members: tuple[Ints, ...]

    def place(self, joints: Floats, markers: Floats) -> Floats:
        """Return both ends of every bone in one frame.

        Parameters
        ----------
        joints, markers : ndarray, shape (n, 3), mm
            NaN where unknown.

        Returns
        -------
        ndarray, shape (n_bones, 2, 3), mm
            NaN where unknown.
        """
        points = np.concatenate([joints, markers])
        middles = [_middle(points[members]) for members in self.members]
        return np.asarray(np.concatenate([points, np.reshape(middles, (-1, 3))])[self.ends])


def find_bones(edges: Ints, limb_of_marker: Ints) -> Bones:
    """Find the bones of a tree.

    Parameters
    ----------
    edges : ndarray of intp, shape (n_joints, 2)
        Parent and child limb of each joint.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker, -1 = left out.
    """
    n_limbs = int(limb_of_marker.max(initial=-1)) + 1
    first_middle = len(edges) + len(limb_of_marker)
    lines: list[tuple[int, int, int, bool]] = []
    members = []
    for limb in range(n_limbs):
        joints = np.flatnonzero((edges == limb).any(axis=1))
        markers = len(edges) + np.flatnonzero(limb_of_marker == limb)
        hub, tips, around = _hub(limb, edges, joints, markers, first_middle + limb)
        lines.extend((hub, int(tip), limb, bool(tip >= len(edges))) for tip in tips)
        members.append(around)
    table = np.array(lines, dtype=np.intp).reshape(-1, 4)
    return Bones(table[:, :2], table[:, 2], table[:, 3].astype(np.bool_), tuple(members))


def _hub(limb: int, edges: Ints, joints: Ints, markers: Ints, middle: int) -> tuple[int, Ints, Ints]:
    """Where the lines of a limb start, where they end, and what is around the middle if they start there."""
    nothing = joints[:0]
    inward = joints[edges[joints, 1] == limb]
    if len(joints) == 0:
        return middle, markers, markers
    if len(joints) == 1:
        return int(joints[0]), markers, nothing
    if len(joints) == 2:
        return int(joints[0]), joints[1:], nothing
    if len(inward):
        return int(inward[0]), joints[joints != inward[0]], nothing
    return middle, joints, joints


def _middle(points: Floats) -> Floats:
    """Mean of the points that are known, NaN where none is."""
    known = points[~np.isnan(points[:, 0])]
    return np.asarray(known.mean(axis=0)) if len(known) else np.full(3, np.nan)


N_AGES = 4
"""Steps in which a trail fades."""


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


def frustum(
    world_from_camera: Floats, size: tuple[float, float], focal: tuple[float, float], depth: float = 400.0
) -> Floats:
    """Return the edges of a camera's pyramid of sight.

    Parameters
    ----------
    world_from_camera : ndarray, shape (4, 4), translation in mm
        Pose of the camera, which looks along its z with x to the right and y down in its image.
    size : tuple of float, px
        Width and height of its image; the principal point is taken for the middle.
    focal : tuple of float, px
        Focal lengths along x and y.
    depth : float, mm
        How far before the camera the pyramid ends.

    Returns
    -------
    ndarray, shape (9, 2, 3), mm
        Both ends of: four edges from the camera's centre, four around the image, and a tick at its upper side.
    """
    half = np.array(size) / 2 / np.array(focal) * depth
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = np.column_stack([signs * half, np.full(4, depth)])
    centre = np.zeros((4, 3))
    above = np.array([[0.0, -half[1], depth], [0.0, -1.25 * half[1], depth]])
    lines = np.concatenate(
        [np.stack([centre, corners], axis=1), np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), above[None]]
    )
    return np.asarray(lines @ world_from_camera[:3, :3].T + world_from_camera[:3, 3])


def distances_to_lines(lines: Floats, place: Floats) -> Floats:
    """Return the distance [px] of a place from each line between two ends, shape (n_lines,).

    Parameters
    ----------
    lines : ndarray, shape (n_lines, 2, 2), px
        Both ends of each; NaN gives NaN.
    place : ndarray, shape (2,), px
        The place.
    """
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    squares = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    parts = np.clip(((place - start) * along).sum(axis=1) / squares, 0.0, 1.0)
    return np.asarray(np.linalg.norm(start + parts[:, np.newaxis] * along - place, axis=1))
