"""Which lines make the bones of a tree of limbs: between joints, and from the joint of an end limb to its markers."""

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
