"""The skeleton in its reference pose, two views that show it best, the bones of its limbs, and where markers are."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from skelgen.model import Project, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.limbs import body_and_limb

_FLAT = 0.3  # an axis along which the body extends less than this share of its size is hardly the vertical
_SUNK = 0.05  # of the body's size: markers that lie farther below zero are not above a floor at zero
_RARELY = 0.01  # of the frames, in which a stray may lie below
_LYING = 0.5  # of a unit vector's length: a body whose left side has less of it level lies on its side
_SURE = 0.9  # confidence below which a marker counts as doubtful


class MarkerState(IntEnum):
    """What a marker's position in a frame rests on."""

    SEEN = 0
    DOUBTFUL = 1
    """Seen, but perhaps another marker, or perhaps on another limb."""
    FILLED = 2
    """Unseen; the skeleton places it."""
    ABSENT = 3


@dataclass(frozen=True, eq=False)
class View:
    """One parallel projection.

    Attributes
    ----------
    title : str
        What it shows.
    across, up, toward : ndarray, shape (3,)
        Unit vectors of the world: to the right, upward, and toward the viewer.
    """

    title: str
    across: Floats
    up: Floats
    toward: Floats


def find_views(points: Floats, marker_positions: Floats, left: Floats | None = None) -> tuple[View, View]:
    """Choose a front and a side view.

    The vertical is the coordinate axis along which nothing lies below zero, as most systems have the floor at zero. If
    several axes or none are so, it is the one along which the lowest marker moves least over the take, as feet stay
    near the floor. The front is what faces a body whose left side is known; else the
    horizontal direction in which the reference pose is widest.

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        The reference pose.
    marker_positions : ndarray, shape (n_frames, n_markers, 3), mm
        The whole take; NaN allowed.
    left : ndarray, shape (3,), optional
        Unit vector from the right to the left of the body in the reference pose, see `left_side`.
    """
    vertical = _vertical(points, marker_positions)
    up = np.eye(3)[vertical]
    if left is not None and np.linalg.norm(left - (left @ up) * up) > _LYING:
        across = left - (left @ up) * up
        across /= np.linalg.norm(across)
        toward = np.cross(across, up)
        return View("Front view", across, up, toward), View("Side view", -toward, up, across)
    level = points - points.mean(axis=0)
    level = level - np.outer(level @ up, up)
    across = np.linalg.svd(level, full_matrices=False)[2][0] if np.ptp(level) > 0 else np.eye(3)[vertical - 1]
    across = across - (across @ up) * up
    across /= np.linalg.norm(across)
    across *= -1.0 if across[np.argmax(np.abs(across))] < 0 else 1.0
    toward = np.cross(across, up)
    return View("Front view (widest side)", across, up, toward), View("Side view", -toward, up, across)


def left_side(skeleton: Skeleton) -> Floats | None:
    """Return the direction from right to left in the reference pose, a unit vector; None where no sides are known.

    It is that between the joints above limbs that are called alike but for their side, and hang on one limb: from the
    right to the left hip, and from the right to the left shoulder.
    """
    places = {
        (joint.parent, skeleton.limb_names[joint.child]): place
        for joint, place in zip(skeleton.joints, reference_joints(skeleton), strict=True)
    }
    between = np.zeros(3)
    for (parent, name), place in places.items():
        limb = body_and_limb(name)[1]
        other = (parent, name.removesuffix(limb) + limb.replace("left ", "right ", 1))
        if limb.startswith("left ") and other in places:
            between += place - places[other]
    length = float(np.linalg.norm(between))
    return between / length if length > 0 else None


def _vertical(points: Floats, marker_positions: Floats) -> int:
    lowest = np.fmin.reduce(marker_positions, axis=1)
    lowest = lowest[~np.isnan(lowest[:, 0])]
    extent = np.ptp(points, axis=0)
    is_flat = extent < _FLAT * extent.max()
    is_below = (lowest < -_SUNK * extent.max()).mean(axis=0) > _RARELY
    refused = is_flat | is_below if (~is_flat & ~is_below).any() else is_flat
    return int(np.argmin(lowest.std(axis=0) + np.where(refused, np.inf, 0.0)))


def reference_joints(skeleton: Skeleton) -> Floats:
    """Return the joints in the reference pose [mm], shape (n_joints, 3)."""
    placed = [
        skeleton.reference_pose[joint.parent, :3, :3] @ joint.position_in_parent
        + skeleton.reference_pose[joint.parent, :3, 3]
        for joint in skeleton.joints
    ]
    return np.array(placed).reshape(-1, 3)


def reference_markers(skeleton: Skeleton) -> Floats:
    """Return the markers in the reference pose [mm], shape (n_markers, 3); NaN for those that are left out."""
    placed = np.full_like(skeleton.marker_offsets, np.nan)
    on_limb = skeleton.limb_of_marker >= 0
    poses = skeleton.reference_pose[skeleton.limb_of_marker[on_limb]]
    placed[on_limb] = np.einsum("nij,nj->ni", poses[:, :3, :3], skeleton.marker_offsets[on_limb]) + poses[:, :3, 3]
    return placed


def place_markers(project: Project, trajectories: Trajectories, frames: slice) -> tuple[Floats, Ints]:
    """Return the measured markers, where unseen those on the skeleton, and the `MarkerState` of each.

    Parameters
    ----------
    project : Project
        Whatever stages have run.
    trajectories : Trajectories
        Its markers.
    frames : slice
        Which frames.

    Returns
    -------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where neither is known.
    states : ndarray of intp, shape (n_frames, n_markers)
        A `MarkerState` each.
    """
    measured = trajectories.positions[frames]
    unseen = np.isnan(measured[..., 0])
    states = np.where(unseen, MarkerState.ABSENT, MarkerState.SEEN)
    if project.has("labels") and project.has_labelling:
        states[project.labelling.confidence[frames] < _SURE] = MarkerState.DOUBTFUL
    if project.has("limbs"):
        doubtful = project.limbs.doubtful
        states[:, doubtful] = np.maximum(states, MarkerState.DOUBTFUL)[:, doubtful]
    if not project.has("skeleton"):
        return measured, states
    placed = project.motion.marker_positions[frames]
    states[unseen & ~np.isnan(placed[..., 0])] = MarkerState.FILLED
    return np.where(unseen[..., np.newaxis], placed, measured), states


@dataclass(frozen=True, eq=False)
class Bones:
    """The lines of all limbs; their ends are indices of joints, then of markers, then of middles of limbs.

    Attributes
    ----------
    ends : ndarray of intp, shape (n_bones, 2)
        Both ends of each line.
    limb : ndarray of intp, shape (n_bones,)
        The limb that it belongs to.
    is_spoke : ndarray of bool, shape (n_bones,)
        Whether it goes to a marker, and not to a joint.
    members : tuple of ndarray of intp
        For each limb, the joints or markers whose mean is its middle; empty where no line ends there.
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
        middles = [middle_of(points[members]) for members in self.members]
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
        if len(joints) == 1 and len(markers):  # a hand, foot or head ends amid what it carries
            end, spokes = (first_middle + limb, markers) if len(markers) > 1 else (int(markers[0]), markers[:0])
            lines.append((int(joints[0]), end, limb, False))
            lines.extend((end, int(marker), limb, True) for marker in spokes)
            members.append(spokes)
            continue
        hub, tips, around = _hub(joints, markers, first_middle + limb)
        lines.extend((hub, int(tip), limb, bool(tip >= len(edges))) for tip in tips)
        members.append(around)
    table = np.array(lines, dtype=np.intp).reshape(-1, 4)
    return Bones(table[:, :2], table[:, 2], table[:, 3].astype(np.bool_), tuple(members))


def _hub(joints: Ints, markers: Ints, middle: int) -> tuple[int, Ints, Ints]:
    """Where the lines of a limb start, where they end, and what is around the middle if they start there."""
    if len(joints) == 0:
        return middle, markers, markers
    if len(joints) == 1:
        return int(joints[0]), markers, joints[:0]
    if len(joints) == 2:
        return int(joints[0]), joints[1:], joints[:0]
    return middle, joints, joints  # as a chest or a pelvis, whatever the root is


def middle_of(points: Floats) -> Floats:
    """Return the mean of the points that are known, NaN where none is."""
    known = points[~np.isnan(points[:, 0])]
    return np.asarray(known.mean(axis=0)) if len(known) else np.full(3, np.nan)
